/* Shapes that are given in words: circle:RADIUS, square:SIDE, triangle:SIDE, polygon:CORNERS:SIDE.
 *
 * Mirrors planner/paths/shapes.py. */
import { closeMatch } from "./close_match.js";
import { InputError } from "./input_error.js";
import { circle, polygon } from "./path.js";
import { pythonNumber, pythonText } from "./format.js";

const SHAPES = "circle:RADIUS, square:SIDE, triangle:SIDE, polygon:CORNERS:SIDE";
const MOST_CORNERS = 1000;
const ALIKE = 0.75; // least likeness of a misspelt name
const CORNERS = { triangle: 3, square: 4 };

/* Make the shape that is given in words; null: the words name no shape. */
function shapeOf(words) {
  const [name, ...sizes] = words.split(":");
  if (!sizes.length || !["circle", "polygon", ...Object.keys(CORNERS)].includes(name)) return null;
  const numbers = sizes.map(pythonNumber);
  if (numbers.includes(null) || numbers.length !== (name === "polygon" ? 2 : 1)) {
    throw new InputError(`${pythonText(words)}; write for example circle:2, square:3 or polygon:6:2`);
  }
  const size = numbers[numbers.length - 1];
  if (!(size > 0 && size < Infinity)) throw new InputError(`${pythonText(words)}; its size must be above 0`);
  if (name === "circle") return circle(size);
  const corners = name === "polygon" ? numbers[0] : CORNERS[name];
  if (!(corners >= 3 && corners <= MOST_CORNERS && Number.isInteger(corners))) {
    throw new InputError(`${pythonText(words)}; give 3 to ${MOST_CORNERS} corners, as in polygon:6:2`);
  }
  return polygon(corners, size);
}

/* Tell whether words look like a shape, known or not: hexagon:3, or circle without a size. */
function likeAShape(words) {
  return /^[A-Za-z]+(:[^/\\]*)?$/.test(words);
}

/* Correct the name of a misspelt shape: square:3 for squre:3; empty where no shape has such a name. */
function nearestShape(words) {
  const [name, ...sizes] = words.split(":"), shapes = SHAPES.split(", ");
  const near = closeMatch(name.toLowerCase(), shapes.map((shape) => shape.split(":")[0]), ALIKE);
  if (near === null || near === name) return "";
  if (sizes.length) return [near, ...sizes].join(":");
  return shapes.find((shape) => shape.startsWith(`${near}:`));
}

export { SHAPES, shapeOf, likeAShape, nearestShape };
