/* The feasible path nearest to the path as drawn: poses of the pivot by Gauss-Newton steps.
 *
 * Poses are columns {x, y, heading}; a task is {target, sides, shares, distance, radius, drift, spacing, timeWeight,
 * turn}, with `sides` the columns alongX, alongY, acrossX and acrossY. Lengths in l, angles in rad. */
import { CONSTANTS } from "./constants.js";
import { clip, column, convolved, halfTurn, interp, largest, mean, sum, unwrap } from "./math.js";
import { pathLength, pathOf, polyline, resample } from "./path.js";
import { STILL } from "./reference.js";

const { SPACING, MOST_POSES, COARSEST, WEIGHTS, ITERATIONS, ALONG } = CONSTANTS.nearest_path;
const { POINTS_A_POSE, ROUNDS, LEAST } = CONSTANTS.nearest_path;
const { EVEN, SHORT, SHORTEST_STEP } = CONSTANTS.nearest_path;

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

/* Interpolate between poses of the pivot, and return the points of the tracked point. */
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

/* Begin with poses along the target, headings smoothed over a pivot distance; and the turn of a lap. */
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
  const turn = closed ? last - first + halfTurn(first - last) : null;
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
  return clip(Math.trunc((0.5 * pivotDistance) / spacing), 1, Math.max(count >> 1, 1));
}

/* Unit vectors along the path, times the weight of such distances, and across it. */
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


/* Repeat the first pose of a lap at its end. */
function wholeLap({ x, y, heading }, turn) {
  return {
    x: Float64Array.from([...x, x[0]]),
    y: Float64Array.from([...y, y[0]]),
    heading: Float64Array.from([...heading, heading[0] + turn]),
  };
}

/* The linearised least squares: cost; gradient [3][m], half of the cost's; diagonal [3][3][m], blocks of the
 * poses, upper triangle; across [3][3][k], blocks of neighbours, row of the first, column of the second. */
function normalEquations(poses, task, weight) {
  const count = poses.x.length, steps = task.turn === null ? count - 1 : count;
  const columns = (length) => Array.from({ length: 3 }, () => new Float64Array(length));
  const gradient = columns(count), diagonal = [0, 1, 2].map(() => columns(count));
  const across = [0, 1, 2].map(() => columns(steps)), costs = new Float64Array(steps);
  const cost = addDistances(poses, task, gradient, diagonal);
  for (let i = 0; i < steps; i++) {
    const j = (i + 1) % count;
    costs[i] = addStep(poses, i, j, j ? 0 : task.turn, task, weight, gradient, diagonal, across);
  }
  return { cost: cost + sum(costs), gradient, diagonal, across };
}

/* Add the squared distances from the target; return their sum. */
function addDistances(poses, task, gradient, diagonal) {
  const { target, sides, shares, distance } = task, count = shares.length;
  let total = 0;
  for (const [sideX, sideY] of [[sides.alongX, sides.alongY], [sides.acrossX, sides.acrossY]]) {
    const costs = new Float64Array(count);
    for (let m = 0; m < count; m++) {
      const aheadX = distance * Math.cos(poses.heading[m]), aheadY = distance * Math.sin(poses.heading[m]);
      const offX = poses.x[m] + aheadX - target[m][0], offY = poses.y[m] + aheadY - target[m][1];
      const residual = sideX[m] * offX + sideY[m] * offY, weighted = shares[m] * residual;
      const slopes = [sideX[m], sideY[m], sideY[m] * aheadX - sideX[m] * aheadY];
      costs[m] = weighted * residual;
      for (let i = 0; i < 3; i++) {
        gradient[i][m] += slopes[i] * weighted;
        for (let j = i; j < 3; j++) diagonal[i][j][m] += shares[m] * slopes[i] * slopes[j];
      }
    }
    total += sum(costs);
  }
  return total;
}

