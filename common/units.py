"""Units of lengths, times, angles and other quantities: as suffixes of names, in brackets, and in sentences.

    split("omega_yr_deg_s")  ->  Name("omega_yr", Unit("deg_s", …))
    split("X [cm]")          ->  Name("X", Unit("cm", …))
    convert(9.0, "cm", "m")  ->  0.09

A suffix is what follows the last underscores of a name: `_cm`, `_rad_s`, `_Pa_s`. Upper and lower case count
(mPa and MPa). SI: m, s, rad, rad/s, m/s, Pa, Pa s, K, kg/m³.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping
from functools import cache
from typing import Any, Literal, NamedTuple, TypeVar, get_args

from common.errors import InputError

Slip = TypeVar("Slip")


class Unit(NamedTuple):
    """A unit: a value v in it is (v + zero) · times / over in SI units."""

    suffix: str
    kind: str
    times: float = 1.0
    over: float = 1.0
    zero: float = 0.0

    @property
    def text(self) -> str:
        """The unit as people write it: rad/s."""
        return _TEXTS.get(self.suffix, self.suffix)


class Name(NamedTuple):
    """A name without its unit, and the unit; None if the name has none."""

    quantity: str
    unit: Unit | None


UNITS = {
    unit.suffix: unit
    for unit in (
        Unit("m", "length"),
        Unit("cm", "length", over=100.0),
        Unit("mm", "length", over=1000.0),
        Unit("um", "length", over=1e6),
        Unit("in", "length", times=0.0254),
        Unit("s", "time"),
        Unit("ms", "time", over=1000.0),
        Unit("min", "time", times=60.0),
        Unit("h", "time", times=3600.0),
        Unit("rad", "angle"),
        Unit("deg", "angle", times=math.pi, over=180.0),
        Unit("rad_s", "angular velocity"),
        Unit("deg_s", "angular velocity", times=math.pi, over=180.0),
        Unit("rpm", "angular velocity", times=math.tau, over=60.0),
        Unit("rps", "angular velocity", times=math.tau),
        Unit("Hz", "angular velocity", times=math.tau),
        Unit("m_s", "speed"),
        Unit("cm_s", "speed", over=100.0),
        Unit("mm_s", "speed", over=1000.0),
        Unit("m_min", "speed", over=60.0),
        Unit("cm_min", "speed", over=6000.0),
        Unit("mm_min", "speed", over=60_000.0),
        Unit("Pa", "pressure"),
        Unit("kPa", "pressure", times=1e3),
        Unit("MPa", "pressure", times=1e6),
        Unit("GPa", "pressure", times=1e9),
        Unit("Pa_s", "viscosity"),
        Unit("mPa_s", "viscosity", over=1000.0),
        Unit("P", "viscosity", over=10.0),
        Unit("cP", "viscosity", over=1000.0),
        Unit("K", "temperature"),
        Unit("C", "temperature", zero=273.15),
        Unit("F", "temperature", times=5.0, over=9.0, zero=459.67),
        Unit("1", "number"),
        Unit("percent", "number", over=100.0),
    )
}
LengthUnit = Literal["l", "m", "cm", "mm"]  # of lengths in words; l is the tail length
LENGTHS = get_args(LengthUnit)
_TEXTS = {
    "um": "µm", "rad_s": "rad/s", "deg_s": "degrees/s", "rps": "turns/s", "deg": "degrees", "m_s": "m/s",
    "cm_s": "cm/s", "mm_s": "mm/s", "m_min": "m/min", "cm_min": "cm/min", "mm_min": "mm/min", "Pa_s": "Pa s",
    "mPa_s": "mPa s", "C": "°C", "F": "°F", "percent": "%", "1": "",
}  # fmt: skip
_SPELLINGS = {  # other spellings of units, after signs have become underscores
    "meter": "m", "metre": "m", "meters": "m", "metres": "m", "inch": "in", "inches": "in", "sec": "s",
    "second": "s", "seconds": "s", "minutes": "min", "hours": "h", "hr": "h", "degree": "deg", "degrees": "deg",
    "radian": "rad", "radians": "rad", "r_min": "rpm", "U_min": "rpm", "1_min": "rpm", "min^-1": "rpm",
    "RPM": "rpm", "rev_min": "rpm", "rev_s": "rps", "turns_s": "rps", "hz": "Hz", "1_s": "Hz", "rad_s^-1": "rad_s",
    "rad_sec": "rad_s", "deg_sec": "deg_s", "degrees_s": "deg_s", "deg_s^-1": "deg_s", "m_s^-1": "m_s",
    "cm_s^-1": "cm_s", "mm_s^-1": "mm_s", "Pas": "Pa_s", "mPas": "mPa_s", "degC": "C", "degF": "F", "%": "percent",
    "-": "1", "": "1",
}  # fmt: skip
SLIPS = {  # factor between two units -> what a larger number is in, and what the smaller one is in
    6.0: ("deg/s", "rpm"),
    2 * math.pi: ("rad", "turns"),
    30 / math.pi: ("rpm", "rad/s"),
    10.0: ("mm", "cm"),
    180 / math.pi: ("degrees", "radians"),
    60.0: ("s or 1/min", "min or 1/s"),
    100.0: ("cm or per cent", "m or 1"),
    360.0: ("degrees", "turns"),
    1000.0: ("mm", "m"),
}
_USUAL = ("rpm", "rad_s", "deg_s", "rps", "mm", "cm", "m", "deg", "rad", "mm_s", "cm_s", "m_s", "cm_min")
_MOST_PARTS = max(len(suffix.split("_")) for suffix in UNITS)  # of a suffix
_KINEMATIC = re.compile(r"(?:^|[_ \[(])(?:c?St|[cm]?m(?:\^?2|²)(?:[_/]s|[_ ]?s(?:\^-|⁻)[1¹]))[\])]?$")
_SIGNS = str.maketrans({"°": "deg", "º": "deg", "µ": "u", "μ": "u", "/": "_", "·": "_", "*": "_", " ": "_",
                        "⁻": "^-", "¹": "1", "−": "-"})  # fmt: skip


def find_unit(text: str) -> Unit | None:
    """Find a unit by its suffix or another spelling ("deg/s", "°", "U/min"); None if it is no known unit."""
    word = text.strip().strip("[]()").strip().translate(_SIGNS)
    word = re.sub("_+", "_", word)
    return UNITS.get(_SPELLINGS.get(word, word))


@cache
def split(name: str) -> Name:
    """Split the name of a column or key into quantity and unit.

    The unit is a suffix (R_yr_mm) or stands in brackets behind the name ("R_yr [mm]", "X (cm)").
    """
    text = name.strip()
    before, bracket, inside = text[:-1].replace("(", "[").rpartition("[")
    if bracket and text[-1:] in ("]", ")") and not set(inside) & set("])"):
        return Name(text[: len(before)].rstrip("_ \t").strip(), find_unit(inside))
    parts = text.split("_")
    for first in range(max(1, len(parts) - _MOST_PARTS), len(parts)):
        unit = UNITS.get("_".join(parts[first:]))
        if unit is not None and unit.suffix != "1":  # x_1 is a name
            return Name("_".join(parts[:first]), unit)
    return Name(name.strip(), None)


def number_and_unit(words: str, units: Collection[str] = LENGTHS) -> tuple[float, str | None]:
    """Split a quantity: 24cm into 24.0 and cm, 3 into 3.0 and None; what is none, or in another unit, into nan."""
    word = re.split(r"[\W\d]", words.rstrip())[-1]
    number = words.rstrip().removesuffix(word)
    unit = next((u for u in (word, getattr(find_unit(word), "suffix", "")) if u in units), None)
    try:
        return float(number) if unit or not word else math.nan, unit
    except ValueError:
        return math.nan, unit


def of_kind(kind: str) -> list[str]:
    """List the suffixes of the units of a kind, such as "length"."""
    return [suffix for suffix, unit in UNITS.items() if unit.kind == kind]


def kinematic_words(name: str) -> str:
    """Say what to give instead of a kinematic viscosity, if the unit of a name is of one; otherwise nothing."""
    if not _KINEMATIC.search(name.strip()):
        return ""
    return "is a kinematic viscosity; give viscosity_mPa_s: cSt (mm²/s) times the density of the liquid in g/cm³"


def to_si(value: Any, suffix: str) -> Any:
    """Convert a number, or an array, to SI units."""
    unit = UNITS[suffix]
    return (value + unit.zero) * unit.times / unit.over


def from_si(value: Any, suffix: str) -> Any:
    """Convert a number, or an array, from SI units."""
    unit = UNITS[suffix]
    return value * unit.over / unit.times - unit.zero


def convert(value: Any, given: str, wanted: str) -> Any:
    """Convert a number, or an array, between units of one kind, named by their suffixes.

    Example:
        >>> convert(9.0, "cm", "mm")
        90.0
    """
    if given == wanted:
        return value
    if UNITS[given].kind != UNITS[wanted].kind:
        raise ValueError(f"{given} is a unit of {UNITS[given].kind}, {wanted} one of {UNITS[wanted].kind}")
    return from_si(to_si(value, given), wanted)


def other_units(suffix: str) -> dict[float, str]:
    """Map the factors by which numbers are larger in other usual units of a kind to these units."""
    others = [other for other in _USUAL if other != suffix and UNITS[other].kind == UNITS[suffix].kind]
    return {convert(1.0, suffix, other): UNITS[other].text for other in others}


def guess_slip(factor: float, slips: Mapping[float, Slip], near: float) -> Slip | None:
    """Guess why numbers are `factor` times what they should be: what has the nearest factor, within `near`.

    Example:
        >>> guess_slip(99.0, other_units("m"), near=1.1)
        'cm'
    """
    within = [each for each in slips if 1 / near < factor / each < near]
    return slips[min(within, key=lambda each: abs(math.log(factor / each)))] if within else None


def format_time(seconds: float) -> str:
    """Write a duration as people say it: 0.35 s, 48.2 s, 12.5 min, 3 h 20 min, 7.5 days."""
    if not math.isfinite(seconds) or abs(seconds) < 90:
        return f"{seconds:.3g} s"
    if abs(seconds) < 5400:
        return f"{seconds / 60:.3g} min"
    if abs(seconds) >= 172_800:
        return f"{seconds / 86_400:.3g} days"
    minutes = round(seconds / 60)
    hours = f"{minutes // 60} h"
    return f"{hours} {minutes % 60} min" if minutes % 60 else hours


def format_length(metres: float) -> str:
    """Write a length as people say it: 3.2 mm, 12.4 cm, 3.1 m."""
    size = abs(metres)
    if size and size < 0.01:
        return f"{1000 * metres:.3g} mm"
    return f"{metres:.3g} m" if size >= 2 else f"{100 * metres:.3g} cm"


def length_in_lab(value: float, length_scale: float) -> str:
    """Write a length given in tail lengths; one of them is `length_scale` in m."""
    return f"{format_length(value * length_scale)} ({tails_in_words(value)} l)"


def tails_in_words(value: float) -> str:
    """Write a length in tail lengths: 0.32, 12, 1200."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def column_units(names: Iterable[object]) -> dict[str, str]:
    """Find the units of columns by their names: as a suffix, or l where a name ends with `_over_l`.

    Columns without a unit are left out.
    """
    units = {}
    for name in map(str, names):
        unit = split(name).unit
        if name.endswith("_over_l"):
            units[name] = "l"
        elif name.endswith(("time_bar", "dwell_bar", "before_bar")):
            units[name] = "μ0 l⁴/EI"
        elif unit is not None:
            units[name] = unit.text
    return units


class Sigma(NamedTuple):
    """One standard deviation of a number: in its own unit, or as a share of it."""

    size: float  # one standard deviation
    relative: bool  # a share of the number

    def of(self, value: float) -> float:
        """Compute σ in the unit of `value`."""
        return self.size * abs(value) if self.relative else self.size


def parse_sigma(given: object, entry: str) -> Sigma:
    """Read σ from a number, or a text like "10 %", whatever it belongs to; `entry` names its place."""
    try:
        if isinstance(given, str) and given.strip().endswith("%"):
            return Sigma(float(given.strip()[:-1]) / 100, True)
        if isinstance(given, int | float) and not isinstance(given, bool):
            return Sigma(float(given), False)
        raise ValueError
    except (ValueError, OverflowError):
        raise InputError(f'{entry} = {given!r}; give a number in its unit, or a text like "10 %"') from None
