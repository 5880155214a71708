/* The look-up table: the tails' wrench is learned, and the head's balance is solved at each query.
 *
 * Mirrors surrogate/table/lookup.py, one robot at a time, without effects. A robot is {C_t, C_r, C_yr, l_over_R,
 * L_over_R, l_over_r0, omega_bar, N, a_over_R}. Units: l, μ0 l⁴/EI, rad; theta_deg in degrees, gaps over 2 r0. */
import { NORMAL_90, errorModes } from "./curve_errors.js";
import { membersAt, networkOf } from "./ensemble.js";
import { general } from "./format.js";
import { checkedGroups } from "./groups.js";
import { headAndTails } from "./heads.js";
import { InputError } from "./input_error.js";
import { errorScale, halfWidth } from "./intervals.js";
import { netSpeed } from "./planar.js";
import { DWELLS } from "./response.js";
import { betweenDwells, curveSpeeds, lagAtEqualDwells, responseCurves } from "./response_table.js";
import { novelty } from "./support.js";
import { readData } from "./table_data.js";
import { networkInputs, tailInputs, wrenchSlopes } from "./tails.js";
import { solveBalance } from "./wrench_balance.js";
import { motionSensitivity, networkIndex, steadyOutputs } from "./wrench_table.js";

const BRANCHES = 0.6; // |ω_yr/ω_t| from which a robot may have several motions
const REASONS = [ // why a robot is outside
  "",
  "none with as many tails were learned",
  "its tails or its motor were not learned, or no motion was found",
  "its tails move as none of the learned ones do",
  "it yaws nearly as fast as its tails turn, and may have several motions",
];
const NOT_OF_HEAD = ["omega_bar", "l_over_R", "l_over_r0", "a_over_R"];
const STEADY = ["v_z", "v_x", "omega_yr_bar"];

/* A robot is outside the domain of a look-up table; reason: in words. */
class OutsideError extends InputError {
  constructor(message, reason) {
    super(message);
    this.reason = reason;
  }
}

/* Read the table that `table_data` of planner/page/table_data.py has written. */
async function readTable(data) {
  const { identity, content } = await readData(data), { intervals, ranges, errors, bases } = content;
  const networks = (parts) => parts.map((part) => (part ? networkOf(part) : null));
  const support = content.support.map((part) => part && { ...part });
  return {
    identity, intervals, ranges, errors, bases, support, curveErrors: content.curve_errors,
    wrench: networks(content.wrench), gap: networkOf(content.gap), curves: networks(content.curves),
  };
}

/* The steady motion of a robot; with dwell_bar among its numbers also the response to equal dwells, and with
 * intervals `<name>_low` and `<name>_high` of each output. With `flag` a robot outside the domain is answered,
 * too, and `outside` tells. NeuralTable.query */
function query(table, robot, options = {}) {
  const { dwell_bar: dwell, ...groups } = robot, values = checkedGroups(groups);
  if (dwell !== undefined) checkFlips(values);
  const found = motionOf(table, values, options.flag), { head, tails, motion } = found;
  const answer = steadyOutputs(table, head, tails, motion);
  if (dwell !== undefined) Object.assign(answer, atDwell(table, found, answer, checkedDwell(dwell)));
  if (options.intervals) Object.assign(answer, intervalsOf(table, found, answer));
  if (options.flag) answer.outside = found.reason !== "";
  return answer;
}

/* Lag, memory, rest and spread after a flip, of a positive motor; see response.js. NeuralTable.response */
function response(table, robot) {
  const values = checkedGroups(robot);
  checkFlips(values);
  const { head, tails, motion } = motionOf(table, values);
  return responseCurves(table, head, tails, motion);
}

/* Independent errors of motion and response of a robot; see curve_errors.js. NeuralTable.error_modes */
function tableErrorModes(table, robot) {
  const found = motionOf(table, checkedGroups(robot)), { head, tails, motion } = found;
  const steady = steadyOutputs(table, head, tails, motion), ends = intervalsOf(table, found, steady);
  const sizes = STEADY.map((name) => {
    const size = (ends[`${name}_high`] - ends[`${name}_low`]) / (2 * NORMAL_90);
    return Math.hypot(size, table.curveErrors.simulator * errorScale(name, steady));
  });
  return errorModes(table.curveErrors, sizes, widthFeatures(table, found), curveSpeeds(head, motion));
}

