/* Shapes that the page offers besides those in words: a figure of eight and a wave. Any unit of length. */
import { InputError } from "./input_error.js";
import { pathOf } from "./path.js";
import { SHAPES, nearestShape, shapeOf } from "./shapes.js";

const POINTS = 400;
const WAVES = 2;
const HEIGHT = 0.12; // of a wave, over its length, to each side

/* Make the shape of a name and a size: words of the command line, such as polygon:6, or eight, or wave. */
function pageShape(name, size) {
  if (!(size > 0 && size < Infinity)) throw new InputError(`${name}: its size must be above 0`);
  if (name === "eight") return eight(size);
  if (name === "wave") return wave(size);
  const words = `${name}:${size}`, path = shapeOf(words);
  if (path) return path;
  const near = nearestShape(words);
  throw new InputError(`${words}: no such shape; ${near && `is it ${near}? `}shapes are ${SHAPES}, eight, wave`);
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
