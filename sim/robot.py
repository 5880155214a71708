"""The robot: dimensions and materials in SI, and the dimensionless groups that the simulator knows.

The one place where SI becomes dimensionless and back. Scales: length l, time μ0 l⁴/EI (2.207 s for the
paper's control example), force EI/l², with EI = E π r0⁴/4. In them the motion depends on

    C_t, C_r, C_yr   the head's drag, spin and side-force coefficients
    l/R, L/R, l/r0   tail length, head length, tail slenderness
    a/R              radius of the circle on which the tails are clamped (default 1: not printed in the
                     paper; its one measured point and the balance of torque put it there)
    ω̄ = ω μ0 l⁴/EI   motor speed, head relative to tails, signed
    N                number of tails

and on the sizes of the effects in `sim.effects` (absent means null).

Files: robot.toml with tables [head], [tails], [fluid], [motor], [drag] and, if any, [effects]; units are
in the key names. Source of the presets: Du, Miller, Jawed (arXiv 2103.05712); its two sets of fitted
coefficients are both kept, by name.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from sim.effects import catalogue
from sim.errors import InputError

GROUP_COLUMNS = ("C_t", "C_r", "C_yr", "l_over_R", "L_over_R", "l_over_r0", "omega_bar", "N")
OPTIONAL_COLUMNS = ("a_over_R",)
DWELL = "dwell_bar"  # switching half-period, beside the robot in sweeps and look-ups
_POSITIVE = ("C_t", "C_r", "l_over_R", "L_over_R", "a_over_R")
_MOST_TAILS = 64


@dataclass(frozen=True)
class Robot:
    """A robot and its fluid in SI units.

    Lengths in m, Young's modulus in Pa, viscosity in Pa s, motor speed in rad/s (magnitude; the
    direction is the control). Effects map names of `sim.effects` to sizes.
    """

    name: str
    tails: int
    tail_length: float
    tail_radius: float
    youngs_modulus: float
    head_radius: float
    head_length: float
    viscosity: float
    motor_speed: float
    C_t: float
    C_r: float
    C_yr: float
    disc_offset: float | None = None  # a; None: the head's radius
    effects: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_tails(self.tails)
        for name in ("tail_length", "tail_radius", "youngs_modulus", "head_radius", "head_length",
                     "viscosity", "motor_speed", "C_t", "C_r"):  # fmt: skip
            _check_positive(name, getattr(self, name))
        if self.disc_offset is not None:
            _check_positive("disc_offset", self.disc_offset)
        _check_finite("C_yr", self.C_yr)
        _check_slenderness(self.tail_length / self.tail_radius)
        check_effects(self.effects)

    @property
    def bending_stiffness(self) -> float:
        """EI = E π r0⁴/4 [N m²]."""
        return self.youngs_modulus * math.pi * self.tail_radius**4 / 4

    @property
    def time_scale(self) -> float:
        """μ0 l⁴/EI [s]: one dimensionless time unit."""
        return self.viscosity * self.tail_length**4 / self.bending_stiffness

    @property
    def omega_bar(self) -> float:
        """Dimensionless motor speed ω̄ (magnitude)."""
        return self.motor_speed * self.time_scale

    def group_values(self) -> dict[str, float]:
        """The dimensionless groups of this robot by column name (positive motor direction)."""
        return {
            "C_t": self.C_t,
            "C_r": self.C_r,
            "C_yr": self.C_yr,
            "l_over_R": self.tail_length / self.head_radius,
            "L_over_R": self.head_length / self.head_radius,
            "l_over_r0": self.tail_length / self.tail_radius,
            "omega_bar": self.omega_bar,
            "N": float(self.tails),
            "a_over_R": (self.disc_offset or self.head_radius) / self.head_radius,
            **self.effects,
        }

    def groups(self) -> Groups:
        """This robot as a batch of one."""
        return Groups.from_columns({k: np.array([v]) for k, v in self.group_values().items()})

    def with_motor(self, omega_bar: float) -> Robot:
        """The same robot with the motor speed that gives `omega_bar`."""
        return replace(self, motor_speed=abs(omega_bar) / self.time_scale)


@dataclass(frozen=True)
class Groups:
    """Dimensionless robots, B of them with the same number of tails N; tensors are (B,), float64."""

    C_t: Tensor
    C_r: Tensor
    C_yr: Tensor
    l_over_R: Tensor
    L_over_R: Tensor
    l_over_r0: Tensor
    omega_bar: Tensor
    a_over_R: Tensor
    N: int
    effects: Mapping[str, Tensor] = field(default_factory=dict)

    def __len__(self) -> int:
        return self.omega_bar.shape[0]

    @staticmethod
    def from_columns(columns: Mapping[str, np.ndarray]) -> Groups:
        """Robots from columns of numbers, checked; all rows must have one N.

        Args:
            columns: GROUP_COLUMNS, optionally a_over_R and effect sizes, each (B,).

        Raises:
            InputError: a missing column, a number that is not finite or out of its range.
        """
        values = check_columns(columns)
        counts = np.unique(values["N"])
        if len(counts) != 1:
            raise InputError(f"a batch has one N; these rows have {counts.astype(int).tolist()}: split them")
        tensors = {name: torch.tensor(array, dtype=torch.float64) for name, array in values.items() if name != "N"}
        effects = {name: tensors.pop(name) for name in list(tensors) if name in catalogue()}
        return Groups(**tensors, N=int(counts[0]), effects=effects)

    def select(self, lanes: Tensor) -> Groups:
        """The rows at `lanes`."""
        own = {f.name: getattr(self, f.name) for f in fields(self)}
        picked: dict[str, Any] = {k: v[lanes] for k, v in own.items() if torch.is_tensor(v)}
        return replace(self, **picked, effects={name: size[lanes] for name, size in self.effects.items()})


def check_columns(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Columns of robots as float64 arrays, with a_over_R filled in; rejects what cannot be simulated."""
    missing = [name for name in GROUP_COLUMNS if name not in columns]
    if missing:
        raise InputError(f"missing column {missing[0]!r}; a robot needs {', '.join(GROUP_COLUMNS)}")
    known = {*GROUP_COLUMNS, *OPTIONAL_COLUMNS, *catalogue()}
    unknown = sorted(set(columns) - known)
    if unknown:
        raise InputError(
            f"unknown column {unknown[0]!r}; allowed are {', '.join(sorted(known))}: rename or drop it"
        )
    values: dict[str, np.ndarray] = {}
    for name, raw in columns.items():
        try:
            values[name] = np.asarray(raw, dtype=float)
        except (TypeError, ValueError):
            raise InputError(f"column {name!r} has a value that is no number; give numbers") from None
    if not len(values["N"]):
        raise InputError("no rows: give at least one robot")
    values.setdefault("a_over_R", np.ones_like(values["N"]))
    for name, array in values.items():
        for row in np.flatnonzero(~np.isfinite(array))[:1]:
            raise InputError(f"{name} = {array[row]} in row {row + 1}; it must be a finite number")
    for name in _POSITIVE:
        for row in np.flatnonzero(values[name] <= 0)[:1]:
            raise InputError(f"{name} = {values[name][row]:g} in row {row + 1}; it must be above 0")
    for row in np.flatnonzero(values["l_over_r0"] <= 5)[:1]:
        _check_slenderness(float(values["l_over_r0"][row]))
    for row in np.flatnonzero(values["omega_bar"] == 0)[:1]:
        raise InputError(f"omega_bar = 0 in row {row + 1}; the motor must turn: give a non-zero speed")
    for count in np.unique(values["N"]):
        _check_tails(count)
    for name in set(values) & set(catalogue()):
        for size in values[name]:
            check_effects({name: float(size)})
    return values


