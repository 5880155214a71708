"""Open loop and tracker on a path of 40 l, for robots that differ from their model.

The camera sees a pose a second (noise 0.01 l and 0.01 rad), 2 s late; 20 % get lost. Prints the errors, by
quarters of the way, and how often the alarm comes for robots of the model. The picture shows the hardest case.

Usage: python -m benchmarks feedback [OUT.png] [ROBOTS]

Takes 10 minutes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from benchmarks.parallel import in_parallel
from benchmarks.proportions import wilson
from planner.paths.path import Path2D, circle
from planner.planning.camera import Camera
from planner.planning.picture import DECLARED, REPLAYED
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.tracking.clock import SLACK
from planner.tracking.swim import Swim, swim
from planner.tracking.tracker import FALSE_ALARM, WINDOW, Command, Tracker
from sim.model.presets import PRESETS
from sim.model.robot import Robot

LENGTH = 40.0
ROBOT = PRESETS["paper-control"]
WRONG = replace(ROBOT, C_t=0.95 * ROBOT.C_t, C_r=1.05 * ROBOT.C_r, C_yr=0.95 * ROBOT.C_yr)
BIAS = {"left_right_bias": 0.0222}  # turns left 3 % faster, right 3 % slower
SPLAY = {"natural_splay": 0.1}  # 11 % faster, turns 8 % faster
FEEDBACK = "#2a7fba"


class Case(NamedTuple):
    name: str
    robot: Robot
    later: Robot | None = None  # from half of the time on


CASES = (
    Case("as planned", ROBOT),
    Case("coefficients 5 % wrong", WRONG),
    Case("3 % asymmetry", replace(ROBOT, effects=BIAS)),
    Case("an effect from halfway on", ROBOT, replace(ROBOT, effects=SPLAY)),
    Case("all of these", replace(WRONG, effects=BIAS), replace(WRONG, effects={**BIAS, **SPLAY})),
)


def eight(length: float) -> Path2D:
    """Make a closed eight of this length."""
    t = np.linspace(0, 2 * math.pi, 2001)[:-1]
    path = Path2D.of(np.stack([np.sin(t), 0.55 * np.sin(2 * t)], 1), closed=True)
    return path.scaled(length / path.length)


class Blind:
    """The schedule as planned, whatever the camera sees."""

    def __init__(self, plan: Plan):
        self._plan = plan
        self._flips = np.cumsum(plan.dwells).tolist()
        self._done = 0

    def update(self, now: float, *_: object) -> Command:
        """Tell what the schedule orders."""
        if self._done < len(self._flips) and now >= self._flips[self._done] - SLACK:
            self._done += 1
        finished = self._done == len(self._flips)
        direction = 0 if finished else self._plan.first_direction * (-1) ** self._done
        flip_at = self._flips[min(self._done, len(self._flips) - 1)]
        return Command(direction, flip_at, finished, False, self._plan.stated_error)


def both(case: Case, planned: Plan) -> tuple[Swim, Swim]:
    """Open loop and with the tracker."""
    blind = swim(Blind(planned), planned, case.robot, Camera(), later=case.later)
    return blind, swim(Tracker(planned), planned, case.robot, Camera(), later=case.later)


def draw(planned: Plan, swims: list[tuple[Swim, Swim]]) -> Figure:
    """Draw the tracks of the hardest case, and distances from the path over the way in all cases."""
    figure = Figure(figsize=(10, 6.6), layout="constrained")
    upper, lower = np.asarray(figure.subfigures(2, 1, height_ratios=(1.15, 1)), dtype=object)
    ways = zip(swims[-1], (REPLAYED, FEEDBACK), ("open loop", "with the tracker"), strict=True)
    for i, (swum, colour, name) in enumerate(ways):
        axes = upper.add_subplot(1, 2, 1 + i)
        axes.plot(*planned.reference.T, color=DECLARED, lw=1.2)
        axes.plot(*swum.poses[:, :2].T, color=colour, lw=0.8)
        half = int(np.searchsorted(swum.times, planned.duration / 2))
        axes.plot(*swum.poses[half, :2], "o", color=colour, ms=5)
        axes.set_aspect("equal")
        axes.set_title(f"{CASES[-1].name}, {name}: {swum.rms():.2g} l rms", fontsize=10)
        axes.set_xlabel("x / l")
        axes.set_ylabel("y / l")
    for i, case in enumerate(CASES):
        axes = lower.add_subplot(1, len(CASES), 1 + i)
        for swum, colour in zip(swims[i], (REPLAYED, FEEDBACK), strict=True):
            axes.semilogy(LENGTH * swum.times / swum.times[-1], smooth(swum), color=colour, lw=1.0)
        axes.set_ylim(3e-3, 10)
        axes.set_title(case.name, fontsize=9)
        axes.set_xlabel("way / l", fontsize=8)
        axes.tick_params(labelsize=7, labelleft=i == 0)
        axes.grid(alpha=0.3)
        if i == 0:
            axes.set_ylabel("distance / l, rms over 1 l", fontsize=8)
    return figure


def smooth(swum: Swim) -> np.ndarray:
    """Compute the root mean square distance over 1 l of the way."""
    width = max(1, round(len(swum.times) / LENGTH))
    padded = np.pad(swum.distance**2, (width // 2, width - 1 - width // 2), mode="edge")
    return np.asarray(np.sqrt(np.convolve(padded, np.ones(width) / width, mode="valid")))


def alarms(planned: Plan, seed: int) -> tuple[int, int]:
    """Count windows, and alarms, of one robot with coefficients that are 1 % uncertain."""
    rng = np.random.default_rng(seed)
    C_t, C_r, C_yr = (np.array([ROBOT.C_t, ROBOT.C_r, ROBOT.C_yr]) * np.exp(0.01 * rng.normal(size=3))).tolist()
    robot = replace(ROBOT, C_t=C_t, C_r=C_r, C_yr=C_yr)
    swum = swim(Tracker(planned), planned, robot, Camera(every_s=0.5, seed=rng))
    return swum.fed // WINDOW, len(swum.alarms)


def lines(swims: list[tuple[Swim, Swim]]) -> Iterator[str]:
    for case, pair in zip(CASES, swims, strict=True):
        for name, swum in zip(("open loop", "tracker"), pair, strict=True):
            quarters = "".join(f"{swum.rms(q / 4, (q + 1) / 4):8.4f}" for q in range(4))
            rang = f"{swum.alarms[0] / swum.times[-1]:.2f}" if swum.alarms else "-"
            yield f"{case.name:28}{name:11}{swum.rms():8.4f}{swum.distance.max():8.3f}{quarters}{rang:>8}"


def main(out: str = "docs/tracking.png", robots: str = "40") -> None:
    planned = plan(eight(LENGTH), ROBOT)
    swims = in_parallel(both, [(case, planned) for case in CASES], quiet=True)
    minutes = planned.duration * ROBOT.time_scale / 60
    print(f"{LENGTH:g} l, {len(planned.dwells)} dwells planned, {minutes:.0f} min")
    print(f"stated: open loop {planned.stated_error:.3f} l, with feedback {planned.feedback_error:.3f} l")
    print(f"{'robot':39}{'rms':>8}{'most':>8}{'rms, quarters of the way':>32}{'alarm':>8}")
    print("\n".join(lines(swims)))
    draw(planned, swims).savefig(out, dpi=130)
    print(f"-> {out}")
    short = plan(circle(2.0), ROBOT)
    counts = np.array(in_parallel(alarms, [(short, seed) for seed in range(int(robots))], quiet=True)).sum(0)
    low, high = wilson(int(counts[1]), int(counts[0]))
    print(
        f"false alarms: {counts[1]} in {counts[0]} windows of {WINDOW} poses, {counts[1] / counts[0]:.2%} "
        f"({low:.2%} to {high:.2%}); stated {FALSE_ALARM:.2%}"
    )
