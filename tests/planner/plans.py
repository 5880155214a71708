"""Plans that several tests need, each made once for all processes of a test session."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from planner.files.plan_files import write_plan
from planner.goal.trip import Trip
from planner.jobs.plan import make_plan, plan
from planner.paths.obstacles import Circle, FreeSpace
from planner.paths.path import Path2D, shape_of
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest
from planner.vehicle.tracked_point import Point, TrackedVehicle, tracked_vehicle
from sim.knowledge import CalibrationKnowledge
from sim.model.presets import PRESETS
from softflagella import to_goal
from surrogate.robot_table import RobotTable
from surrogate.tabulate import tabulate
from tests.shared import shared

CONTROL = PRESETS["paper-control"]
BIASED = replace(CONTROL, effects={"left_right_bias": 0.2})
QUICK = PlanRequest(objective="flips")
LINE = ((0.0, 0.0), (5.0, 0.0))
ROCK = FreeSpace((Circle(2.5, 0.2, 0.4),))  # on the line
CORNER = ((0.0, 0.0), (3.0, 0.0), (3.0, 3.0))
WALLS = ((-2.5, -3.0), (6.0, -3.0), (6.0, 3.0), (-2.5, 3.0))


def path_of(words: str | tuple[tuple[float, float], ...]) -> Path2D:
    """Make a path from points, from a shape in words, or the path "eight"."""
    if not isinstance(words, str):
        return Path2D.of(words)
    if words == "eight":
        angle = np.linspace(0, 2 * math.pi, 401)[:-1]
        return Path2D.of(np.stack([2.05 * np.sin(angle), 1.13 * np.sin(2 * angle)], 1), closed=True)
    shape = shape_of(words)
    assert shape is not None
    return shape[0]


@shared
def tracked(point: Point = "head_centre") -> TrackedVehicle:
    """Ask the package's table for the vehicle of the control robot."""
    return tracked_vehicle(CONTROL, None, point, None)


@shared
def planned(
    path: str | tuple[tuple[float, float], ...] = "circle:2l", robot: str = "paper-control",
    current: tuple[float, float] | None = None, **options: Any,
) -> Plan:  # fmt: skip
    """Plan for a path, in a current [m/s]; see `path_of`."""
    knowledge = None if current is None else CalibrationKnowledge(current=current)
    return plan(path_of(path), PRESETS[robot], knowledge=knowledge, **options)


def predicted_track(result: Plan[Any], noise: float = 0.0) -> pd.DataFrame:
    """Make a track of the poses that a plan predicts at the flips."""
    poses = result.poses + noise * np.random.default_rng(0).normal(size=result.poses.shape)
    rows = np.column_stack([np.concatenate([[0.0], np.cumsum(result.dwells)]), poses])
    return pd.DataFrame(rows, columns=["time_bar", "x_over_l", "y_over_l", "heading_rad"])


@shared
def around(dwell: float | None = None) -> Plan:
    """Plan a line with a rock on it."""
    request = QUICK if dwell is None else PlanRequest(dwell=dwell)
    return make_plan(Path2D.of(LINE), tracked(), replace(request, space=ROCK))


@shared
def trip(goal: tuple[float, float, float] = (1.2, 0.5, 0.8)) -> Plan[Trip]:
    """Plan from rest at the origin to a pose."""
    return to_goal((0.0, 0.0, 0.0), goal, CONTROL, objective="flips")


@shared
def hindered_trip() -> Plan[Trip]:
    """Plan a trip through a place, between walls, around a circle and beside a triangle."""
    regions = [Circle(1.5, -1.1, 0.3), [[4.0, 1.5], [5.0, 1.5], [5.0, 2.5]]]
    task = {"keep_out": regions, "walls": WALLS, "via": [(1.5, 0.3)]}
    return to_goal((0, 0, 0), (3, 0, 0), CONTROL, objective="flips", **task)


@shared
def goal_file() -> bytes:
    """Return goal.json of the trip that is hindered, as it is written."""
    with TemporaryDirectory() as folder:
        write_plan(hindered_trip(), folder)
        return Path(folder, "goal.json").read_bytes()


@shared
def own_table(*, biased: bool = True) -> RobotTable:
    """Simulate the own table of the robot whose two directions differ, or of the control robot."""
    return tabulate(BIASED if biased else CONTROL)
