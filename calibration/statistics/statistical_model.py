"""The statistical model of a table: a forward model of its runs, with parameters and priors, and the noise.

**Forward model.** Nothing in this room knows robots. The swimmer (`calibration.swimmer.swimmer`) is one forward
model; a function of one's own is another one (`calibration.own_model`).

Runs are those of `calibration.table.runs`; their noise, weights and priors those of `calibration.linear.gls`.

**Noise.** S comes from repeats, or is declared. Without both it is unknown: then a guess weighs the outputs
against each other, and no p-value means anything.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeVar

import numpy as np

from calibration.linear.gls import Regression
from calibration.table.runs import Runs
from common.arrays import Flags, Floats, Integers

Value = float | Floats  # one number, or one for each run (n,)
Parameters = Mapping[str, Any]  # name -> Value
Predict = Callable[[Sequence[Parameters]], Floats]  # see `ForwardModel.predict`

_LARGEST = 100.0  # change of ln C, so that C stays a number


@dataclass(frozen=True)
class Parameter:
    """A number to fit: a coefficient, a nuisance parameter, or the size of an effect, which the model may lack."""

    name: str  # in code and files
    title: str  # in words
    start: float  # the value as given; for an effect its null
    bounds: tuple[float, float]  # least and largest value
    typical: float  # a typical size; it sets the finite-difference step
    logarithmic: bool = False  # fitted as its logarithm
    unit: str = "1"  # in which it is shown
    sigma: float | None = None  # of a nuisance parameter's prior, on its own scale; None: free
    plausible: tuple[float, float] | None = None  # sizes of an effect that its source allows; None: all. Of a
    # number: by how much it may differ in some runs
    shown: float = 1.0  # factor to that unit
    theory: float | None = None  # size of an effect that theory gives
    second: Parameter | None = None  # of an effect: its second number, which shows only with the effect
    # Of a second number: values at which the effect is looked for. Of one that may differ in some runs: changes
    # from which it is fitted.
    grid: tuple[float, ...] = ()
    of_these_runs: bool = False  # no run that is made next has it
    of_group: tuple[str, str] | None = None  # the number, and the group that has one of its own

    def changed(self, value: Any, by: Any) -> Any:
        """Change a value by `by`, on the parameter's own scale."""
        return value * np.exp(np.minimum(by, _LARGEST)) if self.logarithmic else value + by

    def moved(self, value: Any, by: Any) -> Any:
        """Change a value by `by`, on the parameter's own scale, within its bounds."""
        within = np.clip(self.changed(value, by), *self.bounds)
        return within if np.ndim(within) else float(within)

    def change(self, before: Any, value: Any) -> Any:
        """Return how far a value is from another one, on the parameter's own scale."""
        return np.log(value / before) if self.logarithmic else value - before

    def offset(self, value: float) -> float:
        """Return how far a value is from that as given, on the parameter's own scale."""
        return float(self.change(self.start, value))

    @property
    def words(self) -> str:
        """The number in words, and as one types it."""
        return f"{self.title} ({self.name})"


class ForwardModel(Protocol):
    """A model that predicts some runs from its parameters."""

    @property
    def runs(self) -> Runs: ...

    @property
    def coefficients(self) -> tuple[Parameter, ...]:
        """Always fitted, mostly without a prior."""
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
        """Predict (P, n, k) for P parameter sets, each with every coefficient and effect."""
        ...

    def linearised(
        self, at: Parameters, along: Sequence[Parameter], *, title: str = "", quick: bool = False
    ) -> Predict:
        """Return a cheap `predict` that agrees with this one, near `at`, to first order in the parameters `along`.

        It knows no bounds. With `quick` it may be NaN where it would take long; `along` may be empty.
        """
        ...


