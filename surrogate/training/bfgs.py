"""Minimise a smooth function of some thousand numbers: the BFGS method with its whole matrix, self-scaled.

L-BFGS keeps the last steps only. On the loss of a look-up table it then needs many times as many iterations: the
matrix of all steps knows the narrow valleys of this loss. The matrix is symmetric, so half of its n² numbers are
kept (0.35 GB for n = 9,000), in strips that fit into a processor's cache. An iteration reads and writes each strip
once.

Where the curvature along a step is smaller than the matrix says, the matrix is scaled before it is updated.
Source: Oren and Luenberger (1974); Al-Baali (1998); for networks Urbán, Stefanou and Pons (2025). The line search
is scipy's, for the strong Wolfe conditions; where it finds no step, steps are halved until the value falls enough.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch
from scipy.optimize import line_search
from torch import Tensor

from common.arrays import Floats

ValueAndGradient = Callable[[Tensor], tuple[float, Tensor]]
_CURVATURE = 0.9  # of the Wolfe conditions
_DECREASE = 1e-4  # of the slope: what counts as a step
_SEARCHES = 15  # trial steps of a line search
_HALVINGS = 40  # of a step, where there is none for the Wolfe conditions
_STATE = ("x", "value", "gradient", "_direction")
_STRIP = 64  # rows


class SymmetricMatrix:
    """A symmetric matrix (n, n), in strips up to the diagonal; an update waits for the next product."""

    def __init__(self, count: int, size: float, like: Tensor):
        height = _STRIP if like.device.type == "cpu" else count
        ends = [(first, min(first + height, count)) for first in range(0, count, height)]
        self.strips = [like.new_zeros(last - first, last) for first, last in ends]
        for strip in self.strips:
            strip.diagonal(strip.shape[1] - len(strip)).fill_(size)
        self._waiting: tuple[float, Tensor, Tensor] | None = None

    def update(self, scale: float, a: Tensor, b: Tensor) -> None:
        """Make it `scale` times itself plus a bᵀ + b aᵀ, each (n,)."""
        assert self._waiting is None
        self._waiting = scale, torch.stack([a, b], 1), torch.stack([b, a])

    def times(self, vector: Tensor) -> Tensor:
        """Compute the product with a vector (n,)."""
        result, waiting = torch.zeros_like(vector), self._waiting
        for strip in self.strips:
            last = strip.shape[1]
            first = last - len(strip)
            if waiting:
                scale, columns, rows = waiting
                strip.addmm_(columns[first:last], rows[:, :last], beta=scale)
            result[first:last].addmv_(strip, vector[:last])
            if first:
                result[:first].addmv_(strip[:, :first].T, vector[first:last])
        self._waiting = None
        return result

    def state_dict(self) -> dict[str, Any]:
        """Return all that it depends on."""
        return {"strips": self.strips, "waiting": self._waiting}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Resume from a state of a matrix of the same size."""
        for mine, other in zip(self.strips, state["strips"], strict=True):
            mine.copy_(other)
        waiting, device = state["waiting"], self.strips[0].device
        self._waiting = waiting and (waiting[0], *(part.to(device) for part in waiting[1:]))


class Minimiser:
    """The state of a minimisation: the point `x` (n,), its value and the inverse Hessian, as estimated so far."""

    def __init__(self, function: ValueAndGradient, x: Tensor):
        self.function = function
        self.x = x
        self.value, self.gradient = function(x)
        self._matrix: SymmetricMatrix | None = None  # None: steepest descent
        self._direction = _downhill(self.gradient)

    def state_dict(self) -> dict[str, Any]:
        """Return all that the next step depends on."""
        matrix = self._matrix and self._matrix.state_dict()
        return {**{name: getattr(self, name) for name in _STATE}, "matrix": matrix}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Resume from a state of the same function."""
        for name in _STATE:
            value = state[name]
            setattr(self, name, value.to(self.x.device) if isinstance(value, Tensor) else value)
        self._matrix = None
        if state["matrix"]:
            self._matrix = SymmetricMatrix(len(self.x), 1.0, self.x)
            self._matrix.load_state_dict(state["matrix"])

    def step(self) -> bool:
        """Perform one iteration; return False where no step along the gradient makes the value smaller."""
        line = self._search()
        if line is None and self._matrix is not None:
            self._forget()
            line = self._search()
        if line is None:
            return False
        length, value, gradient = line
        self._update(length * self._direction, gradient, length)
        self.value, self.gradient = value, gradient
        return True

    def _search(self) -> tuple[float, float, Tensor] | None:
        """Return the step length, value and gradient there; None where there is none."""
        if not float(self.gradient @ self._direction) < 0:
            return None
        tried: dict[bytes, tuple[float, Tensor]] = {}

        def at(point: Floats) -> tuple[float, Tensor]:
            key = point.tobytes()
            if key not in tried:
                # A copy, since it is aligned: the last digits of matrix products depend on that.
                tried[key] = self.function(torch.tensor(point, device=self.x.device))
            return tried[key]

        def value(point: Floats) -> float:
            return at(point)[0]

        def gradient(point: Floats) -> Floats:
            return np.asarray(at(point)[1].cpu().numpy())

        start, direction, slope = (part.cpu().numpy() for part in (self.x, self._direction, self.gradient))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # no step found: said by the answer
            length = line_search(
                value, gradient, start, direction, slope, self.value, c2=_CURVATURE, maxiter=_SEARCHES
            )[0]
        # scipy's search gives up after ten interpolations; a loss with narrow valleys may need steps of 1e-6
        halved = (0.5**k for k in range(_HALVINGS)) if length is None else (length,)
        for length in halved:
            now, slopes = at(start + length * direction)
            if now <= self.value + _DECREASE * length * (slope @ direction):
                return float(length), now, slopes
        return None

    def _forget(self) -> None:
        self._matrix = None
        self._direction = _downhill(self.gradient)

    def _update(self, step: Tensor, gradient: Tensor, length: float) -> None:
        """Update the matrix after a step, and the next direction."""
        self.x = self.x + step
        change = gradient - self.gradient
        curvature = float(step @ change)
        if not curvature > 0:  # a halved step: it says nothing of the matrix
            self._direction = _downhill(gradient) if self._matrix is None else -self._matrix.times(gradient)
            return
        if self._matrix is None:
            size = curvature / float(change @ change)
            self._matrix = SymmetricMatrix(len(step), size, step)
            moved, expected = size * gradient, curvature
            carried = size * change
        else:
            moved = self._matrix.times(gradient)
            carried = moved + self._direction  # the matrix times `change`
            expected = -length * float(step @ self.gradient)  # curvature of the matrix along the step
        scale = max(expected / curvature, 1.0)
        outer = -scale / curvature * carried
        outer += 0.5 * (scale * float(change @ carried) / curvature + 1) / curvature * step
        self._matrix.update(scale, step, outer)
        self._direction = -(scale * moved + step * (outer @ gradient) + outer * (step @ gradient))


def _downhill(gradient: Tensor) -> Tensor:
    """Return the direction of steepest descent, a first step long."""
    return -gradient / gradient.abs().sum().clamp(min=1e-300)
