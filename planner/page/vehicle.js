/* The robot as a vehicle: an arc in each direction of the motor, and a memory of the last dwell.
 *
 * For the motor's directions +1 and −1 a vehicle has
 *
 *   twist    [[forward, left, yaw rate], …]
 *   lag      flat tables after dwells BEFORE_KNOTS, at TIMES: forward, left, heading
 *   rest     flat tables of a first dwell, at TIMES
 *   spread   flat tables, one sigma of the lag over the unknown phase of the disc at the flip, at TIMES
 *   phaseRate   N times the disc's mean spin
 *
 * and modes [{name, twist, lag or null, current}], each one standard deviation; current [x, y] in the lab; tailGap in
 * diameters, and leastGap. Curves of a response are flat: the dwell before slowest, then the dwell, then lag forward,
 * left and heading. Switches are {firstDirection ±1, dwells, poses}: dwell times, and poses [x, y, heading] of the
 * head's centre at the flips and the end. Lengths in l, times in μ0 l⁴/EI, angles in rad. */
import { CONSTANTS } from "./constants.js";
import { arc, clip, column, compose, dot, geomspace, interp, largest, largestSize, mean, indexBelow } from "./math.js";
import { splineMatrix } from "./math.js";
import { outlineOf } from "./robot.js";
import { InputError, general, quoted } from "./words.js";

const { DWELLS, BEFORE, FORGOTTEN } = CONSTANTS.response;
const { SHORTEST, STEP, TIMES, BEFORE_KNOTS } = CONSTANTS.vehicle; // STEP between TIMES
const { QUICK, LONGEST, KEPT, NEARLY, COMPARED, WIDEST, COUNT: GRID, LONGER } = CONSTANTS.zigzag;
const { PAIRS, TRIES } = CONSTANTS.zigzag; // the last simulated pair of dwells is taken
const CURVE = DWELLS.length * 3; // numbers of a curve
const COUNT = TIMES.length;
const RESAMPLE = splineMatrix(DWELLS.map(Math.log), TIMES.map((time) => Math.log(Math.max(time, DWELLS[0]))))
  .map((row, i) => row.map((share) => share * Math.min(TIMES[i] / DWELLS[0], 1)));
const AFTER = sharesAfter(BEFORE);
const SAMPLES = 8; // of the track in each dwell
const OBJECTIVES = ["error", "time", "flips"];
const POINTS = ["head_centre", "head_tip", "pivot"];

/* Which of the tables belongs to a direction of the motor. */
function sideOf(sense) {
  return sense > 0 ? 0 : 1;
}

/* The pose change in `time` after a dwell `before`, null from rest, without the current. */
function motionAfter({ twist, lag, rest }, sense, before, time) {
  const side = sideOf(sense);
  const late = before === null ? restAt(rest[side], time) : lagAt(lag[side], lagPlace(before, time));
  return compose(late, arc(twist[side], time));
}

/* Interpolate lags of a flat table of a first dwell. */
function restAt(table, time) {
  const { i, share } = stepBelow(time);
  return [0, 1, 2].map((k) => (1 - share) * table[3 * i + k] + share * table[3 * i + 3 + k]);
}

/* Where the lag after `time` and a dwell `before` is in a flat table of lags. */
function lagPlace(before, time) {
  const { i, share } = stepBelow(time), last = BEFORE_KNOTS.length - 1;
  const held = clip(before, BEFORE_KNOTS[0], BEFORE_KNOTS[last]), k = Math.min(indexBelow(BEFORE_KNOTS, held), last - 1);
  const part = (held - BEFORE_KNOTS[k]) / (BEFORE_KNOTS[k + 1] - BEFORE_KNOTS[k]);
  return { first: 3 * (k * COUNT + i), share, part };
}

/* Interpolate lags of a flat table at a place. */
function lagAt(table, { first, share, part }) {
  const at = (axis) => {
    const near = first + axis, far = near + 3 * COUNT, shorter = (1 - share) * table[near] + share * table[near + 3];
    return (1 - part) * shorter + part * ((1 - share) * table[far] + share * table[far + 3]);
  };
  return [at(0), at(1), at(2)];
}

/* The step of TIMES below a time, and the share of the way to the next one. */
function stepBelow(time) {
  const place = clip(time / STEP, 0, COUNT - 1), i = Math.min(Math.trunc(place), COUNT - 2);
  return { i, share: place - i };
}

