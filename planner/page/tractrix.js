/* How the robot's pivot and heading move while the tracked point follows a path: the pivot draws a tractrix.
 *
 * Mirrors planner/paths/tractrix.py, which has the equations. A drift is {sideways, current: [x, y]}, as shares of
 * the net speed along the heading. Lengths in l, angles in rad. */
import { TAU, column, differences, mod, unwrap } from "./arrays.js";
import { InputError } from "./input_error.js";
import { arcLength, polyline, resample, stepLengths } from "./path.js";

const LAPS = 6;
const MOST_SLIP = 3.0; // sideways by forward motion
const STILL = { sideways: 0, current: [0, 0] };

/* Compute the tractrix of a path: {p, q, heading, arc, curvature, closed}, p of the tracked point, q of the pivot.
 *
 * heading is without jumps; arc is the arc length of q; curvature is the turn of the heading per length of q in
 * its steps. pivotDistance is the length of the rod; 0: the pivot itself is tracked. */
function reference(path, pivotDistance, spacing, drift = STILL) {
  const p = resample(polyline(path), spacing), dx = differences(column(p, 0)), dy = differences(column(p, 1));
  const tangent = unwrap(dx.map((x, i) => Math.atan2(dy[i], x)));
  const heading = pivotDistance <= 0
    ? pivotHeading(tangent, path.closed, drift)
    : draggedHeading(tangent, stepLengths(p), pivotDistance, path.closed, drift);
  const q = p.map(([x, y], i) => [
    x - pivotDistance * Math.cos(heading[i]), y - pivotDistance * Math.sin(heading[i]),
  ]);
  const arc = arcLength(q), steps = differences(arc);
  const curvature = differences(heading).map((turn, i) => turn / Math.max(steps[i], 1e-9));
  return { p, q, heading, arc, curvature, closed: path.closed };
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

/* The total turn of a closed path: a multiple of 2π. */
function turning(tangent) {
  const first = tangent[0], last = tangent[tangent.length - 1];
  return last - first + (mod(first - last + Math.PI, TAU) - Math.PI);
}

function isStill(drift) {
  return drift.sideways === 0 && drift.current[0] === 0 && drift.current[1] === 0;
}

/* The angle from the heading to a straight path in `direction`. */
function slipOf(direction, drift) {
  let slip = 0;
  if (!isStill(drift)) for (let i = 0; i < 50; i++) slip = Math.atan(ratio(direction - slip, drift));
  return slip;
}

/* The ratio of sideways to forward motion, (u + c·n)/(V + c·e). */
function ratio(heading, drift) {
  const [x, y] = drift.current, ahead = 1 + x * Math.cos(heading) + y * Math.sin(heading);
  const aside = drift.sideways - x * Math.sin(heading) + y * Math.cos(heading);
  if (ahead <= 0 || Math.abs(aside) > MOST_SLIP * ahead) {
    throw new InputError(
      "the current, or the difference of left and right turns, is as fast as the robot's net motion; use a " +
        "longer dwell or a faster motor",
    );
  }
  return aside / ahead;
}

/* The heading along straight steps; exact without drift, where tan(δ/2) decays as exp(−s/a). */
function drag(tangent, length, pivotDistance, start, drift) {
  const heading = new Float64Array(tangent.length + 1), still = isStill(drift);
  let now = (heading[0] = start);
  for (let i = 0; i < tangent.length; i++) {
    const gap = mod(tangent[i] - now + Math.PI, TAU) - Math.PI, decay = Math.exp(-length[i] / pivotDistance);
    now += gap - 2 * Math.atan(Math.tan(gap / 2) * decay);
    if (!still) now -= (ratio(now, drift) * Math.max(Math.cos(gap), 0) * length[i]) / pivotDistance;
    heading[i + 1] = now;
  }
  return heading;
}

export { STILL, reference };
