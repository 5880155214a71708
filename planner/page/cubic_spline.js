/* Cubic splines through a few knots: two continuous derivatives.
 *
 * Mirrors planner/vehicle/cubic_spline.py, which has the formula. */
import { placeBelow } from "./arrays.js";
import { solveDense } from "./dense.js";

/* Evaluate the spline through values at knots, at least four, at some places; both flat, one row of `width`
 * numbers for each knot and place. flatEnd: the slope at the last knot is zero, rather than the third
 * derivative continuous at the knot before. spline_at */
function splineAt(knots, values, width, places, flatEnd = false) {
  const slopes = splineSlopes(knots, values, width, flatEnd), answer = new Float64Array(places.length * width);
  places.forEach((place, row) => {
    const segment = Math.min(Math.max(placeBelow(knots, place), 0), knots.length - 2);
    const h = knots[segment + 1] - knots[segment], t = (place - knots[segment]) / h;
    const atFirst = (1 + 2 * t) * (1 - t) ** 2, atSecond = t ** 2 * (3 - 2 * t), bent = h * t * (1 - t);
    for (let i = 0; i < width; i++) {
      const at = segment * width + i;
      const ends = atFirst * values[at] + atSecond * values[at + width];
      answer[row * width + i] = ends + bent * ((1 - t) * slopes[segment][i] - t * slopes[segment + 1][i]);
    }
  });
  return answer;
}

/* The slopes at the knots, one row for each. */
function splineSlopes(knots, values, width, flatEnd) {
  const count = knots.length, h = Array.from({ length: count - 1 }, (_, i) => knots[i + 1] - knots[i]);
  const secant = (i, k) => (values[(i + 1) * width + k] - values[i * width + k]) / h[i];
  const columns = Array.from({ length: width }, (_, k) => k);
  const matrix = Array.from({ length: count }, () => new Float64Array(count)), right = [];
  for (let i = 1; i < count - 1; i++) {
    matrix[i].set([h[i], 2 * (h[i - 1] + h[i]), h[i - 1]], i - 1);
    right[i] = columns.map((k) => 3 * (h[i] * secant(i - 1, k) + h[i - 1] * secant(i, k)));
  }
  const last = count - 1;
  matrix[0].set([h[1], h[0] + h[1]]);
  right[0] = columns.map((k) => notAKnot(h[0], h[1], secant(0, k), secant(1, k)));
  if (flatEnd) {
    matrix[last][last] = 1;
    right[last] = columns.map(() => 0);
  } else {
    matrix[last].set([h[last - 1] + h[last - 2], h[last - 2]], last - 1);
    right[last] = columns.map((k) => notAKnot(h[last - 1], h[last - 2], secant(last - 1, k), secant(last - 2, k)));
  }
  solveDense(matrix, right);
  return right;
}

/* The right side of the equation of an end, from the end inwards. */
function notAKnot(h, nextH, secant, nextSecant) {
  const total = h + nextH;
  return ((h + 2 * total) * nextH * secant + h ** 2 * nextSecant) / total;
}

export { splineAt };
