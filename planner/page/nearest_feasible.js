/* The feasible path nearest to the path as drawn: poses of the pivot by Gauss-Newton steps.
 *
 * Mirrors planner/paths/nearest_feasible.py, which explains the cost, without hindrances. Lengths in l. */
import { TAU, column, convolved, interp, largest, mean, remainder, unwrap } from "./arrays.js";
import { pathLength, pathOf, polyline, resample } from "./path.js";
import { dampedStep, normalEquations, places, sortedEquations, wholeLap } from "./pose_equations.js";
import { STILL } from "./tractrix.js";

const SPACING = 0.2; // of the poses, in radii of the pivot's circle
const MOST_POSES = 20_000; // of a path that is not longer than so many times COARSEST
const COARSEST = 0.075; // spacing in l
const WEIGHTS = [0.3, 3.0, 30.0, 300.0, 1000.0]; // of what the robot cannot do, one stage after another
const ITERATIONS = 20; // in each stage
const ALONG = 0.6; // of distances along the path beside those across: a robot that is late is still on it
const POINTS_A_POSE = 4; // points of the path for each pose
const ROUNDS = 12; // of growing weights
const LEAST = 0.01; // share of the mean weight that every point keeps

/* Find the path of the tracked point that is nearest to `raw` among those that the robot can follow.
 *
 * pivotDistance: from the pivot to the tracked point, at least 0. radius: smallest radius of the pivot's track.
 * minimax: nearest by the largest distance, not by the root mean square. timeWeight: what time counts beside the
 * distance [l²]. progress: called now and then with the share that is done. */
function nearestPath(raw, pivotDistance, radius, options = {}) {
  const { drift = STILL, minimax = false, timeWeight = 0, progress = null } = options;
  const line = resample(polyline(raw), poseSpacing(raw, radius)), spacing = pathLength(raw) / (line.length - 1);
  const target = raw.closed ? line.slice(0, -1) : line, start = firstPoses(target, pivotDistance, raw.closed);
  const shares = new Float64Array(target.length).fill(1), sides = sidesOf(target, raw.closed);
  const fixed = { target, sides, distance: pivotDistance, radius, drift, spacing, timeWeight, turn: start.turn };
  const task = { ...fixed, shares };
  const stages = WEIGHTS.length + (minimax ? ROUNDS : 0);
  const told = (stage) => progress?.(stage / stages);
  let poses = start.poses;
  WEIGHTS.forEach((weight, stage) => {
    told(stage);
    poses = descend(poses, task, weight);
  });
  if (minimax) poses = smallestDistance(poses, task, told);
  if (task.turn !== null) poses = wholeLap(poses, task.turn);
  const points = trackedPoints(poses, pivotDistance);
  return pathOf(raw.closed ? points.slice(0, -1) : points, raw.closed);
}

/* Interpolate between poses of the pivot, and return the points of the tracked point. tracked_points */
function trackedPoints(poses, pivotDistance) {
  const steps = poses.x.length - 1, knots = Float64Array.from({ length: steps + 1 }, (_, i) => i);
  const at = Float64Array.from({ length: POINTS_A_POSE * steps + 1 }, (_, i) => i / POINTS_A_POSE);
  const [x, y, heading] = [poses.x, poses.y, poses.heading].map((values) => interp(at, knots, values));
  return Array.from(at, (place, i) => {
    const j = Math.floor(place), share = place - j, c = Math.cos(heading[i]), s = Math.sin(heading[i]);
    let off = 0; // between two poses the pivot moves on an arc, which lies off its chord
    if (share > 0) {
      const chord = Math.hypot(poses.x[j + 1] - poses.x[j], poses.y[j + 1] - poses.y[j]);
      off = (-(poses.heading[j + 1] - poses.heading[j]) * chord * share * (1 - share)) / 2;
    }
    return [x[i] - off * s + pivotDistance * c, y[i] + off * c + pivotDistance * s];
  });
}

/* The spacing of the poses by which the nearest path is sought, for the smallest turn radius. */
function poseSpacing(raw, radius) {
  return Math.max(SPACING * radius, Math.min(pathLength(raw) / MOST_POSES, COARSEST));
}

