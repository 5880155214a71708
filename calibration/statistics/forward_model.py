"""The forward model of a calibration: its runs, its parameters, and its predictions with their derivatives.

Nothing in this room knows robots. The swimmer (`calibration.swimmer.swimmer`) is one model; a sphere that settles
in a vessel is another one (`calibration/examples/spheres.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from sim.arrays import Flags, Floats, Integers

Parameters = Mapping[str, float]

_LOG_STEP, _STEP = 0.01, 0.02  # finite-difference steps: in ln C, in units of a typical size
_LARGEST = 100.0  # change of ln C, so that C stays a number


@dataclass(frozen=True)
class Parameter:
    """A number to fit: a coefficient, a nuisance parameter, or the size of an effect, which the model may lack."""

    name: str
    title: str
    start: float  # the value as given; for an effect its null
    bounds: tuple[float, float]
    typical: float  # a typical size; it sets the finite-difference step
    logarithmic: bool = False  # fitted as its logarithm
    unit: str = "1"
    sigma: float | None = None  # of a nuisance parameter's prior, on its own scale; None: free
    plausible: tuple[float, float] | None = None  # sizes of an effect that its source allows; None: all
    shown: float = 1.0  # factor to the unit in which a change is shown
    second: Parameter | None = None  # of an effect: its second number, which shows only with the effect
    grid: tuple[float, ...] = ()  # of a second number: values at which the effect is looked for


@dataclass(frozen=True)
class Runs:
    """Measured runs, ready to be compared: n runs of k outputs."""

    outputs: tuple[str, ...]
    y: Floats  # (n, k), scaled so that errors are relative
    condition: Integers  # (n,) repeats share a number
    session: Integers  # (n,) 0, 1, …: runs made together
    session_names: tuple[str, ...]
    inputs: Floats  # (n, q) what was set or noted, scaled (some by logarithm)
    input_names: tuple[str, ...]
    rows: Integers  # (n,) numbers in the table, from 1
    excluded: tuple[str, ...]  # "row 7: …"
    caveats: tuple[str, ...]  # what these runs cannot show, in words

    def __len__(self) -> int:
        return len(self.y)

    def subset(self, rows: Flags | Integers) -> Any:
        """The runs in `rows`: flags (n,), or places."""
        arrays: dict[str, Any] = {k: v[rows] for k, v in vars(self).items() if isinstance(v, np.ndarray)}
        return replace(self, **arrays)


class ForwardModel(Protocol):
    """A model that predicts some runs from its parameters."""

    @property
    def runs(self) -> Runs: ...

    @property
    def coefficients(self) -> tuple[Parameter, ...]:
        """Always fitted, without a prior."""
        ...

    @property
    def nuisances(self) -> tuple[Parameter, ...]:
        """Nuisance parameters: numbers that were given with a tolerance; always fitted, with their priors."""
        ...

    @property
    def effects(self) -> tuple[Parameter, ...]:
        """What the model may lack and these runs can test."""
        ...

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Predictions (P, n, k) for P parameter sets, each with every coefficient and effect."""
        ...

    def derivatives(
        self, parameters: Parameters, names: Sequence[str], *, title: str = "", quick: bool = False
    ) -> tuple[Floats, Floats]:
        """Prediction (n, k) and its derivatives (n, k, p) on the scales of the parameters `names`.

        With `quick` they may be NaN where they would take long.
        """
        ...


def start_values(model: ForwardModel) -> dict[str, float]:
    """Return every parameter as given: effects at their null."""
    return {p.name: p.start for p in _every(model)}


def parameter(model: ForwardModel, name: str) -> Parameter:
    """Find the coefficient, nuisance parameter or effect called `name`."""
    return next(p for p in _every(model) if p.name == name)


def _every(model: ForwardModel) -> tuple[Parameter, ...]:
    seconds = (e.second for e in model.effects if e.second)
    return (*model.coefficients, *model.nuisances, *model.effects, *seconds)


def moved(changed: Parameter, value: float, by: float) -> float:
    """Change `value` by `by`, on the parameter's own scale, within its bounds."""
    new = value * float(np.exp(min(by, _LARGEST))) if changed.logarithmic else value + by
    return max(changed.bounds[0], min(changed.bounds[1], new))


def stepped(fitted: Sequence[Parameter], parameters: Parameters, step: Floats) -> dict[str, float]:
    """Change those `parameters` that are in `fitted` (p,) by `step` (p,), see `moved`."""
    changes = zip(fitted, step.tolist(), strict=True)
    return {**parameters, **{p.name: moved(p, parameters[p.name], by) for p, by in changes}}


def by_differences(
    model: ForwardModel, parameters: Parameters, names: Sequence[str], *, title: str = ""
) -> tuple[Floats, Floats]:
    """Compute `ForwardModel.derivatives` by finite differences; all changed models are computed together."""
    sets, widths = [dict(parameters)], []
    for name in names:
        changed = parameter(model, name)
        width = _LOG_STEP if changed.logarithmic else _STEP * abs(changed.typical)
        if moved(changed, parameters[name], 2 * width) == changed.bounds[1]:  # downwards where the bound is near
            width = -width
        sets.append({**parameters, name: moved(changed, parameters[name], width)})
        widths.append(width)
    predictions = model.predict(sets, title=title)
    slopes = (predictions[1:] - predictions[0]) / np.array(widths)[:, None, None]
    return predictions[0], np.moveaxis(slopes, 0, -1)
