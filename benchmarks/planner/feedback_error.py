"""How often a robot under a tracker is within the stated error with feedback, from the start of its path.

Random robots and paths as in `stated_errors`; the robot is simulated in time steps exactly as planned, without and
with a current of 5 % of its net speed that nobody knows. The camera is that of the statement: one pose a second,
2 s late, with errors of 0.01 l and 0.01 rad, 20 % lost. The statement holds for a swim if the robot is within it
in 95 % of the time.

Usage: python -m benchmarks feedback_error [ROBOTS] [FIRST SEED] [vehicle]     (40 and 5000)

With `vehicle` the robots move as the planner's vehicle within its uncertainty does, and three further cameras see
them.

Takes 10 seconds of processor time a robot, with `vehicle` 4.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.common import heading, in_parallel, per_cent, row
from benchmarks.planner.stated_errors import random_path
from common.errors import InputError
from planner.jobs.plan import plan
from planner.paths.path import circle
from planner.planning.request import Camera
from sim.motion.warm import compile_once
from tests.oracles.unseen_robots import lab_robot
from tracking.swim import Swim, swim
from tracking.tracker import Tracker

CURRENT = 0.05  # of the net speed
LONGEST = 900  # dwells
CAMERAS = {
    "as documented": Camera(),
    "fine": Camera(noise=(0.003, 0.003), delay_s=0.0, lost=0.0),
    "rough": Camera(noise=(0.03, 0.03)),
    "slow": Camera(every_s=4.0, delay_s=6.0, lost=0.4),
}


class SwimOutcome(NamedTuple):
    """A swim; lengths in l."""

    seed: int
    camera: str
    current: float
    stated: float
    share: float  # of the time within it
    quantile: float  # distance within which the robot is in 95 % of the time
    largest: float


def outcomes(seed: int, vehicle: bool) -> list[SwimOutcome] | str:
    """Plan one seed, and let the robot swim; or say why there is no plan."""
    threadpool_limits(1)
    rng = np.random.default_rng(seed)
    robot = lab_robot(rng)
    try:
        path = random_path(rng, plan(circle(4.0), robot).tracked.vehicle.turn_radius)
        planned = [plan(path, robot, camera=camera) for camera in list(CAMERAS.values())[: None if vehicle else 1]]
    except InputError as refused:
        return f"{seed}: {refused}"
    if len(planned[0].dwells) > LONGEST:
        return f"{seed}: {len(planned[0].dwells)} dwells"
    truth = planned[0].tracked.vehicle.drawn(rng) if vehicle else robot
    angle = rng.uniform(0, 2 * math.pi)
    found = []
    for (name, camera), each in zip(CAMERAS.items(), planned, strict=False):
        for current in (0.0, CURRENT):
            speed = current * each.straight.net_speed * 100 * each.robot.length_scale / each.robot.time_scale
            x, y = speed * math.cos(angle), speed * math.sin(angle)
            tracker, seen = Tracker(each, noise=camera.noise), replace(camera, seed=seed)
            result = swim(tracker, truth, seen, current_cm_s=(x, y))
            found.append(_outcome(seed, name, current, each.feedback_error, result))
    return found


def _outcome(seed: int, camera: str, current: float, stated: float, result: Swim) -> SwimOutcome:
    order = np.argsort(result.distance)
    index = np.searchsorted(np.cumsum(result.weights()[order]), 0.95)
    quantile = float(result.distance[order][index])
    return SwimOutcome(
        seed, camera, current, stated, result.within(stated), quantile, float(result.distance.max())
    )


def main(robots: str = "40", first: str = "5000", vehicle: str = "") -> None:
    compile_once()
    wanted, seed, refused = int(robots), int(first), 0
    lists: list[list[SwimOutcome]] = []
    while len(lists) < wanted:
        batch = range(seed, seed + wanted - len(lists))
        seed = batch.stop
        for result in in_parallel(outcomes, [(one, bool(vehicle)) for one in batch]):
            if isinstance(result, str):
                refused += 1
            else:
                lists.append(result)
    print(f"{len(lists)} robots; {refused} seeds without a plan of at most {LONGEST} dwells")
    print(heading("camera", "current", "held", "share of the time: median, least", "stated / needed: median, 95 %",
                  "stated: median", "largest / stated: median"))  # fmt: skip
    swims = [each for found in lists for each in found]
    for camera, current in dict.fromkeys((each.camera, each.current) for each in swims):
        some = [each for each in swims if (each.camera, each.current) == (camera, current)]
        held = sum(each.share >= 0.95 for each in some)
        shares = [each.share for each in some]
        ratios = [each.stated / each.quantile for each in some]
        print(row(
            camera, f"{current:.0%}", f"{held} of {len(some)}: {per_cent(held, len(some))}",
            f"{np.median(shares):.3f}, {min(shares):.3f}",
            f"{np.median(ratios):.2f}, {np.quantile(ratios, 0.95):.2f}",
            f"{np.median([each.stated for each in some]):.3f} l",
            f"{np.median([each.largest / each.stated for each in some]):.2f}",
        ), flush=True)  # fmt: skip
    for each in swims:
        if each.share < 0.95:
            print(f"not held: seed {each.seed}, {each.camera}, current {each.current:.0%}: {each.quantile:.3f} l "
                  f"needed, {each.stated:.3f} l stated")  # fmt: skip
