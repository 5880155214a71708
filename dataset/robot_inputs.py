"""Sweeps around a robot: inputs in the units of a laboratory, and the dimensionless columns of their rows.

A sweep.toml with `robot = "robot.toml"` has inputs like tail_length_cm or motor_speed_rpm. A row is the robot with
these numbers, as its dimensionless groups. Inputs that are not listed are those of the robot.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.units import UNITS, from_si, of_kind, split, to_si
from sim.effects import check_effects, is_effect
from sim.inputs import group_columns, load_robot
from sim.model.groups import GROUP_COLUMNS, OPTIONAL_COLUMNS
from sim.model.presets import PRESETS
from sim.model.robot import Robot

# Input of a sweep -> the unit in which a file is written; each is a field of `Robot`.
LENGTHS = {"tail_length": "cm", "tail_radius": "mm", "head_radius": "mm", "head_length": "mm", "disc_offset": "mm"}
WITH_UNIT = {**LENGTHS, "youngs_modulus": "MPa", "viscosity": "Pa_s", "motor_speed": "rpm"}
WITHOUT_UNIT = {"N": "tails", "C_t": "C_t", "C_r": "C_r", "C_yr": "C_yr"}
FIELDS = {*WITH_UNIT, *WITHOUT_UNIT.values()}  # that a sweep may vary
_UNUSED = ("name", "sigmas", "learnt_from")  # of a robot, in a sweep


def robot_of_sweep(source: object, folder: Path) -> dict[str, Any]:
    """Load the robot that a sweep.toml names, as fields of `Robot` in SI units.

    Args:
        source: a preset, a file relative to the folder of the sweep.toml, or the fields as they were stored.
        folder: of the sweep.toml.

    Raises:
        InputError: there is no such robot, it has a law that holds between its runs only, or its fields are
            damaged.
    """
    if isinstance(source, dict):
        try:
            check_effects(Robot(name="", **source).effects)
        except (TypeError, AttributeError):
            raise InputError("the fields of its robot are damaged") from None
        return source
    if not isinstance(source, str):
        raise InputError(f"robot = {source!r}; give the name of a robot.toml or of a preset")
    return robot_fields(load_robot(source if source in PRESETS else folder / source))


def robot_fields(robot: Robot) -> dict[str, Any]:
    """Return the fields of a robot that a sweep keeps.

    Raises:
        InputError: the robot has a law that holds between its runs only.
    """
    if robot.learnt_from is not None:
        raise InputError(f"robot {robot.name!r} has a table [learnt_from], which no sweep covers; give it without")
    return {
        field.name: dict(value) if isinstance(value := getattr(robot, field.name), Mapping) else value
        for field in fields(robot)
        if field.name not in _UNUSED
    }


def input_of_robot(name: str) -> tuple[str, str]:
    """Return the field of `Robot` or the effect that an input of a sweep.toml names, and the suffix of its unit.

    Raises:
        InputError: there is no such input, or it has no unit.
    """
    if name in WITHOUT_UNIT or is_effect(name):
        return WITHOUT_UNIT.get(name, name), ""
    quantity, unit = split(name)
    if quantity in WITH_UNIT and unit is not None and unit.kind == UNITS[WITH_UNIT[quantity]].kind:
        return quantity, unit.suffix
    if name in WITH_UNIT:
        units = ", ".join(f"{name}_{suffix}" for suffix in of_kind(UNITS[WITH_UNIT[name]].kind))
        raise InputError(f"input {name!r} has no unit; give one of {units}")
    allowed = ", ".join((*WITHOUT_UNIT, *(f"{key}_{unit}" for key, unit in WITH_UNIT.items())))
    raise InputError(f"unknown input {name!r} of a robot; allowed are {allowed}, in any usual unit, and effects")


def converted(values: Mapping[str, Any], unit: str) -> Mapping[str, Any]:
    """Convert the range of an input to SI units; what is no range stays as it is."""
    try:
        low, high = values["range"]
        return {**values, "range": [to_si(float(low), unit), to_si(float(high), unit)]} if unit else values
    except (KeyError, TypeError, ValueError):
        return values


def robot_columns(robot: Mapping[str, Any], samples: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return the columns of robots, (rows,) each.

    Args:
        robot: fields of `Robot` in SI units.
        samples: fields and effects that differ between the rows, (rows,); a negative motor speed turns the motor
            the other way.
    """
    base = Robot(name="", **robot)
    effects = [name for name in samples if is_effect(name)]
    robots = []
    for values in zip(*(column.tolist() for column in samples.values()), strict=True):
        row = dict(zip(samples, values, strict=True))
        sizes = {**base.effects, **{name: row.pop(name) for name in effects}}
        tails, speed = int(row.pop("tails", base.tails)), abs(row.pop("motor_speed", base.motor_speed))
        robots.append(replace(base, tails=tails, motor_speed=speed, **row, effects=sizes))
    columns = group_columns(robots)
    if "motor_speed" in samples:
        columns["omega_bar"] = np.copysign(columns["omega_bar"], samples["motor_speed"])
    return {name: columns[name] for name in column_names(robot, samples)}


def column_names(robot: Mapping[str, Any], inputs: Mapping[str, object]) -> list[str]:
    """List the columns of the rows of a sweep around a robot."""
    effects = sorted({*robot["effects"], *(name for name in inputs if is_effect(name))})
    return [*GROUP_COLUMNS, *OPTIONAL_COLUMNS, *effects]


def sweep_toml(robot: Robot, source: str) -> str:
    """Write a sweep.toml around a robot: tail length, motor speed, N and coefficients; other inputs as comments.

    Args:
        robot: the robot.
        source: how the sweep.toml names it, see `robot_of_sweep`.
    """
    lines = [
        "# Sweep around a robot. An input has [low, high] and a scale: linear, log or integer. Inputs not listed",
        "# are those of the robot. Units are suffixes: tail_length_mm, motor_speed_rad_s, ...",
        f"robot = {json.dumps(Path(source).as_posix(), ensure_ascii=False)}",
        "rows = 1024",
        "seed = 1",
        "history_every = 8  # one block of 256 rows in so many has the memory of the dwell before",
        "",
        "[inputs]",
        _line("tail_length", "cm", robot.tail_length, 2 / 3, 4 / 3),
        _line("motor_speed", "rpm", robot.motor_speed, 1 / 3, 4 / 3, "log"),
        f'N = {{ range = [{max(1, robot.tails - 1)}, {robot.tails + 1}], scale = "integer" }}',
        *(_line(name, "", getattr(robot, name), 2 / 3, 4 / 3) for name in ("C_t", "C_r", "C_yr")),
        *(
            "# " + _line(name, unit, getattr(robot, name) or robot.head_radius, 0.9, 1.1)
            for name, unit in WITH_UNIT.items()
            if name not in ("tail_length", "motor_speed")
        ),
    ]
    return "\n".join(lines) + "\n"


def _line(name: str, unit: str, value: float, low: float, high: float, scale: str = "linear") -> str:
    shown = from_si(value, unit) if unit else value
    ends = ", ".join(f"{shown * share:.3g}" for share in (low, high))
    return f'{name}{"_" if unit else ""}{unit} = {{ range = [{ends}], scale = "{scale}" }}'
