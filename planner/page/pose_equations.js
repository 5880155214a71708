/* Normal equations of a pivot's poses near a path: the least squares of nearest_feasible.js.
 *
 * Mirrors planner/paths/pose_equations.py, without hindrances. Poses are columns {x, y, heading}; a task is
 * {target, sides, shares, distance, radius, drift, spacing, timeWeight, turn}, with `sides` the columns alongX,
 * alongY, acrossX and acrossY. Lengths in l, angles in rad. */
import { sum } from "./arrays.js";

const EVEN = 0.01; // weight of equal steps
const SHORT = 10.0; // weight of steps that are too short
const SHORTEST_STEP = 0.25; // of the steps, as a share of the spacing

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

export { wholeLap, normalEquations, places, sortedEquations, dampedStep };
