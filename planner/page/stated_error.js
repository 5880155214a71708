/* The errors of a plan: predicted, stated with its uncertainty, with feedback, and guaranteed for an exact vehicle.
 *
 * Deviations from the predicted poses grow along a schedule to first order, and random vehicles are drawn from them;
 * the normal numbers come from a counter and are those that Python draws. Lengths in l, times in μ0 l⁴/EI, angles in
 * rad. */
import { CONSTANTS } from "./constants.js";
import { arc, compose, inversePose, largest, linspace, quantile, sum } from "./math.js";
import { polyline } from "./path.js";
import { distanceTo, nearest } from "./reference.js";
import { BEFORE_KNOTS, COUNT, SHORTEST, STEP, lagAt, lagNoise, lagPlace, pivotRadius, rollOut } from "./vehicle.js";
import { zigzagSpeed } from "./vehicle.js";

const { WEYL, FIRST, SECOND, MIDDLE, TAIL } = CONSTANTS.stated_error;
const { LEVEL, WOBBLE, DRAWS, BLOCKS } = CONSTANTS.stated_error;
const { TIGHTEST, PAIRS_AHEAD } = CONSTANTS.line_of_sight;
const { WITHIN, KEPT, ZIGZAG, PLACE, COURSE, STRETCH, CAMERA } = CONSTANTS.stated_error;
const NOTHING = [0, 0, 0];
const UNCHANGED = { twist: [NOTHING, NOTHING], current: [0, 0] };
let drawn = { seed: null, numbers: [] }; // the last numbers: plans ask for the same again and again

/* Draw the first `count` numbers of a seed, or more. */
function normals(seed, count) {
  const start = mixed((seed + 1) % 2 ** 32), known = drawn.seed === seed ? drawn.numbers : [];
  if (known.length >= count) return known;
  const numbers = Float64Array.from({ length: count }, (_, i) => {
    return known[i] ?? normalQuantile((mixed(mixed(Math.imul(i + 1, WEYL)) ^ start) + 0.5) / 2 ** 32);
  });
  drawn = { seed, numbers };
  return numbers;
}

function mixed(x) {
  let hash = x >>> 0;
  hash = Math.imul(hash ^ (hash >>> 16), FIRST) >>> 0;
  hash = Math.imul(hash ^ (hash >>> 15), SECOND) >>> 0;
  return (hash ^ (hash >>> 15)) >>> 0;
}

/* Φ⁻¹(u) for e⁻²⁵ ≤ u ≤ 1 − e⁻²⁵. */
function normalQuantile(u) {
  const q = u - 0.5, middle = Math.abs(q) <= 0.425;
  const r = middle ? 0.180625 - q * q : Math.sqrt(-Math.log(Math.min(u, 1 - u))) - 1.6;
  const polynomial = (powers) => powers.reduceRight((total, power) => total * r + power, 0);
  const [above, below] = (middle ? MIDDLE : TAIL).map(polynomial);
  return ((middle ? q : Math.sign(q)) * above) / below;
}

/* Propagate modes of a vehicle, and those of its disc's phase, to some flips of a schedule, given by rising numbers from
 * 0 to that of all dwells: {modes, phases}, of each mode {x, y}, columns over the flips. */
