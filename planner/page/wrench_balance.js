/* The motion in which the tails' wrench is in balance with head, disc and motor, by Broyden's method.
 *
 * Mirrors surrogate/wrench/balance.py, step by step. A motion is [v_x of J, v_z, ω_yr, ω_h, ω_t] of a positive
 * motor. Units: l, μ0 l⁴/EI, EI/l². */
import { inverse, solveDense } from "./dense.js";
import { evaluate } from "./ensemble.js";
import { linearThrust, linearTorque, networkInputs, wrenchTerms } from "./tails.js";

const STEPS = 60;
const CORRECTION = 2e-12; // relative
const ACCEPTED = 1e-9; // the last of all corrections, where rounding keeps them above CORRECTION
const DIFFERENCE = 1e-6; // steps of finite differences, relative
const LEAST_SHARE = 1e-3;
const FIRST_SPIN = 0.6; // ω_t/ω in the first guess
const LONGEST = 0.5; // largest relative change of ω_t in one step

/* The motion with torque and thrust of linear theory and the side forces of straight tails. first_guess */
function firstGuess({ speed, gain, resistance }, { perp, parallel, offset, number }) {
  let spin = FIRST_SPIN * speed;
  for (let i = 0; i < 3; i++) {
    const torque = number * perp * offset ** 2 * linearTorque(perp * spin);
    spin = (speed * resistance[3][3]) / (resistance[3][3] + gain * (torque + resistance[3][4]));
  }
  const headSpin = (spin - speed) / gain, matrix = [0, 1, 2].map((i) => resistance[i].slice(0, 3));
  matrix[0][0] += number * perp;
  matrix[1][1] += number * parallel;
  matrix[2][2] += (number * perp) / 3;
  matrix[0][2] -= (number * perp) / 2;
  matrix[2][0] -= (number * perp) / 2;
  const push = [0, 1, 2].map((i) => [-resistance[i][3] * headSpin - resistance[i][4] * spin]);
  push[1][0] += number * (perp - parallel) * spin * offset ** 2 * linearThrust(perp * spin);
  solveDense(matrix, push);
  return [push[0][0], push[1][0], push[2][0], headSpin, spin];
}

function unbalanced(resistance, tails, motion, y) {
  const [side, along, turn, force, thrust, torque, squared] = wrenchTerms(tails, motion);
  const wrench = [
    side + force * y[0], along + thrust * (y[1] + squared * y[4]), turn + force * y[2],
    torque * (y[3] + squared * y[5]),
  ];
  return wrench.map((part, i) => resistance[i].reduce((left, entry, j) => left - entry * motion[j], part));
}

/* Solve for the motion; converged: it was found. solve */
function solveBalance(network, head, tails) {
  const { speed, gain, resistance } = head, motion = firstGuess(head, tails);
  const numbers = (at) => evaluate(network, networkInputs(tails, at, network.shift.length));
  const y = numbers(motion);
  let residual = unbalanced(resistance, tails, motion, y);
  const inverseSlope = inverse(firstSlope(head, tails, motion, residual, y));
  let size = Infinity;
  for (let count = 0; count < STEPS; count++) {
    const step = inverseSlope.map((row) => row.reduce((sum, entry, j) => sum - entry * residual[j], 0));
    const turned = Math.abs(gain * step[3]) / motion[4], share = turned > LONGEST ? LONGEST / turned : 1;
    for (let i = 0; i < 4; i++) {
      step[i] *= share;
      motion[i] += step[i];
    }
    motion[4] = speed + gain * motion[3];
    if (!(motion[4] > 0)) return { motion, converged: false };
    size = correction(step, motion);
    if (size < CORRECTION) return { motion, converged: true };
    if (!Number.isFinite(size)) return { motion, converged: false };
    const before = residual;
    residual = unbalanced(resistance, tails, motion, numbers(motion));
    update(inverseSlope, step, residual.map((left, i) => left - before[i]));
  }
  return { motion, converged: size < ACCEPTED };
}

/* The derivative of what is unbalanced for numbers y of the tails, by differences: four rows of four. */
function firstSlope({ speed, gain, resistance }, tails, motion, residual, y) {
  const largest = Math.max(...motion.slice(0, 4).map(Math.abs)), slope = [[], [], [], []];
  for (let j = 0; j < 4; j++) {
    const width = DIFFERENCE * (Math.abs(motion[j]) + LEAST_SHARE * largest), moved = [...motion];
    moved[j] += width;
    moved[4] = speed + gain * moved[3];
    const left = unbalanced(resistance, tails, moved, y);
    for (let i = 0; i < 4; i++) slope[i][j] = (left[i] - residual[i]) / width;
  }
  return slope;
}

/* The relative size of a step. */
function correction(step, motion) {
  const speed = Math.sqrt(motion[0] ** 2 + motion[1] ** 2) + Math.abs(motion[2]);
  const moved = Math.max(Math.abs(step[0]), Math.abs(step[1])) / speed;
  return Math.max(moved, Math.abs(step[2] / motion[2]), Math.abs(step[3] / motion[3]));
}

/* Update the inverse of the derivative after a step that changed the balance so (Broyden's good update).
 * _update */
function update(inverseSlope, step, change) {
  const predicted = [0, 0, 0, 0], along = [0, 0, 0, 0];
  for (let i = 0; i < 4; i++) {
    for (let j = 0; j < 4; j++) {
      predicted[i] += inverseSlope[i][j] * change[j];
      along[j] += step[i] * inverseSlope[i][j];
    }
  }
  const size = along.reduce((sum, part, i) => sum + part * change[i], 0);
  if (size === 0) return;
  for (let i = 0; i < 4; i++) {
    for (let j = 0; j < 4; j++) inverseSlope[i][j] += ((step[i] - predicted[i]) * along[j]) / size;
  }
}

export { solveBalance, firstGuess };
