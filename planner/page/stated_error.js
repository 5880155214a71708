/* The error of a plan: predicted, stated with its uncertainty, and guaranteed for paths of any length.
 *
 * Mirrors planner/planning/stated_error.py, which explains them. Lengths in l, times in μ0 l⁴/EI. */
import { largest, linspace, sum } from "./arrays.js";
import { nearest } from "./distance.js";
import { normals } from "./draws.js";
import { BEFORE_KNOTS, COUNT, SHORTEST, STEP, pivotRadius } from "./vehicle.js";
import { zigzagSpeed } from "./zigzag.js";

const LEVEL = 0.95;
const WOBBLE = 0.002; // l; what the disc's revolutions move the body, which the vehicle averages
const DRAWS = 400;
const BLOCKS = 300; // places along the schedule where deviations are drawn
const TIGHTEST = 0.97;
const PAIRS_AHEAD = 4; // pairs of dwells

/* Δ = R′/(1 − κ̄ R′), at least the way that the robot makes in some pairs of dwells. look_ahead */
function lookAhead(vehicle, curvature, straight = null) {
  const radius = pivotRadius(vehicle), least = radius / (1 - Math.min(curvature * radius, TIGHTEST));
  if (straight === null) return least;
  return Math.max(least, PAIRS_AHEAD * zigzagSpeed(straight) * (straight.dwells[0] + straight.dwells[1]));
}

/* The bound on the distance from the reference for a vehicle without errors; rod: from the pivot to the tracked
 * point. guaranteed */
function guaranteedError(vehicle, rod, swing, ahead) {
  const first = Math.round(SHORTEST / STEP), lag = [0, 0, 0];
  for (const table of vehicle.lag) {
    for (let row = 0; row < BEFORE_KNOTS.length * COUNT; row++) {
      if (row % COUNT < first) continue;
      for (let axis = 0; axis < 3; axis++) lag[axis] = Math.max(lag[axis], Math.abs(table[3 * row + axis]));
    }
  }
  const flip = Math.sqrt(lag[0] ** 2 + lag[1] ** 2) + (ahead + 2 * rod) * lag[2];
  return swing * (ahead + 2 * rod) + flip;
}

/* The rms over time of distances that are sampled equally often in each dwell. */
function rmsInTime(distance, dwells) {
  const samples = (distance.length - 1) / dwells.length, squares = distance.map((value) => value * value);
  const each = Float64Array.from(dwells, (dwell, i) => {
    return (sum(squares.slice(i * samples + 1, (i + 1) * samples + 1)) / samples) * dwell;
  });
  return Math.sqrt(sum(each) / sum(dwells));
}

/* Distances of a track from the declared path: {distance, signed, normal, closed}; left is positive, and normals
 * point to the left. predicted_error */
function predictedError(declared, track, closed) {
  const { distance, segment, share } = nearest(declared, track), signed = new Float64Array(track.length);
  const normal = track.map(([x, y], i) => {
    const [x0, y0] = declared[segment[i]], [x1, y1] = declared[segment[i] + 1], dx = x1 - x0, dy = y1 - y0;
    const length = Math.max(Math.sqrt(dx * dx + dy * dy), 1e-300), aside = -dy / length, ahead = dx / length;
    signed[i] = (x - (x0 + share[i] * dx)) * aside + (y - (y0 + share[i] * dy)) * ahead;
    return [aside, ahead];
  });
  return { distance, signed, normal, closed };
}

/* Choose the flips of a schedule of `count` dwells between which deviations are drawn. flips_between */
function flipsBetween(count) {
  return [...new Set(Array.from(linspace(0, count, Math.min(count, BLOCKS) + 1), Math.trunc))];
}

/* The quantile LEVEL of the largest distance from the declared path over random vehicles. stated_error
 *
 * growth: at the flips of `flipsBetween`. seed: of the draws. */
function statedError({ flips, modes: growth }, predicted, seed = 0) {
  const blocks = extremes(predicted, flips, (predicted.distance.length - 1) / flips[flips.length - 1]);
  const modes = growth.length, z = normals(seed, 0, DRAWS * modes), worst = new Float64Array(DRAWS);
  const added = growth.map(({ x, y }) => [x.slice(1), y.slice(1)]);
  const { normal } = blocks, last = blocks.low.length - 1, forward = [normal[2 * last + 1], -normal[2 * last]];
  const across = alongDirections(added, normal);
  const onward = alongDirections(added.map(([x, y]) => [[x[last]], [y[last]]]), forward);
  for (let draw = 0; draw < DRAWS; draw++) {
    const ofModes = z.subarray(draw * modes, (draw + 1) * modes);
    const beyond = predicted.closed ? 0 : Math.max(product(ofModes, onward, 0), 0); // past the end of an open path
    worst[draw] = farthest(ofModes, across, blocks, beyond);
  }
  return quantile(worst.sort(), LEVEL) + WOBBLE;
}

/* What modes [x, y] add in each block along a direction, x and y in turn; block by block in one column. */
function alongDirections(modes, directions) {
  const blocks = directions.length / 2, values = new Float64Array(blocks * modes.length);
  modes.forEach(([x, y], p) => {
    for (let block = 0; block < blocks; block++) {
      values[block * modes.length + p] = x[block] * directions[2 * block] + y[block] * directions[2 * block + 1];
    }
  });
  return values;
}

/* The sum of the modes in a block, z standard deviations of each. */
function product(z, values, block) {
  let total = 0;
  for (let p = 0, at = block * z.length; p < z.length; p++, at++) total += z[p] * values[at];
  return total;
}

/* The largest distance from the path of a vehicle with z of the modes; beyond: how far it goes past the end. */
function farthest(z, across, { low, high }, beyond) {
  let worst = 0, off = 0;
  for (let block = 0; block < low.length; block++) {
    const aside = product(z, across, block);
    off = Math.max(Math.abs(high[block] + aside), Math.abs(low[block] + aside));
    worst = Math.max(worst, off);
  }
  return Math.max(worst, Math.hypot(off, beyond));
}

/* Lowest and highest signed distance in each block, and the normals at its end, x and y in turn. */
function extremes({ distance, signed, normal }, flips, samples) {
  const blocks = flips.length - 1, low = new Float64Array(blocks).fill(Infinity);
  const high = new Float64Array(blocks).fill(-Infinity);
  for (let block = 0; block < blocks; block++) {
    const last = block === blocks - 1 ? distance.length : flips[block + 1] * samples;
    for (let i = flips[block] * samples; i < last; i++) {
      const side = signed[i] < 0 || Object.is(signed[i], -0) ? -distance[i] : distance[i];
      low[block] = Math.min(low[block], side);
      high[block] = Math.max(high[block], side);
    }
  }
  return { low, high, normal: Float64Array.from(flips.slice(1).flatMap((end) => normal[end * samples])) };
}

/* The quantile of sorted values, as numpy.quantile. */
function quantile(values, level) {
  const place = level * (values.length - 1), below = Math.floor(place), share = place - below;
  const step = values[below + 1] - values[below];
  return share >= 0.5 ? values[below + 1] - step * (1 - share) : values[below] + step * share;
}

/* The largest distance of a predicted track. Predicted.largest */
function largestDistance({ distance }) {
  return largest(distance);
}

export { lookAhead, guaranteedError, rmsInTime, predictedError, flipsBetween, statedError, largestDistance };
