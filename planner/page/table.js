/* The look-up table: the tails' wrench and the response to a flip are learned, the head's balance is solved at each
 * query.
 *
 * A robot is {C_t, C_r, C_yr, l_over_R, L_over_R, l_over_r0, omega_bar, N, a_over_R}. Curves of a response are flat,
 * in l, l, rad, of a positive motor. Units: l, μ0 l⁴/EI, rad; theta_deg in degrees, gaps over 2 r0. */
import { evaluate, headAndTails, membersAt, motionSensitivity, networkIndex, networkInputs } from "./balance.js";
import { networkOf, solveBalance, steadyOutputs, tailInputs, wrenchSlopes } from "./balance.js";
import { CONSTANTS } from "./constants.js";
import { readData } from "./data.js";
import { clip, dot, mean } from "./math.js";
import { BEFORE, CURVE } from "./vehicle.js";
import { InputError } from "./words.js";

const { OF_TAILS } = CONSTANTS.table, { PARTS, SMALL_SURGE, OF_HEAD, LEAST_FORM } = CONSTANTS.response;
const { NORMAL_90, LAGS } = CONSTANTS.error_modes, { NOVELTY } = CONSTANTS.intervals, { RELATIVE } = CONSTANTS.held_out;
const { DEGREE, DEGREE_OF_MANY, MANY, MOST_TAILS } = CONSTANTS.domain; // of monomials; of so many inputs and more
const STEADY = ["v_z", "v_x", "omega_yr_bar"];
const END = 1.02; // of half an input's range
const BRANCHES = 0.6; // |ω_yr/ω_t| from which a robot may have several motions
const REASONS = { // why a robot is outside
  none: "none with as many tails were learned",
  unknown: "its tails or its motor were not learned, or no motion was found",
  novel: "its tails, or with one or two of them its head, are unlike all learned ones",
  branches: "it yaws nearly as fast as its tails turn, and may have several motions",
};

/* A robot is outside the domain of a look-up table; the message is why. */
class OutsideError extends InputError {}

/* Read the table that Python has written into the page. */
async function readTable(data) {
  const { identity, content } = await readData(data), { intervals, ranges, bases, support } = content;
  const networks = (parts) => parts.map((part) => (part ? networkOf(part) : null));
  return {
    identity, intervals, ranges, bases, support, curveErrors: content.curve_errors,
    wrench: networks(content.wrench), gap: networkOf(content.gap), curves: networks(content.curves),
  };
}

/* The steady motion of a robot. */
function query(table, robot) {
  const { head, tails, motion } = motionOf(table, robot);
  return steadyOutputs(table, head, tails, motion);
}

/* Lag, memory, rest and spread after a flip, of a positive motor. */
function response(table, robot) {
  if (robot.N < 2) {
    throw new InputError(
      "N = 1: the response of one tail depends too much on the phase of the disc, so the look-up table has not "
      + "learned it; simulate it (softflagella replay)",
    );
  }
  const { head, tails, motion } = motionOf(table, robot), speeds = curveSpeeds(head, motion), curves = {};
  const two = tails.number === 2 ? 1 : 0, ofHead = OF_HEAD.map((i) => tails.head[i]);
  const inputs = [...tailInputs(tails, motion), ...ofHead, Math.log(tails.number), two];
  PARTS.forEach((names, part) => {
    const components = evaluate(table.curves[part], inputs);
    let first = 0;
    for (const name of names) {
      const { mean, vectors } = table.bases[name], count = mean.values.length, curve = Float64Array.from(mean.values);
      for (let c = 0; c < vectors.shape[0]; c++, first++) {
        for (let at = 0; at < count; at++) curve[at] += components[first] * vectors.values[c * count + at];
      }
      curves[name] = (name === "spread" ? decodedSpread(curve) : curve).map((value, at) => value * speeds[at % 3]);
    }
  });
  curves.spread = curves.spread.map((value) => two * Math.abs(value)); // of robots with two tails
  return curves;
}

/* A spread from what is learned of it: of each axis the logarithm of its mean square, and its square over that. */
function decodedSpread(learned) {
  const scale = 2 / Math.sqrt(learned.length / 3 - 1);
  const size = Array.from(learned.subarray(0, 3), (value) => Math.exp(Math.min(scale * value, 0)));
  const form = Array.from(learned.subarray(3), (value) => Math.max(2 * value, LEAST_FORM));
  return Float64Array.from(form, (value, at) => Math.sqrt(value * size[at % 3]));
}

/* (w, v_x, ω_yr) of the head's centre, by which the curves are divided. */
function curveSpeeds(head, [vX, vZ, yaw]) {
  const sway = vX + (yaw * head.length) / 2;
  return [Math.hypot(vZ, SMALL_SURGE * sway), sway, yaw];
}

/* Solve for the motion of a robot: {head, tails, motion, inputs, own}; own: inputs of its network of the wrench. */
function motionOf(table, robot) {
  const { head, tails } = headAndTails(robot), kind = networkIndex(robot.N), network = table.wrench[kind];
  if (!table.support[kind] || !network) throw new OutsideError(REASONS.none);
  const { motion, converged } = solveBalance(network, head, tails);
  const learned = OF_TAILS.every((name) => within(table.ranges[name], Math.abs(robot[name])));
  if (!converged || !learned) throw new OutsideError(REASONS.unknown);
  const inputs = tailInputs(tails, motion), own = networkInputs(tails, motion, network.shift.length);
  if (!(novelty(table.support[kind], own) <= 1)) throw new OutsideError(REASONS.novel);
  if (Math.abs(motion[2]) > BRANCHES * Math.abs(motion[4])) throw new OutsideError(REASONS.branches);
  return { head, tails, motion, inputs, own };
}

