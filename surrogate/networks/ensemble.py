"""Networks of the look-up table: small multilayer perceptrons in double precision, as trained.

    h_0 = x,   h_i = tanh(W_i h_{i−1} + b_i),   y = W h + b + A x

K members are evaluated side by side; their mean is the answer. Inputs are shifted and scaled first. A scale
larger than the spread says that the output changes slowly along this input; the first weights are then small.
This is prior knowledge of the problem, and training gains much from it (docs/explanation/lookup.md).

`surrogate.networks.loops` evaluates, `surrogate.networks.training_loop` trains.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from sim.arrays import Floats

if TYPE_CHECKING:
    from surrogate.networks.loops import Layers

SHARED = ("shift", "scale", "mean", "spread")  # what the members have in common


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
        from surrogate.networks.loops import evaluate_all

        y: Floats = evaluate_all(*self.layers, np.ascontiguousarray(inputs, dtype=float))
        return y[:, : self.shape["outputs"]]

    @cached_property
    def layers(self) -> Layers:
        """The same numbers for the compiled loops."""
        from surrogate.networks.loops import Layers

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
