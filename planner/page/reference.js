/* How the pivot moves while the tracked point follows a path, a tractrix; distances between points and polylines.
 *
 * A drift is {sideways, current: [x, y]}, as shares of the net speed along the heading. Lengths in l, angles in
 * rad. */
import { CONSTANTS } from "./constants.js";
import { TAU, clip, column, differences, halfTurn, largest, linspace, smallest, unwrap } from "./math.js";
import { arcLength, pointsAt, polyline, resample, stepLengths, stepsOf } from "./path.js";
import { InputError } from "./words.js";

const { LAPS, MOST_SLIP, POINTS_A_ROD } = CONSTANTS.tractrix;
const { TIE } = CONSTANTS.distance; // difference of distances that are equal
const STILL = { sideways: 0, current: [0, 0] };
const RUN = 16; // segments in a box
const MOST_FILLED = 4000; // points that are added to a polyline

/* Compute the tractrix of a path: {p, q, heading, arc, curvature, closed}, p of the tracked point, q of the pivot.
 *
 * heading is without jumps; arc is the arc length of q; curvature is the turn of the heading per length of q in
 * its steps. pivotDistance is the length of the rod; 0: the pivot itself is tracked. */
function reference(path, pivotDistance, spacing, drift = STILL) {
  const p = resample(polyline(path), spacing), dx = differences(column(p, 0)), dy = differences(column(p, 1));
  const tangent = unwrap(dx.map((x, i) => Math.atan2(dy[i], x)));
  const heading = pivotDistance <= 0 ? pivotHeading(tangent, path.closed, drift)
    : draggedHeading(tangent, stepLengths(p), pivotDistance, path.closed, drift);
  const q = p.map(([x, y], i) => {
    return [x - pivotDistance * Math.cos(heading[i]), y - pivotDistance * Math.sin(heading[i])];
  });
  return withArc({ p, q, heading, closed: path.closed });
}

/* Place the path a rod ahead of a track of the pivot, poses [x, y, course]; heading: the first one, whole turns included. */
function referenceOfPivot(poses, rod, drift, first) {
  const headings = Float64Array.from(poses, ([, , course]) => course - slipOf(course, drift));
  const whole = TAU * Math.round((first - headings[0]) / TAU), heading = headings.map((angle) => angle + whole);
  const q = poses.map(([x, y]) => [x, y]);
  const p = q.map(([x, y], i) => [x + rod * Math.cos(heading[i]), y + rod * Math.sin(heading[i])]);
  return withArc({ p, q, heading, closed: false });
}

/* Add arc and curvature. */
function withArc({ p, q, heading, closed }) {
  const arc = arcLength(q), steps = differences(arc);
  const curvature = differences(heading).map((turn, i) => turn / Math.max(steps[i], 1e-9));
  return { p, q, heading, arc, curvature, closed };
}

/* The heading where the pivot itself follows the path: the mean of the directions of two steps. */
function pivotHeading(tangent, closed, drift) {
  const last = tangent.length - 1, turn = closed ? turning(tangent) : 0;
  const before = closed ? tangent[last] - turn : tangent[0], after = closed ? tangent[0] + turn : tangent[last];
  const ends = [before, ...tangent, after];
  return Float64Array.from({ length: last + 2 }, (_, i) => {
    const angle = (ends[i + 1] + ends[i]) / 2;
    return angle - slipOf(angle, drift);
  });
}

/* The heading of a rod that is dragged; on a closed path for a few laps, until the motion repeats. */
function draggedHeading(tangent, length, pivotDistance, closed, drift) {
  let start = tangent[0] - slipOf(tangent[0], drift), heading;
  for (let lap = 0; lap < (closed ? LAPS : 1); lap++) {
    heading = drag(tangent, length, pivotDistance, start, drift);
    if (closed) start = heading[heading.length - 1] - turning(tangent);
  }
  return heading;
}

/* How close the points of an arc must be for a reference to turn as the arc does, not as its kinks do. */
function closest(pivotDistance, spacing) {
  return Math.max(pivotDistance, spacing) / POINTS_A_ROD;
}

/* The total turn of a closed path: a multiple of 2π. */
function turning(tangent) {
  const first = tangent[0], last = tangent[tangent.length - 1];
  return last - first + halfTurn(first - last);
}

function isStill({ sideways, current: [x, y] }) {
  return sideways === 0 && x === 0 && y === 0;
}

/* The angle from the heading to a straight path in `direction`. */
function slipOf(direction, drift) {
  let slip = 0;
  if (!isStill(drift)) for (let i = 0; i < 50; i++) slip = Math.atan(ratio(direction - slip, drift));
  return slip;
}

