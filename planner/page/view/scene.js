/* What the picture of a plan consists of, in cm with y upwards, and the part of the plane that it shows: zoom, pan,
 * fit, ticks. Pixels go right and down. */
import { bounds, clip } from "../math.js";
import { figure } from "./dom.js";

const LEAST_SCALE = 1e-3; // pixels per cm
const LARGEST_SCALE = 1e6;

/* A viewport: the scale [pixels per cm] and the pixel of the origin. */
function viewport(scale, left, top) {
  return { scale: clip(scale, LEAST_SCALE, LARGEST_SCALE), left, top };
}

/* Show all points [cm] in width × height pixels, with a margin. */
function fitted(points, width, height, margin = 0.12) {
  const [[low, high], [bottom, top]] = bounds(points);
  if (!(high >= low)) return viewport(10, width / 2, height / 2);
  const room = 1 + 2 * margin, scales = [width / (high - low), height / (top - bottom)].map((scale) => scale / room);
  const scale = Math.min(...scales, LARGEST_SCALE);
  return viewport(scale, width / 2 - (scale * (low + high)) / 2, height / 2 + (scale * (bottom + top)) / 2);
}

/* Zoom by a factor about a pixel. */
function zoomed(view, factor, x, y) {
  const scale = clip(view.scale * factor, LEAST_SCALE, LARGEST_SCALE), real = scale / view.scale;
  return { scale, left: x + (view.left - x) * real, top: y + (view.top - y) * real };
}

function panned(view, right, down) {
  return { scale: view.scale, left: view.left + right, top: view.top + down };
}

/* The place [cm] at a pixel. */
function placeAt(view, x, y) {
  return [(x - view.left) / view.scale, (view.top - y) / view.scale];
}

/* The pixel of a place [cm]. */
function pixelOf(view, [x, y]) {
  return [view.left + view.scale * x, view.top - view.scale * y];
}

const LENS_PLACES = {
  "right top": [1, 0], "left top": [0, 0], "right bottom": [1, 1], "left bottom": [0, 1], middle: [0.5, 0.5],
};

/* The place in width × height pixels at which a round lens hides the fewest points [cm]: "right top", …. */
function lensPlace(view, points, width, height, lens) {
  const pixels = points.map((point) => pixelOf(view, point));
  const hidden = Object.values(LENS_PLACES).map(([right, down]) => {
    const x = lens / 2 + right * (width - lens), y = lens / 2 + down * (height - lens);
    return pixels.filter(([px, py]) => Math.hypot(px - x, py - y) < lens / 2).length;
  });
  return Object.keys(LENS_PLACES)[hidden.indexOf(Math.min(...hidden))];
}

/* The transform of a group that is drawn in cm, y upwards. */
function transform(view) {
  return `matrix(${view.scale} 0 0 ${-view.scale} ${view.left} ${view.top})`;
}

/* The step of ticks [cm]: 1, 2 or 5 times a power of ten, at least `pixels` apart. */
function tickStep(view, pixels = 70) {
  const least = pixels / view.scale, power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= least * (1 - 1e-9));
}

/* Multiples of `step` from low to high. */
function ticks(low, high, step) {
  const first = Math.ceil(low / step), last = Math.floor(high / step);
  return Array.from({ length: Math.max(last - first + 1, 0) }, (_, i) => (first + i) * step);
}

/* A number of ticks without the digits that its step does not need. */
function tickWords(value, step) {
  return value.toFixed(Math.max(0, Math.min(6, -Math.floor(Math.log10(step) + 1e-9)))).replace("-", "−");
}

const LEAST_APART = 4; // pixels between flips that are drawn

/* A polyline as the data of an SVG path. */
function lineData(points, closed = false) {
  return points.length ? `M${points.map(([x, y]) => `${x},${y}`).join("L")}${closed ? "Z" : ""}` : "";
}

/* A line of a fixed width in pixels; d: as the data of an SVG path. */
function line(kind, d) {
  return figure("path", { class: kind, d, "vector-effect": "non-scaling-stroke" });
}

/* Build the layers of a plan [cm]: walls and regions, band, drawn and declared path, track by direction. */
function planLayers({ drawn, plan, tracks, old }) {
  const layers = figure("g", { class: old ? "old" : "" }), { keepOut = [], walls } = drawn?.space ?? {};
  if (walls) layers.append(line("walls", lineData(walls.corners, true)));
  for (const { x, y, radius, corners } of keepOut) {
    layers.append(corners ? line("region", lineData(corners, true)) : figure("circle", { class: "region", cx: x, cy: y, r: radius }));
  }
  if (plan) layers.append(band(plan));
  if (drawn) layers.append(line("drawn", lineData(drawn.points, drawn.closed)));
  if (plan) layers.append(line("declared", lineData(plan.reference, plan.closed)), ...motion(plan), ...[plan.start, plan.goal].flatMap((pose) => (pose ? arrow(pose, plan.body) : [])));
  for (const { points } of tracks) layers.append(line("measured", lineData(points)));
  return layers;
}