class Experiment(ForwardModel, Protocol):
    """A forward model of runs that were made somewhere, and can be made again."""

    @property
    def untestable(self) -> Mapping[str, str]:
        """Effects that these runs cannot test: title -> what is missing."""
        ...

    def check(self, prediction: Floats) -> None:
        """Refuse measurements in wrong units, by the prediction (n, k) of the model as given."""
        ...

    def guess(self, start: dict[str, float], used: Flags) -> dict[str, float]:
        """Find a better start for the coefficients, from the runs in `used` (n,), if there is a cheap one."""
        ...

    def possible(self) -> tuple[ForwardModel, list[dict[str, Any]]]:
        """Return a model of runs that can be made next, and their settings, the cheapest first.

        The rows of one setting share a condition, by its place. They may be NaN where they cannot be simulated.
        """
        ...


@dataclass(frozen=True)
class Wrapped:
    """A model around another one; what it does not change is that of the model within."""

    inner: Experiment

    @property
    def runs(self) -> Runs:
        return self.inner.runs

    @property
    def nuisances(self) -> tuple[Parameter, ...]:
        return self.inner.nuisances

    @property
    def effects(self) -> tuple[Parameter, ...]:
        return self.inner.effects

    @property
    def untestable(self) -> Mapping[str, str]:
        return self.inner.untestable

    @property
    def rough(self) -> Wrapped | None:
        """The same model around the rough one of the model within, if there is one."""
        rough = getattr(self.inner, "rough", None)
        return None if rough is None else replace(self, inner=rough)

    def check(self, prediction: Floats) -> None:
        """Refuse measurements as the model within does."""
        self.inner.check(prediction)


Model = TypeVar("Model", bound=ForwardModel)


def start_values(model: ForwardModel) -> dict[str, float]:
    """Return every parameter as given: effects at their null."""
    return {p.name: p.start for p in _every(model)}


def parameter(model: ForwardModel, name: str) -> Parameter:
    """Find the coefficient, nuisance parameter or effect called `name`."""
    return next(p for p in _every(model) if p.name == name)


def _every(model: ForwardModel) -> tuple[Parameter, ...]:
    seconds = (e.second for e in model.effects if e.second)
    return (*model.coefficients, *model.nuisances, *model.effects, *seconds)


def with_runs(model: Model, **changes: Any) -> Model:
    """Return the same model with something else in its runs."""
    changed, inner = copy.copy(model), getattr(model, "inner", None)
    name, new = ("inner", with_runs(inner, **changes)) if inner else ("runs", replace(model.runs, **changes))
    object.__setattr__(changed, name, new)
    return changed


def apply_step(fitted: Sequence[Parameter], parameters: Parameters, step: Floats) -> dict[str, float]:
    """Change those `parameters` that are in `fitted` (p,) by `step` (p,), see `Parameter.moved`."""
    changes = zip(fitted, step.tolist(), strict=True)
    return {**parameters, **{p.name: p.moved(parameters[p.name], by) for p, by in changes}}


def precisions(fitted: Sequence[Parameter]) -> Floats:
    """Return 1/σ² of each parameter, 0 for those that are free, (p,)."""
    return np.array([0.0 if p.sigma is None else p.sigma**-2 for p in fitted])


def prior_offsets(fitted: Sequence[Parameter], parameters: Parameters) -> Floats:
    """Return the change of each parameter from its value as given; 0 for those that are free, (p,)."""
    return np.array([0.0 if p.sigma is None else p.offset(parameters[p.name]) for p in fitted])


def regression(
    runs: Runs,
    rows: Flags,
    columns: Floats,
    fitted: Sequence[Parameter],
    repeated: Integers | Floats | None = None,
) -> Regression:
    """Regress the runs in `rows` (n,) on columns (n, k, m) of all runs, the first those of `fitted`."""
    completion = None if runs.completion is None else runs.completion[rows]
    return Regression(
        columns[rows], precisions(fitted), runs.session[rows], runs.scale[rows], repeated, completion,
        runs.known_covariance, runs.along[rows],
    )  # fmt: skip
