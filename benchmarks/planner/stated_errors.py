"""Coverage of the stated errors of plans, for random robots and paths.

A plan is made with the shipped look-up table, as by default; robots whose turns differ get a table of their own.
The plan is replayed in the simulator. The robot that swims is drawn from the covariance of the coefficients that
the planner is told (1 % of each). A stated error must hold in 95 % of the plans.

Usage: python -m benchmarks stated_errors [PLANS] [FIRST SEED]

Takes 25 seconds of processor time a plan.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.common import heading, in_parallel, per_cent, row, two_quantiles
from common.errors import InputError
from planner.jobs.plan import plan
from planner.paths.path import Path2D, circle, polygon
from sim.knowledge import COEFFICIENTS, CalibrationKnowledge
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.replay import replay
from sim.motion.warm import compile_once
from surrogate.table_file import load
from surrogate.tabulate import tabulate
from tracking.tracks import tracking_error

SIGMA = 0.01  # of ln C
QUICK = 0.25  # rad that the robot turns in a time unit: from here on a fast turner


class Swum(NamedTuple):
    """One plan and its replay; lengths in l."""

    seed: int
    robot: Robot
    yaw: float  # rate of the robot's circle
    stated: float
    wrong: float  # largest error of the robot that differs


def random_robot(rng: np.random.Generator) -> Robot:
    """Draw a robot of the look-up table's domain."""
    base = PRESETS["paper-control"]
    length = base.tail_length
    radius = length / rng.uniform(4, 9)
    robot = replace(
        base,
        tails=int(rng.integers(2, 6)),
        C_t=rng.uniform(1.5, 5),
        C_r=rng.uniform(1.2, 3.5),
        C_yr=rng.uniform(1, 6),
        head_radius=radius,
        head_length=radius * rng.uniform(2.5, 5),
        tail_radius=length / rng.uniform(20, 45),
    )
    if rng.random() < 0.3:
        robot = replace(robot, effects={"left_right_bias": float(rng.uniform(-0.3, 0.3))})
    return robot.with_motor(float(np.exp(rng.uniform(np.log(5), np.log(80)))))


def random_path(rng: np.random.Generator, radius: float) -> Path2D:
    """Draw a path of 6 to 15 turn radii: a smooth curve, a polygon, a circle or a zigzag."""
    kind = rng.integers(4)
    length = radius * rng.uniform(6, 15)
    if kind == 0:
        return circle(length / 2 / np.pi)
    if kind == 1:
        corners = int(rng.integers(3, 7))
        return polygon(corners, max(length / corners, 3 * radius))
    if kind == 2:
        turns = np.cumsum(rng.uniform(-1.5, 1.5, 6))
        return Path2D.of(np.cumsum(length / 6 * np.stack([np.cos(turns), np.sin(turns)], 1), 0), closed=False)
    s = np.linspace(0, length, 800)
    waves = rng.normal(size=(5, 1)) * np.sin(
        rng.uniform(0.2, 0.8, (5, 1)) / radius * s + rng.uniform(0, 6, (5, 1))
    )
    heading = np.cumsum(0.5 / radius * np.tanh(waves.sum(0) / 2)) * (s[1] - s[0])
    return Path2D.of(np.cumsum((s[1] - s[0]) * np.stack([np.cos(heading), np.sin(heading)], 1), 0), closed=False)


def swum(seed: int) -> Swum | str:
    """Plan and replay of one seed, or why there are none."""
    threadpool_limits(1)
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    knowledge = CalibrationKnowledge(COEFFICIENTS, SIGMA**2 * np.eye(3))
    try:
        table = tabulate(robot) if robot.effects else load()
        path = random_path(rng, plan(circle(4.0), robot, lookup=table).tracked.vehicle.turn_radius)
        result = plan(path, robot, lookup=table, knowledge=knowledge)
        moved = {name: getattr(robot, name) * np.exp(SIGMA * rng.normal()) for name in COEFFICIENTS}
        track = replay(result.schedule(replace(robot, **moved)))
    except InputError as refused:
        return f"{seed}: {refused}"
    wrong = tracking_error(result.to_dict(), track).largest
    return Swum(seed, robot, result.tracked.vehicle.yaw_rate, result.stated_error, wrong)


def line(name: str, some: list[Swum]) -> str:
    """Format the figures of a class of robots."""
    held = sum(result.wrong <= result.stated for result in some)
    ratio = np.median([result.stated / result.wrong for result in some])
    stated, wrong = (two_quantiles([getattr(result, key) for result in some]) for key in ("stated", "wrong"))
    return row(name, len(some), per_cent(held, len(some)), f"{ratio:.2f}", stated, wrong)


def main(count: str = "40", first: str = "0") -> None:
    seeds = range(int(first), int(first) + int(count))
    compile_once()
    results = in_parallel(swum, [(seed,) for seed in seeds])
    swims = [result for result in results if isinstance(result, Swum)]
    for refused in (result for result in results if isinstance(result, str)):
        print(refused)
    print(heading("robots", "plans", "held", "stated / largest", "stated: median / 95 %", "largest"))
    classes: tuple[tuple[str, Callable[[Swum], bool]], ...] = (
        ("all", lambda s: True),
        ("slow turners, N = 2", lambda s: s.yaw < QUICK and s.robot.tails == 2),
        ("slow turners, N > 2", lambda s: s.yaw < QUICK and s.robot.tails > 2),
        ("fast turners, N = 2", lambda s: s.yaw >= QUICK and s.robot.tails == 2),
        ("fast turners, N > 2", lambda s: s.yaw >= QUICK and s.robot.tails > 2),
        ("turns differ", lambda s: bool(s.robot.effects)),
    )
    for name, belongs in classes:
        if some := [result for result in swims if belongs(result)]:
            print(line(name, some))
    for result in sorted((s for s in swims if s.wrong > s.stated), key=lambda s: s.seed):
        print(f"not held: seed {result.seed}, {result.wrong:.3f} l, stated {result.stated:.3f} l")
