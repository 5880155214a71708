/* Prediction intervals of each output of the table, wider where the table is less certain.
 *
 * Mirrors surrogate/table/intervals.py and surrogate/table/errors.py; intervals are not learned here. */

const HALVED = [0, 3, 5]; // features whose halves make the octants
const RELATIVE = ["omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "R_yr_over_l", "tail_gap"];

/* The size that errors of an output are relative to, at an answer {output: value}. error_scale */
function errorScale(name, answer) {
  if (RELATIVE.includes(name)) return Math.abs(answer[name]);
  if (name === "theta_deg") return 1;
  if (name === "lag_psi_rad") return Math.abs(answer.omega_yr_bar);
  if (name === "net_speed_bar") return Math.abs(answer.v_z);
  return Math.sqrt(answer.v_x ** 2 + answer.v_z ** 2);
}

/* Half of the width of the interval of an output. Intervals.half_widths
 *
 * The page's robots have no couple in yaw, so their factors are the first ones of `factor`.
 * intervals: as a model file has them. features: 11 of them, see lookup.js. size: what errors are relative to. */
function halfWidth(intervals, name, features, size) {
  const { shift, scale, weights, bounds, middle, factor } = intervals;
  const single = features[features.length - 1] > 0.5;
  const octant = HALVED.reduce((place, f, k) => place + (features[f] > middle.values[k] ? 2 ** k : 0), 0);
  const terms = design(features.map((value, i) => (value - shift.values[i]) / scale.values[i]));
  const log = terms.reduce((total, term, i) => total + term * weights[name].values[i], 0);
  const local = Math.exp(Math.min(Math.max(log, bounds[name][0]), bounds[name][1]));
  return factor[name].values[single ? 2 ** HALVED.length : octant] * local * size;
}

/* 1, x and all products of two, with x held to five standard deviations. */
function design(x) {
  const held = x.map((value) => Math.min(Math.max(value, -5), 5)), terms = [1, ...held];
  held.forEach((value, i) => terms.push(...held.slice(i).map((other) => value * other)));
  return terms;
}

export { errorScale, halfWidth };
