/* The robot in SI units, and its dimensionless groups.
 *
 * Mirrors sim/model/robot.py. A robot is {name, tails, tailLength, tailRadius, youngsModulus, headRadius,
 * headLength, viscosity, motorSpeed, C_t, C_r, C_yr, discOffset, sigmas} and what follows from them: timeScale [s]
 * and omegaBar. Lengths in m, modulus in Pa, viscosity in Pa s, speed in rad/s. A robot whose groups Python has
 * written, with its effects and corrections, has them as `groups`. */
import { general, repr } from "./format.js";
import { checkTails } from "./groups.js";
import { InputError } from "./input_error.js";

const LEAST_SLENDERNESS = 5;
const POSITIVE = {
  tail_length: "tailLength", tail_radius: "tailRadius", youngs_modulus: "youngsModulus", head_radius: "headRadius",
  head_length: "headLength", viscosity: "viscosity", motor_speed: "motorSpeed", C_t: "C_t", C_r: "C_r",
};

/* Make a robot of its numbers; refuse numbers that no robot has. */
function makeRobot(fields) {
  const robot = { discOffset: null, sigmas: {}, ...fields };
  checkTails(robot.tails);
  for (const [name, field] of Object.entries(POSITIVE)) checkPositive(name, robot[field]);
  if (robot.discOffset !== null) checkPositive("disc_offset", robot.discOffset);
  checkFinite("C_yr", robot.C_yr);
  const ratio = robot.tailLength / robot.tailRadius;
  if (!(ratio > LEAST_SLENDERNESS)) {
    throw new InputError(
      `l/r0 = ${general(ratio)}; resistive force theory needs slender tails: above ${LEAST_SLENDERNESS}`,
    );
  }
  const stiffness = (robot.youngsModulus * Math.PI * robot.tailRadius ** 4) / 4;
  robot.timeScale = (robot.viscosity * robot.tailLength ** 4) / stiffness;
  robot.omegaBar = robot.motorSpeed * robot.timeScale;
  const numbers = [robot.timeScale, ...Object.values(groupValues(robot))];
  if (!numbers.every(Number.isFinite) || !(robot.omegaBar > 0)) {
    throw new InputError("lengths, stiffness and viscosity give no finite unit of time; check their units");
  }
  return robot;
}

/* The dimensionless groups by column name, for the positive direction of the motor. Robot.group_values */
function groupValues(robot) {
  if (robot.groups) return robot.groups;
  return {
    C_t: robot.C_t,
    C_r: robot.C_r,
    C_yr: robot.C_yr,
    l_over_R: robot.tailLength / robot.headRadius,
    L_over_R: robot.headLength / robot.headRadius,
    l_over_r0: robot.tailLength / robot.tailRadius,
    omega_bar: robot.omegaBar,
    N: robot.tails,
    a_over_R: (robot.discOffset || robot.headRadius) / robot.headRadius,
  };
}

function checkFinite(name, value) {
  if (!(Math.abs(value) < Number.MAX_VALUE)) {
    throw new InputError(`${name} = ${repr(value)}; it must be a finite number`);
  }
}

function checkPositive(name, value) {
  checkFinite(name, value);
  if (value <= 0) throw new InputError(`${name} = ${general(value)}; it must be above 0`);
}

export { makeRobot, groupValues };
