/* The vehicle that a look-up table gives for a robot: both directions, what is uncertain, and the current.
 *
 * Robots with effects or a calibration, and tables of one robot, are asked by Python, which writes the
 * parts of their vehicle. Lengths in l, times in μ0 l⁴/EI. */
import { CONSTANTS } from "./constants.js";
import { MIRROR } from "./math.js";
import { groupValues } from "./robot.js";
import { OutsideError, query, response, tableErrorModes, within } from "./table.js";
import { fromSi } from "./units.js";
import { BEFORE, lagTable, modeBetween, resampled, trackedPoint } from "./vehicle.js";
import { InputError, general, quoted, refusing } from "./words.js";

const { ODD, TIME_STEPS } = CONSTANTS.from_table, { STEP: CHANGE } = CONSTANTS.from_table;
const { UNMEASURED } = CONSTANTS.knowledge; // standard deviations of ln C, of another robot's
const SIDES = [[1, 1, 1], MIRROR];
const NUMBERS = { // that decide a group: words, field, unit
  l_over_R: ["tail length", "tailLength", "cm"], l_over_r0: ["tail radius", "tailRadius", "mm"],
  L_over_R: ["head length", "headLength", "mm"], a_over_R: ["disc offset", "discOffset", "mm"],
  N: ["number of tails", "tails", ""], omega_bar: ["motor speed", "motorSpeed", "rpm"],
};

/* Ask a table for the vehicle of a robot, and add the tracked point. */
function trackedVehicle(robot, table, point) {
  const groups = groupValues(robot), senses = bothDirections(groups);
  const motions = refusing(() => senses.map((values) => query(table, values)), (refusal) => {
    throw refusal instanceof OutsideError ? new OutsideError(outside(refusal.message, robot, table)) : refusal;
  });
  const vehicle = vehicleOfParts({
    twist: motions.map(twistOf),
    curves: senses.map((values) => response(table, values)),
    before: BEFORE,
    phaseRate: motions.map((motion) => groups.N * motion.omega_t_bar),
    errors: tableErrorModes(table, senses[0]),
    modes: [],
    current: [0, 0],
    tailGap: Math.min(...motions.map((motion) => motion.tail_gap)),
    leastGap: 1,
  }, robot.name);
  const unmeasured = unmeasuredModes(groups, table, vehicle);
  return trackedPoint(robot, { vehicle, unmeasured, calibrated: false, ownTable: false }, point, table.identity);
}

function bothDirections(groups) {
  return [1, -1].map((sense) => ({ ...groups, omega_bar: groups.omega_bar * sense }));
}

function twistOf({ v_z, v_x, omega_yr_bar }) {
  return [v_z, v_x, omega_yr_bar];
}

/* Say why a table does not know a robot: the number that was not learned, in the units of a laboratory, and its
 * range. */
function outside(reason, robot, table) {
  const values = groupValues(robot);
  const group = Object.keys(NUMBERS).find((name) => !within(table.ranges[name], values[name])) ?? "omega_bar";
  const [words, field, unit] = NUMBERS[group], size = robot[field] ?? robot.headRadius; // of the disc offset
  const written = (number, value) => {
    return `${unit ? `${general(fromSi(number, unit), 4)} ${unit}` : number} (${group} = ${general(value, 3)})`;
  };
  const known = table.ranges[group].map((end) => {
    return written(group === "l_over_r0" ? (size * values[group]) / end : (size * end) / values[group], end);
  });
  const alone = !within(table.ranges[group], values[group]);
  const value = `${words} ${written(size, values[group])}`;
  const why = alone ? `${value}, learned were ${known.join(" to ")}` : `${reason}; ${value}`;
  return `robot ${quoted(robot.name)} is outside the look-up table: ${why}; change the robot, or `
    + "simulate it (softflagella steady, softflagella surrogate robot)";
}

/* Modes of a robot whose coefficients are those of another. */
function unmeasuredModes(groups, table, vehicle) {
  return Object.entries(UNMEASURED).map(([name, sigma], k) => {
    const [above, below] = [CHANGE, -CHANGE].map((step) => {
      const values = { ...groups, [name]: groups[name] * Math.exp(step) };
      const edge = { twist: vehicle.twist, lag: vehicle.lag, step: 0 }; // of the table
      return refusing(() => ({ ...motionOfOther(table, values), step }), () => edge);
    });
    return modeBetween(`coefficients: ${k + 1}`, above, below, sigma / (above.step - below.step || Infinity));
  });
}

/* Ask a table for twists and lags of another robot. */
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
 * positive motor. before: dwells of the memory. phaseRate: N times the disc's spin of each. errors: of the table.
 * modes: further ones. The rest is as in vehicle.js. */
function vehicleOfParts({ twist, curves, before, phaseRate, errors, modes, current, tailGap, leastGap }, name) {
  const speed = (twist[0][0] + twist[1][0]) / 2, robot = `robot ${quoted(name)}`;
  if (speed <= 0) {
    throw new InputError(`${robot} does not move forward (v_z = ${general(speed, 3)}); turn its motor slower`);
  }
  if (twist[0][2] <= 0 || -twist[1][2] <= 0) {
    throw new InputError(`${robot} turns to the same side in both directions of its motor; it cannot follow a path`);
  }
  return {
    twist,
    lag: curves.map(({ lag, memory }, side) => mirrored(lagTable(lag, memory, before), SIDES[side])),
    rest: curves.map(({ rest }, side) => mirrored(resampled(rest), SIDES[side])),
    spread: curves.map(({ spread }) => resampled(spread)),
    phaseRate,
    modes: [...tableModes(twist, errors), ...modes],
    current, tailGap, leastGap,
  };
}

/* Turn the errors of the table into modes. The two directions of a mirror-symmetric robot have the same errors; those
 * of other robots also have a part of opposite signs. The simulator turns a little less in time steps. */
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
  const image = new Float64Array(table.length);
  for (let at = 0; at < table.length; at++) image[at] = table[at] * side[at % 3];
  return image;
}

export { trackedVehicle, vehicleOfParts };
