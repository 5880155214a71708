"""A model in which a parameter differs in some runs, from the other runs or about its mean.

With x_s the shift s of a parameter p, and 1_s the runs in which it is at work,

    p_i = p + Σ_s x_s 1_s(i),     or     p_i = p exp(Σ_s x_s 1_s(i))

on the parameter's own scale. So ∂f/∂x_s = ∂f/∂p in the runs of s and 0 in the others, without a simulation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from calibration.statistics.statistical_model import Experiment, Parameter, Parameters, Runs
from common.arrays import Flags, Floats

_LARGEST = 2.0  # change of a logarithm without a prior


@dataclass(frozen=True)
class Shift:
    """A parameter that differs in some runs."""

    of: Parameter  # with the scale on which it differs
    rows: Flags  # (n,)
    where: str  # in words, as in "in session day3" or "of ball 2"
    sigma: float | None = None  # of its prior; None: free

    @property
    def parameter(self) -> Parameter:
        """The shift as a parameter, on its scale."""
        typical = 0.1 if self.of.logarithmic else self.of.sigma or self.of.typical
        end = math.inf if self.sigma else _LARGEST if self.of.logarithmic else 100 * typical
        name, title = f"{self.of.name} {self.where}", f"{self.of.title} {self.where}"
        return Parameter(name, title, 0.0, (-end, end), typical, sigma=self.sigma)


@dataclass(frozen=True)
class Shifted:
    """A model with shifts; an effect that shifts has the scale of its shift."""

    inner: Experiment
    shifts: tuple[Shift, ...]

    @property
    def runs(self) -> Runs:
        return self.inner.runs

    @cached_property
    def coefficients(self) -> tuple[Parameter, ...]:
        return (*self.inner.coefficients, *(s.parameter for s in self.shifts if s.sigma is None))

    @cached_property
    def nuisances(self) -> tuple[Parameter, ...]:
        return (*self.inner.nuisances, *(s.parameter for s in self.shifts if s.sigma is not None))

    @cached_property
    def effects(self) -> tuple[Parameter, ...]:
        shifted = {s.of.name: s.of for s in self.shifts}
        return tuple(shifted.get(effect.name, effect) for effect in self.inner.effects)

    @property
    def untestable(self) -> Mapping[str, str]:
        return self.inner.untestable

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Predict (P, n, k), see `ForwardModel`."""
        return self.inner.predict([self.of_runs(p) for p in sets], title=title)

    def derivatives(
        self, parameters: Parameters, names: Sequence[str], *, title: str = "", quick: bool = False
    ) -> tuple[Floats, Floats]:
        """Compute the prediction and the derivatives, see `ForwardModel`."""
        own, at = {s.parameter.name: s for s in self.shifts}, self.of_runs(parameters)
        inner = list(dict.fromkeys([own[n].of.name if n in own else n for n in names]))
        seen, table = self.inner.derivatives(at, inner, title=title, quick=quick)
        slopes = {name: table[..., i] for i, name in enumerate(inner)}
        linear = {p.name for p in self.inner.effects if not p.logarithmic}
        for name in {s.of.name for s in self.shifts if s.of.logarithmic and s.of.name in linear & set(inner)}:
            slopes[name] = slopes[name] * np.reshape(at[name], (-1, 1))
        slopes |= {n: slopes[own[n].of.name] * own[n].rows[:, None] for n in names if n in own}
        return seen, np.stack([slopes[name] for name in names], -1) if names else np.empty((*seen.shape, 0))

    def of_runs(self, parameters: Parameters) -> dict[str, Any]:
        """Return the parameters of the model within, with what shifts for every run, (n,)."""
        inner = {**parameters}
        shifts: dict[str, tuple[Parameter, Floats]] = {}
        for s in self.shifts:
            change = inner.pop(s.parameter.name) * s.rows
            shifts[s.of.name] = s.of, change + (shifts[s.of.name][1] if s.of.name in shifts else 0.0)
        for name, (of, change) in shifts.items():
            value = inner[name] * np.exp(change) if of.logarithmic else inner[name] + change
            inner[name] = np.clip(value, *of.bounds)
        return inner

    def check(self, prediction: Floats) -> None:
        """Refuse measurements as the model within does."""
        self.inner.check(prediction)

    def guess(self, start: dict[str, float], used: Flags) -> dict[str, float]:
        """Return the start as it is: it comes from a fit."""
        return start

    def possible(self) -> tuple[Shifted, list[dict[str, Any]]]:
        """Return runs that can be made next, in none of which anything shifts."""
        model, settings = self.inner.possible()
        none = np.zeros(len(model.runs), dtype=bool)
        return Shifted(model, tuple(replace(s, rows=none) for s in self.shifts)), settings  # type: ignore[arg-type]
