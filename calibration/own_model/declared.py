"""What a model of one's own declares: outputs, numbers to fit, and effects that it may lack."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import partial
from typing import Any, Literal, get_args

from calibration.statistics.checks import names_once
from calibration.statistics.statistical_model import Parameter
from calibration.table.declared import Declared, Output, refuse_no_deviation
from common.errors import InputError
from common.units import find_unit, parse_sigma, split

Group = Literal["trace", "session", "specimen"]
Function = Callable[[Mapping[str, Any], Mapping[str, float]], Mapping[str, Any]]  # columns, parameters -> outputs
_WIDE = 1000.0  # factor to the ends of the range of a number for which none is given


@dataclass(frozen=True)
class Number(Declared):
    """A number of the model, which is fitted; on a logarithmic scale if it is positive.

    Example:
        >>> import softflagella as sf
        >>> sf.Number("viscosity", 1.0, unit="Pa s", low=0.01, high=100).parameter.logarithmic
        True
    """

    name: str  # in the function's parameters
    start: float  # the value as given
    _: KW_ONLY
    unit: str = "1"
    low: float | None = None  # least value; default: a thousandth of the start
    high: float | None = None  # largest value; default: a thousand times the start
    title: str | None = None  # in words; default: the name
    sigma: float | str | None = None  # of a number known to a tolerance: in its unit, or "1 %" of the start
    per: Group | None = None  # what has a number of its own, such as the start of each trace; None: all share it

    def __post_init__(self) -> None:
        self._tidy(self.name)
        if self.per not in (None, *get_args(Group)):
            raise InputError(f"{self.name}: per {self.per!r}; give one of {', '.join(get_args(Group))}")
        bounds = self._bounds
        _refuse_outside(self.name, "start", self.start, bounds)
        if (sigma := self._deviation) is None:
            return
        refuse_no_deviation(f"{self.name}: sigma", sigma)
        if bounds[0] > 0 and sigma > self.start:
            raise InputError(
                f"{self.name}: sigma {self.sigma!r} is more than the number itself, {self.start:g}; give it in "
                f'{self.unit}, or as a share, such as "1 %"; without sigma the number is free'
            )

    @property
    def _bounds(self) -> tuple[float, float]:
        size = abs(self.start) or 1.0
        low, high = (size / _WIDE, size * _WIDE) if self.start > 0 else (-size * _WIDE, size * _WIDE)
        return low if self.low is None else self.low, high if self.high is None else self.high

    @property
    def _deviation(self) -> float | None:
        """The standard deviation in the unit of the number."""
        return None if self.sigma is None else parse_sigma(self.sigma, f"{self.name}: sigma").of(self.start)

    @property
    def parameter(self) -> Parameter:
        """The number as the calibration has it."""
        sigma, (low, high) = self._deviation, self._bounds
        if low > 0:  # on a logarithmic scale
            sigma, typical = sigma and sigma / self.start, 1.0
        else:
            typical = sigma or abs(self.start) or 1.0
        return Parameter(
            self.name, self.title or self.name, self.start, (low, high), typical,
            logarithmic=low > 0, unit=self.unit, sigma=sigma,
        )  # fmt: skip

    def of_groups(self, names: Sequence[str]) -> tuple[Parameter, ...]:
        """Return the number that each group has of its own."""
        shared = self.parameter
        own = (f" of {name}" for name in names)
        return tuple(
            replace(shared, name=self.name + of, title=shared.title + of, of_these_runs=self.per != "specimen",
                    of_group=(self.name, name))
            for of, name in zip(own, names, strict=True)
        )  # fmt: skip


@dataclass(frozen=True)
class Effect(Declared):
    """What a model may lack; at its null the function is the model without it.

    Example:
        >>> import softflagella as sf
        >>> sf.Effect("wall", "wall of the tube", low=0, high=2, theory=1.0).parameter.start
        0.0
    """

    name: str  # in the function's parameters
    title: str  # in words
    _: KW_ONLY
    low: float  # least size
    high: float  # largest size
    unit: str = "1"
    typical: float | None = None  # a typical size; default: that of theory, or a tenth of the range
    theory: float | None = None  # size that theory gives
    null: float = 0.0  # size at which nothing is added
    plausible: tuple[float, float] | None = None  # sizes that its source allows; default: all

    def __post_init__(self) -> None:
        self._tidy(self.name)
        for what in ("null", "theory"):
            if (value := getattr(self, what)) is not None:
                _refuse_outside(self.name, what, value, (self.low, self.high))

    @property
    def parameter(self) -> Parameter:
        """The size of the effect as the calibration has it."""
        of_theory = 0.0 if self.theory is None else abs(self.theory - self.null)
        typical = self.typical or of_theory or (self.high - self.low) / 10
        return Parameter(
            self.name, self.title or self.name, self.null, (self.low, self.high), typical, unit=self.unit,
            plausible=self.plausible, theory=self.theory,
        )  # fmt: skip


@dataclass(frozen=True)
class Model:
    """A model of one's own, to be calibrated with a table of runs.

    The function gets the columns for which it asks, arrays (n,), and one value for each parameter. It returns an
    array (n,) for each output. With `time` it gets the readings of one trace, sorted in time, so that it may
    integrate an equation; with numbers that sessions or specimens have of their own, the runs of one of these.

    Example:
        >>> import softflagella as sf
        >>> def fall(columns, p):
        ...     d, x = columns["diameter_mm"] / 1e3, columns["diameter_mm"] / columns["tube_mm"]
        ...     return {"v": 500 * d**2 / p["viscosity"] * (1 - 2.1 * p["wall"] * x)}
        >>> model = sf.Model(
        ...     fall,
        ...     outputs={"v": sf.Output("speed", unit="m/s")},
        ...     numbers=[sf.Number("viscosity", 1.0, unit="Pa s", low=0.01, high=100)],
        ...     effects=[sf.Effect("wall", "wall of the tube", low=0, high=2, theory=1.0)],
        ... )
        >>> sf.calibrate("falls.csv", model).corrected  # doctest: +SKIP
        {'viscosity': 0.19, 'wall': 1.04}
    """

    function: Function
    outputs: Mapping[str, Output]  # by their columns
    numbers: Sequence[Number]
    effects: Sequence[Effect] = field(default=())
    settings: Sequence[str] | None = None  # columns that repeats share; default: all for which the function asks
    # In which the function asks for columns, {"length": "m"}; the table may have length_cm.
    units: Mapping[str, str] = field(default_factory=dict)
    time: str | None = None  # column with the times of readings; the table is one of traces

    def __post_init__(self) -> None:
        for name, unit in self.units.items():
            known = find_unit(unit)
            if known is None or split(name).unit not in (None, known):
                raise InputError(f"units: {name!r} in {unit!r}; give a unit that is known, such as m, deg or Pa s")
        for what, kind in (("outputs", Output), ("numbers", Number), ("effects", Effect)):
            given = getattr(self, what)
            each = list(given.values() if what == "outputs" and isinstance(given, Mapping) else given)
            if not all(isinstance(one, kind) for one in each) or not (each or what == "effects"):
                raise InputError(
                    f"{what} of a model are each an sf.{kind.__name__}, one at least; given: {given!r}"
                )
        if self.time is None and any(number.per == "trace" for number in self.numbers):
            raise InputError('a number per trace needs the column of the time: sf.Model(…, time="t_s")')
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