/* Whether a size is within a range that was learned. */
function within([low, high], size) {
  return low * (1 - 1e-9) <= size && size <= high * (1 + 1e-9);
}

/* Independent errors of a robot, each of one of v_z, v_x and ω_yr, and then those of the lag: modes of one standard
 * deviation {twist, lag, memory}; lag and memory are null where a mode changes nothing of them. */
function tableErrorModes({ curveErrors, intervals, ...table }, robot) {
  const found = motionOf(table, robot), { head, tails, motion } = found, speeds = curveSpeeds(head, motion);
  const answer = steadyOutputs(table, head, tails, motion), features = widthFeatures(table, found);
  const group = groupOf(intervals, robot, features);
  const steady = STEADY.map((name, i) => {
    const size = RELATIVE.includes(name) ? Math.abs(answer[name]) : Math.hypot(answer.v_x, answer.v_z);
    const half = halfWidth(intervals, name, features, group, size) / NORMAL_90;
    const sigma = Math.hypot(half, curveErrors.simulator * size);
    return { twist: STEADY.map((_, k) => (k === i ? sigma : 0)), lag: null, memory: null };
  });
  const local = LAGS.map((name, axis) => (halfWidth(curveErrors.widths, name, features, 0, 1) / NORMAL_90) * speeds[axis]);
  const { shape, values } = curveErrors.curves, whole = (BEFORE.length + 1) * CURVE, first = BEFORE.length * CURVE;
  const curves = Array.from({ length: shape[0] }, (_, k) => {
    const curve = values.slice(k * whole, (k + 1) * whole).map((value, at) => value * local[at % 3]);
    const lag = curve.slice(first), memory = curve.slice(0, first).map((value, at) => value - lag[at % CURVE]);
    return { twist: [0, 0, 0], lag, memory };
  });
  return [...steady, ...curves];
}

/* What the width of an interval may depend on, 11 numbers. */
function widthFeatures(table, { head, tails, motion, inputs, own }) {
  const kind = networkIndex(tails.number), members = membersAt(table.wrench[kind], own);
  const sensitivity = motionSensitivity(head, tails, motion), slopes = wrenchSlopes(tails, motion);
  const middle = slopes[0].map((_, i) => mean(members.map((y) => y[i])));
  const spread = mean(members.map((y) => {
    const wrench = slopes.map((row) => dot(row, y.map((value, i) => value - middle[i])));
    return Math.hypot(...sensitivity.map((row) => dot(row, wrench)));
  }));
  const away = novelty(table.support[kind], own);
  const more = [Math.log(away + 1e-12), Math.log(spread + 1e-9), Math.log(tails.number), kind === 0 ? 1 : 0];
  return [...inputs, ...more].map((value) => (Number.isNaN(value) ? 0 : value));
}

/* The group whose intervals a robot has; the page's robots have no couple in yaw. */
function groupOf({ speeds, middle }, { N, omega_bar }, features) {
  const faster = speeds.values.filter((speed) => Math.abs(omega_bar) > speed).length;
  const third = 3 * (Math.min(N, MOST_TAILS) - 1) + faster;
  return 2 * third + Number(features[NOVELTY] > middle.values[third]);
}

/* Half of the width of the interval of an output; size: what errors are relative to. */
function halfWidth({ shift, scale, weights, bounds, factor }, name, features, group, size) {
  const x = features.map((value, i) => clip((value - shift.values[i]) / scale.values[i], -5, 5)), terms = [1, ...x];
  x.forEach((value, i) => terms.push(...x.slice(i).map((other) => value * other)));
  const local = Math.exp(clip(dot(terms, weights[name].values), bounds[name][0], bounds[name][1]));
  return factor[name].values[group] * local * size;
}

/* How far some inputs are from the joint support of the training data, a smooth measure: q over its limit, or how far
 * they are outside their ranges; at most 1 inside. Monomial p is monomial parents[p] times input last[p]. */
function novelty({ shift, scale, factor, limit }, inputs) {
  const x = Float64Array.from(shift.values, (middle, i) => (inputs[i] - middle) / scale.values[i]);
  const features = [1], last = [0], solved = [];
  for (let degree = x.length >= MANY ? DEGREE_OF_MANY : DEGREE, from = 0; degree > 0; degree--) {
    const end = features.length;
    for (let p = from; p < end; p++) {
      for (let input = p ? last[p] : 0; input < x.length; input++) {
        features.push(features[p] * x[input]);
        last.push(input);
      }
    }
    from = end;
  }
  const count = features.length, rows = factor.values;
  let total = 0;
  for (let i = 0; i < count; i++) {
    let remainder = features[i];
    for (let j = 0; j < i; j++) remainder -= rows[i * count + j] * solved[j];
    solved[i] = remainder / rows[i * count + i];
    total += solved[i] ** 2;
  }
  return Math.max(total / count / limit, ...x.map(Math.abs).filter((size) => size > END));
}

export { OutsideError, readTable, query, response, within, tableErrorModes };
