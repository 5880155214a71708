"""Stated errors of robots and paths that the look-up table has never seen, a third of them with long schedules.

Robots are drawn from the domain of the shipped table as labs have them: two to five tails of 7 to 13 cm. Paths are
circles, eights, smooth closed curves and polygons; every third one is enlarged until its plan has more than 2,000
dwells. Each plan is made as by default, and carried out by the robot's own table, which is simulated
with a tenth of the tolerance. Some are replayed in time steps, too. A stated error must hold in 95 % of the plans,
and in 90 % in each third of the robots by their remoteness: their distance from the middle of what the table has
learned.

Usage: python -m benchmarks unseen_robots [PLANS] [FIRST SEED] [REPLAYS]     (100, 5000 and 30)

Takes 4 seconds of processor time a plan, and about two minutes a replay.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.markdown import heading, row
from benchmarks.parallel import in_parallel
from benchmarks.proportions import wilson
from planner.files.tracking_error import tracking_error
from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.planning.stated_error import predicted_error
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.rollout import trace
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.replay import replay, replay_error
from sim.motion.warm import compile_once
from surrogate.one_robot.tabulate import tabulate
from surrogate.table.lookup import NeuralTable
from surrogate.table.model_file import load

LONG = 2000  # dwells
_LARGEST = 40.0  # l, radius of a long path
_NOVELTY = 7  # its place in `NeuralTable.width_features`


class Carried(NamedTuple):
    """A plan and what became of it; lengths in l."""

    seed: int
    flips: int
    remoteness: float
    predicted: float  # largest distance that the plan predicts
    stated: float
    own: float  # largest distance, by the table of the robot itself
    own_stated: float  # stated error of the same plan's path with that table
    replayed: float  # largest distance in time steps; NaN: not replayed
    replay_error: float  # of the simulator itself


def lab_robot(rng: np.random.Generator) -> Robot:
    """Draw a robot as labs have them."""
    length = rng.uniform(0.07, 0.13)
    radius = length / rng.uniform(4, 9)
    robot = replace(
        PRESETS["paper-control"],
        tails=int(rng.integers(2, 6)),
        tail_length=length,
        C_t=rng.uniform(1.5, 5),
        C_r=rng.uniform(1.2, 3.5),
        C_yr=rng.uniform(1, 6),
        head_radius=radius,
        head_length=radius * rng.uniform(2.5, 5),
        tail_radius=length / rng.uniform(20, 45),
    )
    return robot.with_motor(float(np.exp(rng.uniform(np.log(5), np.log(80)))))


def lab_path(rng: np.random.Generator) -> Path2D:
    """Draw a path of 1.5 to 8 l in radius or side."""
    radius = rng.uniform(1.5, 8)
    kind = rng.integers(4)
    angle = np.linspace(0, 2 * np.pi, 1200)
    if kind == 0:
        return circle(radius)
    if kind == 1:
        return Path2D.of(radius * np.stack([np.sin(angle), np.sin(2 * angle) / 2], 1), closed=True)
    if kind == 2:
        waves = (rng.normal() * 0.12 / k * np.cos(k * angle + rng.uniform(0, 6)) for k in (2, 3, 4))
        size = radius * (1 + np.sum(list(waves), axis=0))
        return Path2D.of(size[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1), closed=True)
    return polygon(int(rng.integers(3, 7)), radius)


def planned(seed: int, lookup: NeuralTable) -> Plan:
    """Draw a robot and a path, and plan; every third plan is a long one.

    Raises:
        InputError: there is no such plan.
    """
    rng = np.random.default_rng(seed)
    robot, path = lab_robot(rng), lab_path(rng)
    result = plan(path, robot, lookup=lookup)
    size = 1.0
    while seed % 3 == 0 and len(result.dwells) <= LONG:
        size *= max(1.1, 1.1 * LONG / len(result.dwells))
        if size > _LARGEST:
            raise InputError(
                f"{seed}: a path of {size:.0f} times the size still takes {len(result.dwells)} dwells"
            )
        result = plan(path.scaled(size), robot, lookup=lookup)
    return result


def carried(seed: int, in_time_steps: bool) -> Carried | str:
    """Plan and carry out one seed; or say why there is no plan."""
    lookup = load()
    try:
        result = planned(seed, lookup)
        robot = result.robot
        own = tabulate(robot)
        by_own_table = plan(result.drawn, robot, lookup=own, dwell=result.minimum_dwell)
    except InputError as refused:
        return f"{seed}: {refused}"
    track = trace(table_vehicle(robot, own), result.switches, result.tracked.offset)
    found = predicted_error(result.reference, track, closed=result.drawn.closed).largest
    columns = {name: np.array([value]) for name, value in robot.group_values().items()}
    features = lookup.width_features(lookup.motions(columns))
    replayed = error = float("nan")
    if in_time_steps:
        schedule = result.schedule()
        track_simulated = replay([schedule])[0]
        replayed, error = (
            tracking_error(result.to_dict(), track_simulated).largest,
            replay_error(schedule, track_simulated),
        )
    return Carried(
        seed, len(result.dwells), float(features[0, _NOVELTY]), result.predicted_max, result.stated_error, found,
        by_own_table.stated_error, replayed, error,
    )  # fmt: skip


def line(name: str, some: list[Carried], found: Callable[[Carried], float]) -> str:
    """Format the figures of a class of plans."""
    held = sum(found(one) <= one.stated for one in some)
    low, high = wilson(held, len(some))
    ratio = np.median([one.stated / found(one) for one in some])
    values = [f"{np.median(part):.3f} / {np.quantile(part, 0.95):.3f}" for part in (
        [one.predicted for one in some], [one.stated for one in some], [found(one) for one in some],
        [one.own_stated for one in some],
    )]  # fmt: skip
    share = f"{100 * held / len(some):.0f} % ({100 * low:.0f} to {100 * high:.0f})"
    return row(name, len(some), share, f"{ratio:.2f}", *values)


def main(count: str = "100", first: str = "5000", replays: str = "30") -> None:
    compile_once()
    seeds = range(int(first), int(first) + int(count))
    results = in_parallel(carried, [(seed, place < int(replays)) for place, seed in enumerate(seeds)])
    plans = [result for result in results if isinstance(result, Carried)]
    for refused in (result for result in results if isinstance(result, str)):
        print(refused)
    print(heading("carried out by the robot's own table", "plans", "held", "stated / found",
                  "predicted: median / 95 %", "stated", "found", "stated with the own table"))  # fmt: skip
    ordered = sorted(plans, key=lambda one: one.remoteness)
    cuts = [len(ordered) * k // 3 for k in range(4)]
    classes = [
        ("all", plans),
        (f"up to {LONG} dwells", [one for one in plans if one.flips <= LONG]),
        (f"more than {LONG} dwells", [one for one in plans if one.flips > LONG]),
        *((f"{name} robots", ordered[cuts[k] : cuts[k + 1]])
          for k, name in enumerate(("nearest", "middle", "most remote"))),
    ]  # fmt: skip
    for name, some in classes:
        if some:
            print(line(name, some, lambda one: one.own))
    simulated = [one for one in plans if np.isfinite(one.replayed)]
    if simulated:
        print(line("replayed in time steps", simulated, lambda one: one.replayed))
        print(f"the simulator's own error of a track: {np.median([one.replay_error for one in simulated]):.4f} l "
              f"at the median, {max(one.replay_error for one in simulated):.4f} l at most")  # fmt: skip
    for one in sorted((one for one in plans if one.own > one.stated), key=lambda one: one.seed):
        print(f"not held: seed {one.seed}, {one.flips} dwells, {one.own:.3f} l, stated {one.stated:.3f} l")
