"""Coverage of the stated errors of plans, for random robots and paths.

A plan is made with the shipped look-up table, as by default; robots whose turns differ get a table of their own.
The plan is replayed in the simulator. The robot that swims is drawn from the covariance of the coefficients that
the planner is told (1 % of each). A stated error must hold in 95 % of the plans. The mean path is the mean
position over each pair of flips.

Usage: python -m benchmarks stated_errors [PLANS] [FIRST SEED] [PICTURE]

Takes 25 seconds of processor time a plan.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from benchmarks.markdown import heading, row
from benchmarks.parallel import in_parallel
from benchmarks.proportions import wilson
from planner.files.tracking_error import tracking_error
from planner.paths.distance import distance_to
from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.vehicle.calibration_table import COEFFICIENTS, CalibrationKnowledge
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.replay import replay
from sim.motion.warm import compile_once
from surrogate.one_robot.tabulate import tabulate
from surrogate.table.model_file import load

SIGMA = 0.01  # of ln C
QUICK = 0.25  # rad that the robot turns in a time unit: from here on a fast turner


class Swum(NamedTuple):
    """One plan and its replays; lengths in l."""

    seed: int
    robot: Robot
    flips: int
    yaw: float  # rate of the robot's circle
    stated: float
    wrong: float  # largest error of the robot that differs
    exact: float  # largest error of the robot as planned
    rms: float
    mean_rms: float  # of its mean path
    floor: float  # rms of the zigzag of straight motion with this dwell


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
    """Plan and replays of one seed, or why there are none."""
    threadpool_limits(1)
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    knowledge = CalibrationKnowledge(COEFFICIENTS, SIGMA**2 * np.eye(3))
    try:
        table = tabulate(robot) if robot.effects else load()
        path = random_path(rng, plan(circle(4.0), robot, lookup=table).tracked.vehicle.turn_radius)
        result = plan(path, robot, lookup=table, knowledge=knowledge)
        moved = {name: getattr(robot, name) * np.exp(SIGMA * rng.normal()) for name in COEFFICIENTS}
        tracks = [replay([result.schedule(swimmer)])[0] for swimmer in (replace(robot, **moved), robot)]
    except InputError as refused:
        return f"{seed}: {refused}"
    wrong, exact = (tracking_error(result.to_dict(), track) for track in tracks)
    return Swum(
        seed, robot, len(result.dwells), result.tracked.vehicle.yaw_rate, result.stated_error,
        wrong.largest, exact.largest, exact.rms, _mean_path(result, tracks[1]), result.straight.rms,
    )  # fmt: skip


def _mean_path(result: Plan, track: pd.DataFrame) -> float:
    """Compute the distance of the mean path from the declared one, rms."""
    pairs = track.groupby(track["dwell"] // 2)[["x_over_l", "y_over_l"]].mean().to_numpy()
    return float(np.sqrt(np.mean(distance_to(result.reference, pairs[1:-1]) ** 2)))


def line(name: str, some: list[Swum]) -> str:
    """Format the figures of a class of robots."""
    held = sum(result.wrong <= result.stated for result in some)
    low, high = wilson(held, len(some))

    def two(value: Callable[[Swum], float]) -> str:
        values = [value(result) for result in some]
        return f"{np.median(values):.3f} / {np.quantile(values, 0.95):.3f}"

    return row(
        name, len(some), f"{100 * held / len(some):.0f} % ({100 * low:.0f} to {100 * high:.0f})",
        f"{np.median([result.stated / result.wrong for result in some]):.2f}", two(lambda s: s.stated),
        two(lambda s: s.wrong), two(lambda s: s.mean_rms), two(lambda s: s.rms),
        f"{np.median([result.rms / result.floor for result in some]):.2f}",
    )  # fmt: skip


def draw(swims: list[Swum], path: str) -> None:
    """Plot the largest error of the robot that differs against the stated error."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.6, 5.2), layout="constrained")
    axes = figure.add_subplot()
    for name, colour, kind in (("slow turners", "#2a7fba", False), ("fast turners", "#d9a441", True)):
        some = [result for result in swims if (result.yaw >= QUICK) == kind]
        axes.loglog([s.stated for s in some], [s.wrong for s in some], ".", ms=7, color=colour, label=name)
    ends = [0.8 * min(result.wrong for result in swims), 1.25 * max(result.stated for result in swims)]
    axes.plot(ends, ends, color="black", lw=1)
    axes.set_xlabel("stated error / l")
    axes.set_ylabel("largest error of the robot that differs / l")
    axes.legend(frameon=False)
    axes.grid(alpha=0.3, which="both")
    figure.savefig(path, dpi=110)


def main(count: str = "40", first: str = "0", picture: str = "") -> None:
    seeds = range(int(first), int(first) + int(count))
    compile_once()
    results = in_parallel(swum, [(seed,) for seed in seeds])
    swims = [result for result in results if isinstance(result, Swum)]
    for refused in (result for result in results if isinstance(result, str)):
        print(refused)
    print(heading("robots", "plans", "held", "stated / largest", "stated: median / 95 %", "largest",
                  "mean path, rms", "rms", "rms / zigzag"))  # fmt: skip
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
    if picture:
        draw(swims, picture)
