"""Steady motion of robots: the numbers of a row, whichever way it was solved.

    means:  ω_t, ω_h, ω_yr, v_x, v_z (of the head's centre, body frame), over whole revolutions
    R_yr = √(v_x² + v_z²)/|ω_yr|,   θ = atan2(|v_x|, v_z)

R_yr and θ are those of the head's centre. Those of another point of the axis follow from (v_x, v_z, ω_yr).
docs/reference/signs.md defines the signs.
Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from sim.arrays import Flags, Floats, Integers, Words
from sim.mechanics import planar
from sim.model.response import BEFORE, DWELLS, at_equal_dwells

DIRECT, STEPPING = "direct", "stepping"
STEADY_OUTPUTS = (
    "omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l", "theta_deg", "tail_gap",
)  # fmt: skip
STEADY_COLUMNS = (*STEADY_OUTPUTS[:-1], "converged", STEADY_OUTPUTS[-1])
STABILITY_COLUMNS = ("stable", "growth")
QUALITY_COLUMNS = (*STABILITY_COLUMNS, "error", "method", "note")  # how good a row is, beside its numbers


@dataclass(frozen=True)
class Steady:
    """Mean motion of B robots; all (B,), dimensionless; NaN where `failed`."""

    omega_t: Floats
    omega_h: Floats
    omega_yr: Floats
    v_x: Floats
    v_z: Floats
    tail_gap: Floats  # smallest distance between tails over 2 r0; below 1 they touch
    error: Floats  # estimated relative error of the means (velocities: of the speed); NaN: unknown
    converged: Flags  # the motion is steady and solved to tolerance
    failed: Flags  # no numbers
    method: Words  # DIRECT or STEPPING
    growth: Floats  # logarithm of the growth of small perturbations in a motor revolution; NaN: unknown
    note: Words  # why a row is not converged, not stable, or not solved directly; else empty

    def __len__(self) -> int:
        return len(self.omega_t)

    @property
    def means(self) -> Floats:
        """ω_t, ω_h, ω_yr, v_x and v_z, (B, 5)."""
        return np.stack([self.omega_t, self.omega_h, self.omega_yr, self.v_x, self.v_z], -1)

    @property
    def turn_radius(self) -> Floats:
        """R_yr/l of the head's centre."""
        return np.asarray(np.hypot(self.v_x, self.v_z) / np.abs(self.omega_yr))

    @property
    def slip_angle(self) -> Floats:
        """θ [rad], between the axis and the tangent of the path."""
        return np.asarray(np.arctan2(np.abs(self.v_x), self.v_z))

    @property
    def stable(self) -> Flags:
        """Whether small perturbations decay; time steps settle on a motion only if they do."""
        return np.where(self.method == STEPPING, self.converged, self.converged & (self.growth < 0))

    @np.errstate(all="ignore")  # robots that do not turn have no radius
    def columns(self) -> dict[str, Any]:
        """Return the columns of the command `softflagella sim steady`."""
        values = (
            self.omega_t, self.omega_h, self.omega_yr, self.v_x, self.v_z,
            self.turn_radius, np.degrees(self.slip_angle), self.converged, self.tail_gap,
            self.stable, self.growth, self.error, self.method, self.note,
        )  # fmt: skip
        return dict(zip((*STEADY_COLUMNS, *QUALITY_COLUMNS), values, strict=True))

    def at(self, rows: Integers) -> Steady:
        """Return the rows at `rows`."""
        return Steady(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})

    def with_rows(self, rows: Integers, other: Steady) -> Steady:
        """Replace `rows` of this motion by those of `other`."""
        changed = {}
        for field in fields(self):
            values = getattr(self, field.name)
            wide = np.asarray(values, dtype=object if values.dtype.kind == "U" else None).copy()
            wide[rows] = getattr(other, field.name)
            changed[field.name] = wide.astype(str) if values.dtype.kind == "U" else wide
        return Steady(**changed)


def joined(parts: Sequence[Steady]) -> Steady:
    """Join the rows of motions, one after the other."""
    return Steady(**{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Steady)})


def twists(surge: Floats, sway: Floats, yaw_rate: Floats, sense: Floats) -> Floats:
    """Compute the steady twists (B, 3), forward, left and yaw rate, seen as for a positive motor.

    Args:
        surge, sway, yaw_rate: v_z, v_x and ω_yr, (B,) each.
        sense: direction of the motor, ±1, (B,).
    """
    return np.stack([surge, sense * sway, sense * yaw_rate], -1)


def net_speeds(twist: Floats, lag: Floats, memory: Floats, before: Floats = BEFORE) -> Floats:
    """Compute the net speed (B, D) of equal dwells DWELLS.

    Args:
        twist: steady twists (B, 3), as `twists` returns them.
        lag, memory: curves of the response, (B, D, 3) and (B, K, D, 3), see `sim.model.response`.
        before: T̄ of the dwell before, (K,).
    """
    return planar.net_speed(twist[:, None], lag + at_equal_dwells(memory, before), DWELLS)
