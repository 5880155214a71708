"""Laps near a robot's own turn circle: how long the plans are, and where a tracker ends them.

Random robots (as in `stated_errors`), and for each a circle, a hexagon, a square and a figure of eight whose turns
are 0.85 to 1.3 times as wide as the robot's own circle, planned with the three objectives. A lap takes at least
its length over the robot's speed on its circle, and at most its length over the net speed of straight motion, both
within 20 %.

A tracker with the documented camera then follows each circle, hexagon and square with one of the objectives. The
robot that swims has coefficients that are each 25 % larger or smaller than planned, and moves as the vehicle of
the table. A lap is counted by the angle that the robot has swept about the centre. A robot whose flips are quicker
than the camera swims open loop, and is listed apart.

Usage: python -m benchmarks laps [ROBOTS] [FIRST SEED]     (200 and 55000)

Takes 20 minutes.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.common import heading, in_parallel, per_cent, row
from common.errors import InputError
from planner.jobs.plan import plan
from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import Plan
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.vehicle import Vehicle
from planner.vehicle.zigzag import Objective
from sim.mechanics import planar
from surrogate.table_file import load
from tests.oracles.unseen_robots import lab_robot
from tracking.swim import Swim, swim

WIDTHS = (0.85, 1.3)  # turn radii
OBJECTIVES: tuple[Objective, ...] = ("error", "time", "flips")
OFF = 1.25  # factor of the coefficients
SLACK = 0.2  # of the time of a lap
FULL = 0.9  # of a lap


def paths_near(radius: float) -> dict[str, Path2D]:
    """List paths whose turns are about as wide as a circle of `radius`."""
    angle = np.linspace(0, 2 * math.pi, 200, endpoint=False)
    eight = 2 * radius * np.stack([np.sin(angle), np.sin(angle) * np.cos(angle)], 1)
    return {
        "circle": circle(radius),
        "hexagon": polygon(6, side=radius),
        "square": polygon(4, side=1.6 * radius),
        "figure of eight": Path2D.of(eight, closed=True),
    }


def in_time(planned: Plan) -> bool:
    """Tell whether a lap lasts as long as its length says."""
    length = float(np.hypot(*np.diff(planned.reference, axis=0).T).sum())
    shortest, longest = length / planned.tracked.vehicle.speed, length / planned.straight.net_speed
    return (1 - SLACK) * shortest <= planned.duration <= (1 + SLACK) * longest


def laps_swum(result: Swim) -> float:
    """Count laps by the angle that the tracked point swept about the middle of the path."""
    offset = np.array([result.plan.tracked.offset, 0.0, 0.0])
    x, y = (planar.compose(result.poses, offset)[:, :2] - result.plan.drawn.points.mean(0)).T
    angle = np.unwrap(np.arctan2(y, x))
    return float(angle[-1] - angle[0]) / (2 * math.pi)


def ending(planned: Plan, truth: Vehicle) -> str:
    """Swim a lap under a tracker, and say how it ended."""
    result, camera = swim(planned, truth), planned.request.camera
    if camera.delay_s * len(planned.dwells) > planned.duration * planned.robot.time_scale:
        return "quicker than the camera"
    lap = "full lap" if laps_swum(result) >= FULL else "less"
    alarm = ", alarm" if result.alarms else ""
    missed = ", said to miss a part" if result.missed > planned.feedback_error else ""
    return f"{lap}{'' if result.finished else ', not ended'}{alarm}{missed}"


def outcomes(seed: int) -> list[tuple[str, str]]:
    """Plan and swim near the turn circle of one robot; return what was asked, and what came of it."""
    threadpool_limits(1)
    rng = np.random.default_rng(seed)
    robot, width, factors = lab_robot(rng), rng.uniform(*WIDTHS), OFF ** rng.choice([-1, 1], 3)
    other = replace(robot, **{f"C_{name}": getattr(robot, f"C_{name}") * factor
                              for name, factor in zip(("t", "r", "yr"), factors, strict=True)})  # fmt: skip
    vehicles, answers = [], []
    for each in (robot, other):
        try:
            vehicles.append(table_vehicle(each, load()))
        except InputError:
            return [("robot", "outside the table")]
    for name, path in paths_near(width * vehicles[0].turn_radius).items():
        for objective in OBJECTIVES:
            try:
                planned = plan(path, robot, objective=objective)
            except InputError as refusal:
                answers.append((f"plan, {name}", f"refused: {str(refusal)[:40]}"))
                continue
            answers.append((f"plan, {name}", "in time" if in_time(planned) else "too short or too long"))
            if objective == OBJECTIVES[seed % 3] and name != "figure of eight":
                answers.append((f"swim, {name}", ending(planned, vehicles[1])))
    return answers


def main(robots: str = "200", first: str = "55000") -> None:
    seeds = range(int(first), int(first) + int(robots))
    answers = [each for some in in_parallel(outcomes, [(seed,) for seed in seeds]) for each in some]
    counts, totals = Counter(answers), Counter(asked for asked, _ in answers)
    print(heading("what", "outcome", "share (95 % interval)", "of"))
    for (asked, outcome), count in sorted(counts.items()):
        print(row(asked, outcome, per_cent(count, totals[asked]), totals[asked]))