/* The standard deviation of the lag after each of some times, over the disc's phase, by axis. */
function lagNoise({ spread }, sense, times) {
  const table = spread[sideOf(sense)];
  return [0, 1, 2].map((k) => interp(times, TIMES, TIMES.map((_, i) => table[3 * i + k])));
}

/* |Ω|, the mean of the two directions. */
function yawRate({ twist }) {
  return (Math.abs(twist[0][2]) + Math.abs(twist[1][2])) / 2;
}

/* a = R sin θ: distance from the pivot to the head's centre. */
function pivotDistance({ twist }) {
  return (Math.abs(twist[0][1]) + Math.abs(twist[1][1])) / (Math.abs(twist[0][2]) + Math.abs(twist[1][2]));
}

/* R cos θ: turn radius of the pivot, the larger of the two. */
function pivotRadius({ twist }) {
  return Math.max(...twist.map(([forward, , yaw]) => Math.abs(forward / yaw)));
}

/* R_yr/l of the head's centre, the larger of the two. */
function turnRadius({ twist }) {
  return Math.max(...twist.map(([forward, left, yaw]) => Math.hypot(forward, left) / Math.abs(yaw)));
}

/* Largest speed of the head's centre at constant motor. */
function speedOf({ twist }) {
  return Math.max(...twist.map(([forward, left]) => Math.hypot(forward, left)));
}

/* Distance from the pivot to the tracked point; offset: from the head's centre forward to the tracked point. */
function rodOf({ vehicle, offset }) {
  return pivotDistance(vehicle) + offset;
}

/* Add the tracked point to a vehicle: {robot, vehicle, point, offset, model, ownTable, calibrated, unmeasured,
 * warnings}. model: hash of the table. ownTable: whether the table is of this robot alone. unmeasured: modes of a
 * robot whose coefficients are those of another. */
function trackedPoint(robot, { vehicle, unmeasured, calibrated, ownTable }, point, model) {
  if (!POINTS.includes(point)) {
    throw new InputError(`point ${quoted(point)}; allowed are ${POINTS.join(", ")}`, "options");
  }
  const offset = [0, outlineOf(robot)[0], -pivotDistance(vehicle)][POINTS.indexOf(point)];
  const { tailGap, leastGap } = vehicle, warnings = [];
  if (tailGap < leastGap) {
    const without = leastGap === 1 ? "the model has no contact" : "contact does not hold them apart";
    warnings.push(`tails touch (predicted gap ${tailGap.toFixed(2)} diameters): ${without}`);
  }
  return { robot, vehicle, point, offset, model, ownTable, calibrated, unmeasured, warnings };
}

/* The mode of a cause by which a motion {twist, lag} goes from `below` to `above`, times a factor. */
function modeBetween(name, above, below, factor) {
  const slope = (one, other) => Float64Array.from(one, (value, i) => factor * (value - other[i]));
  return {
    name,
    twist: above.twist.map((twist, side) => slope(twist, below.twist[side])),
    lag: above.lag.map((lag, side) => slope(lag, below.lag[side])),
    current: [0, 0],
  };
}

/* Resample a flat curve over DWELLS at TIMES. Below the shortest dwell it is a straight line to zero. */
function resampled(curve) {
  const values = new Float64Array(3 * COUNT);
  for (let at = 0; at < values.length; at++) {
    const row = RESAMPLE[Math.floor(at / 3)];
    for (let k = 0, from = at % 3; k < row.length; k++, from += 3) values[at] += row[k] * curve[from];
  }
  return values;
}

/* Shares of the memories after dwells `before` in those after dwells of BEFORE_KNOTS. */
function sharesAfter(before) {
  return splineMatrix([...before, FORGOTTEN].map(Math.log), BEFORE_KNOTS.map(Math.log), true);
}

/* Lags after dwells of BEFORE_KNOTS, from flat curves of the lag and of the memory after dwells `before`. */
function lagTable(lag, memory, before = BEFORE) {
  const shares = before === BEFORE ? AFTER : sharesAfter(before);
  const after = Array.from(before, (_, j) => resampled(memory.slice(j * CURVE, (j + 1) * CURVE)));
  const long = resampled(lag), size = long.length, table = new Float64Array(shares.length * size);
  for (let k = 0; k < shares.length; k++) {
    table.set(long, k * size);
    for (let j = 0; j < after.length; j++) {
      for (let at = 0; at < size; at++) table[k * size + at] += shares[k][j] * after[j][at];
    }
  }
  return table;
}