function errorGrowth(vehicle, modes, { dwells, firstDirection }, { poses, changes }, flips) {
  const from = firstDirection < 0 ? 1 : 0, sides = Array.from(dwells, (_, i) => (i + from) % 2);
  const circles = sides.map((side, i) => arc(vehicle.twist[side], dwells[i]));
  const places = sides.map((_, i) => lagPlace(i ? dwells[i - 1] : dwells[i], dwells[i]));
  const lags = changes.map((change, i) => compose(change, inversePose(circles[i])));
  const c = poses.map(([, , heading]) => Math.cos(heading)), s = poses.map(([, , heading]) => Math.sin(heading));
  const growth = (mode, added) => {
    const twist = vehicle.twist.map((row, side) => row.map((value, k) => value + mode.twist[side][k]));
    const turns = mode.twist.flat().some((value) => value !== 0), [currentX, currentY] = mode.current;
    const grown = { x: [0], y: [0] };
    let x = 0, y = 0, turned = 0;
    for (let i = 0, next = 1; i < dwells.length; i++) {
      const lag = added(i), circle = turns ? arc(twist[sides[i]], dwells[i]) : circles[i], late = lags[i][2] + lag[2];
      const cosine = Math.cos(late), sine = Math.sin(late), change = changes[i];
      const ahead = lags[i][0] + lag[0] + (cosine * circle[0] - sine * circle[1]) - change[0];
      const left = lags[i][1] + lag[1] + (sine * circle[0] + cosine * circle[1]) - change[1];
      x += c[i] * ahead - s[i] * left + currentX * dwells[i] - turned * (poses[i + 1][1] - poses[i][1]);
      y += s[i] * ahead + c[i] * left + currentY * dwells[i] + turned * (poses[i + 1][0] - poses[i][0]);
      turned += late + circle[2] - change[2];
      if (flips[next] !== i + 1) continue;
      grown.x.push(x);
      grown.y.push(y);
      next += 1;
    }
    return grown;
  };
  const lagOf = ({ lag }) => (i) => (lag ? lagAt(lag[sides[i]], places[i]) : NOTHING);
  return {
    modes: modes.map((mode) => growth(mode, lagOf(mode))),
    phases: phaseLags(vehicle, sides, dwells).map((lag) => growth(UNCHANGED, (i) => lag[i])),
  };
}

/* What the four modes of the disc's phase add to the lags of the dwells. */
function phaseLags(vehicle, sides, dwells) {
  const spread = [1, -1].map((sense) => lagNoise(vehicle, sense, dwells));
  let turned = 0;
  const phase = Array.from(dwells, (dwell, i) => {
    const before = turned;
    turned += vehicle.phaseRate[sides[i]] * dwell;
    return before;
  });
  return [0, 1].flatMap((side) => [Math.cos, Math.sin].map((wave) => sides.map((of, i) => {
    return of === side ? spread[side].map((values) => values[i] * wave(phase[i])) : NOTHING;
  })));
}

/* Δ = R′/(1 − κ̄ R′), at least the way that the robot makes in some pairs of dwells. */
function lookAhead(vehicle, curvature, straight) {
  const radius = pivotRadius(vehicle), least = radius / (1 - Math.min(curvature * radius, TIGHTEST));
  return Math.max(least, PAIRS_AHEAD * zigzagSpeed(straight) * (straight.dwells[0] + straight.dwells[1]));
}

/* The bound on the distance from the reference for a vehicle without errors; rod: from the pivot to the tracked
 * point. */
function guaranteedError(vehicle, rod, swing, ahead) {
  const first = Math.round(SHORTEST / STEP), lag = [0, 0, 0];
  for (const table of vehicle.lag) {
    for (let row = 0; row < BEFORE_KNOTS.length * COUNT; row++) {
      if (row % COUNT < first) continue;
      for (let axis = 0; axis < 3; axis++) lag[axis] = Math.max(lag[axis], Math.abs(table[3 * row + axis]));
    }
  }
  return swing * (ahead + 2 * rod) + Math.hypot(lag[0], lag[1]) + (ahead + 2 * rod) * lag[2];
}

/* The rms over time of distances that are sampled equally often in each dwell. */
function rmsInTime(distance, dwells) {
  const samples = (distance.length - 1) / dwells.length;
  const squares = distance.slice(1).map((value, i) => (value ** 2 * dwells[Math.floor(i / samples)]) / samples);
  return Math.sqrt(sum(squares) / sum(dwells));
}

/* Distances of a track from the declared path: {distance, signed, normal, closed}; left is positive, and normals
 * point to the left. */
