/* Corners of a path, and arcs that round them.
 *
 * Mirrors planner/paths/fillets.py. Any unit of length; angles in rad. */
import { TAU, column, differences, linspace, mod, smallest } from "./arrays.js";
import { polyline, stepLengths, stepsOf } from "./path.js";

const CORNER = 15 * (Math.PI / 180); // larger kinks are corners; smaller ones belong to curves
const FINE = 2 * (Math.PI / 180); // largest turn between two points of an arc
const FEWEST = 8; // points of an arc

/* The signed turning angle [rad] at every point; zero at the ends of an open path. */
function kinks(path) {
  const line = polyline(path), dx = differences(column(line, 0)), dy = differences(column(line, 1));
  const direction = dx.map((x, i) => Math.atan2(dy[i], x)), last = direction.length - 1;
  const turns = path.closed
    ? direction.map((angle, i) => angle - direction[i ? i - 1 : last])
    : Float64Array.from([0, ...differences(direction), 0]);
  return turns.map((turn) => mod(turn + Math.PI, TAU) - Math.PI);
}

/* The largest radius that fits all corners; infinite without corners. */
function largestFillet(path) {
  const reach = kinks(path).map((angle) => (Math.abs(angle) > CORNER ? Math.tan(Math.abs(angle) / 2) : 0));
  const edges = stepLengths(polyline(path));
  const fits = Array.from(edges, (edge, i) => edge / (reach[i] + reach[(i + 1) % reach.length]));
  return smallest(fits);
}

/* Replace corners by arcs of `radius`, tangent to the edges; at most `largestFillet`. */
function fillet(path, radius) {
  const angles = kinks(path), corner = Array.from(angles, (angle) => Math.abs(angle) > CORNER);
  if (radius === 0 || !corner.includes(true)) return path;
  const line = polyline(path), lengths = stepLengths(line), rounded = [];
  path.points.forEach((point, i) => {
    if (!corner[i]) {
      rounded.push(point);
      return;
    }
    const angle = angles[i], before = i ? i - 1 : lengths.length - 1;
    const reach = radius * Math.tan(Math.abs(angle) / 2);
    const into = [0, 1].map((k) => (line[before + 1][k] - line[before][k]) / lengths[before]);
    const inward = Math.sign(angle) * radius, start = point.map((value, k) => value - reach * into[k]);
    const centre = [start[0] - inward * into[1], start[1] + inward * into[0]];
    const x = start[0] - centre[0], y = start[1] - centre[1];
    for (const turned of linspace(0, angle, Math.max(FEWEST, stepsOf(Math.abs(angle), FINE)))) {
      const c = Math.cos(turned), s = Math.sin(turned);
      rounded.push([centre[0] + (c * x - s * y), centre[1] + (s * x + c * y)]);
    }
  });
  return { points: rounded, closed: path.closed };
}

export { CORNER, kinks, largestFillet, fillet };
