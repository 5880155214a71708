/* The feasible path nearest to the path as drawn: poses of the pivot by Gauss-Newton steps.
 *
 * Poses are columns {x, y, heading}; a task is {target, sides, shares, distance, radius, drift, spacing, timeWeight,
 * turn}, with `sides` the columns of directions along the path and across it. Lengths in l, angles in rad. */
import { CONSTANTS } from "./constants.js";
import { clip, column, convolved, differences, halfTurn, interp, largest, mean, unwrap } from "./math.js";
import { pathLength, pathOf, polyline, resample } from "./path.js";
import { STILL } from "./reference.js";

const { SPACING, MOST_POSES, COARSEST, WEIGHTS, ITERATIONS, ALONG } = CONSTANTS.nearest_path;
const { POINTS_A_POSE, ROUNDS, LEAST } = CONSTANTS.nearest_path;
const { EVEN, SHORT, SHORTEST_STEP } = CONSTANTS.nearest_path;

/* Find the path of the tracked point that is nearest to `raw` among those that the robot can follow.
 *
 * pivotDistance: from the pivot to the tracked point, at least 0. radius: smallest radius of the pivot's track.
 * minimax: nearest by the largest distance, not by the root mean square. timeWeight: what time counts beside the
 * distance [l²]. apart: how far neighbours among its points may be from each other, about. progress: called now and
 * then with the share that is done. */
function nearestPath(raw, pivotDistance, radius, options = {}) {
  const { drift = STILL, minimax = false, timeWeight = 0, apart = Infinity, progress = null } = options;
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
  const points = trackedPoints(poses, pivotDistance, apart);
  return pathOf(raw.closed ? points.slice(0, -1) : points, raw.closed);
}

/* Interpolate between poses of the pivot, and return the points of the tracked point. */
function trackedPoints(poses, pivotDistance, apart) {
  const steps = poses.x.length - 1, chords = differences(poses.x).map((x, i) => {
    return Math.hypot(x, poses.y[i + 1] - poses.y[i]);
  });
  const pieces = Math.max(POINTS_A_POSE, Math.ceil(mean(chords) / apart));
  const knots = Float64Array.from({ length: steps + 1 }, (_, i) => i);
  const at = Float64Array.from({ length: pieces * steps + 1 }, (_, i) => i / pieces);
  const [x, y, heading] = [poses.x, poses.y, poses.heading].map((values) => interp(at, knots, values));
  return Array.from(at, (place, i) => {
    const j = Math.floor(place), share = place - j, c = Math.cos(heading[i]), s = Math.sin(heading[i]);
    let off = 0; // between two poses the pivot moves on an arc, which lies off its chord
    if (share > 0) {
      off = (-(poses.heading[j + 1] - poses.heading[j]) * chords[j] * share * (1 - share)) / 2;
    }
    return [x[i] - off * s + pivotDistance * c, y[i] + off * c + pivotDistance * s];
  });
}

/* The spacing of the poses by which the nearest path is sought, for the smallest turn radius. */
function poseSpacing(raw, radius) {
  return Math.max(SPACING * radius, Math.min(pathLength(raw) / MOST_POSES, COARSEST));
}

/* Begin with poses along the target, headings smoothed over a pivot distance; and the turn of a lap. */
function firstPoses(target, pivotDistance, closed) {
  const count = target.length, moves = Array.from({ length: closed ? count : count - 1 }, (_, i) => {
    return [0, 1].map((axis) => target[(i + 1) % count][axis] - target[i][axis]);
  });
  const length = moves.map(([x, y]) => Math.hypot(x, y)), least = 1e-9 * largest(length);
  const going = Array.from(moves.keys()).filter((i) => length[i] > least);
  const known = unwrap(going.map((i) => Math.atan2(moves[i][1], moves[i][0])));
  const first = known[0], last = known[known.length - 1];
  const turn = closed ? last - first + halfTurn(first - last) : null;
  const tangent = interp(Array.from(target.keys()), going, known);
  const smoothed = Math.trunc((0.5 * pivotDistance) / mean(going.map((i) => length[i]))); // neighbours to each side
  const reach = clip(smoothed, 1, Math.max(count >> 1, 1));
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

/* Unit vectors along the path, times the weight of such distances, and across it. */
function sidesOf(target, closed) {
  const count = target.length, last = count - 1;
  const angle = Float64Array.from(target, (_, i) => {
    const before = target[i ? i - 1 : closed ? last : 0], after = target[i < last ? i + 1 : closed ? 0 : last];
    return Math.atan2(after[1] - before[1], after[0] - before[0]);
  });
  const c = angle.map(Math.cos), s = angle.map(Math.sin), along = (value) => ALONG * value;
  return [[c.map(along), s.map(along)], [s.map((value) => -value), c]];
}

/* Find poses whose largest distance from the target is small. */
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
  const index = indices(poses.x.length, task.turn !== null);
  let damping = 1e-3, system = normalEquations(poses, task, weight, index);
  for (let round = 0; round < ITERATIONS; round++) {
    let moved = null, candidate = null;
    for (; damping < 1e6; damping *= candidate ? 6 : 10) {
      const step = dampedStep(system, damping);
      if (step !== null) moved = stepped(poses, step, index);
      candidate = step && normalEquations(moved, task, weight, index);
      if (candidate?.cost < system.cost) break;
    }
    if (!(candidate?.cost < system.cost)) return poses;
    const gained = system.cost - candidate.cost;
    poses = moved;
    system = candidate;
    damping = Math.max(damping / 5, 1e-9);
    if (gained < 1e-3 * system.cost) break;
  }
  return poses;
}

