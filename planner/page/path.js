/* Paths in the plane: shapes, points at equal distances, smoothing, corners and arcs that round them.
 *
 * A path is {points, closed}: rows [x, y], and whether the last point is joined to the first. Lengths are in tail
 * lengths l, but any unit works; angles in rad. */
import { CONSTANTS } from "./constants.js";
import { TAU, bounds, column, convolved, differences, halfTurn, interp, largest, linspace, runningSum } from "./math.js";
import { smallest, sum } from "./math.js";
import { formatLength, inLab, inTails } from "./units.js";
import { InputError, general, repr } from "./words.js";

const { CIRCLE_POINTS, LARGEST, MOST_SMOOTHED, EVEN } = CONSTANTS.path;
const { LONGEST, SMALLEST } = CONSTANTS.paths_units;
const { CORNER } = CONSTANTS.declare;
const FINE = 2 * (Math.PI / 180); // largest turn between two points of an arc
const FEWEST = 8; // points of an arc
const POINTS = 400, WAVES = 2, HEIGHT = 0.12; // of a wave: half of its height, over its length
const SHAPES = {
  circle: (radius) => curve(CIRCLE_POINTS, true, (angle) => [radius * Math.cos(angle), radius * Math.sin(angle)]),
  eight: (width) => curve(POINTS, true, (angle) => {
    return [(width / 2) * Math.sin(angle), (width / 2) * Math.sin(angle) * Math.cos(angle)];
  }),
  wave: (length) => curve(POINTS - 1, false, (angle) => {
    return [(length * angle) / TAU, HEIGHT * length * Math.sin(WAVES * angle)];
  }),
  triangle: (side) => polygon(3, side),
  square: (side) => polygon(4, side),
  "polygon:6": (side) => polygon(6, side),
};

/* Make the shape of a name and a size. */
function pageShape(name, size) {
  if (!(size > 0 && size < Infinity)) throw new InputError(`${name}: its size must be above 0`);
  return SHAPES[name](size);
}

/* A curve over a whole turn, in so many steps. */
function curve(steps, closed, at) {
  return pathOf(Array.from({ length: steps + (closed ? 0 : 1) }, (_, i) => at((TAU * i) / steps)), closed);
}

/* Make a regular polygon about the origin, counter-clockwise; it starts in the middle of its lower side. */
function polygon(corners, side) {
  const reach = side / 2 / Math.sin(Math.PI / corners);
  const ring = Array.from({ length: corners }, (_, i) => (TAU * (i + 0.5)) / corners - Math.PI / 2)
    .map((angle) => [reach * Math.cos(angle), reach * Math.sin(angle)]);
  return pathOf([[0, (ring[0][1] + ring[corners - 1][1]) / 2], ...ring], true);
}

/* Make a path from points; by default it is closed if it ends where it begins. */
function pathOf(points, closed = null) {
  const rows = Array.from(points), [first] = rows;
  if (!rows.length) throw new InputError("the path is empty; give at least two points");
  const bad = rows.findIndex(([x, y]) => !(Math.abs(x) < LARGEST && Math.abs(y) < LARGEST));
  if (bad >= 0) {
    throw new InputError(
      `point ${bad + 1} of the path is [${rows[bad].map(repr).join(", ")}]; give finite numbers, smaller than `
      + general(LARGEST),
    );
  }
  const size = largest(rows.map(([x, y]) => Math.max(Math.abs(x - first[0]), Math.abs(y - first[1]))));
  const least = 1e-12 * Math.max(size, 1e-300);
  const kept = rows.filter((point, i) => i === 0 || distance(point, rows[i - 1]) > least);
  if (kept.length < 2 || size === 0) {
    throw new InputError("all points of the path are the same; give at least two that differ");
  }
  const meets = distance(kept[0], kept[kept.length - 1]) <= 1e-9 * size;
  if (meets) kept.pop();
  return { points: kept, closed: closed ?? meets };
}

function distance([x, y], [toX, toY]) {
  return Math.hypot(toX - x, toY - y);
}

/* Multiply the coordinates. */
function scaled(path, factor) {
  return { points: path.points.map(([x, y]) => [x * factor, y * factor]), closed: path.closed };
}

/* The points; those of a closed path with the first one repeated at the end. */
function polyline(path) {
  return path.closed ? [...path.points, path.points[0]] : path.points;
}

/* Lengths of the steps of a polyline. */
function stepLengths(line) {
  return Float64Array.from({ length: line.length - 1 }, (_, i) => distance(line[i], line[i + 1]));
}

function pathLength(path) {
  return sum(stepLengths(polyline(path)));
}

/* The length of a polyline from its start to each of its points. */
function arcLength(line) {
  return runningSum(stepLengths(line));
}

/* Width and height of a path. */
function extent({ points }) {
  return bounds(points).map(([low, high]) => high - low);
}

