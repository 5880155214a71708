"""How often a robot is as near to its path as the tracker says, with and without a current.

Robots are drawn within the plan's uncertainty. They move as the planner's vehicle does. The factor of the bound
was chosen on the first two paths; the others show that it holds. The tracker is tracker.h, which needs a C
compiler.

Usage: python -m benchmarks tracker_bound [ROBOTS]

Takes 2 minutes.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from benchmarks.parallel import in_parallel
from benchmarks.planner.feedback import eight
from planner.paths.path import Path2D, circle, polygon
from planner.planning.camera import Camera
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.tracking.swim import swim
from planner.vehicle.dwell_choice import Objective
from sim.model.presets import PRESETS
from tests.planner.compiled import CompiledTracker
from tests.planner.vehicles import drawn_vehicle

CURRENTS = (0.0, 0.06, 0.12)  # of the net speed


def wave() -> Path2D:
    """Make two waves, 10 l long."""
    share = np.linspace(0, 1, 400)
    return Path2D.of(np.stack([10 * share, 0.8 * np.sin(4 * math.pi * share)], 1))


class Case(NamedTuple):
    name: str
    path: Path2D
    robot: str = "paper-control"
    objective: Objective = "error"


CASES = (
    Case("circle of radius 2 l", circle(2.0)),
    Case("eight of 12 l", eight(12.0)),
    Case("wave", wave()),
    Case("triangle", polygon(3, 4.0)),
    Case("wave, few flips", wave(), objective="flips"),
    Case("wave, N = 4", wave(), robot="paper-triangle"),
    Case("triangle, N = 4", polygon(3, 4.0), robot="paper-triangle"),
)


def covered(planned: Plan, seeds: int, current: float) -> list[tuple[float, float, float]]:
    """Return the share of the time within the bound, the mean bound, and the error of some robots."""
    results = []
    with TemporaryDirectory() as folder:
        tracker = CompiledTracker(planned, Path(folder))
        for seed in range(seeds):
            tracker.restart()
            rng = np.random.default_rng(seed)
            angle = rng.uniform(0, 2 * math.pi)
            flow = current * planned.straight.net_speed * np.array([math.cos(angle), math.sin(angle)])
            truth = replace(drawn_vehicle(planned.tracked.vehicle, rng), current=flow)
            every, delay = float(rng.choice([0.5, 1.0, 3.0])), float(rng.choice([0.0, 1.0, 2.0]))
            result = swim(tracker, planned, truth, Camera(seed=rng, every_s=every, delay_s=delay, lost=0.1))
            results.append((result.within(result.errors), float(result.errors.mean()), result.rms()))
    return results


def main(robots: str = "10") -> None:
    for case in CASES:
        planned = plan(case.path, PRESETS[case.robot], objective=case.objective)
        cases = [(planned, int(robots), current) for current in CURRENTS]
        for current, results in zip(CURRENTS, in_parallel(covered, cases, quiet=True), strict=True):
            share, bound, error = np.array(results).T
            print(
                f"{case.name:21}current {current:.0%}: within {share.mean():.1%} of the time "
                f"({share.min():.1%} to {share.max():.1%}), bound {bound.mean():.4f}, error {error.mean():.4f} l",
                flush=True,
            )