/* What a vehicle does on a schedule: changes of the pose in each dwell; poses of the head's centre at the flips and
 * the end; motion, such poses at equal times within each dwell; track [x, y] of the tracked point at these times. */
function rollOut(vehicle, switches, offset, samples = SAMPLES) {
  const { dwells } = switches, [driftX, driftY] = vehicle.current;
  const changes = Array.from({ length: samples }, (_, k) => poseChanges(vehicle, switches, (k + 1) / samples));
  const poses = chain(switches.poses[0], changes[samples - 1], dwells, vehicle.current), motion = [poses[0]];
  dwells.forEach((dwell, i) => {
    for (let k = 0; k < samples; k++) {
      const pose = compose(poses[i], changes[k][i]), time = dwell * ((k + 1) / samples);
      motion.push([pose[0] + driftX * time, pose[1] + driftY * time, pose[2]]);
    }
  });
  const track = motion.map((pose) => compose(pose, [offset, 0, 0]).slice(0, 2));
  return { changes: changes[samples - 1], poses, motion, track };
}

/* The pose change in each dwell up to a share of it, from rest. */
function poseChanges(vehicle, { firstDirection, dwells }, share) {
  return Array.from(dwells, (dwell, i) => {
    return motionAfter(vehicle, i % 2 ? -firstDirection : firstDirection, i ? dwells[i - 1] : null, dwell * share);
  });
}

/* Compose poses from a start, pose changes, and a current during the dwells. */
function chain(start, changes, dwells, current) {
  const poses = [Array.from(start)];
  let turned = 0, x = 0, y = 0;
  changes.forEach((change, i) => {
    const c = Math.cos(start[2] + turned), s = Math.sin(start[2] + turned);
    x += c * change[0] - s * change[1] + current[0] * dwells[i];
    y += s * change[0] + c * change[1] + current[1] * dwells[i];
    turned += change[2];
    poses.push([start[0] + x, start[1] + y, start[2] + turned]);
  });
  return poses;
}

/* The zigzag of a vehicle with shortest dwell `dwell`, without the current: the motor flips so that each pair of
 * dwells turns the robot as far to the left as to the right. {dwells, speed, swing, sway, drift, rms, largest};
 * dwells in the positive and in the negative direction, speeds net. */
function zigzag(vehicle, dwell, offset = 0) {
  const still = { ...vehicle, current: [0, 0] }, rates = vehicle.twist.map((twist) => Math.abs(twist[2]));
  const fast = rates[0] >= rates[1] ? 0 : 1, pair = [0, 0];
  let ratio = rates[fast] / rates[1 - fast], rolled, last;
  for (let count = 0; count < TRIES; count++) {
    pair[fast] = dwell;
    pair[1 - fast] = dwell * ratio;
    const dwells = Array.from({ length: 2 * PAIRS }, (_, i) => pair[i % 2]);
    rolled = rollOut(still, { firstDirection: 1, dwells, poses: [[0, 0, 0]] }, offset);
    last = rolled.poses.slice(-3);
    const turn = last[2][2] - last[0][2];
    if (Math.abs(turn) < 1e-10) break;
    const sign = fast === 1 ? 1 : -1; // the slower direction turns to this side
    ratio = Math.max(ratio - (sign * turn) / (rates[1 - fast] * dwell), 1e-3);
  }
  const middle = (last[2][2] + last[1][2]) / 2, c = Math.cos(middle), s = Math.sin(middle);
  const x = last[2][0] - last[0][0], y = last[2][1] - last[0][1], duration = pair[0] + pair[1];
  const length = Math.max(Math.hypot(x, y), 1e-300), along = [x / length, y / length];
  const track = rolled.track.slice(-2 * SAMPLES - 1, -1), [middleX, middleY] = [0, 1].map((k) => mean(column(track, k)));
  const across = track.map(([atX, atY]) => (atY - middleY) * along[0] - (atX - middleX) * along[1]);
  const average = mean(across);
  return {
    dwells: pair,
    speed: (c * x + s * y) / duration,
    swing: Math.abs(last[2][2] - last[1][2]),
    sway: swayOf(vehicle, last, along),
    drift: (c * y - s * x) / duration,
    rms: Math.sqrt(mean(across.map((value) => (value - average) ** 2))),
    largest: largestSize(across),
  };
}

