"""robot.toml: a robot in the units of a laboratory, with comments.

The file has the tables [tails], [head], [fluid], [motor], [drag] and, if there are any, [effects] and
[learnt_from]. A key is a quantity with its unit as suffix: length_cm, speed_rpm, viscosity_Pa_s. Every usual
unit is read (`common.units`), one is written. KEY_sigma states one standard deviation of a measured number: a
number in the unit of its key, or a text like "10 %".
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from common.errors import InputError
from common.units import UNITS, Sigma, from_si, kinematic_words, of_kind, split, to_si
from sim.model.entries import ENTRIES, Entry
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.uncertainty import DEFAULTS, read_sigma, sigma_text

_SIGMA = "_sigma"
_LARGEST = 1e100  # of a number, whatever its unit
_FAR = {"": 30.0, "cm": 30.0, "mm": 30.0, "MPa": 300.0, "Pa_s": 300.0, "rpm": 300.0}  # times the paper's, or less
_NEAR = 10.0  # times, of a number in the unit that it may be in
_HEADER = """\
# Units are suffixes: length_cm, length_mm, speed_rpm, speed_rad_s, ... KEY_sigma states one standard deviation of
# a number, in its unit or as "5 %"; only a calibration uses it.
"""
_NOTES = {
    "drag": (
        "# Coefficients of the head (radius R, length L). For a new robot, start from 3, 2.8 and 2 as a first\n"
        "# guess, and let `softflagella calibrate` fit them to measured runs."
    )
}
_NO_EFFECTS = "# [effects]                       # their sizes, if there are any\n# end_over_end_drag = 5.0"


def read_robot(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Read the fields of `Robot` in SI units, and `sigmas`, from the tables of a robot.toml.

    Args:
        tables: as parsed, without name, effects, learnt_from and calibration.

    Raises:
        InputError: an entry is unknown, missing, given twice, without a unit, or no number.
    """
    values: dict[str, Any] = {}
    keys: dict[str, str] = {}  # field -> the key that gave it
    stated: list[tuple[Entry, str, object]] = []
    for table, content in tables.items():
        for key, value in content.items() if isinstance(content, dict) else [("", content)]:
            entry = _entry(table, key.removesuffix(_SIGMA))
            if entry is None:
                raise InputError(_unknown(table, key))
            if key.endswith(_SIGMA) and entry.field not in DEFAULTS:
                raise InputError(f"[{table}] {key}: this number takes no standard deviation")
            if key.endswith(_SIGMA):
                stated.append((entry, key, value))
            elif entry.field in values:
                raise InputError(f"[{table}] {keys[entry.field]} and {key} are the same number; drop one")
            else:
                values[entry.field], keys[entry.field] = _number(value, key, f"[{table}] {key}"), key
                if entry.field not in ("tails", "C_yr") and value <= 0:
                    raise InputError(f"[{table}] {key} = {value:g}; it must be above 0")
    for entry in ENTRIES:
        if entry.field not in values and not entry.optional:
            raise InputError(f"missing entry [{entry.table}] {entry.key}")
    scales = {**values, "disc_offset": values.get("disc_offset", values["head_radius"])}  # by default
    sigmas = {
        entry.field: _read_sigma(value, scales[entry.field], key, f"[{entry.table}] {key}")
        for entry, key, value in stated
    }
    return {**values, "sigmas": sigmas}


def doubtful(tables: Mapping[str, Any]) -> Iterator[str]:
    """Ask about each number, of a robot.toml that has been read, that silicone in glycerine can hardly have."""
    for table, content in tables.items():
        for key, number in content.items() if isinstance(content, dict) else ():
            entry, unit = _entry(table, key), split(key).unit
            paper = getattr(PRESETS["paper-control"], entry.field) if entry and entry.field != "tails" else None
            if not (entry and paper and number):
                continue
            own = unit.suffix if unit else ""
            units = [own, *(suffix for suffix in of_kind(unit.kind) if suffix != "in")] if unit else [own]
            times = {each: max(abs(to_si(number, each) if each else number) / paper, 1e-300) for each in units}
            ratio, far = times[own], _FAR[entry.unit]
            if not 1 / far <= ratio <= far:
                likely = min(units, key=lambda suffix: abs(math.log(times[suffix])))
                asked = f"is its unit {likely}?" if 1 / _NEAR <= times[likely] <= _NEAR else "is it right?"
                size = f"{ratio:,.0f}" if 1 < ratio < 1e9 else f"{ratio:.2g}"
                yield f"{key} = {number:g} is {size} times that of the paper's robot; {asked}"


def check_keys(names: Iterable[str], option: str) -> None:
    """Refuse names TABLE.KEY, given with an option, that are no entry of a robot, with the nearest ones."""
    known = ["name", *(f"{entry.table}.{entry.key}" for entry in ENTRIES)]
    for name in names:
        table, _, key = name.rpartition(".")
        if name == "name" or table == "effects" or _entry(table, key.removesuffix(_SIGMA)):
            continue
        if kinematic := kinematic_words(key.removesuffix(_SIGMA)):
            raise InputError(f"{option} {name} {kinematic}")
        within = [each for each in known if key in each]
        near = within if 0 < len(within) <= 3 else difflib.get_close_matches(name, known, 3, 0.5)
        hint = f"is it {' or '.join(near)}?" if near else f"there are {', '.join(known)} and effects.NAME"
        raise InputError(f"{option} {name}: a robot has no such entry; {hint}")


