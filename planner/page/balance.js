/* The balance of a robot's head, disc and motor with the mean wrench of its tails, which networks give.
 *
 * Heads are {speed |ω|, gain ∂ω_t/∂ω_h, resistance, length L, sense ±1}, tails {perp, parallel, offset, radius,
 * number, spinDrag, head}, a motion is [v_x of J, v_z, ω_yr, ω_h, ω_t] of a positive motor. Without effects a
 * reversed motor makes the mirror image. Units: l, μ0 l⁴/EI, EI/l²; the gap is over 2 r0, the slip angle in
 * degrees. */
import { CONSTANTS } from "./constants.js";
import { dot, inverse, mean, solveDense } from "./math.js";

const { SOFT, SMALL_DEFLECTION, SMALL_SURGE, TINY, THRUST, THRUST_SOFT, THRUST_POWER } = CONSTANTS.tails;
const { TORQUE_SOFT, TORQUE_POWER } = CONSTANTS.tails;
const { STEPS, CORRECTION, ACCEPTED, DIFFERENCE, MIN_SHARE, FIRST_SPIN, MAX_TURN } = CONSTANTS.balance;
const { MIN_SURGE } = CONSTANTS.tails;

/* Prepare a network {shift, scale, middle, spread, members} from the arrays of a model file. */
function networkOf({ shape, state }) {
  const parts = (name, k) => {
    const { values } = state[name], size = values.length / shape.members;
    return values.subarray(k * size, (k + 1) * size);
  };
  const members = Array.from({ length: shape.members }, (_, k) => ({
    weights: Array.from({ length: shape.depth + 1 }, (_, layer) => parts(`weights.${layer}`, k)),
    biases: Array.from({ length: shape.depth + 1 }, (_, layer) => parts(`biases.${layer}`, k)),
    bypass: parts("bypass", k),
  }));
  const [shift, scale, middle, spread] = ["shift", "scale", "mean", "spread"].map((name) => state[name].values);
  return { shift, scale, middle, spread, members };
}

/* The mean of the members, as an array of the outputs. */
function evaluate(network, inputs) {
  const members = membersAt(network, inputs);
  return members[0].map((_, j) => mean(members.map((outputs) => outputs[j])));
}

/* The outputs of every member. */
function membersAt(network, inputs) {
  const { shift, scale, middle, spread, members } = network;
  const first = Float64Array.from(shift, (value, i) => (inputs[i] - value) / scale[i]);
  return members.map((member) => perceptron(member, first).map((value, j) => value * spread[j] + middle[j]));
}

function perceptron({ weights, biases, bypass }, first) {
  let hidden = first;
  weights.forEach((weight, layer) => {
    const next = Float64Array.from(biases[layer]);
    addProduct(next, hidden, weight);
    hidden = layer < weights.length - 1 ? next.map(Math.tanh) : next;
  });
  addProduct(hidden, first, bypass);
  return hidden;
}

/* Add xᵀ W, with the rows of W one after another. */
function addProduct(total, x, weights) {
  const count = total.length;
  for (let i = 0, at = 0; i < x.length; i++, at += count) {
    for (let j = 0; j < count; j++) total[j] += x[i] * weights[at + j];
  }
}

const SINGLE_INPUTS = 13, PAIR_INPUTS = 11; // of the networks of robots with one and with two tails

/* Thrust of a tail in linear theory over (ζ⊥ − ζ∥) ω_t a², roughly, at drag number S. */
function linearThrust(S) {
  return (THRUST * S) / (1 + (S / THRUST_SOFT) ** THRUST_POWER);
}

/* Torque of a tail in linear theory over ζ⊥ ω_t a², roughly, at drag number S. */
function linearTorque(S) {
  return (1 + (S / TORQUE_SOFT) ** 2) ** TORQUE_POWER;
}

/* The inputs of the networks for three tails and more, of the gap and of the response. */
function tailInputs({ perp, offset, radius, number, spinDrag }, [vX, vZ, yaw, , spin]) {
  const dragNumber = perp * spin;
  const deflection = ((Math.sqrt(vX ** 2 + yaw ** 2 + TINY) / spin) * dragNumber) / (dragNumber + SOFT);
  return [
    Math.log(dragNumber), Math.log(offset), -Math.log(radius), Math.asinh(deflection / SMALL_DEFLECTION),
    Math.atan2(vX, yaw), Math.asinh(vZ / (offset * spin) / SMALL_SURGE),
    Math.log(spinDrag / (number * perp * offset ** 2)),
  ];
}

