/* Head, disc, motor and tails of a robot without effects, from its dimensionless groups.
 *
 * Mirrors surrogate/wrench/heads.py, sim/solve/assembly.py and sim/mechanics/drag.py. Without effects a reversed
 * motor makes the mirror image, so the numbers are those of a positive one. Units: l, μ0 l⁴/EI, EI/l². */
import { headInputs } from "./tails.js";

/* Drag coefficients per length along and across a tail, in units of μ0. tail_coefficients */
function tailCoefficients(slenderness) {
  const log = Math.log(slenderness);
  return [(2 * Math.PI) / (log - 0.5), (4 * Math.PI) / (log + 0.5)];
}

/* Resistance of the head about J, four rows of five. head_resistance */
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
 * {speed |ω|, gain ∂ω_t/∂ω_h, resistance, length L, sense ±1}. heads_and_tails */
function headAndTails(robot) {
  const radius = 1 / robot.l_over_R, length = robot.L_over_R * radius, number = robot.N;
  const [parallel, perp] = tailCoefficients(robot.l_over_r0);
  const resistance = headResistance(robot.C_t, robot.C_r, robot.C_yr, radius, length);
  const gain = 1, offset = robot.a_over_R * radius;
  const head = {
    speed: Math.abs(robot.omega_bar), gain, resistance, length, sense: Math.sign(robot.omega_bar),
  };
  const tails = {
    perp, parallel, offset, radius: 1 / robot.l_over_r0, number,
    spinDrag: resistance[3][3], head: headInputs(resistance, length, gain, number * perp, offset),
  };
  return { head, tails };
}

/* Resistance of straight tails to (v_x, v_z, ω_yr), three rows of three. straight_resistance */
function straightResistance({ number, perp, parallel }) {
  const across = number * perp, along = number * parallel;
  return [[across, 0, -across / 2], [0, along, 0], [-across / 2, 0, across / 3]];
}

export { tailCoefficients, headResistance, headAndTails, straightResistance };
