/* The response of a robot to a flip of its motor: at which dwells its curves are known, and memory between them.
 *
 * Mirrors sim/model/response.py. Curves are flat: the dwell before slowest, then the dwell, then (Δz, Δx, Δψ)
 * in l, l, rad. Times in μ0 l⁴/EI. */
import { geomspace, placeBelow } from "./arrays.js";

const DWELLS = geomspace(0.2, 4.0, 25); // T̄ of the curves
const BEFORE = geomspace(0.2, 1.2, 16); // T̄ of the dwell before
const FORGOTTEN = 1.4; // T̄ of the dwell before from which on the response is that after a long one
const SETTLED = 2.0; // time units after a flip from which the lag is constant
const CURVE = DWELLS.length * 3; // numbers of a curve

/* The memory where the dwell before is as long as the dwell. at_equal_dwells */
function atEqualDwells(memory) {
  return Float64Array.from({ length: CURVE }, (_, at) => {
    const before = DWELLS[Math.floor(at / 3)], k = Math.max(placeBelow(BEFORE, before), 0);
    if (before >= FORGOTTEN) return 0;
    if (k === BEFORE.length - 1) return ((FORGOTTEN - before) / (FORGOTTEN - BEFORE[k])) * memory[k * CURVE + at];
    const share = (before - BEFORE[k]) / (BEFORE[k + 1] - BEFORE[k]);
    return (1 - share) * memory[k * CURVE + at] + share * memory[(k + 1) * CURVE + at];
  });
}

export { DWELLS, BEFORE, FORGOTTEN, SETTLED, CURVE, atEqualDwells };
