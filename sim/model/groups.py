"""Dimensionless robots: the groups that the motion depends on, and the columns that hold them.

    C_t, C_r, C_yr   the head's drag, spin and side-force coefficients
    l/R, L/R, l/r0   tail length, head length, tail slenderness
    a/R              radius of the circle on which the tails are clamped (default 1: the paper does not print it;
                     its one measured point and the balance of torque give a value near 1)
    ω̄ = ω μ0 l⁴/EI   motor speed, tails relative to head, signed
    N                number of tails

and the sizes of the effects of `sim.effects` (absent means null). SLOPE_INPUTS and SLOPE_OUTPUTS are the names in
derivatives of the steady motion, which `sim.motion.sensitivity` gives and data sets store.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from common.arrays import Flags, Floats, Integers
from common.errors import InputError

MOTOR_SPEED = "motor speed, tails relative to head"  # what omega_bar is
GROUP_COLUMNS = ("C_t", "C_r", "C_yr", "l_over_R", "L_over_R", "l_over_r0", "omega_bar", "N")
OPTIONAL_COLUMNS = ("a_over_R",)
SLOPE_INPUTS = ("C_t", "C_r", "C_yr", "l_over_R", "L_over_R", "l_over_r0", "omega_bar", "a_over_R")
SLOPE_OUTPUTS = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l", "theta_rad")
DWELL = "dwell_bar"  # switching half-period, beside the robot in sweeps and look-ups
MOST_TAILS = 64
LEAST_SLENDERNESS = 5.0
_POSITIVE = ("C_t", "C_r", "l_over_R", "L_over_R", "a_over_R")


@dataclass(frozen=True)
class Groups:
    """Dimensionless robots, B of them with the same number of tails N; arrays are (B,)."""

    C_t: Floats
    C_r: Floats
    C_yr: Floats
    l_over_R: Floats
    L_over_R: Floats
    l_over_r0: Floats
    omega_bar: Floats
    a_over_R: Floats
    N: int
    effects: Mapping[str, Floats] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.omega_bar)

    @staticmethod
    def from_columns(columns: Mapping[str, Any]) -> Groups:
        """Make robots from columns of numbers, checked; all rows must have one N.

        Args:
            columns: GROUP_COLUMNS, optionally a_over_R, each (B,) or one number. Every other column is the size of
                an effect.

        Raises:
            InputError: a missing column, a number that is not finite or out of its range.
        """
        values = checked_values(columns)
        counts = np.unique(values["N"])
        if len(counts) != 1:
            raise InputError(f"a batch has one N; these rows have {counts.astype(int).tolist()}: split them")
        sizes = {name: array.copy() for name, array in values.items() if name != "N"}
        groups = {name: sizes.pop(name) for name in (*GROUP_COLUMNS, *OPTIONAL_COLUMNS) if name != "N"}
        return Groups(**groups, N=int(counts[0]), effects=sizes)

    def reversed(self) -> Groups:
        """Return the same robots with their motors reversed: an odd effect changes more of them than ω̄."""
        return replace(self, omega_bar=-self.omega_bar)

    def select(self, rows: Integers | Flags) -> Groups:
        """Select the robots at indices or flags."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        picked: dict[str, Any] = {k: v[rows] for k, v in values.items() if k not in ("N", "effects")}
        return replace(self, **picked, effects={name: size[rows] for name, size in self.effects.items()})


def checked_values(columns: Mapping[str, Any]) -> dict[str, Floats]:
    """Convert columns of robots to float64 arrays, with a_over_R filled in; reject numbers that no robot has.

    Names that are no group are taken for effects here; `sim.inputs.check_columns` knows which there are.
    """
    missing = [name for name in GROUP_COLUMNS if name not in columns]
    if missing:
        raise InputError(f"missing column {missing[0]!r}; a robot needs {', '.join(GROUP_COLUMNS)}")
    values: dict[str, Floats] = {}
    for name, raw in columns.items():
        try:
            values[name] = np.atleast_1d(np.asarray(raw, dtype=float))
        except (TypeError, ValueError, OverflowError):
            raise InputError(f"column {name!r} has a value that is no number; give numbers") from None
    if not len(values["N"]):
        raise InputError("no rows: give at least one robot")
    values.setdefault("a_over_R", np.ones_like(values["N"]))
    if not np.isfinite(np.concatenate([array.ravel() for array in values.values()])).all():
        for name, array in values.items():
            for row in np.flatnonzero(~np.isfinite(array))[:1]:
                raise InputError(f"{name} = {array[row]} in row {row + 1}; it must be a finite number")
    if (np.concatenate([values[name].ravel() for name in _POSITIVE]) <= 0).any():
        for name in _POSITIVE:
            for row in np.flatnonzero(values[name] <= 0)[:1]:
                raise InputError(f"{name} = {values[name][row]:g} in row {row + 1}; it must be above 0")
    for row in np.flatnonzero(values["l_over_r0"] <= LEAST_SLENDERNESS)[:1]:
        check_slenderness(float(values["l_over_r0"][row]))
    if not values["omega_bar"].all():
        row = np.flatnonzero(values["omega_bar"] == 0)[0]
        raise InputError(f"omega_bar = 0 in row {row + 1}; the motor must turn: give a non-zero speed")
    for count in sorted(set(values["N"].ravel().tolist())):
        check_tails(count)
    return values


def check_tails(count: float) -> None:
    """Refuse a number of tails that no robot has."""
    if not math.isfinite(count) or count != int(count) or not 1 <= count <= MOST_TAILS:
        raise InputError(f"N = {count:g}; the number of tails is an integer from 1 to {MOST_TAILS}")


def check_finite(name: str, value: float) -> None:
    """Refuse what is no finite number."""
    if not isinstance(value, int | float) or not abs(value) < sys.float_info.max:  # there are larger integers
        raise InputError(f"{name} = {value}; it must be a finite number")


def check_positive(name: str, value: float) -> None:
    """Refuse what is no finite number above 0."""
    check_finite(name, value)
    if value <= 0:
        raise InputError(f"{name} = {value:g}; it must be above 0")


def check_slenderness(ratio: float) -> None:
    """Refuse tails that are too stout for resistive force theory."""
    if not ratio > LEAST_SLENDERNESS:
        raise InputError(
            f"l/r0 = {ratio:g}; resistive force theory needs slender tails: above {LEAST_SLENDERNESS:g}"
        )