/* The ratio of sideways to forward motion, (u + c·n)/(V + c·e). */
function ratio(heading, { sideways, current: [x, y] }) {
  const ahead = 1 + x * Math.cos(heading) + y * Math.sin(heading);
  const aside = sideways - x * Math.sin(heading) + y * Math.cos(heading);
  if (ahead > 0 && Math.abs(aside) <= MOST_SLIP * ahead) return aside / ahead;
  throw new InputError(
    "the current, or the difference of left and right turns, is as fast as the robot's net motion; use a longer "
    + "dwell or a faster motor",
  );
}

/* The heading along straight steps; exact without drift, where tan(δ/2) decays as exp(−s/a). */
function drag(tangent, length, pivotDistance, start, drift) {
  const heading = new Float64Array(tangent.length + 1), still = isStill(drift);
  let now = (heading[0] = start);
  for (let i = 0; i < tangent.length; i++) {
    const gap = halfTurn(tangent[i] - now), decay = Math.exp(-length[i] / pivotDistance);
    now += gap - 2 * Math.atan(Math.tan(gap / 2) * decay);
    if (!still) now -= ratio(now, drift) * Math.max(Math.cos(gap), 0) * (1 - decay);
    heading[i + 1] = now;
  }
  return heading;
}

/* The distance of each point from a polyline. */
function distanceTo(line, points) {
  return nearest(line, points).distance;
}

/* Find the place on a polyline that is nearest to each point: columns distance, segment and share of it.
 *
 * Of segments whose distances differ by less than TIE the lowest number counts. Segments are looked at in runs, each in
 * its box; the place that was found last is a good guess of the next. */
function nearest(line, points) {
  const xs = column(line, 0), ys = column(line, 1), count = line.length - 1, runs = Math.ceil(count / RUN);
  const [left, right, low, high] = [xs, ys].flatMap((values) => [Math.min, Math.max].map((end) => {
    return Float64Array.from({ length: runs }, (_, run) => end(...values.subarray(run * RUN, (run + 1) * RUN + 1)));
  }));
  const distance = new Float64Array(points.length), share = new Float64Array(points.length);
  const segment = new Int32Array(points.length);
  let nearest = 0, part = 0; // of the segment that was looked at last
  const squareTo = (i, x, y) => {
    const dx = xs[i + 1] - xs[i], dy = ys[i + 1] - ys[i], square = dx * dx + dy * dy;
    const along = square > 0 ? ((x - xs[i]) * dx + (y - ys[i]) * dy) / square : 0;
    part = along < 0 ? 0 : along > 1 ? 1 : along;
    const awayX = x - xs[i] - part * dx, awayY = y - ys[i] - part * dy;
    return awayX * awayX + awayY * awayY;
  };
  const near = (run, x, y, reach) => { // whether a part of the run may be as near as that
    const awayX = Math.max(left[run] - x, x - right[run], 0), awayY = Math.max(low[run] - y, y - high[run], 0);
    return (awayX * awayX + awayY * awayY) * (1 - 1e-12) <= reach;
  };
  points.forEach(([x, y], k) => {
    let least = squareTo(nearest, x, y);
    for (let run = 0; run < runs; run++) {
      if (!near(run, x, y, least)) continue;
      for (let i = run * RUN; i < Math.min((run + 1) * RUN, count); i++) least = Math.min(least, squareTo(i, x, y));
    }
    const reach = (Math.sqrt(least) + TIE) ** 2;
    for (let i = 0; i < count; i++) {
      if (i % RUN === 0 && !near(i / RUN, x, y, reach)) i += RUN - 1;
      else if (squareTo(i, x, y) <= reach) {
        nearest = i;
        break;
      }
    }
    segment[k] = nearest;
    distance[k] = Math.sqrt(squareTo(nearest, x, y));
    share[k] = part;
  });
  return { distance, segment, share };
}

/* The largest distance of any point of the first polyline from the second, and the reverse. */
function twoSided(first, second) {
  return [largest(distanceTo(second, filled(first))), largest(distanceTo(first, filled(second)))];
}

/* Add points to a polyline, so that all steps are short compared with its length. */
function filled(line) {
  const lengths = arcLength(line), end = lengths[lengths.length - 1];
  const step = Math.max(smallest(differences(lengths)), end / MOST_FILLED);
  const count = clip(stepsOf(end, step), 2, MOST_FILLED);
  return pointsAt(line, lengths, Float64Array.from(new Set([...linspace(0, end, count), ...lengths])).sort());
}

export { STILL, reference, referenceOfPivot, slipOf, ratio, distanceTo, nearest, twoSided, closest };