function predictedError(declared, track, closed) {
  const { distance, segment, share } = nearest(declared, track), signed = new Float64Array(track.length);
  const normal = track.map(([x, y], i) => {
    const [x0, y0] = declared[segment[i]], [x1, y1] = declared[segment[i] + 1], dx = x1 - x0, dy = y1 - y0;
    const length = Math.max(Math.hypot(dx, dy), 1e-300), aside = -dy / length, ahead = dx / length;
    const side = (x - (x0 + share[i] * dx)) * aside + (y - (y0 + share[i] * dy)) * ahead;
    signed[i] = side < 0 || Object.is(side, -0) ? -distance[i] : distance[i];
    return [aside, ahead];
  });
  return { distance, signed, normal, closed };
}

/* Choose the flips of a schedule of `count` dwells between which deviations are drawn. */
function flipsBetween(count) {
  return [...new Set(Array.from(linspace(0, count, Math.min(count, BLOCKS) + 1), Math.trunc))];
}

/* The quantile LEVEL of the largest distance from the declared path over random vehicles. growth: at the flips. */
function statedError(growth, flips, predicted, seed = 0) {
  const { low, high, normal } = extremes(predicted, flips), blocks = low.length, last = blocks - 1, wide = blocks + 1;
  const count = growth.length, z = normals(seed, DRAWS * count + 3), across = new Float64Array((count + 3) * wide);
  growth.forEach(({ x, y }, p) => { // across the path at the end of each block, and along it at its end
    normal.forEach(([aside, ahead], block) => (across[p * wide + block] = x[block + 1] * aside + y[block + 1] * ahead));
    across[p * wide + blocks] = x[blocks] * normal[last][1] - y[blocks] * normal[last][0];
  });
  const moved = new Float64Array(wide), worst = new Float64Array(DRAWS);
  for (let draw = 0; draw < DRAWS; draw++) {
    let off = 0, most = 0;
    moved.fill(0);
    for (let p = 0; p < count; p += 4) { // four at a time, which is faster; what is beyond the last is 0
      const [a, b, c, d] = z.subarray(draw * count + p), ofB = wide, ofC = 2 * wide, ofD = 3 * wide;
      for (let block = 0, at = p * wide; block < wide; block++, at++) {
        moved[block] += a * across[at] + b * across[at + ofB] + c * across[at + ofC] + d * across[at + ofD];
      }
    }
    for (let block = 0; block < blocks; block++) {
      off = Math.max(Math.abs(high[block] + moved[block]), Math.abs(low[block] + moved[block]));
      most = Math.max(most, off);
    }
    const beyond = predicted.closed ? 0 : Math.max(moved[blocks], 0); // past the end of an open path
    worst[draw] = Math.max(most, Math.hypot(off, beyond));
  }
  return quantile(worst.sort(), LEVEL) + WOBBLE;
}

/* Lowest and highest signed distance in each block, and the normal at its end. */
function extremes({ signed, normal }, flips) {
  const last = flips.length - 1, samples = (signed.length - 1) / flips[last];
  const blocks = flips.slice(1).map((end, block) => {
    return signed.slice(flips[block] * samples, block === last - 1 ? undefined : end * samples);
  });
  return {
    low: Float64Array.from(blocks, (some) => Math.min(...some)),
    high: Float64Array.from(blocks, (some) => Math.max(...some)),
    normal: flips.slice(1).map((end) => normal[end * samples]),
  };
}

/* The stated error with feedback, with the camera that is stated by default; from distances of the predicted track,
 * dwells, net speed, the unit of time in seconds, and the error of the open loop. */
function feedbackError(distance, dwells, netSpeed, timeScale, stated) {
  const delay = CAMERA.delay_s / timeScale, gap = CAMERA.every_s / (timeScale * (1 - CAMERA.lost));
  if (delay * dwells.length > KEPT * sum(dwells)) return stated;
  const zigzag = inTime(distance, dwells), poses = STRETCH / (netSpeed * gap);
  const place = (PLACE * CAMERA.noise[0]) / Math.sqrt(poses + 4), course = COURSE * netSpeed * (delay + gap);
  return bound(zigzag / 0.95, Math.hypot(ZIGZAG * zigzag, place, course));
}

