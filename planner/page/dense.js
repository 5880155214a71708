/* Small dense matrices, as arrays of rows.
 *
 * Mirrors sim/linear/dense.py. */

/* Solve a x = b in place by Gaussian elimination with pivoting: b becomes x, a is overwritten. factor_dense, solve_factored */
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
    for (let j = k + 1; j < count; j++) {
      if (a[k][j] === 0) continue;
      for (let i = 0; i < columns; i++) b[k][i] -= a[k][j] * b[j][i];
    }
    for (let i = 0; i < columns; i++) b[k][i] /= a[k][k];
  }
}

/* The inverse of a matrix; numbers that are not finite where there is none. */
function inverse(matrix) {
  const unit = matrix.map((_, i) => matrix.map((_, j) => (i === j ? 1 : 0)));
  solveDense(matrix.map((row) => [...row]), unit);
  return unit;
}

export { solveDense, inverse };
