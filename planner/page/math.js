/* Columns of numbers, angles, rigid motions of the plane, small matrices and splines.
 *
 * A column is an array or a Float64Array, rows are arrays of arrays. A pose is [x, y, ψ], a twist [forward, left,
 * yaw rate]; lengths in any unit, angles in rad. */

const TAU = 2 * Math.PI;
const MIRROR = [1, -1, -1]; // reflection about the body's axis: what a reversed motor does

/* The remainder with the sign of the divisor, as Python's %. */
function mod(value, divisor) {
  const rest = value % divisor;
  return rest !== 0 && rest < 0 !== divisor < 0 ? rest + divisor : rest;
}

/* An angle within half a turn of zero. */
function halfTurn(angle) {
  return mod(angle + Math.PI, TAU) - Math.PI;
}

function clip(value, low, high) {
  return Math.min(Math.max(value, low), high);
}

function sum(values) {
  let total = 0;
  for (const value of values) total += value;
  return total;
}

function mean(values) {
  return sum(values) / values.length;
}

/* The sum of products. */
function dot(one, other) {
  let total = 0;
  for (let i = 0; i < one.length; i++) total += one[i] * other[i];
  return total;
}

/* The largest value; −∞ of none, NaN if there is one. */
function largest(values) {
  let most = -Infinity;
  for (const value of values) if (!(value <= most)) most = value;
  return most;
}

/* The smallest value; ∞ of none, NaN if there is one. */
function smallest(values) {
  return -largest(Array.from(values, (value) => -value));
}

/* The largest absolute value; 0 of none. */
function largestSize(values) {
  return Math.max(0, largest(Array.from(values, Math.abs)));
}

function median(values) {
  const sorted = Float64Array.from(values).sort(), middle = sorted.length >> 1;
  return sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
}

/* The quantile of sorted values, between the two nearest. */
function quantile(values, level) {
  const place = level * (values.length - 1), below = Math.floor(place);
  return values[below] + (place - below) * (values[Math.min(below + 1, values.length - 1)] - values[below]);
}

/* Sums of the first values, one more than there are values: 0, a, a + b, … */
function runningSum(values) {
  const totals = new Float64Array(values.length + 1);
  for (let i = 0; i < values.length; i++) totals[i + 1] = totals[i] + values[i];
  return totals;
}

/* Differences of neighbours. */
function differences(values) {
  return Float64Array.from({ length: Math.max(values.length - 1, 0) }, (_, i) => values[i + 1] - values[i]);
}

/* Equal steps from start to end, both included. */
function linspace(start, end, count) {
  const step = (end - start) / (count - 1);
  return Float64Array.from({ length: count }, (_, i) => (i && i === count - 1 ? end : start + i * step));
}

/* Steps of equal ratio from start to end, both included. */
function geomspace(start, end, count) {
  return linspace(Math.log(start), Math.log(end), count).map((log, i) => {
    return i === 0 ? start : i === count - 1 ? end : Math.exp(log);
  });
}

/* A column of rows. */
function column(rows, index) {
  return Float64Array.from(rows, (row) => row[index]);
}

/* Lowest and highest value of each coordinate of points. */
function bounds(points) {
  return [0, 1].map((axis) => [smallest(column(points, axis)), largest(column(points, axis))]);
}

/* The last index of rising knots whose value is at most x; −1 if there is none. */
function indexBelow(knots, x) {
  let low = -1, high = knots.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (knots[middle] <= x) low = middle;
    else high = middle;
  }
  return low;
}

/* Values at x between rising knots, constant beyond both ends. */
function interp(x, knots, values) {
  const last = knots.length - 1;
  return Float64Array.from(x, (at) => {
    const j = indexBelow(knots, at);
    if (j < 0) return values[0];
    if (j >= last) return values[last];
    return ((values[j + 1] - values[j]) / (knots[j + 1] - knots[j])) * (at - knots[j]) + values[j];
  });
}

/* Angles [rad] without jumps of more than half a turn. */
function unwrap(angles) {
  const smooth = Float64Array.from(angles);
  for (let i = 1; i < smooth.length; i++) {
    const step = angles[i] - angles[i - 1];
    smooth[i] = smooth[i - 1] + (Math.abs(step) <= Math.PI ? step : halfTurn(step));
  }
  return smooth;
}

/* Sums of products with a symmetric kernel wherever it lies fully within the values. */
function convolved(values, kernel) {
  const count = values.length - kernel.length + 1;
  return Float64Array.from({ length: count }, (_, i) => dot(kernel, values.subarray(i)));
}

