"""Networks of the look-up table: small multilayer perceptrons in double precision, as trained.

    h_0 = x,   h_i = tanh(W_i h_{i−1} + b_i),   y = W h + b + A x

K members are evaluated side by side; their mean is the answer. Inputs are shifted and scaled first. A scale
larger than the spread says that the output changes slowly along this input; the first weights are then small.
This is prior knowledge of the problem, and training gains much from it (docs/explanation/lookup.md).

`surrogate.networks.compiled` evaluates the mean, one robot at a time. Here are all members at once, also for
inputs that carry a derivative (`sim.linear.complex_step`). `surrogate.networks.trainable` trains.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from sim.arrays import Floats
from surrogate.networks.compiled import Packed

SHARED = ("shift", "scale", "mean", "spread")  # what the members have in common


def perceptrons(
    x: Any, weights: Sequence[Any], biases: Sequence[Any], bypass: Any, tanh: Callable[[Any], Any]
) -> Any:
    """Return y of the module's head for every member, (K, M, O), at inputs (K, M, F) or (M, F).

    Args:
        weights, biases: layer by layer, (K, I, O) and (K, 1, O), arrays or tensors.
        bypass: A, (K, F, O).
        tanh: of such arrays or tensors.
    """
    hidden = x
    for weight, bias in zip(weights[:-1], biases[:-1], strict=True):
        hidden = tanh(hidden @ weight + bias)
    return hidden @ weights[-1] + biases[-1] + x @ bypass


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
        x = (inputs - self.shift) / self.scale
        y = perceptrons(x, self.weights, self.biases, self.bypass, _tanh)
        return np.asarray(y * self.spread + self.mean)

    def __call__(self, inputs: Floats) -> Floats:
        """Return the mean of the members, (M, O)."""
        return np.asarray(self.members_at(inputs).mean(0))

    @cached_property
    def packed(self) -> Packed:
        """The same numbers for the compiled loops."""
        shape = self.shape
        parts = [self.shift, self.scale, self.mean, self.spread]
        for k in range(shape["members"]):
            for weight, bias in zip(self.weights, self.biases, strict=True):
                parts += [weight[k].ravel(), bias[k].ravel()]
            parts.append(self.bypass[k].ravel())
        sizes = (0, *(shape[name] for name in ("inputs", "outputs", "width", "depth", "members")))
        return Packed(np.concatenate(parts), np.array(sizes))


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


def _tanh(x: Any) -> Any:
    if np.isrealobj(x):
        return np.tanh(x)
    value = np.tanh(x.real)
    return value + 1j * (1 - value * value) * x.imag
