/* The table of the response to a flip: curves over the dwell, learned from simulated flips.
 *
 * Mirrors surrogate/table/response_table.py. Curves are flat, as in response.js, in l, l, rad, of a positive
 * motor; times in μ0 l⁴/EI. */
import { placeBelow } from "./arrays.js";
import { evaluate } from "./ensemble.js";
import { DWELLS, atEqualDwells } from "./response.js";
import { tailInputs } from "./tails.js";

const PARTS = [["lag"], ["memory", "rest"], ["spread"]]; // what each network gives
const SMALL_SURGE = 0.1; // of v_x
const OF_HEAD = [0, 1, 2, 3, 5, 6]; // of the inputs of the head: all but the coupling of sway and turn

/* Lag, memory, rest and spread of a robot in steady motion. ResponseTable.curves */
function responseCurves(table, head, tails, motion) {
  const speeds = curveSpeeds(head, motion), inputs = responseInputs(tails, motion), curves = {};
  PARTS.forEach((names, part) => {
    const components = evaluate(table.curves[part], inputs);
    let first = 0;
    for (const name of names) {
      const { mean, vectors } = table.bases[name], count = mean.values.length;
      const curve = Float64Array.from(mean.values);
      for (let c = 0; c < vectors.shape[0]; c++) {
        const size = components[first + c];
        for (let at = 0; at < count; at++) curve[at] += size * vectors.values[c * count + at];
      }
      first += vectors.shape[0];
      const scaled = name === "spread" ? spreadOf(curve, tails.number) : curve;
      curves[name] = scaled.map((value, at) => value * speeds[at % 3]);
    }
  });
  curves.spread = curves.spread.map(Math.abs);
  return curves;
}

/* The spread of its logarithm, which was learned of robots with two tails. */
function spreadOf(logarithm, number) {
  return logarithm.map((value) => (number === 2 ? Math.exp(Math.min(value, 0)) : 0));
}

/* Lags with the memory of a dwell before of the same length. ResponseTable.equal_dwells */
function lagAtEqualDwells({ lag, memory }) {
  const added = atEqualDwells(memory);
  return lag.map((value, at) => value + added[at]);
}

function responseInputs(tails, motion) {
  const two = tails.number === 2 ? 1 : 0;
  return [...tailInputs(tails, motion), ...OF_HEAD.map((i) => tails.head[i]), Math.log(tails.number), two];
}

/* (w, v_x, ω_yr) of the head's centre, by which the curves are divided. curve_speeds */
function curveSpeeds(head, [vX, vZ, yaw]) {
  const sway = vX + (yaw * head.length) / 2;
  return [Math.sqrt(vZ ** 2 + (SMALL_SURGE * sway) ** 2), sway, yaw];
}

/* Interpolate a curve at one dwell: cubic in ln T̄ through four knots, then constant. between_dwells */
function betweenDwells(curve, dwell) {
  const knots = DWELLS.map(Math.log), place = Math.log(Math.min(dwell, DWELLS[DWELLS.length - 1]));
  const below = placeBelow(knots, place) + (knots.includes(place) ? 0 : 1);
  const first = Math.min(Math.max(below - 2, 0), knots.length - 4), total = [0, 0, 0];
  for (let i = 0; i < 4; i++) {
    let weight = 1;
    for (let j = 0; j < 4; j++) {
      if (j !== i) weight *= (place - knots[first + j]) / (knots[first + i] - knots[first + j]);
    }
    for (let axis = 0; axis < 3; axis++) total[axis] += weight * curve[3 * (first + i) + axis];
  }
  return total;
}

export { responseCurves, lagAtEqualDwells, curveSpeeds, betweenDwells };
