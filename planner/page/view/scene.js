/* What the picture of a plan consists of, drawn in cm with y upwards; a transform puts it on the screen. */

import { figure } from "./dom.js";
import { pixelOf, tickStep, tickWords, ticks } from "./viewport.js";

const LEAST_APART = 4; // pixels between flips that are drawn

/* A polyline as the data of an SVG path. */
function lineData(points, closed = false) {
  return points.length ? `M${points.map(([x, y]) => `${x},${y}`).join("L")}${closed ? "Z" : ""}` : "";
}

/* A line of a fixed width in pixels. */
function line(kind, points, closed = false) {
  return figure("path", { class: kind, d: lineData(points, closed), "vector-effect": "non-scaling-stroke" });
}

/* Build the layers of a plan [cm]: band, drawn and declared path, track by direction. */
function planLayers({ drawn, plan, tracks, old }) {
  const layers = figure("g", { class: old ? "old" : "" });
  if (plan) layers.append(band(plan));
  if (drawn) layers.append(line("drawn", drawn.points, drawn.closed));
  if (plan) {
    layers.append(line("declared", plan.reference, plan.closed), ...motion(plan));
    layers.append(startMark(plan));
  }
  for (const { points } of tracks) layers.append(line("measured", points));
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
  return Object.entries(data).map(([direction, d]) =>
    figure("path", { class: direction === "1" ? "forward" : "backward", d, "vector-effect": "non-scaling-stroke" }),
  );
}

/* An arrow at the start pose, as long as the head. */
function startMark(plan) {
  const [x, y, heading] = plan.start;
  const size = plan.body.headLength;
  const tip = [x + size * Math.cos(heading), y + size * Math.sin(heading)];
  const barbs = [2.6, -2.6].map((angle) => [
    tip[0] + 0.35 * size * Math.cos(heading + angle), tip[1] + 0.35 * size * Math.sin(heading + angle),
  ]);
  const d = `${lineData([[x, y], tip])}${lineData([barbs[0], tip, barbs[1]])}`;
  return figure("path", { class: "start", d, "vector-effect": "non-scaling-stroke" });
}

/* Dots at flips that are LEAST_APART pixels or more from the one drawn before; null: they are too dense. */
function flips(plan, view) {
  let d = "", last = null, drawn = 0;
  for (const [x, y] of plan.flips) {
    const here = pixelOf(view, [x, y]);
    if (last && Math.hypot(here[0] - last[0], here[1] - last[1]) < LEAST_APART) return null;
    last = here;
    d += `M${x},${y}h0`;
    drawn += 1;
  }
  return drawn ? figure("path", { class: "flip", d, "vector-effect": "non-scaling-stroke" }) : null;
}

/* Where a tail is clamped, seen from above, in radii of the disc, which is turned so that no tail hides another. */
function acrossOf(k, tails) {
  return Math.cos((Math.PI * (4 * k + 1)) / (2 * tails));
}

/* The robot from above, to scale, at the origin, heading to the right. */
function robotShape({ headLength, headRadius, tailLength, tailRadius, discOffset, tails }) {
  const shape = figure("g", { class: "robot" });
  const rear = -headLength / 2;
  for (let k = 0; k < tails; k++) {
    const across = discOffset * acrossOf(k, tails);
    shape.append(
      figure("rect", {
        class: "tail", x: rear - tailLength, y: across - tailRadius, width: tailLength, height: 2 * tailRadius,
      }),
    );
  }
  shape.append(
    figure("rect", {
      class: "head", x: rear, y: -headRadius, width: headLength, height: 2 * headRadius, rx: headRadius / 4,
    }),
  );
  return shape;
}

function poseTransform([x, y, heading]) {
  return `translate(${x} ${y}) rotate(${(heading * 180) / Math.PI})`;
}

/* Axes with ticks [cm], a grid, and a scale bar, for a picture of width × height pixels. */
function axes(view, width, height, unit = "cm") {
  const step = tickStep(view);
  const group = figure("g", { class: "axes" });
  const right = (width - view.left) / view.scale, left = -view.left / view.scale;
  const up = view.top / view.scale, down = (view.top - height) / view.scale;
  for (const x of ticks(left, right, step)) {
    const [px] = pixelOf(view, [x, 0]);
    group.append(figure("path", { class: "grid", d: `M${px},0V${height}` }));
    if (px > 30 && px < width - 16) {
      group.append(figure("text", { x: px, y: height - 6, "text-anchor": "middle" }, tickWords(x, step)));
    }
  }
  for (const y of ticks(down, up, step)) {
    const [, py] = pixelOf(view, [0, y]);
    group.append(figure("path", { class: "grid", d: `M0,${py}H${width}` }));
    if (py > 12 && py < height - 26) group.append(figure("text", { x: 4, y: py - 3 }, tickWords(y, step)));
  }
  const bar = step * view.scale;
  group.append(
    figure("path", { class: "bar", d: `M${width - 16 - bar},${height - 30}v6h${bar}v-6` }),
    figure(
      "text", { x: width - 16 - bar / 2, y: height - 34, "text-anchor": "middle" },
      `${tickWords(step, step)} ${unit}`,
    ),
  );
  return group;
}

export { acrossOf, axes, flips, lineData, planLayers, poseTransform, robotShape };
