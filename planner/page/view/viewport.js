/* The part of the plane that a picture shows: zoom, pan, fit, ticks. Lengths in cm, pixels right and down. */

const LEAST_SCALE = 1e-3; // pixels per cm
const LARGEST_SCALE = 1e6;

/* A viewport: the scale [pixels per cm] and the pixel of the origin. */
function viewport(scale, left, top) {
  return { scale: Math.min(Math.max(scale, LEAST_SCALE), LARGEST_SCALE), left, top };
}

/* Show all points [cm] in width × height pixels, with a margin. */
function fitted(points, width, height, margin = 0.12) {
  let [low, high, bottom, top] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const [x, y] of points) {
    low = Math.min(low, x);
    high = Math.max(high, x);
    bottom = Math.min(bottom, y);
    top = Math.max(top, y);
  }
  if (!(high >= low)) return viewport(10, width / 2, height / 2);
  const room = 1 + 2 * margin;
  const least = 1e-3;
  const scale = Math.min(
    width / (room * Math.max(high - low, least)), height / (room * Math.max(top - bottom, least)),
  );
  return viewport(scale, width / 2 - (scale * (low + high)) / 2, height / 2 + (scale * (bottom + top)) / 2);
}

/* Zoom by a factor about a pixel. */
function zoomed(view, factor, x, y) {
  const scale = Math.min(Math.max(view.scale * factor, LEAST_SCALE), LARGEST_SCALE);
  const real = scale / view.scale;
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
  const hidden = Object.entries(LENS_PLACES).map(([name, [right, down]]) => {
    const x = lens / 2 + right * (width - lens);
    const y = lens / 2 + down * (height - lens);
    const inside = points.filter((point) => {
      const [px, py] = pixelOf(view, point);
      return Math.hypot(px - x, py - y) < lens / 2;
    });
    return { name, count: inside.length };
  });
  return hidden.reduce((best, place) => (place.count < best.count ? place : best)).name;
}

/* The transform of a group that is drawn in cm, y upwards. */
function transform(view) {
  return `matrix(${view.scale} 0 0 ${-view.scale} ${view.left} ${view.top})`;
}

/* The step of ticks [cm]: 1, 2 or 5 times a power of ten, at least `pixels` apart. */
function tickStep(view, pixels = 70) {
  const least = pixels / view.scale;
  const power = 10 ** Math.floor(Math.log10(least));
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

export { fitted, lensPlace, panned, pixelOf, placeAt, tickStep, tickWords, ticks, transform, viewport, zoomed };