def _check_tails(count: float) -> None:
    if not math.isfinite(count) or count != int(count) or not 1 <= count <= _MOST_TAILS:
        raise InputError(f"N = {count:g}; the number of tails is an integer from 1 to {_MOST_TAILS}")


def _check_finite(name: str, value: float) -> None:
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{name} = {value}; it must be a finite number")


def _check_positive(name: str, value: float) -> None:
    _check_finite(name, value)
    if value <= 0:
        raise InputError(f"{name} = {value:g}; it must be above 0")


def _check_slenderness(ratio: float) -> None:
    if not ratio > 5:
        raise InputError(f"l/r0 = {ratio:g}; resistive force theory needs slender tails: above 5")


def check_effects(effects: Mapping[str, float]) -> None:
    """Reject unknown effects and sizes outside their bounds."""
    for name, size in effects.items():
        if name not in catalogue():
            raise InputError(f"unknown effect {name!r}; known are {', '.join(catalogue())}")
        _check_finite(name, size)
        low, high = catalogue()[name].bounds
        if not low <= size <= high:
            raise InputError(f"{name} = {size:g}; its size must lie from {low:g} to {high:g}")


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


def load_robot(source: str | Path) -> Robot:
    """A robot from a preset's name or a robot.toml.

    Raises:
        InputError: the file is no robot; the line says which key and what is allowed.
    """
    if str(source) in PRESETS:
        return PRESETS[str(source)]
    path = Path(source)
    if not path.is_file():
        raise InputError(f"no robot {str(source)!r}; give a robot.toml or one of {', '.join(PRESETS)}")
    try:
        tables = tomllib.loads(path.read_text())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as broken:
        raise InputError(f"{path} is not TOML: {broken}") from None
    name = tables.pop("name", path.stem)
    effects = tables.pop("effects", {})
    values: dict[str, object] = {}
    for table, content in tables.items():
        for key, value in content.items() if isinstance(content, dict) else [("", content)]:
            if (table, key) not in _TOML:
                allowed = ", ".join(f"[{t}] {k}" for t, k in _TOML)
                raise InputError(f"{path}: unknown entry [{table}] {key}; allowed are {allowed}")
            values[_TOML[table, key]] = value
    for (table, key), attribute in _TOML.items():
        if attribute not in values and attribute not in _OPTIONAL_KEYS:
            raise InputError(f"{path}: missing entry [{table}] {key}")
        if attribute in values and not isinstance(values[attribute], int | float):
            raise InputError(f"{path}: [{table}] {key} = {values[attribute]!r}; give a number")
    return Robot(name=str(name), effects=dict(effects), **values)  # type: ignore[arg-type]


