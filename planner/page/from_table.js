/* The vehicle that a look-up table gives for a robot: both directions, what is uncertain, and the current.
 *
 * Mirrors planner/vehicle/from_table.py. Robots with effects, a correction or a calibration, and tables of one
 * robot, are asked by Python, which writes the parts of their vehicle. Lengths in l, times in μ0 l⁴/EI. */
import { general, pythonText } from "./format.js";
import { InputError } from "./input_error.js";
import { query, response, tableErrorModes } from "./lookup.js";
import { MIRROR } from "./planar.js";
import { refusingRobot } from "./refusals.js";
import { BEFORE } from "./response.js";
import { groupValues } from "./robot.js";
import { lagTable, resampled } from "./vehicle.js";

const ODD = 0.2; // share of a table's error that has opposite signs in the two directions
const TIME_STEPS = 2.5e-4; // of the yaw rate, one standard deviation: error of time steps
const STEP = 0.02; // of a coefficient, for derivatives
const UNMEASURED = { C_t: 0.35, C_r: 0.22, C_yr: 0.48 }; // standard deviations of ln C, of another robot's
const SIDES = [[1, 1, 1], MIRROR];

/* Ask a table for the vehicle of a robot. table_vehicle */
function tableVehicle(robot, table) {
  const groups = groupValues(robot);
  const senses = bothDirections(groups);
  const motions = refusingRobot(robot, table, () => senses.map((values) => query(table, values)));
  return vehicleOfParts({
    twist: motions.map(twistOf),
    curves: senses.map((values) => response(table, values)),
    before: BEFORE,
    phaseRate: motions.map((motion) => groups.N * motion.omega_t_bar),
    errors: () => tableErrorModes(table, senses[0]),
    modes: [],
    current: [0, 0],
    tailGap: Math.min(...motions.map((motion) => motion.tail_gap)),
    leastGap: 1,
  }, robot.name);
}

function bothDirections(groups) {
  return [1, -1].map((sense) => ({ ...groups, omega_bar: groups.omega_bar * sense }));
}

function twistOf({ v_z, v_x, omega_yr_bar }) {
  return [v_z, v_x, omega_yr_bar];
}

/* Modes of a robot whose coefficients are those of another. coefficient_modes of UNMEASURED */
function unmeasuredModes(robot, table, vehicle) {
  const groups = groupValues(robot);
  return Object.entries(UNMEASURED).map(([name, sigma], k) => {
    const ends = [1, -1].map((sign) => {
      try {
        const values = { ...groups, [name]: groups[name] * Math.exp(sign * STEP) };
        return { ...motionOfOther(table, values), step: sign * STEP };
      } catch (refusal) {
        if (!(refusal instanceof InputError)) throw refusal;
        return { twist: vehicle.twist, lag: vehicle.lag, step: 0 }; // at the edge of the table
      }
    });
    const [above, below] = ends, scale = sigma / (above.step - below.step || Infinity);
    const slope = (one, other) => Array.from(one, (value, i) => scale * (value - other[i]));
    return {
      name: `coefficients: ${k + 1}`,
      twist: above.twist.map((twist, side) => slope(twist, below.twist[side])),
      lag: above.lag.map((lag, side) => slope(lag, below.lag[side])),
      current: [0, 0],
    };
  });
}

/* Ask a table for twists and lags of another robot. _other */
function motionOfOther(table, values) {
  const senses = bothDirections(values);
  return {
    twist: senses.map((sense) => twistOf(query(table, sense))),
    lag: senses.map((sense, side) => {
      const { lag, memory } = response(table, sense);
      return mirrored(lagTable(lag, memory, BEFORE), SIDES[side]);
    }),
  };
}

/* Make a vehicle of a table's answers in both directions.
 *
 * twist: [forward, left, yaw rate] of each direction. curves: flat lag, memory, rest and spread of each, as for a
 * positive motor. before: dwells of the memory. phaseRate: N times the disc's spin of each. errors: gives the
 * table's errors, see curve_errors.js. modes: further ones. The rest is as in vehicle.js. */
function vehicleOfParts({ twist, curves, before, phaseRate, errors, modes, current, tailGap, leastGap }, name) {
  const speed = (twist[0][0] + twist[1][0]) / 2, robot = `robot ${pythonText(name)}`;
  if (speed <= 0) {
    throw new InputError(`${robot} does not move forward (v_z = ${general(speed, 3)}); turn its motor slower`);
  }
  if (twist[0][2] <= 0 || -twist[1][2] <= 0) {
    throw new InputError(
      `${robot} turns to the same side in both directions of its motor; it cannot follow a path`,
    );
  }
  return {
    twist,
    lag: curves.map(({ lag, memory }, side) => mirrored(lagTable(lag, memory, before), SIDES[side])),
    rest: curves.map(({ rest }, side) => mirrored(resampled(rest), SIDES[side])),
    spread: curves.map(({ spread }) => resampled(spread)),
    phaseRate,
    modes: [...tableModes(twist, errors()), ...modes],
    current, tailGap, leastGap,
  };
}

/* Turn the errors of the table into modes. The two directions of a mirror-symmetric robot have the same errors;
 * those of other robots also have a part of opposite signs. The simulator turns a little less in time steps. */
function tableModes(twist, errors) {
  const alike = twist[1].every((value, i) => {
    const image = twist[0][i] * MIRROR[i];
    return Math.abs(value - image) <= 1e-9 * Math.abs(image);
  });
  const signs = alike ? [[1, 1]] : [[1, 1], [ODD, -ODD]];
  const tables = errors.map(({ lag, memory }) => lag && lagTable(lag, memory));
  const turned = twist.map(([, , rate]) => [0, 0, TIME_STEPS * rate]);
  const ofSteps = { name: "table: time steps", twist: turned, lag: null, current: [0, 0] };
  return [ofSteps, ...signs.flatMap((sign) => errors.map((error, i) => {
    const sides = SIDES.map((side, s) => side.map((value) => sign[s] * value));
    return {
      name: `table: ${i + 1}`,
      twist: sides.map((side) => side.map((value, k) => value * error.twist[k])),
      lag: tables[i] && sides.map((side) => mirrored(tables[i], side)),
      current: [0, 0],
    };
  }))];
}

function mirrored(table, side) {
  return table.map((value, at) => value * side[at % 3]);
}

export { tableVehicle, unmeasuredModes, vehicleOfParts };