/* Bound in 95 % of all cases what is uniform between ±most, with a normal error of deviation `spread`. */
function bound(most, spread) {
  const uniform = (most * most) / 3, variance = uniform + spread * spread;
  const share = (uniform / Math.max(variance, 1e-30)) ** 3;
  return (WITHIN[0] + share * (WITHIN[1] - WITHIN[0])) * Math.sqrt(variance);
}

/* The distance within which a track is in 95 % of the time. */
function inTime(distance, dwells) {
  const samples = (distance.length - 1) / dwells.length, least = 0.95 * sum(dwells);
  const order = Array.from({ length: distance.length - 1 }, (_, i) => i);
  order.sort((one, other) => distance[one + 1] - distance[other + 1]);
  let spent = 0;
  const at = order.find((i) => (spent += dwells[Math.floor(i / samples)] / samples) >= least);
  return distance[(at ?? order[order.length - 1]) + 1];
}

/* A schedule with what is predicted of it; its stated error is drawn when it is asked for.
 *
 * parts: tracked, drawn, declared (see declare.js), switches, straight (motion with the shortest dwell), guaranteed
 * (bound on the error without uncertainty) and seed (of the random robots). */
class Followed {
  constructor(parts) {
    const { tracked: { vehicle, offset }, declared, switches, drawn } = Object.assign(this, parts);
    this.rolled = rollOut(vehicle, switches, offset);
    this.predicted = predictedError(declared.reference.p, this.rolled.track, drawn.closed);
    this.predictedMax = largest(this.predicted.distance);
    this.flips = flipsBetween(switches.dwells.length);
  }

  growthOf(modes) {
    return errorGrowth(this.tracked.vehicle, modes, this.switches, this.rolled, this.flips);
  }

  get growth() {
    return (this.grown ??= this.growthOf(this.tracked.vehicle.modes));
  }

  get stated() {
    const { modes, phases } = this.growth;
    return (this.known ??= statedError([...modes, ...phases], this.flips, this.predicted, this.seed));
  }

  /* The stated error if the coefficients are those of another robot; null: calibrated, or not known. */
  get unmeasured() {
    const { tracked: { unmeasured }, growth: { modes, phases } } = this;
    if (!unmeasured.length) return null;
    return statedError([...modes, ...this.growthOf(unmeasured).modes, ...phases], this.flips, this.predicted);
  }

  /* The errors: {track, motion, stated, feedback, guaranteed, closure, predictedRms, predictedMax, drawnRms, drawnMax,
   * tableShare}. */
  get errors() {
    const { tracked, declared, drawn, straight, switches: { dwells }, rolled: { track, motion }, predicted, stated } = this;
    const fromDrawn = distanceTo(polyline(drawn), track), path = declared.reference.p;
    const [endX, endY] = track[track.length - 1], [startX, startY] = path[0];
    const squares = [...this.growth.modes, ...this.growth.phases].map(({ x, y }) => {
      return x.reduce((total, value, i) => total + value ** 2 + y[i] ** 2, 0);
    });
    const ofTable = squares.filter((_, p) => tracked.vehicle.modes[p]?.name.startsWith("table: "));
    return {
      track,
      motion,
      stated,
      feedback: feedbackError(predicted.distance, dwells, zigzagSpeed(straight), tracked.robot.timeScale, stated),
      guaranteed: this.guaranteed,
      closure: drawn.closed ? Math.hypot(endX - startX, endY - startY) : null,
      predictedRms: rmsInTime(predicted.distance, dwells),
      predictedMax: this.predictedMax,
      drawnRms: rmsInTime(fromDrawn, dwells),
      drawnMax: largest(fromDrawn),
      tableShare: sum(ofTable) / Math.max(sum(squares), 1e-300),
    };
  }
}

export { lookAhead, guaranteedError, Followed };
