"""Tracking error of the paper's rule, of sum-up rounding and of the planner, replayed in the simulator.

The paper's rule: a straight line by equal dwells T; a turn by an angle α by holding one direction for α/ω_yr; a
circle by pairs of dwells of which one is shorter, so that every pair turns a little. It knows steady motion only.
Sum-up rounding takes the turning that the pivot's reference wants, on a grid of steps T, and turns left or right
so that the sum of all turning stays near the wanted one. It knows steady motion and the reference.

All three begin where the planner begins, with the planner's T. Errors are distances from the path as drawn.

Usage: python -m benchmarks simple_rules

Takes a minute.
"""

from __future__ import annotations

import math

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.planner.tracking import CASES
from planner.files.tracking_error import tracking_error
from planner.planning.plan import plan
from planner.planning.planned import Plan
from sim.arrays import Floats
from sim.model.presets import PRESETS
from sim.model.schedule import Schedule
from sim.motion.replay import replay
from surrogate.table.model_file import load

Rule = tuple[int, list[float], tuple[float, float, float]]  # first direction, dwells, start


def paper_circle(result: Plan, radius: float) -> Rule:
    """Choose the dwells T + d/2 and T − d/2: a pair turns by Ω d and gets ahead by 2 T v_z sinc(Ω T/2)."""
    rate, speed, dwell = _steady(result)
    ahead = speed * _sinc(rate * dwell / 2)
    less = 2 * dwell * ahead / (radius * rate)
    pairs = round(2 * math.pi / (rate * less))
    dwells = [dwell + less / 2, dwell - less / 2] * pairs
    return 1, dwells, (radius, 0.0, math.pi / 2 - rate * dwell / 2)


def paper_polygon(result: Plan, corners: int, side: float) -> Rule:
    """Make sides by equal dwells, corners by one dwell of α/ω_yr, from the middle of the lower side."""
    rate, speed, dwell = _steady(result)
    turn = 2 * math.pi / corners
    ahead = speed * _sinc(rate * dwell / 2) * dwell
    dwells: list[float] = []
    owed = 0.0
    for number, length in enumerate((side / 2, *[side] * (corners - 1), side / 2)):
        count = max(2, 2 * round((length / ahead + owed) / 2))
        owed += length / ahead - count
        leg = [dwell] * count
        leg[0] += turn / rate if number else 0.0
        dwells += leg
    low = side / 2 / math.tan(math.pi / corners)
    return 1, dwells, (0.0, -low, -rate * dwell / 2)


def sum_up_rounding(result: Plan) -> Rule:
    """Round the turning of the planner's reference on a grid of steps T, without the predicted pose."""
    rate, _, dwell = _steady(result)
    guide, surge = result.declared.reference, float(result.tracked.vehicle.twist[0, 0])
    wanted = np.clip(guide.curvature * result.tracked.vehicle.pivot_radius, -1, 1)
    speed = result.straight.net_speed + (surge - result.straight.net_speed) * np.abs(wanted)
    time = np.concatenate([[0.0], np.cumsum(np.diff(guide.arc) / speed)])
    turned = np.concatenate([[0.0], np.cumsum(wanted * np.diff(time))])
    grid = np.arange(dwell, time[-1], dwell)
    dwells: list[float] = []
    first, sense, done = 0, 0, 0.0
    for goal in np.interp(grid, time, turned).tolist():
        now = 1 if goal - done >= 0 else -1
        done += now * dwell
        if now == sense:
            dwells[-1] += dwell
        else:
            dwells.append(dwell)
            first, sense = first or now, now
    x, y = guide.q[0]
    heading = float(guide.heading[0]) - first * rate * dwell / 2
    a = result.tracked.rod
    return first, dwells, (float(x + a * math.cos(heading)), float(y + a * math.sin(heading)), heading)


def _steady(result: Plan) -> tuple[float, float, float]:
    """Return yaw rate, speed along the axis, and dwell."""
    return result.tracked.vehicle.yaw_rate, float(result.tracked.vehicle.twist[0, 0]), result.minimum_dwell


def _sinc(angle: float) -> float:
    return math.sin(angle) / angle


def _errors(result: Plan, rule: Rule) -> tuple[float, float, float]:
    """Compute the distance from the drawn path, rms and largest [l], and time [s]."""
    first, dwells, start = rule
    robot = result.robot
    track = replay([Schedule(robot.group_values(), first, np.array(dwells), start, robot.time_scale)])[0]
    error = tracking_error(result.to_dict(), track)
    return error.raw_rms, error.raw_largest, sum(dwells) * robot.time_scale


def _rules(result: Plan, name: str) -> dict[str, Rule]:
    size = {"circle": 1.5, "square": 3.0, "triangle": 4.0}[name]
    corners = {"square": 4, "triangle": 3}
    paper = paper_polygon(result, corners[name], size) if name in corners else paper_circle(result, size)
    dwells: Floats = result.dwells
    return {
        "the paper's rule": paper,
        "sum-up rounding": sum_up_rounding(result),
        "this planner": (result.first_direction, dwells.tolist(), result.start),
    }


def main() -> None:
    threadpool_limits(1)
    lookup = load()
    print(f"{'path':30}{'rule':20}{'rms':>9}{'max':>9}{'minutes':>9}{'flips':>7}")
    for title, path, robot in CASES:
        result = plan(path, PRESETS[robot], lookup=lookup)
        for name, rule in _rules(result, title.split(",")[0]).items():
            rms, largest, seconds = _errors(result, rule)
            print(f"{title:30}{name:20}{rms:9.4f}{largest:9.4f}{seconds / 60:9.1f}{len(rule[1]):7d}", flush=True)
