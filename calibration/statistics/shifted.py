"""A model in which a parameter differs in some runs, from the other runs or about its mean.

With x_s the shift s of a parameter p, and 1_s the runs in which it is at work,

    p_i = p + Σ_s x_s 1_s(i),     or     p_i = p exp(Σ_s x_s 1_s(i))

on the parameter's own scale. The linear model of the model within is enough for it: no shift is simulated.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from calibration.statistics.statistical_model import Parameter, Parameters, Predict, Wrapped, parameter
from common.arrays import Flags, Floats
from common.errors import InputError

_LARGEST = 7.0  # change of a logarithm without a prior


@dataclass(frozen=True)
class Shift:
    """A parameter that differs in some runs."""

    parameter: Parameter  # with the scale on which it differs
    rows: Flags  # (n,)
    where: str  # in words, as in "in session day3" or "of ball 2"
    sigma: float | None = None  # of its prior; None: free

    @property
    def change(self) -> Parameter:
        """The shift as a parameter, on its scale."""
        typical = 0.1 if self.parameter.logarithmic else self.parameter.sigma or self.parameter.typical
        end = math.inf if self.sigma else _LARGEST if self.parameter.logarithmic else 100 * typical
        name, title = f"{self.parameter.name} {self.where}", f"{self.parameter.title} {self.where}"
        return Parameter(name, title, 0.0, (-end, end), typical, sigma=self.sigma, of_these_runs=True)


@dataclass(frozen=True)
class Shifted(Wrapped):
    """A model with shifts; an effect that shifts has the scale of its shift."""

    shifts: tuple[Shift, ...]

    @cached_property
    def coefficients(self) -> tuple[Parameter, ...]:
        return (*self.inner.coefficients, *(s.change for s in self.shifts if s.sigma is None))

    @property
    def nuisances(self) -> tuple[Parameter, ...]:
        return (*self.inner.nuisances, *(s.change for s in self.shifts if s.sigma is not None))

    @property
    def effects(self) -> tuple[Parameter, ...]:
        shifted = {s.parameter.name: s.parameter for s in self.shifts}
        return tuple(shifted.get(effect.name, effect) for effect in self.inner.effects)

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Predict (P, n, k), see `ForwardModel`."""
        with self._arrays_taken():
            return self.inner.predict([self.of_runs(p) for p in sets], title=title)

    def linearised(
        self, at: Parameters, along: Sequence[Parameter], *, title: str = "", quick: bool = False
    ) -> Predict:
        """Return the linear model, see `ForwardModel`."""
        own, centre = {s.change.name: s.parameter.name for s in self.shifts}, self.of_runs(at)
        inner = [parameter(self.inner, name) for name in dict.fromkeys(own.get(p.name, p.name) for p in along)]
        beyond = {of.name: self._unbounded(at)[of.name] - centre[of.name] for of in self._differing}
        with self._arrays_taken():
            predict = self.inner.linearised(centre, inner, title=title, quick=quick)

        def within(parameters: Parameters) -> dict[str, Any]:
            free = self._unbounded(parameters)
            return {**free, **{name: free[name] - excess for name, excess in beyond.items()}}

        return lambda sets: predict([within(parameters) for parameters in sets])

    @contextmanager
    def _arrays_taken(self) -> Iterator[None]:
        """Say so where the model within fails because parameters are arrays."""
        try:
            yield
        except (TypeError, ValueError) as error:
            if isinstance(error, InputError | np.linalg.LinAlgError):
                raise
            names = ", ".join(of.name for of in self._differing)
            raise InputError(
                f"the model fails where {names} differs between runs: its predict must take one value for each "
                f"run, an array (n,), in place of a number ({type(error).__name__}: {error})"
            ) from error

    def of_runs(self, parameters: Parameters) -> dict[str, Any]:
        """Return the parameters of the model within, with what shifts for every run, (n,)."""
        inner = self._unbounded(parameters)
        return {**inner, **{of.name: np.clip(inner[of.name], *of.bounds) for of in self._differing}}

    @property
    def _differing(self) -> list[Parameter]:
        """What shifts."""
        return list({s.parameter.name: s.parameter for s in self.shifts}.values())

    def _unbounded(self, parameters: Parameters) -> dict[str, Any]:
        inner = {**parameters}
        for s in self.shifts:
            inner[s.parameter.name] = s.parameter.changed(
                inner[s.parameter.name], inner.pop(s.change.name) * s.rows
            )
        return inner

    def guess(self, start: dict[str, float], used: Flags) -> dict[str, float]:
        """Return the start as it is: it comes from a fit."""
        return start

    def possible(self) -> tuple[Shifted, list[dict[str, Any]]]:
        """Return runs that can be made next, in none of which anything shifts."""
        model, settings = self.inner.possible()
        none = np.zeros(len(model.runs), dtype=bool)
        return Shifted(model, tuple(replace(s, rows=none) for s in self.shifts)), settings  # type: ignore[arg-type]