/* Begin with poses along the target, headings smoothed over a pivot distance; and the turn of a lap. _start */
function firstPoses(target, pivotDistance, closed) {
  const count = target.length, moves = [];
  for (let i = 0; i < (closed ? count : count - 1); i++) {
    const next = target[(i + 1) % count];
    moves.push([next[0] - target[i][0], next[1] - target[i][1]]);
  }
  const length = moves.map(([x, y]) => Math.hypot(x, y)), least = 1e-9 * largest(length);
  const going = Array.from(moves.keys()).filter((i) => length[i] > least);
  const known = unwrap(going.map((i) => Math.atan2(moves[i][1], moves[i][0])));
  const first = known[0], last = known[known.length - 1];
  const turn = closed ? last - first + remainder(first - last, TAU) : null;
  const tangent = interp(Array.from(target.keys()), going, known);
  const reach = smoothingReach(pivotDistance, mean(going.map((i) => length[i])), count);
  const early = (i) => (closed ? tangent[count - reach + i] - turn : tangent[0]);
  const late = (i) => (closed ? tangent[i] + turn : tangent[count - 1]);
  const around = Float64Array.from({ length: count + 2 * reach }, (_, i) => {
    const k = i - reach;
    return k < 0 ? early(i) : k < count ? tangent[k] : late(k - count);
  });
  const kernel = new Float64Array(2 * reach + 1).fill(1 / (2 * reach + 1));
  const heading = convolved(around, kernel);
  const x = column(target, 0).map((value, i) => value - pivotDistance * Math.cos(heading[i]));
  const y = column(target, 1).map((value, i) => value - pivotDistance * Math.sin(heading[i]));
  return { poses: { x, y, heading }, turn };
}

/* The number of neighbours to each side over which headings are smoothed. */
function smoothingReach(pivotDistance, spacing, count) {
  return Math.max(Math.min(Math.trunc((0.5 * pivotDistance) / spacing), Math.floor(count / 2)), 1);
}

/* Unit vectors along the path, times the weight of such distances, and across it. _sides */
function sidesOf(target, closed) {
  const count = target.length, last = count - 1;
  const angle = Float64Array.from(target, (_, i) => {
    const before = target[i ? i - 1 : closed ? last : 0], after = target[i < last ? i + 1 : closed ? 0 : last];
    return Math.atan2(after[1] - before[1], after[0] - before[0]);
  });
  return {
    alongX: angle.map((value) => ALONG * Math.cos(value)),
    alongY: angle.map((value) => ALONG * Math.sin(value)),
    acrossX: angle.map((value) => -Math.sin(value)),
    acrossY: angle.map((value) => Math.cos(value)),
  };
}

/* Find poses whose largest distance from the target is small. _minimax */
function smallestDistance(poses, task, told) {
  let best = poses, { shares } = task;
  for (let stage = 0; stage < ROUNDS; stage++) {
    told(WEIGHTS.length + stage);
    const away = distances(poses, task), grown = shares.map((share, i) => share * away[i]), middle = mean(grown);
    shares = grown.map((share) => Math.max(share / middle, LEAST));
    poses = descend(poses, { ...task, shares }, WEIGHTS[WEIGHTS.length - 1]);
    if (largest(distances(poses, task)) < largest(distances(best, task))) best = poses;
  }
  return best;
}

/* The distances of the tracked point from the target. */
function distances(poses, { target, distance }) {
  return poses.x.map((x, i) => {
    const heading = poses.heading[i], y = poses.y[i] + distance * Math.sin(heading) - target[i][1];
    return Math.hypot(x + distance * Math.cos(heading) - target[i][0], y);
  });
}

/* Minimise by Gauss-Newton with Levenberg's damping, for one weight of the constraints. */
function descend(poses, task, weight) {
  const place = places(poses.x.length, task.turn !== null);
  let damping = 1e-3, system = normalEquations(poses, task, weight);
  for (let round = 0; round < ITERATIONS; round++) {
    const sorted = sortedEquations(system, place);
    let tried = null, candidate = null;
    while (damping < 1e6 && !tried) {
      const step = dampedStep(sorted, damping);
      if (step === null) {
        damping *= 10;
        continue;
      }
      const moved = stepped(poses, step, place);
      candidate = normalEquations(moved, task, weight);
      if (candidate.cost < system.cost) tried = moved;
      else damping *= 6;
    }
    if (!tried) return poses;
    const gained = system.cost - candidate.cost;
    poses = tried;
    system = candidate;
    damping = Math.max(damping / 5, 1e-9);
    if (gained < 1e-3 * system.cost) break;
  }
  return poses;
}

/* Poses after a step, which is sorted by `place`. */
function stepped({ x, y, heading }, step, place) {
  return {
    x: x.map((value, i) => value - step[3 * place[i]]),
    y: y.map((value, i) => value - step[3 * place[i] + 1]),
    heading: heading.map((value, i) => value - step[3 * place[i] + 2]),
  };
}

export { nearestPath, poseSpacing };
