"""What is declared of a table: its outputs, and in which units and kinds."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from numbers import Real
from typing import Literal, Self

from common.errors import InputError
from common.units import find_unit, from_si, parse_sigma


class Declared:
    """What is declared: a unit and what follows it have their keywords, numbers are numbers."""

    unit: str

    def __new__(cls, *given: object, **_: object) -> Self:
        """Refuse what is given by its place alone where it needs its keyword."""
        first: tuple[str, ...] = cls.__match_args__  # type: ignore[attr-defined]
        for value in given[len(first) :]:
            raise InputError(
                f"sf.{cls.__name__}({', '.join(first)}, …): the further value {value!r} needs its keyword, as in "
                f"unit={value!r}"
            )
        return super().__new__(cls)

    def _tidy(self, of: str) -> None:
        """Refuse a unit that is no text, and numbers that are none; without a unit it is 1."""
        if not isinstance(self.unit, str):
            raise InputError(f'{of}: unit {self.unit!r}; give a text such as "m/s", or leave it out')
        object.__setattr__(self, "unit", self.unit.strip() or "1")
        for name, kind in type(self).__annotations__.items():
            value, numbers = getattr(self, name, None), {"float": Real, "float | None": Real | None}
            if not isinstance(value, numbers.get(kind, object)):
                raise InputError(f"{of}: {name} {value!r}; give a number")


@dataclass(frozen=True)
class Output(Declared):
    """What was measured, in a column of the same name.

    Example:
        >>> import softflagella as sf
        >>> sf.Output("speed", unit="m/s").kind
        'ratio'
    """

    title: str  # in words
    _: KW_ONLY
    unit: str = "1"
    kind: Literal["ratio", "difference"] = "ratio"  # "difference" for angles and for values that change sign
    # Standard deviation of one run, if it is known: a text like "2 %" for a ratio; for a difference, in its unit.
    sigma: float | str | None = None
    unit_checked: bool = False  # a session that reads 10, 60, … times as much as others is right

    def __post_init__(self) -> None:
        name = f"output {self.title!r}"
        if self.kind not in ("ratio", "difference"):
            raise InputError(f"{name}: kind {self.kind!r}; give 'ratio' or 'difference'")
        self._tidy(name)
        if self.sigma is not None:
            self.deviation(self.sigma, f"{name}: sigma")

    @property
    def turn(self) -> float:
        """A whole turn in the unit of an angle whose differences are compared; 0 for all else."""
        unit = find_unit(self.unit) if self.kind == "difference" else None
        return float(from_si(math.tau, unit.suffix)) if unit and unit.kind == "angle" else 0.0

    def deviation(self, sigma: float | str, entry: str) -> float:
        """Read a standard deviation of one run, relative for a ratio; `entry` names its place."""
        size, relative = parse_sigma(sigma, entry)
        if relative != (self.kind == "ratio"):
            meant = f"a number in {self.unit}" if relative else 'a share, such as "2 %"'
            raise InputError(f"{entry} {sigma!r}: this output is compared as a {self.kind}; give {meant}")
        refuse_no_deviation(entry, size)
        return size


def refuse_no_deviation(entry: str, sigma: float) -> None:
    if not 0 < sigma < math.inf:
        raise InputError(f"{entry} {sigma:g}; give a standard deviation above 0, or none")
