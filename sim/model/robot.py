"""The robot in SI units. Only here SI units become dimensionless numbers and back.

Scales: length l, time μ0 l⁴/EI (2.207 s for the paper's control example), force EI/l², with EI = E π r0⁴/4. In
these units the motion depends only on the groups of `sim.model.groups`.

`sim.inputs` reads and writes robots as files.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from common.errors import InputError
from common.notebook import Shown
from common.units import UNITS, Sigma, format_length, from_si
from sim.model.entries import ENTRIES
from sim.model.groups import Groups, check_finite, check_positive, check_slenderness, check_tails
from sim.model.learnt_range import LearntRange
from sim.model.uncertainty import DEFAULTS


def bending_stiffness(numbers: Mapping[str, Any]) -> Any:
    """Compute EI = E π r0⁴/4 [N m²] from numbers of robots, by field of `Robot`: one each, or arrays."""
    return numbers["youngs_modulus"] * math.pi * numbers["tail_radius"] ** 4 / 4


def time_scale(numbers: Mapping[str, Any]) -> Any:
    """Compute the unit of time μ0 l⁴/EI [s] in the same way."""
    return numbers["viscosity"] * numbers["tail_length"] ** 4 / bending_stiffness(numbers)


def groups_of(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Compute the groups in the same way, by column name, for the positive direction of the motor."""
    return {
        "C_t": numbers["C_t"],
        "C_r": numbers["C_r"],
        "C_yr": numbers["C_yr"],
        "l_over_R": numbers["tail_length"] / numbers["head_radius"],
        "L_over_R": numbers["head_length"] / numbers["head_radius"],
        "l_over_r0": numbers["tail_length"] / numbers["tail_radius"],
        "omega_bar": numbers["motor_speed"] * time_scale(numbers),
        "N": 1.0 * numbers["tails"],
        "a_over_R": numbers["disc_offset"] / numbers["head_radius"],
    }


