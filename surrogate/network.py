"""Networks of the look-up table: small multilayer perceptrons in double precision, as trained.

    h_0 = x,   h_i = tanh(W_i h_{i−1} + b_i),   y = W h + b + A x

K members are evaluated side by side; their mean is the answer. Inputs are shifted and scaled first. A scale
larger than the spread says that the output changes slowly along this input; the first weights are then small.
This is prior knowledge of the problem, and training gains much from it (docs/explanation/lookup.md).

Compiled loops evaluate blocks of robots; `surrogate.training.networks` trains.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from common.arrays import Floats
from sim.jit import compiled_fast
from sim.linear.lane_arrays import copy

BLOCK = 64  # robots that are evaluated together
SHARED = ("shift", "scale", "mean", "spread")  # what the members have in common


class Layers(NamedTuple):
    """An ensemble for the loops: scale, mean and spread are in the weights; numbers of outputs are even."""

    shift: Floats  # (F,)
    first: Floats  # (K, W, F)
    hidden: Floats  # (K, D − 1, W, W)
    last: Floats  # (K, O, W + F), of the last hidden layer and of the inputs
    biases: Floats  # (K, D, W)
    rest: Floats  # (K, O)


@dataclass(frozen=True)
class Ensemble:
    """K perceptrons, each plus a linear map; inputs (M, F), outputs (M, O)."""

    weights: tuple[Floats, ...]  # of the layers, (K, I, O)
    biases: tuple[Floats, ...]  # of the layers, (K, 1, O)
    bypass: Floats  # (K, F, O)
    shift: Floats  # (F,)
    scale: Floats  # (F,)
    mean: Floats  # (O,)
    spread: Floats  # (O,)

    @staticmethod
    def from_state(state: Mapping[str, Floats]) -> Ensemble:
        """Return the network of arrays by name, see `state_shapes`."""
        depth = sum(name.startswith("weights.") for name in state)
        layers = {kind: tuple(state[f"{kind}.{k}"] for k in range(depth)) for kind in ("weights", "biases")}
        return Ensemble(**layers, **{name: state[name] for name in ("bypass", *SHARED)})  # type: ignore[arg-type]

    @property
    def state(self) -> dict[str, Floats]:
        """All arrays by name."""
        layers = {f"weights.{k}": weight for k, weight in enumerate(self.weights)}
        layers |= {f"biases.{k}": bias for k, bias in enumerate(self.biases)}
        return {**layers, "bypass": self.bypass, **{name: getattr(self, name) for name in SHARED}}

    @property
    def shape(self) -> dict[str, int]:
        """Numbers of inputs, outputs and members; width and number of the hidden layers."""
        members, inputs, outputs = self.bypass.shape
        width, depth = self.weights[0].shape[2], len(self.weights) - 1
        return {"inputs": inputs, "outputs": outputs, "width": width, "depth": depth, "members": members}

    def member(self, k: int) -> Ensemble:
        """Return the network of member k alone."""
        state = self.state
        return Ensemble.from_state({n: part if n in SHARED else part[k : k + 1] for n, part in state.items()})

    def members_at(self, inputs: Floats) -> Floats:
        """Return outputs of every member, (K, M, O)."""
        return np.stack([self.member(k)(inputs) for k in range(self.shape["members"])])

    def __call__(self, inputs: Floats) -> Floats:
        """Return the mean of the members, (M, O)."""
        y = evaluate_all(self.layers, np.ascontiguousarray(inputs, dtype=float))
        return y[:, : self.shape["outputs"]]

    @cached_property
    def layers(self) -> Layers:
        """The same numbers for the compiled loops."""

        def turned(weight: Floats) -> Floats:
            """Return (K, O, I) for an even number of outputs."""
            return np.ascontiguousarray(_even(weight).swapaxes(1, 2))

        share, last = self.spread / self.shape["members"], len(self.weights) - 1
        bypass = self.bypass / self.scale[:, None] * share
        first = self.weights[0] / self.scale[:, None]
        rest = self.biases[last][:, 0] * share + self.mean / self.shape["members"]
        inner = [turned(_even(weight.swapaxes(1, 2)).swapaxes(1, 2)) for weight in self.weights[1:last]]
        out = _even((self.weights[last] * share).swapaxes(1, 2)).swapaxes(1, 2)
        none = np.empty((len(first), 0, *2 * [turned(first).shape[1]]))
        return Layers(
            np.ascontiguousarray(self.shift),
            turned(first),
            np.ascontiguousarray(np.stack(inner, 1)) if inner else none,
            turned(np.concatenate([out, bypass], 1)),
            np.ascontiguousarray(np.stack([_even(bias)[:, 0] for bias in self.biases[:last]], 1)),
            np.ascontiguousarray(_even(rest)),
        )


def _even(array: Floats) -> Floats:
    """Return an array with an even last axis, zeros added."""
    odd = array.shape[-1] % 2
    return np.pad(array, [(0, 0)] * (array.ndim - 1) + [(0, odd)])


def state_shapes(*, inputs: int, outputs: int, width: int, depth: int, members: int) -> dict[str, tuple[int, ...]]:
    """Return the shape of every array in the state of a network."""
    pairs = list(pairwise([inputs, *[width] * depth, outputs]))
    return {
        **{f"weights.{k}": (members, i, o) for k, (i, o) in enumerate(pairs)},
        **{f"biases.{k}": (members, 1, o) for k, (_, o) in enumerate(pairs)},
        "bypass": (members, inputs, outputs),
        "shift": (inputs,),
        "scale": (inputs,),
        "mean": (outputs,),
        "spread": (outputs,),
    }


@compiled_fast
def tanh(x: float) -> float:
    """Return tanh x within 1e-15: p/q, the Padé approximant at x/4, whose argument is doubled twice.

    That of the C library takes one number at a time. Here loops over arrays become vector instructions.
    """
    a = min(max(x, -20.0), 20.0) / 4
    s = a * a
    p = a * (34459425 + s * (4729725 + s * (135135 + s * (990 + s))))
    q = 34459425 + s * (16216200 + s * (945945 + s * (13860 + 45 * s)))
    for _ in range(2):
        p, q = 2 * p * q, q * q + p * p
    return p / q


@compiled_fast
def product(w: Floats, bias: Floats, x: Floats, y: Floats, triangular: bool) -> None:
    """Write W x + bias of robots x (M, F) to y (M, O), for an even O; entries above the diagonal may be left out.

    Four robots at a time share the weights, so that the processor reads fewer numbers than it multiplies.
    """
    count, outputs, inputs = len(x), len(w), w.shape[1]
    whole = count - count % 4
    for k in range(0, whole, 4):
        p, q, r, s = x[k], x[k + 1], x[k + 2], x[k + 3]
        for j in range(0, outputs, 2):
            u, v, stop = w[j], w[j + 1], min(j + 2, inputs) if triangular else inputs
            a0, b0 = bias[j], bias[j + 1]
            a1, a2, a3, b1, b2, b3 = a0, a0, a0, b0, b0, b0
            for i in range(stop):
                a0 += u[i] * p[i]
                a1 += u[i] * q[i]
                a2 += u[i] * r[i]
                a3 += u[i] * s[i]
                b0 += v[i] * p[i]
                b1 += v[i] * q[i]
                b2 += v[i] * r[i]
                b3 += v[i] * s[i]
            y[k, j], y[k + 1, j], y[k + 2, j], y[k + 3, j] = a0, a1, a2, a3
            y[k, j + 1], y[k + 1, j + 1], y[k + 2, j + 1], y[k + 3, j + 1] = b0, b1, b2, b3
    for k in range(whole, count):
        p = x[k]
        for j in range(outputs):
            u, total, stop = w[j], bias[j], min(j + 1, inputs) if triangular else inputs
            for i in range(stop):
                total += u[i] * p[i]
            y[k, j] = total


@compiled_fast
def evaluate(layers: Layers, x: Floats, y: Floats) -> None:
    """Write the mean of the members at inputs x (M, F) to y (M, O)."""
    count, inputs, width = len(x), x.shape[1], layers.first.shape[1]
    members, depth = layers.biases.shape[:2]
    hidden, following = np.empty((count, width + inputs)), np.empty((count, width + inputs))
    own = np.empty_like(y)
    shifted = x - layers.shift  # here, since a scale may be small: an input that was learned with one value
    for row in range(count):
        copy(hidden[row, width:], shifted[row])
        copy(following[row, width:], shifted[row])
    y[:] = 0.0
    for k in range(members):
        product(layers.first[k], layers.biases[k, 0], shifted, hidden, False)
        for i in range(depth):
            for row in range(count):
                for j in range(width):
                    hidden[row, j] = tanh(hidden[row, j])
            if i + 1 < depth:
                product(layers.hidden[k, i], layers.biases[k, i + 1], hidden, following, False)
                hidden, following = following, hidden
        product(layers.last[k], layers.rest[k], hidden, own, False)
        for row in range(count):
            for j in range(y.shape[1]):
                y[row, j] += own[row, j]


@compiled_fast
def evaluate_all(layers: Layers, x: Floats) -> Floats:
    """Return the mean of the members, (M, O) with the padding, at inputs x (M, F)."""
    y = np.empty((len(x), layers.rest.shape[1]))
    for begin in range(0, len(x), BLOCK):
        evaluate(layers, x[begin : begin + BLOCK], y[begin : begin + BLOCK])
    return y
