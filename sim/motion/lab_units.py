"""The steady motion of a robot in the units of a lab, under the column names of a measured table.

    ω [rpm] = (60/2π) ω̄/T,   ω_yr [rad/s] = ω̄_yr/T,   R_yr [cm] = l R̄_yr,   v [cm/s] = l √(v_x² + v_z²)/T

with the units of length l and time T = μ0 l⁴/EI of the robot. A circle takes 2π/|ω_yr|. Spins and yaw rate are
signed. Turn radius, slip angle and speed are those of the head's centre.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sim.arrays import Floats
from sim.effects.tail_contact import EFFECT as CONTACT
from sim.effects.tail_contact import least_gap
from sim.model.robot import Robot

RPM = 2 * math.pi / 60  # rad/s
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


def lab_columns(motion: Mapping[str, Any], length_cm: Any, time_s: Any) -> dict[str, Floats]:
    """Convert a dimensionless motion to LAB_COLUMNS, each (M,).

    Args:
        motion: columns of the steady motion (`sim.motion.steady_motion.STEADY_OUTPUTS`), each (M,).
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
    lines = [
        f"{robot.name}: {tails} of {100 * robot.tail_length:.4g} cm, motor at "
        f"{robot.motor_speed / RPM:.4g} rpm, fluid of {robot.viscosity:.4g} Pa s"
    ]
    for name, (what, unit, column, plain_unit) in _QUANTITIES.items():
        line = f"  {what:18}{lab[name]:>10.4g} {unit}"
        if plain_unit:
            bare = float(motion[column][0]) if column else plain[name]
            line = f"{line:40} ({bare:.4g} {plain_unit})"
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
        lines.append(f"  {error} {100 * float(motion['error'][0]):.2g} %")
    return "\n".join(lines)
