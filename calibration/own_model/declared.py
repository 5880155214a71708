"""What a model of one's own declares: outputs, numbers to fit, and effects that it may lack."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

from calibration.statistics.checks import names_once
from calibration.statistics.statistical_model import Parameter
from common.errors import InputError

Function = Callable[[Mapping[str, Any], Mapping[str, float]], Mapping[str, Any]]  # columns, parameters -> outputs
_WIDE = 1000.0  # factor to the ends of the range of a number for which none is given


@dataclass(frozen=True)
class Output:
    """What was measured, in a column of the same name.

    Example:
        >>> import softflagella as sf
        >>> sf.Output("speed", "m/s").kind
        'ratio'
    """

    title: str  # in words
    unit: str = "1"
    kind: Literal["ratio", "difference"] = "ratio"  # "difference" for angles and for values that change sign
    sigma: float | None = None  # standard deviation of one run, if it is known: relative for a ratio
    unit_checked: bool = False  # a session that reads 10, 60, … times as much as others is right

    def __post_init__(self) -> None:
        if self.kind not in ("ratio", "difference"):
            raise InputError(f"output {self.title!r}: kind {self.kind!r}; give 'ratio' or 'difference'")
        _refuse_negative(f"output {self.title!r}", self.sigma)


@dataclass(frozen=True)
class Number:
    """A number of the model, which is fitted; on a logarithmic scale if it is positive.

    Example:
        >>> import softflagella as sf
        >>> sf.Number("viscosity", 1.0, "Pa s", low=0.01, high=100).parameter.logarithmic
        True
    """

    name: str  # in the function's parameters
    start: float  # the value as given
    unit: str = "1"
    low: float | None = None  # least value; default: a thousandth of the start
    high: float | None = None  # largest value; default: a thousand times the start
    title: str | None = None  # in words; default: the name
    sigma: float | None = None  # of a number that is known to a tolerance: relative if low is above 0

    def __post_init__(self) -> None:
        _refuse_outside(self.name, "start", self.start, self.parameter.bounds)
        _refuse_negative(self.name, self.sigma)

    @property
    def parameter(self) -> Parameter:
        """The number as the calibration has it."""
        size = abs(self.start) or 1.0
        low, high = (size / _WIDE, size * _WIDE) if self.start > 0 else (-size * _WIDE, size * _WIDE)
        low, high = low if self.low is None else self.low, high if self.high is None else self.high
        return Parameter(
            self.name, self.title or self.name, self.start, (low, high), 1.0 if low > 0 else self.sigma or size,
            logarithmic=low > 0, unit=self.unit, sigma=self.sigma,
        )  # fmt: skip


@dataclass(frozen=True)
class ModelEffect:
    """What a model may lack, `sf.Effect`; at its null the function is the model without it.

    Example:
        >>> import softflagella as sf
        >>> sf.Effect("wall", "wall of the tube", low=0, high=2, theory=1.0).parameter.start
        0.0
    """

    name: str  # in the function's parameters
    title: str  # in words
    low: float  # least size
    high: float  # largest size
    unit: str = "1"
    typical: float | None = None  # a typical size; default: that of theory, or a tenth of the range
    theory: float | None = None  # size that theory gives
    null: float = 0.0  # size at which nothing is added
    plausible: tuple[float, float] | None = None  # sizes that its source allows; default: all

    def __post_init__(self) -> None:
        for what in ("null", "theory"):
            if (value := getattr(self, what)) is not None:
                _refuse_outside(self.name, what, value, (self.low, self.high))

    @property
    def parameter(self) -> Parameter:
        """The size of the effect as the calibration has it."""
        of_theory = 0.0 if self.theory is None else abs(self.theory - self.null)
        typical = self.typical or of_theory or (self.high - self.low) / 10
        return Parameter(
            self.name, self.title, self.null, (self.low, self.high), typical, unit=self.unit,
            plausible=self.plausible, theory=self.theory,
        )  # fmt: skip


@dataclass(frozen=True)
class Model:
    """A model of one's own, to be calibrated with a table of runs.

    The function gets the columns for which it asks, arrays (n,), and one value for each parameter. It returns an
    array (n,) for each output.

    Example:
        >>> import softflagella as sf
        >>> def fall(columns, p):
        ...     d, x = columns["diameter_mm"] / 1e3, columns["diameter_mm"] / columns["tube_mm"]
        ...     return {"v": 500 * d**2 / p["viscosity"] * (1 - 2.1 * p["wall"] * x)}
        >>> model = sf.Model(
        ...     fall,
        ...     outputs={"v": sf.Output("speed", "m/s")},
        ...     numbers=[sf.Number("viscosity", 1.0, "Pa s", low=0.01, high=100)],
        ...     effects=[sf.Effect("wall", "wall of the tube", low=0, high=2, theory=1.0)],
        ... )
        >>> sf.calibrate("falls.csv", model).corrected  # doctest: +SKIP
        {'viscosity': 0.19, 'wall': 1.04}
    """

    function: Function
    outputs: Mapping[str, Output]  # by their columns
    numbers: Sequence[Number]
    effects: Sequence[ModelEffect] = field(default=())
    settings: Sequence[str] | None = None  # columns that repeats share; default: all for which the function asks

    def __post_init__(self) -> None:
        for what, kind in (("outputs", Output), ("numbers", Number), ("effects", ModelEffect)):
            given = getattr(self, what)
            each = list(given.values() if what == "outputs" and isinstance(given, Mapping) else given)
            if not all(isinstance(one, kind) for one in each) or not (each or what == "effects"):
                name = kind.__name__.removeprefix("Model")
                raise InputError(f"{what} of a model are each an sf.{name}, one at least; given: {given!r}")
        names_once(parameter.name for parameter in self.parameters)

    def without(self, *names: str) -> Model:
        """Return the model without some of its effects, which stay at their null."""
        nulls = {effect.name: effect.null for effect in self.effects if effect.name in names}
        if unknown := [name for name in names if name not in nulls]:
            known = ", ".join(effect.name for effect in self.effects)
            raise InputError(f"the model has no effect {unknown[0]!r}; it has {known}")
        rest = [effect for effect in self.effects if effect.name not in nulls]
        return replace(self, function=partial(_with_nulls, self.function, nulls), effects=rest)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Numbers and effects as the calibration has them."""
        return (*(number.parameter for number in self.numbers), *(effect.parameter for effect in self.effects))


def _with_nulls(function: Function, nulls: Mapping[str, float], columns: Any, p: Any) -> Mapping[str, Any]:
    """Call a function with effects at their null."""
    return function(columns, {**nulls, **p})


def _refuse_outside(name: str, what: str, value: float, bounds: tuple[float, float]) -> None:
    low, high = bounds
    if not (low < high and low <= value <= high and math.isfinite(value)):
        raise InputError(f"{name}: {what} {value:g} with low {low:g} and high {high:g}; give low ≤ {what} ≤ high")


def _refuse_negative(name: str, sigma: float | None) -> None:
    if sigma is not None and not 0 < sigma < math.inf:
        raise InputError(f"{name}: sigma {sigma:g}; give a standard deviation above 0, or none")