def field_of(name: str) -> str:
    """Return the field of `Robot` that TABLE.KEY is, in any unit; of an effect its name."""
    table, _, key = name.rpartition(".")
    entry = _entry(table, key)
    return entry.field if entry else key


def robot_toml(robot: Robot) -> str:
    """Write the text of a robot.toml that is read back to the same robot, to the last bit."""
    tables: dict[str, list[str]] = {table: [note] for table, note in _NOTES.items()}
    for entry in ENTRIES:
        lines = tables.setdefault(entry.table, [])
        value = getattr(robot, entry.field)
        unit, number = _written(robot.number(entry.field), entry.unit)
        text = f"{entry.with_unit(unit)} = {number}"
        if value is None:  # the default of the disc offset, the only optional number
            lines.append(_line(f"# {text}", f"{entry.comment}; without it R"))
        else:
            lines.append(_line(text, entry.comment))
        if entry.field in robot.sigmas:
            lines.append(_sigma_line(robot.sigmas[entry.field], entry.with_unit(unit), entry))
    if robot.effects:
        tables["effects"] = [f"{name} = {float(size)!r}" for name, size in robot.effects.items()]
    if robot.learnt_from:
        learnt = robot.learnt_from
        tables["learnt_from"] = [f"low = {list(learnt.low)}", f"high = {list(learnt.high)}"]
    known = [*dict.fromkeys(entry.table for entry in ENTRIES), "effects", "learnt_from"]
    order = sorted(tables, key=known.index)
    blocks = ["\n".join([f"[{table}]", *tables[table]]) for table in order]
    name = json.dumps(robot.name, ensure_ascii=False).replace("\x7f", "\\u007f")  # escapes as TOML does
    return "\n\n".join([f"{_HEADER}name = {name}", *blocks, *([] if robot.effects else [_NO_EFFECTS])]) + "\n"


def _entry(table: str, key: str) -> Entry | None:
    return next((entry for entry in ENTRIES if entry.fits(table, key)), None)


def _unknown(table: str, key: str) -> str:
    """Say what is wrong with a key: it has no unit, or there is no such number; tell the nearest entry."""
    quantity = key.removesuffix(_SIGMA)
    if kinematic := kinematic_words(quantity):
        return f"[{table}] {key} {kinematic}"
    for entry in ENTRIES:
        if entry.unit and (table, quantity) == (entry.table, entry.quantity):
            units = ", ".join(entry.with_unit(suffix) for suffix in of_kind(UNITS[entry.unit].kind))
            return f"[{table}] {key} has no unit; give one of {units}"
    tables = ", ".join(f"[{name}]" for name in dict.fromkeys(entry.table for entry in ENTRIES))
    if not key:
        return f"{table} is in no table; a robot has {tables}"
    entries = [f"[{entry.table}] {entry.key}" for entry in ENTRIES]
    half = ", half of it" if "diameter" in key else ""
    near = difflib.get_close_matches(f"[{table}] {key.replace('diameter', 'radius')}", entries, 1)
    hint = f"is it {near[0]}{half}?" if near else f"a robot has {tables}"
    return f"unknown entry [{table}] {key}; {hint}"


def _number(value: object, key: str, entry: str) -> float:
    """Convert a number of the file to SI units."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise InputError(f"{entry} = {value!r}; give a number")
    if not abs(value) < _LARGEST:
        raise InputError(f"{entry} = {value!r}; give a finite number")
    unit = split(key).unit
    return to_si(value, unit.suffix) if unit else value


def _read_sigma(value: object, number: float, key: str, entry: str) -> Sigma:
    unit = split(key.removesuffix(_SIGMA)).unit
    return read_sigma(value, number, entry, unit.suffix if unit else "")


def _sigma_line(sigma: Sigma, key: str, entry: Entry) -> str:
    if sigma.relative or not entry.unit:
        return f"{key}{_SIGMA} = {sigma_text(sigma)}"
    unit, number = _written(sigma.size, entry.unit)
    return f"{entry.with_unit(unit)}{_SIGMA} = {number}"


def _written(value: float, unit: str) -> tuple[str, str]:
    """Write a number in a unit, as short as it can be so that it is read back to the last bit.

    Returns:
        The unit and the number; in SI units where no number in `unit` is read back exactly.
    """
    if not unit:
        return unit, repr(value)
    guess = from_si(value, unit)
    rounded = (float(f"{guess:.{digits}g}") for digits in range(1, 18))
    for number in (*rounded, math.nextafter(guess, math.inf), math.nextafter(guess, 0.0)):
        if to_si(number, unit) == value:
            return unit, repr(number).removesuffix(".0")
    return _SI[UNITS[unit].kind], repr(value)


_SI = {"length": "m", "pressure": "Pa", "viscosity": "Pa_s", "angular velocity": "rad_s"}


def _line(text: str, comment: str) -> str:
    return f"{text:<33} # {comment}" if comment else text
