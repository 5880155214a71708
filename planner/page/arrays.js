/* Operations on columns of numbers as NumPy carries them out, in the same order, so that rounding is the same.
 *
 * A column is an array or a Float64Array, rows are arrays of arrays. */

const TAU = 2 * Math.PI;

/* The remainder with the sign of the divisor, as Python's %. */
function mod(value, divisor) {
  const rest = value % divisor;
  return rest !== 0 && rest < 0 !== divisor < 0 ? rest + divisor : rest;
}

/* The remainder by the nearest multiple, as math.remainder; ties go to the even one. */
function remainder(value, divisor) {
  const rest = value % divisor, half = Math.abs(divisor) / 2, size = Math.abs(rest);
  const odd = Math.abs(Math.trunc(value / divisor)) % 2 === 1;
  return size > half || (size === half && odd) ? rest - Math.sign(rest) * Math.abs(divisor) : rest;
}

/* √(x² + y²) to the last bit, as math.hypot: the squares are added with the errors of their rounding. */
function hypot(x, y) {
  const [small, large] = [Math.abs(x), Math.abs(y)].sort((one, other) => one - other);
  const root = Math.sqrt(large * large + small * small);
  if (!(root > 0 && root < Infinity)) return root;
  const [a, b, c] = [large, small, root].map(exactSquare);
  return root + (a[0] - c[0] + b[0] + (a[1] + b[1] - c[1])) / (2 * root);
}

/* A square as the sum of two numbers, without an error (Dekker's product). */
function exactSquare(value) {
  const shifted = 134_217_729 * value, high = shifted - (shifted - value), low = value - high;
  const square = value * value;
  return [square, high * high - square + 2 * high * low + low * low];
}

/* The sum of a column, in pairs of halves as numpy.sum adds them. */
function sum(values) {
  return partSum(values, 0, values.length);
}

function partSum(values, start, count) {
  if (count < 8) {
    let total = 0;
    for (let i = 0; i < count; i++) total += values[start + i];
    return total;
  }
  if (count > 128) {
    const half = Math.floor(count / 2), first = half - (half % 8);
    return partSum(values, start, first) + partSum(values, start + first, count - first);
  }
  const part = Array.from({ length: 8 }, (_, k) => values[start + k]), whole = count - (count % 8);
  for (let i = 8; i < whole; i += 8) for (let k = 0; k < 8; k++) part[k] += values[start + i + k];
  let total = part[0] + part[1] + (part[2] + part[3]) + (part[4] + part[5] + (part[6] + part[7]));
  for (let i = whole; i < count; i++) total += values[start + i];
  return total;
}

function mean(values) {
  return sum(values) / values.length;
}

/* The largest value; −∞ of none, NaN if there is one. */
function largest(values) {
  let most = -Infinity;
  for (const value of values) if (!(value <= most)) most = value;
  return most;
}

/* The smallest value; ∞ of none, NaN if there is one. */
function smallest(values) {
  let least = Infinity;
  for (const value of values) if (!(value >= least)) least = value;
  return least;
}

/* The largest absolute value; 0 of none. */
function largestSize(values) {
  let most = 0;
  for (const value of values) most = Math.max(most, Math.abs(value));
  return most;
}

function median(values) {
  const sorted = Float64Array.from(values).sort(), middle = sorted.length >> 1;
  return sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
}

/* Sums of the first values, one more than there are values: 0, a, a + b, … */
function runningSum(values) {
  const totals = new Float64Array(values.length + 1);
  for (let i = 0; i < values.length; i++) totals[i + 1] = totals[i] + values[i];
  return totals;
}

/* Differences of neighbours. */
function differences(values) {
  const steps = new Float64Array(Math.max(values.length - 1, 0));
  for (let i = 0; i < steps.length; i++) steps[i] = values[i + 1] - values[i];
  return steps;
}

/* Equal steps from start to end, both included. */
function linspace(start, end, count) {
  const values = new Float64Array(count), step = (end - start) / (count - 1);
  for (let i = 0; i < count; i++) values[i] = i * step + start;
  if (count > 1) values[count - 1] = end;
  return values;
}

/* Steps of equal ratio from start to end, both included, as numpy.geomspace. */
function geomspace(start, end, count) {
  const values = linspace(Math.log10(start), Math.log10(end), count).map((power) => 10 ** power);
  values[0] = start;
  if (count > 1) values[count - 1] = end;
  return values;
}

/* A column of rows. */
function column(rows, index) {
  return Float64Array.from(rows, (row) => row[index]);
}

/* The last place of rising knots whose value is at most x; −1 if there is none. */
function placeBelow(knots, x) {
  let low = -1, high = knots.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (knots[middle] <= x) low = middle;
    else high = middle;
  }
  return low;
}

/* Values at x between rising knots, constant beyond both ends, as numpy.interp. */
function interp(x, knots, values) {
  const last = knots.length - 1;
  return Float64Array.from(x, (at) => {
    const j = placeBelow(knots, at);
    if (j < 0) return values[0];
    if (j >= last) return values[last];
    if (knots[j] === at) return values[j];
    return ((values[j + 1] - values[j]) / (knots[j + 1] - knots[j])) * (at - knots[j]) + values[j];
  });
}

/* Angles [rad] without jumps of more than half a turn. */
function unwrap(angles) {
  const smooth = Float64Array.from(angles);
  let added = 0;
  for (let i = 1; i < smooth.length; i++) {
    const step = angles[i] - angles[i - 1];
    let short = mod(step + Math.PI, TAU) - Math.PI;
    if (short === -Math.PI && step > 0) short = Math.PI;
    if (Math.abs(step) >= Math.PI) added += short - step;
    smooth[i] = angles[i] + added;
  }
  return smooth;
}

/* Sums of products with a kernel wherever it lies fully within the values, as numpy.convolve in mode "valid". */
function convolved(values, kernel) {
  const width = kernel.length, means = new Float64Array(values.length - width + 1);
  for (let i = 0; i < means.length; i++) {
    let total = 0;
    for (let k = 0; k < width; k++) total += values[i + k] * kernel[width - 1 - k];
    means[i] = total;
  }
  return means;
}

export { TAU, mod, remainder, hypot, sum, mean, largest, smallest, largestSize, median, runningSum, differences };
export { linspace, geomspace, column, placeBelow, interp, unwrap, convolved };