/* What one or two tails feel of their head, from the resistance (4 rows of 5), L, ∂ω_t/∂ω_h, N ζ⊥ and a. */
function headInputs(resistance, length, gain, across, offset) {
  const [sway, surge, turn, spin] = [0, 1, 2, 3].map((i) => resistance[i][i]);
  return [
    Math.log(sway / across), Math.log(surge / across), Math.log(turn / across), Math.log(length),
    resistance[0][2] / Math.sqrt(sway * turn), Math.log(resistance[0][3] / across), resistance[3][4] / spin,
    resistance[2][4] / (across * offset ** 2), Math.log(gain),
  ];
}

/* The inputs of the network of robots with one tail. */
function singleInputs({ perp, offset, radius, spinDrag, head }, [, , , , spin]) {
  const drag = Math.log(spinDrag / (perp * offset ** 2));
  return [Math.log(perp * spin), Math.log(offset), -Math.log(radius), drag, ...head];
}

/* The inputs of the network of robots with two tails. */
function pairInputs(tails, motion) {
  const inputs = tailInputs(tails, motion), [sway, surge, turn, , coupling, , disc, , gain] = tails.head;
  const spin = inputs.pop() + Math.log(Math.exp(-gain) + disc);
  return [...inputs, spin, sway, surge, turn, coupling];
}

/* The inputs of the network of the wrench that has so many. */
function networkInputs(tails, motion, count) {
  if (count === SINGLE_INPUTS) return singleInputs(tails, motion);
  return count === PAIR_INPUTS ? pairInputs(tails, motion) : tailInputs(tails, motion);
}

/* The terms of the wrench: F_x, F_z, M_y of straight tails; then side force, thrust, torque and m². */
function wrenchTerms({ perp, parallel, offset, number }, [vX, vZ, yaw, , spin]) {
  const dragNumber = perp * spin, across = number * perp;
  const sideways = Math.sqrt(vX ** 2 + yaw ** 2 + TINY), couple = number * spin * offset ** 2;
  return [
    across * (yaw / 2 - vX), -number * parallel * vZ, across * (vX / 2 - yaw / 3), across * sideways,
    (perp - parallel) * couple * linearThrust(dragNumber), -perp * couple * linearTorque(dragNumber),
    (sideways / (offset * spin)) ** 2,
  ];
}

/* ∂(wrench)/∂y at a motion, four rows of six. */
function wrenchSlopes(tails, motion) {
  const [, , , force, thrust, torque, squared] = wrenchTerms(tails, motion);
  return [
    [force, 0, 0, 0, 0, 0],
    [0, thrust, 0, 0, thrust * squared, 0],
    [0, 0, force, 0, 0, 0],
    [0, 0, 0, torque, 0, torque * squared],
  ];
}

/* Drag coefficients per length along and across a tail, in units of μ0. */
function tailCoefficients(slenderness) {
  const log = Math.log(slenderness);
  return [(2 * Math.PI) / (log - 0.5), (4 * Math.PI) / (log + 0.5)];
}

/* Resistance of the head about J, four rows of five. */
function headResistance(C_t, C_r, C_yr, radius, length) {
  const lever = length / 2, translation = 6 * Math.PI * C_t * radius;
  const spin = 8 * Math.PI * C_r * radius ** 3, side = C_yr * radius * length;
  return [
    [translation, 0, translation * lever, side, 0],
    [0, translation, 0, 0, 0],
    [translation * lever, 0, translation * lever ** 2, side * lever, 0],
    [0, 0, 0, spin, 0],
  ];
}

/* Heads and tails of a robot {C_t, C_r, C_yr, l_over_R, L_over_R, l_over_r0, omega_bar, a_over_R, N}. The head is
 * {speed |ω|, gain ∂ω_t/∂ω_h, resistance, length L, sense ±1}. */
function headAndTails(robot) {
  const radius = 1 / robot.l_over_R, length = robot.L_over_R * radius, number = robot.N;
  const [parallel, perp] = tailCoefficients(robot.l_over_r0);
  const resistance = headResistance(robot.C_t, robot.C_r, robot.C_yr, radius, length);
  const gain = 1, offset = robot.a_over_R * radius;
  const head = { speed: Math.abs(robot.omega_bar), gain, resistance, length, sense: Math.sign(robot.omega_bar) };
  const tails = {
    perp, parallel, offset, radius: 1 / robot.l_over_r0, number,
    spinDrag: resistance[3][3], head: headInputs(resistance, length, gain, number * perp, offset),
  };
  return { head, tails };
}

/* Resistance of straight tails to (v_x, v_z, ω_yr), three rows of three. */
function straightResistance({ number, perp, parallel }) {
  const across = number * perp, along = number * parallel;
  return [[across, 0, -across / 2], [0, along, 0], [-across / 2, 0, across / 3]];
}