function band(plan) {
  const d = lineData(plan.reference, plan.closed);
  return figure("path", { class: "band", d, "stroke-width": 2 * plan.stated });
}

/* The predicted track: one path for each direction of the motor. */
function motion(plan) {
  const data = { 1: "", "-1": "" };
  plan.dwells.forEach((_, i) => {
    const direction = i % 2 ? -plan.firstDirection : plan.firstDirection;
    data[direction] += lineData(plan.track.slice(i * plan.samples, (i + 1) * plan.samples + 1));
  });
  return [line("forward", data[1]), line("backward", data[-1])];
}

/* An arrow at a pose, as long as the head. */
function arrow([x, y, heading], { headLength: size }) {
  const from = ([atX, atY], length, angle) => [atX + length * Math.cos(angle), atY + length * Math.sin(angle)];
  const tip = from([x, y], size, heading), [left, right] = [2.6, -2.6].map((a) => from(tip, 0.35 * size, heading + a));
  return line("start", lineData([[x, y], tip]) + lineData([left, tip, right]));
}

/* Dots at flips that are LEAST_APART pixels or more from the one drawn before; null: they are too dense. */
function flips(plan, view) {
  let d = "", last = null;
  for (const [x, y] of plan.flips) {
    const here = pixelOf(view, [x, y]);
    if (last && Math.hypot(here[0] - last[0], here[1] - last[1]) < LEAST_APART) return null;
    last = here;
    d += `M${x},${y}h0`;
  }
  return line("flip", d);
}

/* Where a tail is clamped, seen from above, in radii of the disc, which is turned so that no tail hides another. */
function acrossOf(k, tails) {
  return Math.cos((Math.PI * (4 * k + 1)) / (2 * tails));
}

/* The robot from above, to scale, at the origin, heading to the right. */
function robotShape({ headLength, headRadius, tailLength, tailRadius, discOffset, tails }) {
  const rear = -headLength / 2, part = (kind, place) => figure("rect", { class: kind, ...place });
  const clamped = Array.from({ length: tails }, (_, k) => discOffset * acrossOf(k, tails) - tailRadius);
  const size = { width: tailLength, height: 2 * tailRadius }, head = { width: headLength, height: 2 * headRadius };
  return figure(
    "g", { class: "robot" }, clamped.map((y) => part("tail", { x: rear - tailLength, y, ...size })),
    part("head", { x: rear, y: -headRadius, ...head, rx: headRadius / 4 }),
  );
}

function poseTransform([x, y, heading]) {
  return `translate(${x} ${y}) rotate(${(heading * 180) / Math.PI})`;
}

/* A grid, and the ticks [cm] and scale bar over it, for a picture of width × height pixels: {grid, axes}. */
function axesOf(view, width, height) {
  const step = tickStep(view), grid = figure("g"), axes = figure("g", { class: "axes" });
  const text = (x, y, anchor, words) => axes.append(figure("text", { x, y, "text-anchor": anchor }, words));
  const right = (width - view.left) / view.scale, left = -view.left / view.scale;
  const up = view.top / view.scale, down = (view.top - height) / view.scale;
  for (const x of ticks(left, right, step)) {
    const [px] = pixelOf(view, [x, 0]);
    grid.append(figure("path", { class: "grid", d: `M${px},0V${height}` }));
    if (px > 30 && px < width - 56) text(px, height - 6, "middle", tickWords(x, step));
  }
  for (const y of ticks(down, up, step)) {
    const [, py] = pixelOf(view, [0, y]);
    grid.append(figure("path", { class: "grid", d: `M0,${py}H${width}` }));
    if (py > 32 && py < height - 26) text(4, py - 3, "start", tickWords(y, step));
  }
  const bar = step * view.scale;
  axes.append(figure("path", { class: "bar", d: `M${width - 16 - bar},${height - 30}v6h${bar}v-6` }));
  text(width - 16 - bar / 2, height - 34, "middle", `${tickWords(step, step)} cm`);
  text(width - 8, height - 6, "end", "x [cm]");
  text(4, 16, "start", "y [cm]");
  return { grid, axes };
}

export { acrossOf, axesOf, fitted, flips, lensPlace, lineData, panned, pixelOf, placeAt, planLayers, poseTransform };
export { robotShape, ticks, tickStep, transform, viewport, zoomed };
