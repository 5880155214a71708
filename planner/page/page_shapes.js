/* Shapes that the page offers. Any unit of length. */
import { InputError } from "./input_error.js";
import { circle, pathOf, polygon } from "./path.js";

const POINTS = 400;
const WAVES = 2;
const HEIGHT = 0.12; // of a wave, over its length, to each side

const SHAPES = {
  circle,
  eight,
  wave,
  triangle: (side) => polygon(3, side),
  square: (side) => polygon(4, side),
  "polygon:6": (side) => polygon(6, side),
};

/* Make the shape of a name and a size. */
function pageShape(name, size) {
  if (!(size > 0 && size < Infinity)) throw new InputError(`${name}: its size must be above 0`);
  return SHAPES[name](size);
}

/* The lemniscate of Gerono, of a width. */
function eight(width) {
  const points = Array.from({ length: POINTS }, (_, i) => {
    const angle = (2 * Math.PI * i) / POINTS;
    return [(width / 2) * Math.sin(angle), (width / 2) * Math.sin(angle) * Math.cos(angle)];
  });
  return pathOf(points, true);
}

/* A sine wave of a length. */
function wave(length) {
  const points = Array.from({ length: POINTS }, (_, i) => {
    const share = i / (POINTS - 1);
    return [length * share, HEIGHT * length * Math.sin(2 * Math.PI * WAVES * share)];
  });
  return pathOf(points, false);
}

export { pageShape };
