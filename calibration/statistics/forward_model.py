"""What a calibration needs of its subject: runs, parameters, and a forward model.

Nothing in this file or in fit, noise, misfit, attribute and loop is about robots. The swimmer
(`calibration.swimmer.swimmer`) is one model; a sphere that settles in a vessel is another one
(`calibration/examples/spheres.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from sim.arrays import Flags, Floats, Integers

if TYPE_CHECKING:
    from calibration.statistics.fit import Fit

Parameters = Mapping[str, float]

_LOG_STEP, _STEP = 0.01, 0.02  # finite-difference steps: in ln C, in units of a typical size
_LARGEST = 100.0  # change of ln C, so that C stays a number


@dataclass(frozen=True)
class Parameter:
    """A number to fit: a coefficient, a number as given, or the size of an effect, which the model may lack."""

    name: str
    title: str
    start: float  # the value as given; for an effect its null
    bounds: tuple[float, float]
    typical: float  # a typical size; it sets the finite-difference step
    logarithmic: bool = False  # fitted as its logarithm
    unit: str = "1"
    sigma: float | None = None  # of a number as given: one standard deviation on its own scale; None: free
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
    set_aside: tuple[str, ...]  # "row 7: …"
    limits: tuple[str, ...]  # what these runs cannot show, in words

    def __len__(self) -> int:
        return len(self.y)

    def subset(self, rows: Flags | Integers) -> Any:
        """The runs in `rows`: flags (n,), or places."""
        own: dict[str, Any] = {k: v[rows] for k, v in vars(self).items() if isinstance(v, np.ndarray)}
        return replace(self, **own)


@dataclass(frozen=True)
class Predictive:
    """A model that predicts runs that no effect explains."""

    prediction: Floats  # (n, k)
    terms: tuple[str, ...]  # that it depends on, in words
    content: Any  # what is handed on


class Model(Protocol):
    """A forward model of some runs."""

    @property
    def runs(self) -> Runs: ...

    @property
    def coefficients(self) -> tuple[Parameter, ...]:
        """Always fitted."""
        ...

    @property
    def given(self) -> tuple[Parameter, ...]:
        """Numbers as given that are not exact: always fitted, with their priors."""
        ...

    @property
    def effects(self) -> tuple[Parameter, ...]:
        """What the model may lack and these runs can test."""
        ...

    @property
    def untestable(self) -> Mapping[str, str]:
        """Effects that these runs cannot test: title -> what is missing."""
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

    def check(self, prediction: Floats) -> None:
        """Refuse runs that cannot have the units that they name; (n, k): prediction of the model as given.

        Raises:
            InputError: a column is wrong by a factor that is not possible.
        """
        ...

    def possible(self) -> tuple[Model, list[dict[str, Any]]]:
        """A model of runs that can be made next, and their settings."""
        ...

    def predictive(self, base: Fit, used: Flags, rows: Flags, test: Flags) -> Predictive | None:
        """The best predictive model where no effect explains the runs, if there is one that goes beyond them.

        Args:
            base: the calibrated model.
            used, rows, test: (n,) runs to learn from, to learn from in the end, and to state the error on.
        """
        ...

    def guess(self, start: dict[str, float], used: Flags) -> dict[str, float]:
        """A better start for the coefficients, from the runs in `used` (n,), if there is a cheap one."""
        ...


def start_values(model: Model) -> dict[str, float]:
    """Every parameter as given: effects at their null."""
    return {p.name: p.start for p in _every(model)}


def parameter(model: Model, name: str) -> Parameter:
    """The coefficient, number or effect called `name`."""
    return next(p for p in _every(model) if p.name == name)


def _every(model: Model) -> tuple[Parameter, ...]:
    seconds = (e.second for e in model.effects if e.second)
    return (*model.coefficients, *model.given, *model.effects, *seconds)


def moved(one: Parameter, value: float, by: float) -> float:
    """`value` changed by `by`, on the parameter's own scale, within its bounds."""
    new = value * float(np.exp(min(by, _LARGEST))) if one.logarithmic else value + by
    return max(one.bounds[0], min(one.bounds[1], new))


def stepped(fitted: Sequence[Parameter], parameters: Parameters, step: Floats) -> dict[str, float]:
    """`parameters` with those of `fitted` (p,) changed by `step` (p,), see `moved`."""
    changes = zip(fitted, step.tolist(), strict=True)
    return {**parameters, **{one.name: moved(one, parameters[one.name], by) for one, by in changes}}


def by_differences(
    model: Model, parameters: Parameters, names: Sequence[str], *, title: str = ""
) -> tuple[Floats, Floats]:
    """`Model.derivatives` by finite differences; all changed models are computed together."""
    sets, widths = [dict(parameters)], []
    for name in names:
        one = parameter(model, name)
        width = _LOG_STEP if one.logarithmic else _STEP * abs(one.typical)
        if moved(one, parameters[name], 2 * width) == one.bounds[1]:  # downwards where the bound is near
            width = -width
        sets.append({**parameters, name: moved(one, parameters[name], width)})
        widths.append(width)
    found = model.predict(sets, title=title)
    return found[0], np.moveaxis((found[1:] - found[0]) / np.array(widths)[:, None, None], 0, -1)