/* Half of the distance between the pivot at flips to the right and at flips to the left. */
function swayOf(vehicle, poses, [alongX, alongY]) {
  const distance = pivotDistance(vehicle);
  const across = poses.map(([x, y, heading]) => {
    return (x - distance * Math.cos(heading)) * -alongY + (y - distance * Math.sin(heading)) * alongX;
  });
  return (across[1] - (across[0] + across[2]) / 2) / 2;
}

/* 2 h, the swing of the heading past the line of sight, with look-ahead `ahead`. */
function zigzagHysteresis({ swing, sway }, ahead) {
  return Math.max(swing + 2 * Math.atan(sway / ahead), 0.2 * swing);
}

/* Speed of the straight motion, with its drift. */
function zigzagSpeed({ speed, drift }) {
  return Math.hypot(speed, drift);
}

/* Dwells in order of preference: the best one, then shorter ones; `least`: null, or the shortest one allowed. */
function dwellsFor(vehicle, objective, least) {
  if (!OBJECTIVES.includes(objective)) {
    throw new InputError(`objective ${quoted(objective)}; allowed are ${OBJECTIVES.join(", ")}`, "options");
  }
  const shortest = checkLeast(least), most = longestDwell(vehicle, shortest);
  if (most === shortest) return [shortest];
  const grid = geomspace(shortest, most, GRID), speeds = netSpeeds(vehicle, grid);
  const enough = (KEPT[objective] ?? 1) * largest(speeds), good = (speed) => speed >= enough;
  const first = objective === "flips" ? speeds.findLastIndex(good) : speeds.findIndex(good);
  if (first === 0) return [shortest];
  const count = Math.max(2, Math.ceil(8 * Math.log2(grid[first] / shortest)) + 1);
  return Array.from(geomspace(shortest, grid[first], count)).reverse();
}

/* Dwells with which straight motion is nearly as fast as with the fastest, longest first. */
function nearlyFastest(vehicle, least) {
  const shortest = checkLeast(least), grid = geomspace(shortest, longestDwell(vehicle, shortest), GRID);
  const speeds = netSpeeds(vehicle, grid), enough = NEARLY * largest(speeds);
  const good = grid.filter((_, i) => speeds[i] >= enough);
  return Array.from(geomspace(good[good.length - 1], good[0], COMPARED));
}

/* Longer dwells, up to the longest that is considered. */
function longerDwells(vehicle, dwell) {
  const count = Math.floor(Math.log(longestDwell(vehicle, dwell) / dwell) / Math.log(LONGER));
  return Array.from({ length: count }, (_, k) => dwell * LONGER ** (k + 1));
}

/* The longest dwell that is considered; not below `least`. */
function longestDwell(vehicle, least) {
  const quickest = Math.max(...vehicle.twist.map((twist) => Math.abs(twist[2])));
  return Math.max(least, Math.min(LONGEST, (2 * WIDEST) / quickest));
}

/* Net speeds of straight motion with some shortest dwells, as in a zigzag; no current. */
function netSpeeds(vehicle, dwells) {
  const rates = vehicle.twist.map((twist) => Math.abs(twist[2])), quickest = Math.max(...rates);
  return dwells.map((dwell) => {
    const [positive, negative] = rates.map((rate) => (dwell * quickest) / rate);
    const first = motionAfter(vehicle, 1, negative, positive);
    const move = compose(first, motionAfter(vehicle, -1, positive, negative));
    return Math.hypot(move[0], move[1]) / (positive + negative);
  });
}

/* The shortest dwell that is allowed; refuse one that the curves of the response do not cover. */
function checkLeast(least) {
  if (least === null) return QUICK;
  if (Number.isFinite(least) && least >= SHORTEST) return least;
  throw new InputError(
    `minimum dwell ${general(least)} is below ${general(SHORTEST)} time units; for shorter dwells the response of `
    + `the tails is not known: give at least ${general(SHORTEST)}`,
    "options",
  );
}

export { BEFORE, CURVE, BEFORE_KNOTS, COUNT, SAMPLES, SHORTEST, STEP, sideOf, motionAfter, lagPlace, lagAt, lagNoise };
export { yawRate, pivotDistance, pivotRadius, turnRadius, speedOf, rodOf, trackedPoint, modeBetween, resampled, lagTable };
export { rollOut, zigzag, zigzagHysteresis, zigzagSpeed, QUICK, dwellsFor, nearlyFastest, longerDwells, longestDwell, checkLeast };
