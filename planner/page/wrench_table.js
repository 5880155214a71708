/* The motion that the networks for the tails' mean wrench give, and the gap between the tails.
 *
 * Mirrors surrogate/table/wrench_table.py, one robot at a time. A motion is [v_x of J, v_z, ω_yr, ω_h, ω_t] of a
 * positive motor. Units: l, μ0 l⁴/EI; the gap is over 2 r0, the slip angle in degrees. */
import { inverse } from "./dense.js";
import { evaluate } from "./ensemble.js";
import { straightResistance } from "./heads.js";
import { linearTorque, tailInputs } from "./tails.js";

const CLASSES = 3; // networks for N = 1, N = 2, and three or more tails
const LEAST_SURGE = 0.05; // of the speed: errors of v_z are relative to this at least

/* Which of the networks belongs to N tails. network_index */
function networkIndex(number) {
  return Math.min(number, CLASSES) - 1;
}

/* The steady outputs of a motion, of the head's centre. WrenchTable.outputs */
function steadyOutputs(table, head, tails, motion) {
  const [vX, surge, turn, headSpin, spin] = motion, { sense } = head;
  const yaw = sense * turn, sway = sense * (vX + (turn * head.length) / 2);
  return {
    omega_t_bar: sense * spin, omega_h_bar: sense * headSpin, omega_yr_bar: yaw, v_x: sway, v_z: surge,
    R_yr_over_l: Math.sqrt(sway ** 2 + surge ** 2) / Math.abs(yaw),
    theta_deg: Math.atan2(Math.abs(sway), surge) * (180 / Math.PI),
    tail_gap: tailGap(table.gap, tails, motion),
  };
}

/* The smallest distance between tails over 2 r0; infinite for one tail. WrenchTable.tail_gap */
function tailGap(network, tails, motion) {
  if (tails.number <= 1) return Infinity;
  const share = evaluate(network, [...tailInputs(tails, motion), Math.log(tails.number)])[0];
  const clamps = 2 * tails.offset * Math.sin(Math.PI / Math.max(tails.number, 2));
  return (share * clamps) / (2 * tails.radius);
}

/* ∂(relative motion)/∂(wrench) with the drag of straight tails, four rows of four. motion_sensitivity */
function motionSensitivity(head, tails, motion) {
  const [vX, vZ, yaw, headSpin, spin] = motion, { resistance, gain } = head, straight = straightResistance(tails);
  const matrix = resistance.map((row) => [row[0], row[1], row[2], row[3] + gain * row[4]]);
  for (let i = 0; i < 3; i++) for (let j = 0; j < 3; j++) matrix[i][j] += straight[i][j];
  const { number, perp, offset } = tails;
  matrix[3][3] += gain * (number * perp * offset ** 2 * linearTorque(perp * spin));
  const speed = Math.sqrt(vX ** 2 + vZ ** 2);
  const sizes = [
    Math.sqrt(vX ** 2 + (yaw / 2) ** 2), Math.max(Math.abs(vZ), LEAST_SURGE * speed), Math.abs(yaw),
    Math.min(Math.abs(headSpin), spin) / 3,
  ];
  return inverse(matrix).map((row, i) => row.map((entry) => entry / sizes[i]));
}

export { networkIndex, steadyOutputs, motionSensitivity };
