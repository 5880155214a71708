"""Steady motion of robots: the numbers of a row, whichever way it was solved, and in the units of a lab.

    means:  ω_t, ω_h, ω_yr, v_x, v_z (of the head's centre, body frame), over whole revolutions
    R_yr = √(v_x² + v_z²)/|ω_yr|,   θ = atan2(|v_x|, v_z)

R_yr and θ are those of the head's centre. Those of another point of the axis follow from (v_x, v_z, ω_yr).
docs/reference/signs.md defines the signs. Units: l, μ0 l⁴/EI.

In the units of a lab, under the column names of a measured table, with the units of length l and time T = μ0 l⁴/EI
of the robot,

    ω [rpm] = (60/2π) ω̄/T,   ω_yr [rad/s] = ω̄_yr/T,   R_yr [cm] = l R̄_yr,   v [cm/s] = l √(v_x² + v_z²)/T,

and a circle takes 2π/|ω_yr|. Spins and yaw rate are signed; speed is that of the head's centre, too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from common.arrays import Flags, Floats, Integers, Words
from sim.effects.tail_contact import EFFECT as CONTACT
from sim.effects.tail_contact import least_gap
from sim.mechanics import planar
from sim.model.response import BEFORE, DWELLS, at_equal_dwells
from sim.model.robot import Robot

DIRECT, STEPPING = "direct", "stepping"
STEADY_OUTPUTS = (
    "omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l", "theta_deg", "tail_gap",
)  # fmt: skip
STEADY_COLUMNS = (*STEADY_OUTPUTS[:-1], "converged", STEADY_OUTPUTS[-1])
STABILITY_COLUMNS = ("stable", "growth")
QUALITY_COLUMNS = (*STABILITY_COLUMNS, "error", "method", "note")  # how good a row is, beside its numbers
RPM = 2 * math.pi / 60  # rad/s
LARGE_ERROR = 0.2  # estimated relative error above which a number is not an answer
# Column in lab units: what it is, its unit, the column that it is made from, and that one's unit.
_QUANTITIES = {
    "omega_h_rpm": ("spin of the head", "rpm", "omega_h_bar", "EI/(μ0 l⁴)"),
    "omega_t_rpm": ("spin of the tails", "rpm", "omega_t_bar", "EI/(μ0 l⁴)"),
    "omega_yr_rad_s": ("yaw rate", "rad/s", "omega_yr_bar", "EI/(μ0 l⁴)"),
    "R_yr_cm": ("turn radius", "cm", "R_yr_over_l", "l"),
    "theta_deg": ("slip angle", "degrees", "", ""),
    "v_cm_s": ("speed", "cm/s", "", "EI/(μ0 l³)"),
    "circle_s": ("time of a circle", "s", "", "μ0 l⁴/EI"),
}
LAB_COLUMNS = tuple(_QUANTITIES)


def lab_title(column: str) -> str:
    """Return what a column of LAB_COLUMNS is, with its unit: speed [cm/s]."""
    return "{} [{}]".format(*_QUANTITIES[column][:2])


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
        """Return the columns of the command `softflagella steady`."""
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


def net_speeds(
    twist: Floats, lag: Floats, memory: Floats, before: Floats = BEFORE, dwells: Floats = DWELLS
) -> Floats:
    """Compute the net speed (B, D) of equal dwells, NaN for those shorter than the first `before`.

    Args:
        twist: steady twists (B, 3), as `twists` returns them.
        lag, memory: curves of the response, (B, D, 3) and (B, K, D, 3), see `sim.model.response`.
        before: T̄ of the dwell before, (K,).
        dwells: T̄ of the curves, (D,).
    """
    speed = planar.net_speed(twist[:, None], lag + at_equal_dwells(memory, before, dwells), dwells)
    return np.where(dwells < before[0], np.nan, speed)


def lab_columns(motion: Mapping[str, Any], length_cm: Any, time_s: Any) -> dict[str, Floats]:
    """Convert a dimensionless motion to LAB_COLUMNS, each (M,).

    Args:
        motion: columns of the steady motion, STEADY_OUTPUTS, each (M,).
        length_cm: tail length of each robot [cm], (M,) or one for all.
        time_s: time scale of each robot [s], (M,) or one for all.
    """
    length, time = np.asarray(length_cm, dtype=float), np.asarray(time_s, dtype=float)
    speed = np.hypot(motion["v_x"], motion["v_z"])
    with np.errstate(divide="ignore"):  # a robot that does not turn never completes a circle
        circle = 2 * math.pi * time / np.abs(motion["omega_yr_bar"])
    return {
        "omega_h_rpm": motion["omega_h_bar"] * (1 / time / RPM),
        "omega_t_rpm": motion["omega_t_bar"] * (1 / time / RPM),
        "omega_yr_rad_s": motion["omega_yr_bar"] / time,
        "R_yr_cm": motion["R_yr_over_l"] * length,
        "theta_deg": np.asarray(motion["theta_deg"]),
        "v_cm_s": speed * length / time,
        "circle_s": circle,
    }


def lab_motion(robots: Sequence[Robot], motion: Mapping[str, Any]) -> dict[str, Floats]:
    """Convert the motions of M robots, in the simulator's units, to LAB_COLUMNS, each (M,)."""
    length = np.array([100 * robot.tail_length for robot in robots])
    return lab_columns(motion, length, np.array([robot.time_scale for robot in robots]))


def describe_motion(robot: Robot, motion: Mapping[str, Any], *, error: str = "estimated relative error") -> str:
    """Write the motion of one robot as lines: lab units, then dimensionless, and the error if it is known.

    Args:
        robot: the robot.
        motion: columns of its steady motion, each (1,); its stability is described if it is known.
        error: what the column `error` is.
    """
    lab = {name: float(values[0]) for name, values in lab_motion([robot], motion).items()}
    plain = {
        "v_cm_s": float(np.hypot(motion["v_x"], motion["v_z"])[0]),
        "circle_s": lab["circle_s"] / robot.time_scale,
    }
    tails = "1 tail" if robot.tails == 1 else f"{robot.tails} tails"
    wrong = float(motion["error"][0]) if "error" in motion else 0.0
    digits, beside = (1, f" ± {100 * wrong:.0f} %") if wrong > LARGE_ERROR else (4, "")
    lines = [
        f"{robot.name}: {tails} of {100 * robot.tail_length:.4g} cm, motor at "
        f"{robot.motor_speed / RPM:.4g} rpm, fluid of {robot.viscosity:.4g} Pa s"
    ]
    for name, (what, unit, column, plain_unit) in _QUANTITIES.items():
        line = f"  {what:18}{lab[name]:>10.{digits}g} {unit}{beside}"
        if plain_unit:
            bare = float(motion[column][0]) if column else plain[name]
            line = f"{line:40} ({bare:.{digits}g} {plain_unit})"
        lines.append(line)
    if motion["tail_gap"][0] < least_gap(robot.effects.get(CONTACT.name, 0.0)):
        lines.append(
            f"  the tails touch, and nothing keeps them apart in the model: add the effect {CONTACT.name}"
        )
    if "growth" in motion and np.isfinite(motion["growth"][0]):
        factor = math.exp(float(motion["growth"][0]))
        lines.append(
            f"  {'stable' if motion['stable'][0] else 'unstable'}: in a motor revolution small "
            f"perturbations change by a factor of {factor:.2g}"
        )
    if "error" in motion:
        lines.append(f"  {error} {100 * wrong:.2g} %{': do not rely on these numbers' if beside else ''}")
    return "\n".join(lines)