def robot_toml(robot: Robot) -> str:
    """The text of a robot.toml that `load_robot` reads back to the same robot."""
    tables: dict[str, list[str]] = {}
    for (table, key), attribute in _TOML.items():
        value = getattr(robot, attribute)
        if value is not None:
            tables.setdefault(table, []).append(f"{key} = {value!r}")
    if robot.effects:
        tables["effects"] = [f"{name} = {float(size)!r}" for name, size in robot.effects.items()]
    blocks = ["\n".join([f"[{table}]", *lines]) for table, lines in tables.items()]
    return "\n\n".join([f'name = "{robot.name}"', *blocks]) + "\n"


def _paper(name: str, **changes: object) -> Robot:
    base = Robot(
        name=name,
        tails=2,
        tail_length=0.11,
        tail_radius=3.2e-3,
        youngs_modulus=1.2e6,
        head_radius=0.016,
        head_length=0.06,
        viscosity=1.49,
        motor_speed=1.0,
        C_t=3.0,
        C_r=2.8,
        C_yr=2.0,
    )
    return replace(base, **changes)  # type: ignore[arg-type]


_FITTED = {"C_t": 4.0, "C_r": 2.06, "C_yr": 6.0}  # the paper's fit to its experiments

PRESETS: dict[str, Robot] = {
    # Control section: N = 2, ω̄ = ±10, C = (3.0, 2.8, 2.0).
    "paper-control": _paper("paper-control").with_motor(10.0),
    # The same robot with four tails, for the triangle of its first figure (N = 4, l = 11 cm). The motor speed
    # there is not given; at ω̄ = 10 the tails stay apart, at its measured 143.66 rpm the model has them touch.
    "paper-triangle": _paper("paper-triangle", tails=4).with_motor(10.0),
    # Its one measured point: N = 4, l = 11 cm, 143.66 rpm.
    "paper-measured": _paper("paper-measured", tails=4, motor_speed=143.66 * 2 * math.pi / 60, **_FITTED),
}
