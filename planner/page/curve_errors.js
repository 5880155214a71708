/* The error of the learned response at one robot: local sizes, and how the error varies over the dwells.
 *
 * Mirrors surrogate/table/curve_errors.py and `joined` of surrogate/error_modes.py. Curves are flat, as in
 * response.js, in l, l, rad, of a positive motor. */
import { halfWidth } from "./intervals.js";
import { BEFORE, CURVE } from "./response.js";

const NORMAL_90 = 1.6449; // half of an interval that holds 90 % of a normal distribution, in standard deviations
const SIZES = ["lag_z", "lag_x", "lag_psi_rad"]; // the names of the sizes among the widths

/* The errors of the steady motion, each of one of v_z, v_x and ω_yr, and then those of the lag: modes of one
 * standard deviation {twist, lag, memory}; lag and memory are null where a mode changes nothing of them.
 *
 * sizes: standard deviations of v_z, v_x and ω_yr. features: see lookup.js. speeds: see response_table.js. */
function errorModes(curveErrors, sizes, features, speeds) {
  const local = SIZES.map((name, axis) => {
    return (halfWidth(curveErrors.widths, name, features, 1) / NORMAL_90) * speeds[axis];
  });
  const { shape, values } = curveErrors.curves, whole = (BEFORE.length + 1) * CURVE;
  const steady = sizes.map((size, i) => {
    return { twist: [0, 1, 2].map((k) => (k === i ? size : 0)), lag: null, memory: null };
  });
  const curves = Array.from({ length: shape[0] }, (_, k) => {
    const curve = values.slice(k * whole, (k + 1) * whole).map((value, at) => value * local[at % 3]);
    const lag = curve.slice(BEFORE.length * CURVE);
    const memory = curve.slice(0, BEFORE.length * CURVE).map((value, at) => value - lag[at % CURVE]);
    return { twist: [0, 0, 0], lag, memory };
  });
  return [...steady, ...curves];
}

export { NORMAL_90, errorModes };