/* Refuse a path that no schedule can be meant for. turnRadius: of the robot's circle. */
function checkSize(path, robot, turnRadius) {
  const across = extent(path), long = pathLength(path) > LONGEST;
  if (!long && Math.max(...across) >= SMALLEST * turnRadius) return;
  const lab = across.map((value) => formatLength(value * robot.tailLength)).join(" by ");
  const words = `${inLab(pathLength(path), robot)} long, ${lab} (${across.map(inTails).join(" by ")} l)`;
  const why = long ? `; at most ${general(LONGEST)} l can be planned`
    : `: too small, the robot's circle has a radius of ${inLab(turnRadius, robot)}`;
  throw new InputError(`the path is ${words}${why}; scale it`);
}

/* Place points at equal arc length, at most `spacing` apart; the ends are kept. */
function resample(line, spacing) {
  const lengths = arcLength(line), end = lengths[lengths.length - 1];
  return pointsAt(line, lengths, linspace(0, end, Math.max(2, stepsOf(end, spacing) + 1)));
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
    throw new InputError(`smoothing over ${general(length)} l; give a length above 0 and below half the path's`);
  }
  const points = resample(polyline(path), Math.max(length / 20, whole / MOST_SMOOTHED)), last = points.length - 1;
  const sigma = length / 2 / (whole / last), reach = Math.ceil(4 * sigma);
  const turned = ([aboutX, aboutY], [x, y]) => [2 * aboutX - x, 2 * aboutY - y]; // so that the ends stay
  const at = (i) => {
    if (path.closed) return points[((i % last) + last) % last];
    if (i < 0) return turned(points[0], points[Math.min(-i, last)]);
    return i <= last ? points[i] : turned(points[last], points[Math.max(2 * last - i, 0)]);
  };
  const around = Array.from({ length: last + 2 * reach + (path.closed ? 0 : 1) }, (_, i) => at(i - reach));
  const bell = Float64Array.from({ length: 2 * reach + 1 }, (_, i) => Math.exp(-0.5 * ((i - reach) / sigma) ** 2));
  const total = sum(bell), kernel = bell.map((value) => value / total);
  const x = convolved(column(around, 0), kernel), y = convolved(column(around, 1), kernel);
  const means = Array.from(x, (value, i) => [value, y[i]]);
  return { path: pathOf(means, path.closed), moved: largest(means.map((point, i) => distance(point, points[i]))) };
}

/* The signed turning angle [rad] at every point; zero at the ends of an open path. */
function kinks(path) {
  const line = polyline(path), dx = differences(column(line, 0)), dy = differences(column(line, 1));
  const direction = dx.map((x, i) => Math.atan2(dy[i], x)), last = direction.length - 1;
  const turns = path.closed ? direction.map((angle, i) => angle - direction[i ? i - 1 : last])
    : Float64Array.from([0, ...differences(direction), 0]);
  return turns.map(halfTurn);
}

/* The largest radius that fits all corners; infinite without corners. */
function largestFillet(path) {
  const reach = kinks(path).map((angle) => (Math.abs(angle) > CORNER ? Math.tan(Math.abs(angle) / 2) : 0));
  const edges = stepLengths(polyline(path));
  return smallest(edges.map((edge, i) => edge / (reach[i] + reach[(i + 1) % reach.length])));
}

/* Replace corners by arcs of `radius`, tangent to the edges; at most `largestFillet`. */
function fillet(path, radius, apart) {
  const angles = kinks(path), line = polyline(path), lengths = stepLengths(line);
  if (radius === 0) return path;
  const step = Math.min(FINE, apart / radius);
  const points = path.points.flatMap((point, i) => {
    const angle = angles[i], before = i ? i - 1 : lengths.length - 1;
    if (!(Math.abs(angle) > CORNER)) return [point];
    const reach = radius * Math.tan(Math.abs(angle) / 2), inward = Math.sign(angle) * radius;
    const into = [0, 1].map((k) => (line[before + 1][k] - line[before][k]) / lengths[before]);
    const start = point.map((value, k) => value - reach * into[k]);
    const centre = [start[0] - inward * into[1], start[1] + inward * into[0]];
    const x = start[0] - centre[0], y = start[1] - centre[1];
    return Array.from(linspace(0, angle, Math.max(FEWEST, stepsOf(Math.abs(angle), step))), (turned) => {
      const c = Math.cos(turned), s = Math.sin(turned);
      return [centre[0] + (c * x - s * y), centre[1] + (s * x + c * y)];
    });
  });
  return { points, closed: path.closed };
}

export { pageShape, pathOf, scaled, polyline, stepLengths, pathLength, arcLength, extent, checkSize, resample };
export { pointsAt, stepsOf, smoothed, CORNER, kinks, largestFillet, fillet };
