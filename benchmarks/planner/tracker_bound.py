"""How often a robot is as near to its path as the tracker says, with and without a current.

Robots are drawn within the plan's uncertainty. They move as the planner's vehicle does.

Usage: python -m benchmarks tracker_bound [ROBOTS]

Takes 5 minutes.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from benchmarks.parallel import in_parallel
from benchmarks.planner.feedback import eight
from planner.paths.path import circle
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.tracking.tracker import Tracker
from sim.model.presets import PRESETS
from tests.planner.swimming import Camera, rms, swum

CURRENTS = (0.0, 0.001, 0.002)  # l per time unit; the net speed is 0.016


def covered(planned: Plan, seed: int, current: float) -> tuple[float, float, float]:
    """Return the share of the time within the bound, the mean bound, and the error of one robot."""
    rng, car = np.random.default_rng(seed), planned.tracked.vehicle
    twist, lag, angle = car.twist.copy(), car.lag.copy(), rng.uniform(0, 2 * math.pi)
    for mode, z in zip(car.modes, rng.standard_normal(len(car.modes)), strict=True):
        twist += z * mode.twist
        lag += 0.0 if mode.lag is None else z * mode.lag
    flow = current * np.array([math.cos(angle), math.sin(angle)])
    truth = replace(car, twist=twist, lag=lag, current=flow)
    camera = Camera(rng=rng, every=float(rng.choice([0.5, 1.0, 3.0])))
    result = swum(Tracker(planned), planned, truth, camera)
    return float((result.distance <= result.errors).mean()), float(result.errors.mean()), rms(result.distance)


def main(robots: str = "10") -> None:
    for name, path in (("circle of radius 2 l", circle(2.0)), ("eight of 12 l", eight(12.0))):
        planned = plan(path, PRESETS["paper-control"])
        for current in CURRENTS:
            cases = [(planned, seed, current) for seed in range(int(robots))]
            share, bound, error = np.array(in_parallel(covered, cases, quiet=True)).T
            print(
                f"{name:21}current {current:.3f}: within {share.mean():.1%} of the time "
                f"({share.min():.1%} to {share.max():.1%}), bound {bound.mean():.4f}, error {error.mean():.4f} l"
            )