const CLASSES = 3; // networks for N = 1, N = 2, and three or more tails

/* Which of the networks belongs to N tails. */
function networkIndex(number) {
  return Math.min(number, CLASSES) - 1;
}

/* The steady outputs of a motion, of the head's centre. */
function steadyOutputs(table, head, tails, motion) {
  const [vX, surge, turn, headSpin, spin] = motion, { sense } = head;
  const yaw = sense * turn, sway = sense * (vX + (turn * head.length) / 2);
  return {
    omega_t_bar: sense * spin, omega_h_bar: sense * headSpin, omega_yr_bar: yaw, v_x: sway, v_z: surge,
    R_yr_over_l: Math.sqrt(sway ** 2 + surge ** 2) / Math.abs(yaw),
    theta_deg: (180 / Math.PI) * Math.atan2(Math.abs(sway), surge),
    tail_gap: tailGap(table.gap, tails, motion),
  };
}

/* The smallest distance between tails over 2 r0; infinite for one tail. */
function tailGap(network, tails, motion) {
  if (tails.number <= 1) return Infinity;
  const share = evaluate(network, [...tailInputs(tails, motion), Math.log(tails.number)])[0];
  const clamps = 2 * tails.offset * Math.sin(Math.PI / Math.max(tails.number, 2));
  return (share * clamps) / (2 * tails.radius);
}

/* ∂(relative motion)/∂(wrench) with the drag of straight tails, four rows of four. */
function motionSensitivity(head, tails, motion) {
  const [vX, vZ, yaw, headSpin, spin] = motion, { resistance, gain } = head, straight = straightResistance(tails);
  const matrix = resistance.map((row) => [row[0], row[1], row[2], row[3] + gain * row[4]]);
  for (let i = 0; i < 3; i++) for (let j = 0; j < 3; j++) matrix[i][j] += straight[i][j];
  const { number, perp, offset } = tails;
  matrix[3][3] += gain * (number * perp * offset ** 2 * linearTorque(perp * spin));
  const speed = Math.sqrt(vX ** 2 + vZ ** 2);
  const sizes = [
    Math.sqrt(vX ** 2 + (yaw / 2) ** 2), Math.max(Math.abs(vZ), MIN_SURGE * speed), Math.abs(yaw),
    Math.min(Math.abs(headSpin), spin) / 3,
  ];
  return inverse(matrix).map((row, i) => row.map((entry) => entry / sizes[i]));
}

/* The motion with torque and thrust of linear theory and the side forces of straight tails. */
function firstGuess({ speed, gain, resistance }, tails) {
  const { perp, parallel, offset, number } = tails, straight = straightResistance(tails);
  let spin = FIRST_SPIN * speed;
  for (let i = 0; i < 3; i++) {
    const torque = number * perp * offset ** 2 * linearTorque(perp * spin);
    spin = (speed * resistance[3][3]) / (resistance[3][3] + gain * (torque + resistance[3][4]));
  }
  const headSpin = (spin - speed) / gain, matrix = straight.map((row, i) => row.map((entry, j) => entry + resistance[i][j]));
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
  return wrench.map((part, i) => part - dot(resistance[i], motion));
}

/* Solve for the motion; converged: it was found. */
function solveBalance(network, head, tails) {
  const { speed, gain, resistance } = head, motion = firstGuess(head, tails);
  const numbers = (at) => evaluate(network, networkInputs(tails, at, network.shift.length));
  const y = numbers(motion);
  let residual = unbalanced(resistance, tails, motion, y);
  const inverseSlope = inverse(firstSlope(head, tails, motion, residual, y));
  let size = Infinity;
  for (let count = 0; count < STEPS; count++) {
    const step = inverseSlope.map((row) => -dot(row, residual));
    const turned = Math.abs(gain * step[3]) / motion[4], share = turned > MAX_TURN ? MAX_TURN / turned : 1;
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
    const width = DIFFERENCE * (Math.abs(motion[j]) + MIN_SHARE * largest), moved = [...motion];
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

/* Update the inverse of the derivative after a step that changed the balance so (Broyden's good update). */
function update(inverseSlope, step, change) {
  const predicted = inverseSlope.map((row) => dot(row, change)), size = dot(step, predicted);
  const along = step.map((_, j) => dot(step, inverseSlope.map((row) => row[j])));
  if (size === 0) return;
  inverseSlope.forEach((row, i) => along.forEach((part, j) => (row[j] += ((step[i] - predicted[i]) * part) / size)));
}

export { networkOf, evaluate, membersAt, tailInputs, networkInputs, wrenchSlopes, headAndTails, networkIndex };
export { steadyOutputs, motionSensitivity, solveBalance };
