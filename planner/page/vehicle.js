/* The robot as a vehicle: an arc in each direction of the motor, and a memory of the last dwell.
 *
 * Mirrors planner/vehicle/vehicle.py, which explains the model. For the motor's directions +1 and −1 a vehicle has
 *
 *   twist    [[forward, left, yaw rate], …]
 *   lag      flat tables after dwells BEFORE_KNOTS, at TIMES: forward, left, heading
 *   rest     flat tables of a first dwell, at TIMES
 *   spread   flat tables, one sigma of the lag over the unknown phase of the disc at the flip, at TIMES
 *   phaseRate   N times the disc's mean spin
 *
 * and modes [{name, twist, lag or null, current}], each one standard deviation; current [x, y] in the lab; tailGap
 * in diameters, and leastGap. Lengths in l, times in μ0 l⁴/EI, angles in rad. */
import { geomspace, interp, placeBelow } from "./arrays.js";
import { splineAt } from "./cubic_spline.js";
import { arc, compose } from "./planar.js";
import { BEFORE, CURVE, DWELLS, FORGOTTEN, SETTLED } from "./response.js";

const SHORTEST = DWELLS[0]; // shortest dwell whose response is known
const STEP = 0.02; // between the dwells at which lags are kept
const COUNT = Math.round(SETTLED / STEP) + 1;
const TIMES = Float64Array.from({ length: COUNT }, (_, i) => i * STEP);
const BEFORE_KNOTS = geomspace(BEFORE[0], FORGOTTEN, 33); // dwells before at which lags are kept

/* Which of the tables belongs to a direction of the motor. */
function sideOf(sense) {
  return sense > 0 ? 0 : 1;
}

/* The lag after `time` and a dwell `before`; null: from rest. Vehicle.lag_after */
function lagAfter(vehicle, sense, before, time) {
  if (before !== null) return interpolated(vehicle.lag[sideOf(sense)], before, time);
  const table = vehicle.rest[sideOf(sense)], { i, share } = stepBelow(time);
  return [0, 1, 2].map((k) => (1 - share) * table[3 * i + k] + share * table[3 * i + 3 + k]);
}

/* The pose change in `time` after a dwell `before`, without the current. Vehicle.motion */
function motionAfter(vehicle, sense, before, time) {
  return compose(lagAfter(vehicle, sense, before, time), arc(vehicle.twist[sideOf(sense)], time));
}

/* The standard deviation of the lag after each of some times, over the disc's phase, by axis. Vehicle.lag_noise */
function lagNoise(vehicle, sense, times) {
  const table = vehicle.spread[sideOf(sense)];
  return [0, 1, 2].map((k) => interp(times, TIMES, TIMES.map((_, i) => table[3 * i + k])));
}

/* Interpolate lags of a flat table after `time` and a dwell `before`. */
function interpolated(table, before, time) {
  return lagAt(table, lagPlace(before, time));
}

/* Where the lag after `time` and a dwell `before` is in a flat table of lags. */
function lagPlace(before, time) {
  const { i, share } = stepBelow(time), last = BEFORE_KNOTS.length - 1;
  const held = Math.min(Math.max(before, BEFORE_KNOTS[0]), BEFORE_KNOTS[last]);
  const k = Math.min(Math.max(placeBelow(BEFORE_KNOTS, held), 0), last - 1);
  const part = (held - BEFORE_KNOTS[k]) / (BEFORE_KNOTS[k + 1] - BEFORE_KNOTS[k]);
  return { first: 3 * (k * COUNT + i), share, part };
}

/* Interpolate lags of a flat table at a place. */
function lagAt(table, { first, share, part }) {
  const lag = [0, 0, 0];
  for (let axis = 0; axis < 3; axis++) {
    const near = first + axis, far = near + 3 * COUNT;
    const shorter = (1 - share) * table[near] + share * table[near + 3];
    lag[axis] = (1 - part) * shorter + part * ((1 - share) * table[far] + share * table[far + 3]);
  }
  return lag;
}

/* The step of TIMES below a time, and the share of the way to the next one. */
function stepBelow(time) {
  const place = Math.min(Math.max(time, 0) / STEP, COUNT - 1), i = Math.min(Math.trunc(place), COUNT - 2);
  return { i, share: place - i };
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
  return Math.max(...twist.map(([forward, left, yaw]) => Math.sqrt(forward ** 2 + left ** 2) / Math.abs(yaw)));
}

/* Largest speed of the head's centre at constant motor. */
function speedOf({ twist }) {
  return Math.max(...twist.map(([forward, left]) => Math.sqrt(forward ** 2 + left ** 2)));
}

/* Resample a flat curve over DWELLS at TIMES. Below the shortest dwell it is a straight line to zero. */
function resampled(curve) {
  const places = TIMES.map((time) => Math.log(Math.max(time, DWELLS[0])));
  const spline = splineAt(DWELLS.map(Math.log), curve, 3, places);
  return spline.map((value, at) => value * Math.min(TIMES[Math.floor(at / 3)] / DWELLS[0], 1));
}

/* Lags after dwells of BEFORE_KNOTS, from flat curves of the lag and of the memory after dwells `before`.
 * lag_table */
function lagTable(lag, memory, before = BEFORE) {
  const knots = [...before, FORGOTTEN].map(Math.log), known = new Float64Array((before.length + 1) * CURVE);
  known.set(memory);
  const fine = splineAt(knots, known, CURVE, BEFORE_KNOTS.map(Math.log), true);
  const table = new Float64Array(BEFORE_KNOTS.length * COUNT * 3);
  for (let k = 0; k < BEFORE_KNOTS.length; k++) {
    table.set(resampled(lag.map((value, at) => value + fine[k * CURVE + at])), k * COUNT * 3);
  }
  return table;
}

export { SHORTEST, STEP, COUNT, BEFORE_KNOTS, sideOf, lagAfter, motionAfter, lagNoise, lagPlace, lagAt };
export { yawRate, pivotDistance, pivotRadius, turnRadius, speedOf, resampled, lagTable };