/* Add the residuals of the step from pose i to pose j, which is `turn` further in a lap; return their cost. */
function addStep(poses, i, j, turn, task, weight, gradient, diagonal, across) {
  const { x, y, heading } = poses, next = heading[j] + turn;
  const dx = x[j] - x[i], dy = y[j] - y[i], middle = (next + heading[i]) / 2;
  const c = Math.cos(middle), s = Math.sin(middle), forward = c * dx + s * dy, aside = c * dy - s * dx;
  const part = stepPart(forward, aside, next - heading[i], c, s, task, weight), { ff, fg, gg, ft, tt } = part;
  // second derivatives by x and y of the step, in the lab
  const xx = c * c * ff - 2 * c * s * fg + s * s * gg;
  const xy = c * s * (ff - gg) + (c * c - s * s) * fg;
  const yy = s * s * ff + 2 * c * s * fg + c * c * gg;
  // by x, y and the mean heading, which adds g dφ to f and −f dφ to g
  const swingF = aside / 2, swingG = -forward / 2;
  const byF = ff * swingF + fg * swingG, byG = fg * swingF + gg * swingG;
  const xSwing = c * byF - s * byG, ySwing = s * byF + c * byG, swing = byF * swingF + byG * swingG;
  // by x, y, mean heading and the turn
  const xTurn = c * ft, yTurn = s * ft, swingTurn = swingF * ft;
  const fromX = c * part.f - s * part.g, fromY = s * part.f + c * part.g;
  const fromSwing = swingF * part.f + swingG * part.g;
  for (const [at, sign] of [[i, -1], [j, 1]]) {
    gradient[0][at] += sign * fromX;
    gradient[1][at] += sign * fromY;
    gradient[2][at] += fromSwing + sign * part.t;
    diagonal[0][0][at] += xx;
    diagonal[0][1][at] += xy;
    diagonal[1][1][at] += yy;
    diagonal[0][2][at] += sign * xSwing + xTurn;
    diagonal[1][2][at] += sign * ySwing + yTurn;
    diagonal[2][2][at] += swing + 2 * sign * swingTurn + tt;
  }
  const blocks = [
    [-xx, -xy, -xSwing - xTurn],
    [-xy, -yy, -ySwing - yTurn],
    [xSwing - xTurn, ySwing - yTurn, swing - tt],
  ];
  for (let a = 0; a < 3; a++) for (let b = 0; b < 3; b++) across[a][b][i] = blocks[a][b];
  return part.cost;
}

/* What the residuals of a step add: cost, and derivatives by forward part f, sideways part g and turn t. */
function stepPart(forward, aside, turn, c, s, task, weight) {
  const { radius, spacing } = task, [cx, cy] = task.drift.current;
  const slip = (task.drift.sideways - cx * s + cy * c) / (1 + cx * c + cy * s);
  const sideways = weight * (aside - slip * forward), sense = Math.sign(turn);
  const over = Math.max(sense * turn * radius - forward, 0); // turns further than it can
  const turning = weight ** 2 * over, bent = over > 0 ? weight ** 2 : 0;
  const least = SHORTEST_STEP * spacing, short = Math.max(least - forward, 0);
  const uneven = EVEN * (forward - spacing), late = task.timeWeight / spacing; // times the length
  const length = Math.max(forward, least), going = forward >= least ? 1 : 0;
  return {
    cost: sideways ** 2 + turning * over + SHORT ** 2 * short ** 2 + uneven ** 2 + late * length,
    f: -weight * slip * sideways - turning - SHORT ** 2 * short + EVEN * uneven + (late / 2) * going,
    g: weight * sideways,
    t: radius * sense * turning,
    ff: weight ** 2 * slip ** 2 + bent + (short > 0 ? SHORT ** 2 : 0) + EVEN ** 2 + ((late / 4) * going) / length,
    fg: -(weight ** 2) * slip,
    gg: weight ** 2,
    ft: -radius * sense * bent,
    tt: radius ** 2 * bent,
  };
}

/* Order the poses in the system so that neighbours are near one another: the place of each. */
function places(count, closed) {
  const place = new Int32Array(count), half = Math.floor((count + 1) / 2);
  for (let i = 0; i < count; i++) place[i] = !closed ? i : i < half ? 2 * i : 2 * (count - 1 - i) + 1;
  return place;
}

/* Assemble the normal matrix and the right side, sorted by `place`: {band, right, width}.
 *
 * The matrix is symmetric. band[row][d] is its entry in column `row`, d rows below the diagonal. */
function sortedEquations(system, place) {
  const count = place.length, steps = system.across[0][0].length;
  let apart = 0;
  for (let i = 0; i < steps; i++) apart = Math.max(apart, Math.abs(place[(i + 1) % count] - place[i]));
  const width = 3 * apart + 2, right = new Float64Array(3 * count);
  const band = new Float64Array(3 * count * (width + 1));
  const entry = (pose, i, below) => (3 * pose + i) * (width + 1) + below;
  for (let m = 0; m < count; m++) {
    for (let i = 0; i < 3; i++) {
      right[3 * place[m] + i] = system.gradient[i][m];
      for (let j = i; j < 3; j++) band[entry(place[m], i, j - i)] = system.diagonal[i][j][m];
    }
  }
  for (let k = 0; k < steps; k++) {
    const first = place[k], second = place[(k + 1) % count], later = second > first;
    const low = Math.min(first, second), rows = 3 * Math.abs(second - first);
    for (let i = 0; i < 3; i++) {
      for (let j = 0; j < 3; j++) { // row j of the later pose, column i of the earlier one
        band[entry(low, i, rows + j - i)] = later ? system.across[i][j][k] : system.across[j][i][k];
      }
    }
  }
  return { band, right, width };
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

export { nearestPath, poseSpacing };
