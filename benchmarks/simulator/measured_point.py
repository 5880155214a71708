"""Which missing physics or wrong nuisance parameter could explain the paper's one measured point.

The model with the paper's own fit has ω_h/ω = 0.403 at N = 4, l = 11 cm, 143.66 rpm. The tank had 0.441. Each
effect and each nuisance parameter is changed alone, without and with contact between the tails, to the smallest
change that gives the measured value. What can is then compared over the runs that the paper could have made: the
run that tells an explanation from all others is the one where the nearest other one is the farthest away.

Usage: python -m benchmarks measured_point

Takes 10 minutes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.optimize import brentq

from sim.effects import catalogue
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.steady import orbits
from tests.reference.cases import MEASURED_HEAD_SHARE

MEASURED = PRESETS["paper-measured"]
CONTACT = {"tail_contact": 1.0}
# Sizes that go with another one, or whose source allows a range only through what is noted beside the runs.
BESIDE = {"natural_twist": {"natural_splay": 0.2}, "shear_thinning_time": {"shear_thinning": 0.3}}
PLAUSIBLE = {"viscosity_drift": (-0.2, 0.5), "tank_wall": (0.0, 0.3), "contact_line": (0.0, 0.2)}
NUMBERS = ("youngs_modulus", "viscosity", "tail_radius", "tail_length", "head_radius", "disc_offset")
COEFFICIENTS = ("C_t", "C_r", "C_yr")
STEPS = 8  # sizes on each side of the null at which the gap is looked for
RUNS = tuple(product((2, 3, 4, 5), (0.05, 0.07, 0.09, 0.11, 0.13, 0.15), (40.0, 80.0, 143.66)))
NOISE = 0.025  # relative, of a measured rate

Change = Callable[[Robot, float], Robot]


def effect_change(name: str) -> Change:
    """Make a function that puts a size of an effect into a robot."""

    def changed(robot: Robot, size: float) -> Robot:
        return replace(robot, effects={**robot.effects, **BESIDE.get(name, {}), name: size})

    return changed


def number_change(name: str) -> Change:
    """Multiply a nuisance parameter by e^size."""

    def changed(robot: Robot, size: float) -> Robot:
        value = getattr(robot, name) or robot.head_radius  # clamps at a = R where nothing else is said
        return replace(robot, **{name: value * float(np.exp(size))})  # type: ignore[arg-type]

    return changed


def head_shares(robots: Sequence[Robot]) -> np.ndarray:
    """Compute ω_h/ω of robots; NaN where they have no orbit."""
    return motions(robots)[0]


def motions(robots: Sequence[Robot]) -> np.ndarray:
    """Compute ω_h/ω and the yaw rate [rad/s] of orbits, (2, B)."""
    rows = []
    for robot in robots:
        motion = orbits(robot.groups())
        share = motion.omega_h[0] / (motion.omega_h[0] - motion.omega_t[0])
        rows.append((share, motion.omega_yr[0] / robot.time_scale))
    return np.array(rows).T


def closing_size(change: Change, robot: Robot, null: float, bounds: tuple[float, float]) -> tuple[float, float]:
    """Find the smallest change that gives the measured share (NaN: none), and the nearest share on the way."""
    best, nearest = np.nan, float(head_shares([change(robot, null)])[0])
    for end in bounds:
        sizes = null + (end - null) * np.linspace(0, 1, STEPS + 1)
        shares = head_shares([change(robot, size) for size in sizes])
        for share in shares[np.isfinite(shares)]:
            if abs(share - MEASURED_HEAD_SHARE) < abs(nearest - MEASURED_HEAD_SHARE):
                nearest = float(share)
        over = shares - MEASURED_HEAD_SHARE
        crossings = np.flatnonzero(over[:-1] * over[1:] < 0)
        if end == null or not len(crossings):
            continue
        i = crossings[0]

        def gap(size: float) -> float:
            return float(head_shares([change(robot, size)])[0]) - MEASURED_HEAD_SHARE

        size = brentq(gap, sizes[i], sizes[i + 1], xtol=1e-3 * abs(end - null))
        if not abs(best - null) < abs(size - null):
            best = size
    return best, nearest


def candidates() -> dict[str, tuple[Change, float, tuple[float, float], tuple[float, float]]]:
    """name -> change, null, bounds, and the sizes that are plausible."""
    known = {}
    for name, effect in catalogue().items():
        plausible = PLAUSIBLE.get(name) or effect.plausible or effect.bounds
        known[name] = (effect_change(name), effect.null, effect.bounds, plausible)
    for name in NUMBERS:
        width = 2 * MEASURED.sigma(name).of(getattr(MEASURED, name) or MEASURED.head_radius)
        width /= getattr(MEASURED, name) or MEASURED.head_radius
        known[f"{name} as given"] = (number_change(name), 0.0, (-0.7, 0.7), (-width, width))
    for name in COEFFICIENTS:
        known[f"{name} of the fit"] = (number_change(name), 0.0, (-1.0, 1.0), (-0.05, 0.05))
    return known


def gaps() -> dict[str, float]:
    """Print what closes the gap, and return the closing sizes beside contact."""
    touching = replace(MEASURED, effects=CONTACT)
    print(f"omega_h/omega: measured {MEASURED_HEAD_SHARE:.3f}, model {head_shares([MEASURED])[0]:.4f}, "
          f"with contact {head_shares([touching])[0]:.4f}")  # fmt: skip
    print(f"\n{'alone':28}{'closes at':>11}{'nearest':>9}{'with contact':>15}{'nearest':>9}   plausible")
    sizes = {}
    for name, (change, null, bounds, plausible) in candidates().items():
        words = ""
        for robot in (MEASURED, touching):
            if name == "tail_contact" and robot is touching:
                continue
            size, nearest = closing_size(change, robot, null, bounds)
            inside = "" if np.isnan(size) or plausible[0] <= size <= plausible[1] else "*"
            words += f"{'-' if np.isnan(size) else f'{size:.3g}{inside}':>{11 if not words else 15}}{nearest:9.4f}"
            if robot is touching and not np.isnan(size):
                sizes[name] = size
        print(f"{name:28}{words}   {plausible[0]:.3g} to {plausible[1]:.3g}", flush=True)
    print("* outside the plausible range; -: no size within bounds. Nuisance parameters, fit: ln of the factor")
    return sizes


def deciding_runs(sizes: dict[str, float]) -> None:
    """Print for each explanation the run that tells it best from all others, in standard deviations of a run."""
    known = candidates()
    robots = [
        replace(MEASURED, tails=tails, tail_length=length, motor_speed=rpm * np.pi / 30, effects=CONTACT)
        for tails, length, rpm in RUNS
    ]
    predicted = {name: motions([known[name][0](robot, size) for robot in robots]) for name, size in sizes.items()}
    print(
        f"\n{'explanation':28}{'size':>7}   deciding run             omega_h/omega    yaw [rad/s]   sd to the next"
    )
    for name, motion in predicted.items():
        rivals = [rival for key, rival in predicted.items() if key != name]
        apart = [np.hypot(*(np.log(np.abs(motion) / np.abs(rival)) / NOISE)) for rival in rivals]
        least = np.min(np.nan_to_num(apart), 0)
        run = int(np.argmax(least))
        tails, length, rpm = RUNS[run]
        words = f"N = {tails}, {100 * length:2.0f} cm, {rpm:6.2f} rpm{motion[0, run]:12.3f}{motion[1, run]:15.3f}"
        print(f"{name:28}{sizes[name]:7.3g}   {words}{least[run]:12.1f}")


def main() -> None:
    deciding_runs(gaps())
