/* The domain of the table: the joint support of its training data, as a smooth measure.
 *
 * Mirrors surrogate/table/support.py, which has the definition. */

const DEGREE = 3;
const DEGREE_OF_MANY = 2;
const MANY = 8; // inputs
const END = 1.02; // of half an input's range

/* List the monomials of some inputs: monomial p is monomial parents[p] times input last[p].
 * products_of */
function products(inputs) {
  const parents = [0], last = [0];
  const most = inputs >= MANY ? DEGREE_OF_MANY : DEGREE;
  let level = [{ place: 0, first: 0 }];
  for (let degree = 1; degree <= most; degree++) {
    const next = [];
    for (const { place, first } of level) {
      for (let input = first; input < inputs; input++) {
        next.push({ place: parents.length, first: input });
        parents.push(place);
        last.push(input);
      }
    }
    level = next;
  }
  return { parents, last };
}

/* q over its limit at some inputs, or how far they are outside their ranges: at most 1 inside the support.
 * Support.novelty */
function novelty({ shift, scale, factor, limit }, inputs) {
  const { parents, last } = products(shift.values.length), count = parents.length;
  const x = Float64Array.from(shift.values, (middle, i) => (inputs[i] - middle) / scale.values[i]);
  const features = new Float64Array(count).fill(1), solved = new Float64Array(count), rows = factor.values;
  let total = 0;
  for (let p = 1; p < count; p++) features[p] = features[parents[p]] * x[last[p]];
  for (let i = 0; i < count; i++) {
    let remainder = features[i];
    for (let j = 0; j < i; j++) remainder -= rows[i * count + j] * solved[j];
    solved[i] = remainder / rows[i * count + i];
    total += solved[i] ** 2;
  }
  const away = x.map(Math.abs).filter((size) => size > END);
  return Math.max(total / count / limit, ...away);
}

export { novelty };