/* Solve for the motion of checked groups: {head, tails, motion, inputs, reason}. NeuralTable.motions */
function motionOf(table, values, flag = false) {
  const { head, tails } = headAndTails(values), kind = networkIndex(values.N), network = table.wrench[kind];
  const nothing = { motion: [NaN, NaN, NaN, NaN, NaN], converged: false };
  const { motion, converged } = network ? solveBalance(network, head, tails) : nothing;
  const inputs = tailInputs(tails, motion), known = converged && withinRanges(table, values);
  const own = network ? networkInputs(tails, motion, network.shift.length) : inputs;
  const reason = REASONS[reasonOf(table.support[kind], motion, own, known)];
  if (reason && !flag) throw new OutsideError(refusal(table, values, reason), reason);
  return { head, tails, motion, inputs, reason };
}

function withinRanges(table, values) {
  return NOT_OF_HEAD.every((name) => within(table.ranges[name], Math.abs(values[name])));
}

function within([low, high], size) {
  return low * (1 - 1e-9) <= size && size <= high * (1 + 1e-9);
}

function reasonOf(support, motion, inputs, known) {
  if (!support) return 1;
  if (!known) return 2;
  if (!(novelty(support, inputs) <= 1)) return 3;
  return Math.abs(motion[2]) > BRANCHES * Math.abs(motion[4]) ? 4 : 0;
}

function refusal(table, values, reason) {
  const outside = Object.entries(table.ranges).find(([name, ends]) => !within(ends, Math.abs(values[name])));
  const more = outside && `; ${outside[0]} = ${general(Math.abs(values[outside[0]]))}, learned were `
    + `${general(outside[1][0])} to ${general(outside[1][1])}`;
  return `the robot in row 1 is outside the look-up table: ${reason}${more ?? ""}; change the robot, or simulate `
    + "it (softflagella steady, softflagella surrogate robot)";
}

function checkFlips(values) {
  if (values.N >= 2) return;
  throw new InputError(
    "N = 1: the response of one tail depends too much on the phase of the disc, so the look-up table "
    + "has not learned it; simulate it (softflagella replay)",
  );
}

function checkedDwell(dwell) {
  if (typeof dwell !== "number") throw new InputError("dwell_bar has a value that is no number; give numbers");
  if (Number.isFinite(dwell) && dwell >= DWELLS[0] * (1 - 1e-9)) return dwell;
  throw new InputError(`dwell_bar = ${general(dwell)}; give a dwell from ${general(DWELLS[0])} on`);
}

/* Net speed and lags at one dwell, when all dwells are equal. */
function atDwell(table, { head, tails, motion }, steady, dwell) {
  const curves = responseCurves(table, head, tails, motion), lag = betweenDwells(lagAtEqualDwells(curves), dwell);
  const twist = [steady.v_z, head.sense * steady.v_x, head.sense * steady.omega_yr_bar];
  return { net_speed_bar: netSpeed(twist, lag, dwell), lag_psi_rad: lag[2], lag_x: lag[1], lag_z: lag[0] };
}

/* What the width of an interval may depend on, 11 numbers. NeuralTable.width_features */
function widthFeatures(table, { head, tails, motion, inputs }) {
  const kind = networkIndex(tails.number), network = table.wrench[kind], support = table.support[kind];
  let away = 0, spread = 0;
  if (network && support) {
    const own = networkInputs(tails, motion, network.shift.length), members = membersAt(network, own);
    const sensitivity = motionSensitivity(head, tails, motion), slopes = wrenchSlopes(tails, motion);
    const middle = slopes[0].map((_, i) => members.reduce((total, y) => total + y[i], 0) / members.length);
    away = novelty(support, own);
    for (const y of members) {
      const wrench = slopes.map((row) => row.reduce((total, slope, i) => total + slope * (y[i] - middle[i]), 0));
      const moved = sensitivity.map((row) => row.reduce((total, entry, i) => total + entry * wrench[i], 0));
      spread += Math.hypot(...moved) / members.length;
    }
  }
  const more = [Math.log(away + 1e-12), Math.log(spread + 1e-9), Math.log(tails.number), kind === 0 ? 1 : 0];
  return [...inputs, ...more].map((value) => (Number.isNaN(value) ? 0 : value));
}

function intervalsOf(table, found, answer) {
  if (!table.intervals) throw new InputError("this look-up table has no intervals; train it again");
  const features = widthFeatures(table, found), ends = {};
  for (const [name, value] of Object.entries(answer)) {
    if (!(name in table.intervals.factor)) continue;
    const half = Number.isFinite(value) ? halfWidth(table.intervals, name, features, errorScale(name, answer)) : 0;
    ends[`${name}_low`] = value - half;
    ends[`${name}_high`] = value + half;
  }
  return ends;
}

export { OutsideError, readTable, query, response, tableErrorModes };
