"""Robots that swim a path as labs have them, drawn at random."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from common.errors import InputError
from planner.jobs.plan import plan
from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import Plan
from sim.knowledge import COEFFICIENTS, NUMBERS
from sim.model.robot import Robot
from surrogate.table_file import load
from tests.oracles.swims import CameraNoise
from tests.oracles.unseen_robots import lab_robot

_DWELLS, _LONGEST, _SHORTEST = (60, 800), 2500.0, 1.0  # of a swim; time [s], and mean dwell [s]


class LabSwim(NamedTuple):
    """A swim: the robot as given and as it is, and what disturbs robot and camera, as `make_track` has it."""

    given: Robot
    truth: Robot
    path: Path2D  # [m]
    plan: Plan
    disturbed: dict[str, Any]


def lab_loop(rng: np.random.Generator) -> Path2D:
    """Draw a path of 8 to 16 l: a circle, polygon, star, or smooth closed line."""
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    size, turn = rng.uniform(0.1, 0.25, 2), rng.uniform(0, 2 * np.pi, 2)
    reach = 1 + size[0] * np.cos(2 * angle + turn[0]) + size[1] * np.cos(3 * angle + turn[1])
    smooth = Path2D.of(reach[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1), closed=True)
    star = Path2D.of(polygon(5, 1.0).points[[0, 2, 4, 1, 3]], closed=True)
    kinds = (circle(1.0), polygon(3, 1.0), polygon(4, 1.0), polygon(int(rng.integers(5, 7)), 1.0), star, smooth)
    path = kinds[int(rng.integers(len(kinds)))]
    return path.scaled(float(rng.uniform(8, 16)) / path.length)


def drawn_swim(seed: int) -> LabSwim:
    """Draw robots and paths until there is a plan that a camera can follow, and what disturbs its swim.

    Coefficients are off by up to 20 %, other numbers within two of their standard deviations.
    """
    rng = np.random.default_rng(seed)
    while True:
        given, path = replace(lab_robot(rng), name="lab"), lab_loop(rng)
        try:
            planned = plan(path, given, lookup=load())
        except InputError:  # too tight
            continue
        duration, dwells = planned.seconds.sum(), len(planned.dwells)
        if _DWELLS[0] <= dwells <= _DWELLS[1] and _SHORTEST * dwells <= duration <= _LONGEST:
            break
    true: dict[str, Any] = {name: getattr(given, name) * rng.uniform(0.8, 1.2) for name in COEFFICIENTS}
    for name in NUMBERS:
        value = given.number(name)
        true[name] = value + given.sigma(name).of(value) * np.clip(rng.normal(), -2, 2)
    usual, (white, slow) = CameraNoise(), np.exp(rng.uniform(-0.7, 0.7, (2, 2)))
    noise = CameraNoise(usual.every, tuple(white * usual.white), tuple(slow * usual.slow), rng.uniform(5, 20))
    disturbed = {
        "camera": noise,
        "kick": tuple(rng.uniform(0, 1, 2) * (2e-4, math.radians(0.2))),
        "current": tuple(2e-5 * rng.normal(size=2)),
        "marker": tuple(rng.normal(size=3) * (2e-3, 2e-3, math.radians(1.0))),
        "scale": 1 + 0.005 * rng.normal(),
    }
    return LabSwim(given, replace(given, **true), path.scaled(given.tail_length), planned, disturbed)
