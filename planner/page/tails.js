/* The mean wrench of the tails on the disc: what its networks see, and what their numbers multiply.
 *
 * Mirrors surrogate/wrench/tails.py, which has the formulas. Tails of one robot are {perp, parallel, offset,
 * radius, number, spinDrag, head}, a motion is [v_x of J, v_z, ω_yr, ω_h, ω_t] of a positive motor. Units: l,
 * μ0 l⁴/EI. */

const SOFT = 12; // S from which a tail bends with the flow while it turns
const SMALL_DEFLECTION = 0.05;
const SMALL_SURGE = 0.05;
const TINY = 1e-30;
const SINGLE_INPUTS = 13;

/* Thrust of a tail in linear theory over (ζ⊥ − ζ∥) ω_t a², roughly, at drag number S. linear_thrust */
function linearThrust(S) {
  return (0.125 * S) / (1 + (S / 8) ** 1.35);
}

/* Torque of a tail in linear theory over ζ⊥ ω_t a², roughly, at drag number S. linear_torque */
function linearTorque(S) {
  return (1 + (S / 6) ** 2) ** -0.125;
}

/* The inputs of the networks for two tails and more, of the gap and of the response. tail_inputs */
function tailInputs({ perp, offset, radius, number, spinDrag }, [vX, vZ, yaw, , spin]) {
  const dragNumber = perp * spin;
  const deflection = ((Math.sqrt(vX ** 2 + yaw ** 2 + TINY) / spin) * dragNumber) / (dragNumber + SOFT);
  return [
    Math.log(dragNumber), Math.log(offset), -Math.log(radius), Math.asinh(deflection / SMALL_DEFLECTION),
    Math.atan2(vX, yaw), Math.asinh(vZ / (offset * spin) / SMALL_SURGE),
    Math.log(spinDrag / (number * perp * offset ** 2)),
  ];
}

/* What a single tail feels of its head, from the resistance (4 rows of 5), L, ∂ω_t/∂ω_h, N ζ⊥ and a.
 * head_inputs */
function headInputs(resistance, length, gain, across, offset) {
  const [sway, surge, turn, spin] = [0, 1, 2, 3].map((i) => resistance[i][i]);
  return [
    Math.log(sway / across), Math.log(surge / across), Math.log(turn / across), Math.log(length),
    resistance[0][2] / Math.sqrt(sway * turn), Math.log(resistance[0][3] / across), resistance[3][4] / spin,
    resistance[2][4] / (across * offset ** 2), Math.log(gain),
  ];
}

/* The inputs of the network of robots with one tail. single_inputs */
function singleInputs({ perp, offset, radius, spinDrag, head }, [, , , , spin]) {
  const drag = Math.log(spinDrag / (perp * offset ** 2));
  return [Math.log(perp * spin), Math.log(offset), -Math.log(radius), drag, ...head];
}

/* The inputs of the network of the wrench that has so many. network_inputs */
function networkInputs(tails, motion, count) {
  return count === SINGLE_INPUTS ? singleInputs(tails, motion) : tailInputs(tails, motion);
}

/* The terms of the wrench: F_x, F_z, M_y of straight tails; then side force, thrust, torque and m².
 * wrench_terms */
function wrenchTerms({ perp, parallel, offset, number }, [vX, vZ, yaw, , spin]) {
  const dragNumber = perp * spin, across = number * perp;
  const sideways = Math.sqrt(vX ** 2 + yaw ** 2 + TINY), couple = number * spin * offset ** 2;
  return [
    across * (yaw / 2 - vX), -number * parallel * vZ, across * (vX / 2 - yaw / 3), across * sideways,
    (perp - parallel) * couple * linearThrust(dragNumber), -perp * couple * linearTorque(dragNumber),
    (sideways / (offset * spin)) ** 2,
  ];
}

/* ∂(wrench)/∂y at a motion, four rows of six. wrench_slopes */
function wrenchSlopes(tails, motion) {
  const [, , , force, thrust, torque, squared] = wrenchTerms(tails, motion);
  return [
    [force, 0, 0, 0, 0, 0],
    [0, thrust, 0, 0, thrust * squared, 0],
    [0, 0, force, 0, 0, 0],
    [0, 0, 0, torque, 0, torque * squared],
  ];
}

export { linearThrust, linearTorque, tailInputs, headInputs, networkInputs, wrenchTerms, wrenchSlopes };
