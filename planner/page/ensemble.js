/* Networks of the look-up table: small perceptrons in double precision, each plus a linear map.
 *
 * Mirrors surrogate/networks/ensemble.py and surrogate/networks/loops.py, one robot at a time. */

/* Prepare a network {shift, scale, mean, spread, members} from the arrays of a model file. Ensemble.from_state */
function networkOf({ shape, state }) {
  const parts = (name, k) => {
    const { values } = state[name], size = values.length / shape.members;
    return values.subarray(k * size, (k + 1) * size);
  };
  const members = Array.from({ length: shape.members }, (_, k) => ({
    weights: Array.from({ length: shape.depth + 1 }, (_, layer) => parts(`weights.${layer}`, k)),
    biases: Array.from({ length: shape.depth + 1 }, (_, layer) => parts(`biases.${layer}`, k)),
    bypass: parts("bypass", k),
  }));
  const [shift, scale, mean, spread] = ["shift", "scale", "mean", "spread"].map((name) => state[name].values);
  return { shift, scale, mean, spread, members };
}

/* The mean of the members, as an array of the outputs. */
function evaluate(network, inputs) {
  const first = scaledInputs(network, inputs), { mean, spread, members } = network;
  const total = new Float64Array(mean.length);
  for (const member of members) addTo(total, perceptron(member, first));
  return total.map((value, j) => (value / members.length) * spread[j] + mean[j]);
}

/* The outputs of every member. Ensemble.members_at */
function membersAt(network, inputs) {
  const first = scaledInputs(network, inputs), { mean, spread, members } = network;
  return members.map((member) => perceptron(member, first).map((value, j) => value * spread[j] + mean[j]));
}

function scaledInputs({ shift, scale }, inputs) {
  return Float64Array.from(shift, (middle, i) => (inputs[i] - middle) / scale[i]);
}

function perceptron({ weights, biases, bypass }, first) {
  let hidden = first;
  weights.forEach((weight, layer) => {
    const next = Float64Array.from(biases[layer]);
    addProduct(next, hidden, weight);
    hidden = layer < weights.length - 1 ? next.map(Math.tanh) : next;
  });
  addProduct(hidden, first, bypass);
  return hidden;
}

/* Add xᵀ W, with the rows of W one after another. */
function addProduct(total, x, weights) {
  const count = total.length;
  for (let i = 0, at = 0; i < x.length; i++, at += count) {
    for (let j = 0; j < count; j++) total[j] += x[i] * weights[at + j];
  }
}

function addTo(total, values) {
  for (let j = 0; j < total.length; j++) total[j] += values[j];
}

export { networkOf, evaluate, membersAt };
