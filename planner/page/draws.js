/* Standard normal numbers from a counter, the same as Python draws.
 *
 * Mirrors planner/draws.py, which has the sources. */

const WEYL = 0x9e3779b9, FIRST = 0x21f0aaad, SECOND = 0x735a2d97;
const MIDDLE = [ // numerator and denominator, in powers of 0.180625 − (u − ½)²
  [3.387132872796366608, 133.14166789178437745, 1971.5909503065514427, 13731.693765509461125,
    45921.953931549871457, 67265.770927008700853, 33430.575583588128105, 2509.0809287301226727],
  [1.0, 42.313330701600911252, 687.1870074920579083, 5394.1960214247511077,
    21213.794301586595867, 39307.89580009271061, 28729.085735721942674, 5226.495278852545925],
];
const TAIL = [ // in powers of √(−ln min(u, 1 − u)) − 1.6
  [1.42343711074968357734, 4.6303378461565452959, 5.7694972214606914055, 3.64784832476320460504,
    1.27045825245236838258, 0.24178072517745061177, 0.0227238449892691845833, 7.7454501427834140764e-4],
  [1.0, 2.05319162663775882187, 1.6763848301838038494, 0.68976733498510000455,
    0.14810397642748007459, 0.0151986665636164571966, 5.475938084995344946e-4, 1.05075007164441684324e-9],
];

const KEPT = 8; // draws that are remembered: plans ask for the same numbers again and again
const DRAWN = new Map();

/* Draw the numbers `first` to `first + count − 1` of a seed. */
function normals(seed, first, count) {
  const key = `${seed} ${first} ${count}`;
  if (!DRAWN.has(key)) DRAWN.set(key, drawnNormals(seed, first, count));
  if (DRAWN.size > KEPT) DRAWN.delete(DRAWN.keys().next().value);
  return DRAWN.get(key);
}

function drawnNormals(seed, first, count) {
  const key = mixed((seed + 1) % 2 ** 32);
  const drawn = new Float64Array(count);
  for (let i = 0; i < count; i++) {
    drawn[i] = quantile((mixed(mixed(Math.imul(first + i + 1, WEYL)) ^ key) + 0.5) / 2 ** 32);
  }
  return drawn;
}

function mixed(x) {
  let hash = x >>> 0;
  hash = Math.imul(hash ^ (hash >>> 16), FIRST) >>> 0;
  hash = Math.imul(hash ^ (hash >>> 15), SECOND) >>> 0;
  return (hash ^ (hash >>> 15)) >>> 0;
}

/* Φ⁻¹(u) for e⁻²⁵ ≤ u ≤ 1 − e⁻²⁵. */
function quantile(u) {
  const q = u - 0.5;
  if (Math.abs(q) <= 0.425) {
    const r = 0.180625 - q * q;
    return (q * polynomial(MIDDLE[0], r)) / polynomial(MIDDLE[1], r);
  }
  const r = Math.sqrt(-Math.log(Math.min(u, 1 - u))) - 1.6;
  return (Math.sign(q) * polynomial(TAIL[0], r)) / polynomial(TAIL[1], r);
}

function polynomial(powers, r) {
  let total = powers[7];
  for (let i = 6; i >= 0; i--) total = total * r + powers[i];
  return total;
}

export { normals };
