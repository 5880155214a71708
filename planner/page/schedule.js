/* Switching times by hysteresis about the line of sight.
 *
 * Mirrors planner/planning/schedule.py, which explains the law. Lengths in l, times in μ0 l⁴/EI, angles in rad. */
import { general } from "./format.js";
import { InputError } from "./input_error.js";
import { LineOfSight, hysteresis } from "./line_of_sight.js";
import { compose, inversePose } from "./planar.js";
import { FOLLOWING, tell } from "./progress.js";
import { motionAfter, pivotDistance, sideOf, speedOf, turnRadius } from "./vehicle.js";
import { zigzag } from "./zigzag.js";

const MOST_SWITCHES = 2_000_000;
const PATIENCE = 30.0; // lengths of the robot's motion that may pass without progress along the path
const EVERY = 2_000; // switches between two calls of `progress`

/* Choose dwell times that keep the tracked point on the reference: switches {firstDirection, dwells, poses}.
 *
 * offset: from the head's centre forward to the tracked point. start: {pose, sense}; default: at rest at the
 * beginning of the reference, with its heading. */
function follow(reference, vehicle, guidance, offset = 0, options = {}) {
  const start = options.start ?? startAtRest(reference, vehicle, guidance, offset);
  const law = new LineOfSight(reference, vehicle, guidance, offset), dwells = [], poses = [start.pose];
  const around = guidance.ahead + pivotDistance(vehicle) + offset + turnRadius(vehicle);
  const patience = (PATIENCE * around) / Math.max(speedOf(vehicle), 1e-300);
  let { pose, sense } = start, before = null, furthest = law.place, stalled = 0; // before: at rest
  for (;;) {
    const { time, ended } = law.nextDwell(pose, sense, before);
    if (time > 0) {
      pose = law.poseAfter(pose, sense, before, time);
      law.integrate(pose, sense);
      dwells.push(time);
      poses.push(pose);
      sense = -sense;
      before = time;
    }
    if (ended) return { firstDirection: start.sense, dwells: Float64Array.from(dwells), poses };
    stalled = law.place > furthest ? 0 : stalled + time;
    furthest = Math.max(furthest, law.place);
    if (stalled > patience) {
      const [x, y] = reference.p[furthest].map((value) => general(value, 3));
      throw new InputError(
        `the robot does not get past (${x}, ${y}) l, where the path turns back too sharply; split it there`,
      );
    }
    if (dwells.length >= MOST_SWITCHES) {
      throw new InputError(`the path needs more than ${MOST_SWITCHES} switches; split it`);
    }
    if (dwells.length % EVERY === 0) tell(options.progress, FOLLOWING, law.place / reference.q.length);
  }
}

/* Start at rest near the beginning of the reference, so that the first dwell continues as one of the zigzag does:
 * {pose, sense}. start_at_rest */
function startAtRest(reference, vehicle, guidance, offset) {
  const [first] = reference.heading;
  const turning = Array.from(reference.heading).find((heading) => Math.abs(heading - first) > 1e-6);
  const sense = turning === undefined || turning > first ? 1 : -1;
  const straight = zigzag(vehicle, guidance.dwell, offset);
  const heading = first - sense * straight.swing * (1 - hysteresis(reference, vehicle, 1)[0]);
  const [[px, py], [qx, qy]] = [reference.p[0], reference.q[0]], toHead = Math.hypot(px - qx, py - qy) - offset;
  const sway = sense * straight.sway, c = Math.cos(heading), s = Math.sin(heading);
  const bent = [qx + sway * s + toHead * c, qy - sway * c + toHead * s, heading];
  const before = straight.dwells[sideOf(-sense)];
  const after = compose(bent, motionAfter(vehicle, sense, before, guidance.dwell));
  return { pose: compose(after, inversePose(motionAfter(vehicle, sense, null, guidance.dwell))), sense };
}

export { follow, startAtRest };