/* The pose reached by `then`, given in the frame of `first`. */
function compose(first, then) {
  const c = Math.cos(first[2]), s = Math.sin(first[2]);
  return [first[0] + (c * then[0] - s * then[1]), first[1] + (s * then[0] + c * then[1]), first[2] + then[2]];
}

/* The pose that undoes a pose. */
function inversePose([x, y, heading]) {
  const c = Math.cos(heading), s = Math.sin(heading);
  return [-(c * x + s * y), s * x - c * y, -heading];
}

/* The pose after holding a twist for a time. */
function arc([forward, left, rate], time) {
  const angle = rate * time, half = angle / 2, sinc = (x) => (x === 0 ? 1 : Math.sin(x) / x);
  const along = time * sinc(angle), across = time * sinc(half) * Math.sin(half);
  return [along * forward - across * left, across * forward + along * left, angle];
}

/* Solve a x = b in place by Gaussian elimination with pivoting: b becomes x, a is overwritten. */
function solveDense(a, b) {
  const count = b.length, columns = b[0].length;
  for (let k = 0; k < count; k++) {
    let best = k;
    for (let i = k + 1; i < count; i++) if (Math.abs(a[i][k]) > Math.abs(a[best][k])) best = i;
    [a[k], a[best]] = [a[best], a[k]];
    [b[k], b[best]] = [b[best], b[k]];
    for (let i = k + 1; i < count; i++) {
      const factor = a[i][k] / a[k][k];
      if (factor === 0) continue;
      for (let j = k + 1; j < count; j++) a[i][j] -= factor * a[k][j];
      for (let j = 0; j < columns; j++) b[i][j] -= factor * b[k][j];
    }
  }
  for (let k = count - 1; k >= 0; k--) {
    for (let i = 0; i < columns; i++) {
      for (let j = k + 1; j < count; j++) b[k][i] -= a[k][j] * b[j][i];
      b[k][i] /= a[k][k];
    }
  }
}

/* The inverse of a matrix; numbers that are not finite where there is none. */
function inverse(matrix) {
  const unit = matrix.map((_, i) => matrix.map((_, j) => (i === j ? 1 : 0)));
  solveDense(matrix.map((row) => [...row]), unit);
  return unit;
}

/* The cubic spline through values at knots, at least four: rows of the matrix that gives its values at some places.
 *
 * flatEnd: the slope at the last knot is zero, rather than the third derivative continuous at the knot before, as it is
 * at the second knot. */
function splineMatrix(knots, places, flatEnd = false) {
  const h = differences(knots), last = h.length, zeros = () => new Float64Array(last + 1);
  const matrix = Array.from(knots, zeros), slopes = Array.from(knots, zeros); // matrix · slopes = secants
  const add = (row, i, share) => { // of the secant of step i
    row[i + 1] += share / h[i];
    row[i] -= share / h[i];
  };
  const notAKnot = (row, i, j) => { // step i of the end, and its neighbour j
    const total = h[i] + h[j];
    add(row, i, ((h[i] + 2 * total) * h[j]) / total);
    add(row, j, h[i] ** 2 / total);
  };
  for (let i = 1; i < last; i++) {
    matrix[i].set([h[i], 2 * (h[i - 1] + h[i]), h[i - 1]], i - 1);
    add(slopes[i], i - 1, 3 * h[i]);
    add(slopes[i], i, 3 * h[i - 1]);
  }
  matrix[0].set([h[1], h[0] + h[1]]);
  notAKnot(slopes[0], 0, 1);
  matrix[last].set(flatEnd ? [0, 1] : [h[last - 1] + h[last - 2], h[last - 2]], last - 1);
  if (!flatEnd) notAKnot(slopes[last], last - 1, last - 2);
  solveDense(matrix, slopes);
  return Array.from(places, (place) => {
    const i = clip(indexBelow(knots, place), 0, last - 1), t = (place - knots[i]) / h[i], bent = h[i] * t * (1 - t);
    const row = slopes[i].map((slope, k) => bent * ((1 - t) * slope - t * slopes[i + 1][k]));
    row[i] += (1 + 2 * t) * (1 - t) ** 2;
    row[i + 1] += t ** 2 * (3 - 2 * t);
    return row;
  });
}

export { TAU, MIRROR, mod, halfTurn, clip, sum, mean, dot, largest, smallest, largestSize, median, quantile };
export { runningSum, differences, linspace, geomspace, column, bounds, indexBelow, interp, unwrap, convolved, compose };
export { inversePose, arc, solveDense, inverse, splineMatrix };