/* Poses after a step, which is sorted by `index`. */
function stepped({ x, y, heading }, step, index) {
  const [newX, newY, newHeading] = [x, y, heading].map((values, axis) => values.map((value, i) => {
    return value - step[3 * index[i] + axis];
  }));
  return { x: newX, y: newY, heading: newHeading };
}

/* Repeat the first pose of a lap at its end. */
function wholeLap({ x, y, heading }, turn) {
  const whole = (values, more) => Float64Array.from([...values, values[0] + more]);
  return { x: whole(x, 0), y: whole(y, 0), heading: whole(heading, turn) };
}

/* The linearised least squares: {cost, band, right, width}.
 *
 * The matrix is symmetric. band[row][d] is its entry in column `row`, d rows below the diagonal. index: where each pose
 * stands, in poses. Residuals are the distances from the target, and of each step its slip, what it turns further than
 * the robot can, what it is too short and uneven, and the root of the time that it takes. */
function normalEquations({ x, y, heading }, task, weight, index) {
  const { target, sides, shares, distance, radius, drift, spacing, timeWeight, turn } = task, count = x.length;
  const width = turn === null ? 5 : 8, right = new Float64Array(3 * count);
  const band = new Float64Array(3 * count * (width + 1));
  const row = new Float64Array(6), at = new Int32Array(6), late = timeWeight / spacing, least = SHORTEST_STEP * spacing;
  let cost = 0;
  const add = (residual, numbers) => {
    cost += residual * residual;
    for (let a = 0; a < numbers; a++) {
      right[at[a]] += row[a] * residual;
      for (let b = 0; b < numbers; b++) {
        if (at[b] >= at[a]) band[at[a] * (width + 1) + at[b] - at[a]] += row[a] * row[b];
      }
    }
  };
  const settle = (first, pose) => {
    for (let axis = 0; axis < 3; axis++) at[first + axis] = 3 * index[pose] + axis;
  };
  for (let m = 0; m < count; m++) {
    const aheadX = distance * Math.cos(heading[m]), aheadY = distance * Math.sin(heading[m]);
    const offX = x[m] + aheadX - target[m][0], offY = y[m] + aheadY - target[m][1], root = Math.sqrt(shares[m]);
    settle(0, m);
    for (const [sidesX, sidesY] of sides) {
      row[0] = root * sidesX[m];
      row[1] = root * sidesY[m];
      row[2] = row[1] * aheadX - row[0] * aheadY;
      add(row[0] * offX + row[1] * offY, 3);
    }
  }
  for (let i = 0; i < (turn === null ? count - 1 : count); i++) {
    const j = (i + 1) % count, next = heading[j] + (j ? 0 : turn), middle = (next + heading[i]) / 2;
    const dx = x[j] - x[i], dy = y[j] - y[i], c = Math.cos(middle), s = Math.sin(middle), [cx, cy] = drift.current;
    const forward = c * dx + s * dy, aside = c * dy - s * dx, turned = next - heading[i], sense = Math.sign(turned);
    const addStep = (residual, byForward, byAside, byTurn) => { // and its derivatives
      row[3] = c * byForward - s * byAside;
      row[4] = s * byForward + c * byAside;
      row[5] = (aside * byForward - forward * byAside) / 2;
      row[0] = -row[3];
      row[1] = -row[4];
      row[2] = row[5] - byTurn;
      row[5] += byTurn;
      add(residual, 6);
    };
    settle(0, i);
    settle(3, j);
    const slip = (drift.sideways - cx * s + cy * c) / (1 + cx * c + cy * s), over = sense * turned * radius - forward;
    addStep(weight * (aside - slip * forward), -weight * slip, weight, 0);
    if (over > 0) addStep(weight * over, -weight, 0, weight * radius * sense);
    if (forward < least) addStep(SHORT * (least - forward), -SHORT, 0, 0);
    addStep(EVEN * (forward - spacing), EVEN, 0, 0);
    const time = Math.sqrt(late * Math.max(forward, least));
    if (late) addStep(time, forward >= least ? late / 2 / time : 0, 0, 0);
  }
  return { cost, band, right, width };
}

/* Order the poses in the system so that neighbours are near one another: the index of each. */
function indices(count, closed) {
  const index = new Int32Array(count), half = Math.floor((count + 1) / 2);
  for (let i = 0; i < count; i++) index[i] = !closed ? i : i < half ? 2 * i : 2 * (count - 1 - i) + 1;
  return index;
}

/* Solve the damped normal equations by Cholesky's method; null where they are not positive definite. */
function dampedStep({ band, right, width }, damping) {
  const factor = Float64Array.from(band), step = Float64Array.from(right), count = step.length, wide = width + 1;
  for (let j = 0; j < count; j++) {
    const at = j * wide, most = Math.min(width, count - 1 - j), square = factor[at] + damping;
    if (!(square > 0)) return null;
    const root = (factor[at] = Math.sqrt(square));
    for (let d = 1; d <= most; d++) factor[at + d] /= root;
    for (let d = 1; d <= most; d++) {
      const share = factor[at + d], below = (j + d) * wide - d;
      if (share !== 0) for (let e = d; e <= most; e++) factor[below + e] -= share * factor[at + e];
    }
    step[j] /= root;
    for (let d = 1; d <= most; d++) step[j + d] -= factor[at + d] * step[j];
  }
  for (let j = count - 1; j >= 0; j--) {
    const at = j * wide, most = Math.min(width, count - 1 - j);
    for (let d = 1; d <= most; d++) step[j] -= factor[at + d] * step[j + d];
    step[j] /= factor[at];
  }
  return step;
}

export { nearestPath, poseSpacing, dampedStep };
