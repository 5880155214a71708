"""Robots as users give them: robot.toml, names of presets, columns of a table. Checked here, with effects.

A robot.toml has the tables [head], [tails], [fluid], [motor], [drag] and, if there are any, [effects] and
[correction]. The names of the keys say their units. Beside a number that was measured, KEY_sigma may state one
standard deviation of it: a number in the same unit, or a text like "10 %".
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sim.arrays import Floats
from sim.effects import catalogue, check_effects, check_size
from sim.io.errors import InputError, naming
from sim.io.files import write_text
from sim.io.reading import read_toml
from sim.model.correction import correction_tables, read_correction
from sim.model.groups import GROUP_COLUMNS, OPTIONAL_COLUMNS, checked_values
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.uncertainty import DEFAULTS, Sigma, read_sigma, sigma_text

# Table and key in robot.toml -> field of Robot; the key says the unit.
_TOML = {
    ("tails", "count"): "tails",
    ("tails", "length_m"): "tail_length",
    ("tails", "radius_m"): "tail_radius",
    ("tails", "youngs_modulus_Pa"): "youngs_modulus",
    ("tails", "disc_offset_m"): "disc_offset",
    ("head", "radius_m"): "head_radius",
    ("head", "length_m"): "head_length",
    ("fluid", "viscosity_Pa_s"): "viscosity",
    ("motor", "speed_rad_s"): "motor_speed",
    ("drag", "C_t"): "C_t",
    ("drag", "C_r"): "C_r",
    ("drag", "C_yr"): "C_yr",
}
_OPTIONAL_KEYS = {"disc_offset"}
_LARGEST = 1e100  # of a number, whatever its unit
_SIGMA = "_sigma"  # a key with this ending holds one standard deviation of the number beside it
_SIGMAS = {(table, key + _SIGMA): name for (table, key), name in _TOML.items() if name in DEFAULTS}


def check_columns(columns: Mapping[str, Any]) -> dict[str, Floats]:
    """Convert columns of robots to float64 arrays, a_over_R filled in; reject robots that cannot be simulated.

    Args:
        columns: `sim.model.groups.GROUP_COLUMNS`, optionally a_over_R and effect sizes, each (M,).

    Raises:
        InputError: a column is missing or unknown, or a number is not finite or out of its range.
    """
    known = {*GROUP_COLUMNS, *OPTIONAL_COLUMNS, *catalogue()}
    unknown = sorted(set(columns) - known)
    if unknown:
        raise InputError(
            f"unknown column {unknown[0]!r}; allowed are {', '.join(sorted(known))}: rename or drop it"
        )
    values = checked_values(columns)
    for name in set(values) & set(catalogue()):
        for size in (values[name].min(), values[name].max()):
            check_size(name, float(size))
    return values


def names_robot(source: str | Path) -> bool:
    """Tell whether words name a robot, a preset or a robot.toml, rather than a table of points."""
    path = Path(source)
    return str(source) in PRESETS or path.suffix == ".toml" or not (path.suffix or path.exists())


def load_robot(source: str | Path) -> Robot:
    """Load a robot from a preset's name or a robot.toml.

    Args:
        source: path of a file, or one of `sim.model.presets.PRESETS`.

    Raises:
        InputError: the file does not describe a robot; the message names the key and what is allowed.

    Example:
        >>> from softflagella import load_robot
        >>> load_robot("paper-control").tails
        2
    """
    if str(source) in PRESETS:
        return PRESETS[str(source)]
    path = Path(source)
    if not path.exists():
        raise InputError(f"no robot {str(source)!r}; give a robot.toml or one of {', '.join(PRESETS)}")
    with naming(path):
        return _read_robot(path)


def _read_robot(path: Path) -> Robot:
    tables = read_toml(path)
    name = tables.pop("name", path.stem)
    tables.pop("calibration", None)  # read by planner.vehicle.calibration_table
    correction = read_correction(tables.pop("correction"), str(path)) if "correction" in tables else None
    effects = tables.pop("effects", {})
    if not isinstance(effects, dict):
        raise InputError(f"{path}: effects = {effects!r}; write a table [effects] with lines name = size")
    stated: dict[str, tuple[str, object]] = {}
    values = _values(path, tables, stated)
    check_effects(effects)
    sigmas = _sigmas(values, stated)
    return Robot(name=str(name), effects=dict(effects), sigmas=sigmas, correction=correction, **values)  # type: ignore[arg-type]


def _sigmas(values: Mapping[str, Any], stated: Mapping[str, tuple[str, object]]) -> dict[str, Sigma]:
    """Read standard deviations by field; a disc offset that is not given has the head's radius in its place."""
    scales = {**values, "disc_offset": values.get("disc_offset", values["head_radius"])}
    return {name: read_sigma(given, scales[name], entry) for name, (entry, given) in stated.items()}


def _values(path: Path, tables: dict[str, Any], stated: dict[str, tuple[str, object]]) -> dict[str, object]:
    """Read the fields of `Robot` by name; entries of standard deviations are collected in `stated`."""
    values: dict[str, object] = {}
    for table, content in tables.items():
        for key, value in content.items() if isinstance(content, dict) else [("", content)]:
            if (table, key) in _SIGMAS:
                stated[_SIGMAS[table, key]] = (f"{path}: [{table}] {key}", value)
                continue
            if (table, key) not in _TOML:
                allowed = ", ".join(f"[{t}] {k}" for t, k in _TOML)
                raise InputError(f"{path}: unknown entry [{table}] {key}; allowed are {allowed}")
            values[_TOML[table, key]] = value
    for (table, key), attribute in _TOML.items():
        if attribute not in values and attribute not in _OPTIONAL_KEYS:
            raise InputError(f"{path}: missing entry [{table}] {key}")
        value = values.get(attribute, 0)
        if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < _LARGEST:
            raise InputError(f"{path}: [{table}] {key} = {values[attribute]!r}; give a finite number")
    return values


def save_robot(robot: Robot, path: str | Path) -> None:
    """Write a robot.toml that `load_robot` reads back to the same robot.

    Args:
        robot: the robot, in SI units.
        path: the file.

    Raises:
        InputError: the file cannot be written.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> from softflagella import load_robot, save_robot
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     save_robot(load_robot("paper-control"), Path(folder) / "robot.toml")
        ...     load_robot(Path(folder) / "robot.toml") == load_robot("paper-control")
        True
    """
    write_text(path, robot_toml(robot))


def robot_toml(robot: Robot) -> str:
    """Write the text of a robot.toml that `load_robot` reads back to the same robot."""
    tables: dict[str, list[str]] = {}
    for (table, key), attribute in _TOML.items():
        value = getattr(robot, attribute)
        if value is not None:
            tables.setdefault(table, []).append(f"{key} = {value!r}")
        if attribute in robot.sigmas:
            tables.setdefault(table, []).append(f"{key}{_SIGMA} = {sigma_text(robot.sigmas[attribute])}")
    if robot.effects:
        tables["effects"] = [f"{name} = {float(size)!r}" for name, size in robot.effects.items()]
    if robot.correction:
        tables["correction"] = [f"{k} = {json.dumps(v)}" for k, v in correction_tables(robot.correction).items()]
    blocks = ["\n".join([f"[{table}]", *lines]) for table, lines in tables.items()]
    name = json.dumps(robot.name, ensure_ascii=False).replace("\x7f", "\\u007f")  # escapes as TOML does
    return "\n\n".join([f"name = {name}", *blocks]) + "\n"
