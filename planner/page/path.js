/* Paths in the plane: polylines, circles, polygons, points at equal distances, smoothing.
 *
 * Mirrors planner/paths/path.py. A path is {points, closed}: rows [x, y], and whether the last point is joined to
 * the first. Lengths are in tail lengths l, but any unit works. */
import { TAU, column, convolved, interp, largest, linspace, runningSum, sum } from "./arrays.js";
import { InputError } from "./input_error.js";
import { general, repr } from "./format.js";

const CIRCLE_POINTS = 720;
const LARGEST = 1e100; // coordinate: squares of larger ones overflow
const MOST_SMOOTHED = 200_000;
const EVEN = 1e-9; // of a step, that rounding may add to a length

/* Make a path from points; by default it is closed if it ends where it begins. Path2D.of */
function pathOf(points, closed = null) {
  if (points.length === 0) throw new InputError("the path is empty; give at least two points");
  const rows = Array.from(points);
  checkShape(rows);
  const bad = rows.findIndex(([x, y]) => !(Math.abs(x) < LARGEST && Math.abs(y) < LARGEST));
  if (bad >= 0) {
    const point = `[${rows[bad].map(repr).join(", ")}]`;
    throw new InputError(
      `point ${bad + 1} of the path is ${point}; give finite numbers, smaller than ${general(LARGEST)}`,
    );
  }
  const [first] = rows;
  let size = 0;
  for (const [x, y] of rows) size = Math.max(size, Math.abs(x - first[0]), Math.abs(y - first[1]));
  const least = 1e-12 * Math.max(size, 1e-300);
  const kept = rows.filter((point, i) => i === 0 || distance(point, rows[i - 1]) > least);
  if (kept.length < 2 || size === 0) {
    throw new InputError("all points of the path are the same; give at least two that differ");
  }
  const meets = distance(kept[0], kept[kept.length - 1]) <= 1e-9 * size;
  if (meets) kept.pop();
  return { points: kept, closed: closed ?? meets };
}

/* Refuse what is no table of two columns. */
function checkShape(rows) {
  const width = Array.isArray(rows[0]) ? rows[0].length : 0;
  const regular = width ? rows.every((row) => Array.isArray(row) && row.length === width) : true;
  const numbers = rows.every((row) => [row].flat().every((value) => typeof value === "number"));
  if (!regular || !numbers) throw new InputError("the path has an entry that is no number; give pairs x, y");
  if (width === 2) return;
  const shape = width ? `(${rows.length}, ${width})` : `(${rows.length},)`;
  throw new InputError(`the path has shape ${shape}; give (n, 2): x and y of each point`);
}

function distance(first, second) {
  const x = second[0] - first[0], y = second[1] - first[1];
  return Math.sqrt(x * x + y * y);
}

/* Multiply the coordinates. Path2D.scaled */
function scaled(path, factor) {
  return { points: path.points.map(([x, y]) => [x * factor, y * factor]), closed: path.closed };
}

/* The points; those of a closed path with the first one repeated at the end. Path2D.polyline */
function polyline(path) {
  return path.closed ? [...path.points, path.points[0]] : path.points;
}

/* Lengths of the steps of a polyline. */
function stepLengths(line) {
  const lengths = new Float64Array(line.length - 1);
  for (let i = 0; i < lengths.length; i++) lengths[i] = distance(line[i], line[i + 1]);
  return lengths;
}

/* Path2D.length */
function pathLength(path) {
  return sum(stepLengths(polyline(path)));
}

/* Make a circle about the origin, counter-clockwise from (radius, 0). */
function circle(radius) {
  const angles = Array.from({ length: CIRCLE_POINTS }, (_, i) => (TAU * i) / CIRCLE_POINTS);
  return pathOf(angles.map((angle) => [radius * Math.cos(angle), radius * Math.sin(angle)]), true);
}

/* Make a regular polygon about the origin, counter-clockwise; it starts in the middle of its lower side. */
function polygon(corners, side) {
  const reach = side / 2 / Math.sin(Math.PI / corners), ring = [];
  for (let i = 0; i < corners; i++) {
    const angle = (TAU * (i + 0.5)) / corners - Math.PI / 2;
    ring.push([reach * Math.cos(angle), reach * Math.sin(angle)]);
  }
  const last = ring[corners - 1], middle = [(ring[0][0] + last[0]) / 2, (ring[0][1] + last[1]) / 2];
  return pathOf([middle, ...ring], true);
}

/* The length of a polyline from its start to each of its points. arc_length */
function arcLength(line) {
  return runningSum(stepLengths(line));
}

/* Place points at equal arc length, at most `spacing` apart; the ends are kept. */
function resample(line, spacing) {
  const lengths = arcLength(line), end = lengths[lengths.length - 1];
  const count = Math.max(2, stepsOf(end, spacing) + 1);
  return pointsAt(line, lengths, linspace(0, end, count));
}

/* Interpolate a polyline, whose points are at these lengths, at other lengths. */
function pointsAt(line, lengths, at) {
  const x = interp(at, lengths, column(line, 0)), y = interp(at, lengths, column(line, 1));
  return Array.from(x, (value, i) => [value, y[i]]);
}

/* The number of equal steps of a length, at most `most` each, whatever the last bits of both are. */
function stepsOf(length, most) {
  return Math.ceil(length / most - EVEN);
}

/* Smooth a path over a length: {path, moved}, with `moved` how far that moves it. */
function smoothed(path, length) {
  const whole = pathLength(path);
  if (!(length > 0 && length < whole / 2)) {
    throw new InputError(
      `smoothing over ${general(length)} l; give a length above 0 and below half the path's`,
    );
  }
  const points = resample(polyline(path), Math.max(length / 20, whole / MOST_SMOOTHED)), last = points.length - 1;
  const sigma = length / 2 / (whole / last), reach = Math.ceil(4 * sigma), around = [];
  if (path.closed) {
    const count = last; // without the first point's repetition
    for (let i = -reach; i < count + reach; i++) around.push(points[((i % count) + count) % count]);
  } else { // turned about the ends, which therefore stay
    const [start, end] = [points[0], points[last]];
    const turned = (about, [x, y]) => [2 * about[0] - x, 2 * about[1] - y];
    for (let i = reach; i > 0; i--) around.push(turned(start, points[Math.min(i, last)]));
    for (const point of points) around.push(point);
    for (let i = 1; i <= reach; i++) around.push(turned(end, points[last - Math.min(i, last)]));
  }
  const bell = Float64Array.from({ length: 2 * reach + 1 }, (_, i) => Math.exp(-0.5 * ((i - reach) / sigma) ** 2));
  const total = sum(bell), kernel = bell.map((value) => value / total);
  const x = convolved(column(around, 0), kernel), y = convolved(column(around, 1), kernel);
  const means = Array.from(x, (value, i) => [value, y[i]]);
  const moved = largest(means.map((point, i) => distance(point, points[i])));
  return { path: pathOf(means, path.closed), moved };
}

export { pathOf, scaled, polyline, stepLengths, pathLength, circle, polygon, arcLength, resample, stepsOf };
export { smoothed };