@dataclass(frozen=True, repr=False)
class Robot(Shown):
    """A robot and its fluid in SI units.

    Lengths are in m, Young's modulus in Pa, viscosity in Pa s, motor speed in rad/s (a magnitude; the direction is
    the control). `effects` maps names of `sim.effects` to sizes, which are checked when the robot is read or
    simulated.

    Example:
        >>> from softflagella import load_robot
        >>> robot = load_robot("paper-control")
        >>> round(robot.time_scale, 3), round(robot.omega_bar, 6)
        (2.207, 10.0)
    """

    name: str  # in messages and files
    tails: int  # N
    tail_length: float  # l [m]
    tail_radius: float  # r0 [m]
    youngs_modulus: float  # E of the tails [Pa]
    head_radius: float  # R [m]
    head_length: float  # L [m]
    viscosity: float  # μ0 [Pa s]
    motor_speed: float  # ω, tails relative to head, a magnitude [rad/s]
    C_t: float  # the head's translational drag
    C_r: float  # the head's spin drag
    C_yr: float  # the head's side force
    disc_offset: float | None = None  # a; None: the head's radius
    effects: Mapping[str, float] = field(default_factory=dict)  # name -> size
    sigmas: Mapping[str, Sigma] = field(default_factory=dict)  # of the fields that state one, see `sigma`
    learnt_from: LearntRange | None = None  # the runs that its law was learnt from

    def __post_init__(self) -> None:
        check_tails(self.tails)
        for name in ("tail_length", "tail_radius", "youngs_modulus", "head_radius", "head_length",
                     "viscosity", "motor_speed", "C_t", "C_r"):  # fmt: skip
            check_positive(name, getattr(self, name))
        if self.disc_offset is not None:
            check_positive("disc_offset", self.disc_offset)
        check_finite("C_yr", self.C_yr)
        check_slenderness(self.tail_length / self.tail_radius)
        try:
            numbers = [self.time_scale, *self._given_groups().values()]
        except ArithmeticError:
            numbers = [math.inf]
        if not all(map(math.isfinite, numbers)) or not self.omega_bar > 0:
            raise InputError("lengths, stiffness and viscosity give no finite unit of time; check their units")

    def __repr__(self) -> str:
        length, radius, R, L = map(
            format_length, (self.tail_length, self.tail_radius, self.head_radius, self.head_length)
        )
        modulus, rpm = from_si(self.youngs_modulus, "MPa"), from_si(self.motor_speed, "rpm")
        tails = "1 tail" if self.tails == 1 else f"{self.tails} tails"
        lines = [
            f"Robot {self.name!r}: {tails}, l = {length}, r0 = {radius}, E = {modulus:.4g} MPa",
            f"  head R = {R}, L = {L}; fluid {self.viscosity:.4g} Pa s; motor {rpm:.4g} rpm",
            f"  C_t = {self.C_t:.4g}, C_r = {self.C_r:.4g}, C_yr = {self.C_yr:.4g}; "
            f"ω̄ = {self.omega_bar:.4g}, unit of time {self.time_scale:.4g} s",
        ]
        if self.effects:
            lines.append("  effects: " + ", ".join(f"{name} {size:.4g}" for name, size in self.effects.items()))
        return "\n".join(lines)

    def quantities(self) -> list[tuple[str, str]]:
        """List the numbers of robot.toml with units, stated standard deviations, and effects."""
        rows = []
        for entry in ENTRIES:
            if (value := getattr(self, entry.field)) is not None:
                numbers = [value, *([self.sigmas[entry.field].of(value)] if entry.field in self.sigmas else [])]
                words = [f"{entry.written(number):.4g}" for number in numbers]
                unit = f" {UNITS[entry.unit].text}" if entry.unit else ""
                name = entry.quantity.replace("_", " ") if entry.unit else entry.quantity
                rows.append((f"{entry.table}, {name}", f"{' ± '.join(words)}{unit}"))
        effects = [(f"effect {name}", f"{size:.4g}") for name, size in self.effects.items()]
        return [*rows, ("unit of time", f"{self.time_scale:.4g} s"), *effects]

    def number(self, name: str) -> float:
        """Return a number in SI units; the disc offset is by default the head's radius."""
        value: float | None = getattr(self, name)
        return self.head_radius if value is None else value

    def sigma(self, name: str) -> Sigma:
        """Return one standard deviation of a field, as stated or by default (`sim.model.uncertainty`)."""
        return self.sigmas.get(name, DEFAULTS[name])

    @property
    def bending_stiffness(self) -> float:
        """EI = E π r0⁴/4 [N m²]."""
        return float(bending_stiffness(vars(self)))

    @property
    def length_scale(self) -> float:
        """The unit of length, l [m]."""
        return self.tail_length

    @property
    def time_scale(self) -> float:
        """The unit of dimensionless time, μ0 l⁴/EI [s]."""
        return float(time_scale(vars(self)))

    @property
    def omega_bar(self) -> float:
        """Dimensionless motor speed ω̄ (magnitude)."""
        return self.motor_speed * self.time_scale

    def group_values(self) -> dict[str, float]:
        """Compute the dimensionless groups of this robot by column name, for the positive direction of the motor.

        Raises:
            InputError: the robot has a law, and is outside the runs that it was learnt from.
        """
        values = self._given_groups()
        if self.learnt_from is not None:
            self.learnt_from.check(values)
        return values

    def _given_groups(self) -> dict[str, float]:
        """Compute the groups of any robot, within the runs of its law or not."""
        return {**groups_of({**vars(self), "disc_offset": self.number("disc_offset")}), **self.effects}

    def groups(self) -> Groups:
        """Return this robot as a batch of one."""
        return Groups.from_columns(self.group_values())

    @property
    def outline(self) -> tuple[float, float, float]:
        """Front and back of head and straight tails, forward from the head's centre, and half of the width [l]."""
        half = self.head_length / 2 / self.tail_length
        width = max(self.head_radius, self.number("disc_offset") + self.tail_radius)
        return half, -half - 1.0, width / self.tail_length

    def with_motor(self, omega_bar: float) -> Robot:
        """Return the same robot with the motor speed that gives `omega_bar`."""
        return replace(self, motor_speed=abs(omega_bar) / self.time_scale)
