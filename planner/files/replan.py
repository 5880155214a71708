"""A plan from where a robot is now: the rest of a saved plan, or of a trip to a goal, from its track so far.

A running track is a camera's table: time_s, x_cm, y_cm and heading_deg of the head's centre, or in other units, or
the columns of a replay. Its last row may still be incomplete. Of a trip to a goal the way to the goal is planned
again, through the places that are left; of any other plan the rest of its path (`planner.tracking.rest`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from planner.files.goal_json import load_goal
from planner.files.plan_json import load_plan
from planner.files.saved_plan import plan_json, restore_plan
from planner.files.tracking_error import track_in_tails
from planner.goal.trip import Trip, to_goal
from planner.paths.obstacles import FreeSpace
from planner.paths.units import Swimmer
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest
from planner.tracking.rest import place_reached, rest_of
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.io.quantities import numbers_of
from surrogate.interface import LookupTable

_LARGEST = 1e6  # l, of a place; time units, of a time


def saved_trip(source: str | Path, *, lookup: LookupTable | None = None, own_table: bool = False) -> Plan:
    """Read a plan, with the trip to a goal that it belongs to; see `restore_plan`.

    Raises:
        InputError: the file is no plan, or its robot cannot be simulated.
    """
    plan = restore_plan(source, lookup=lookup, own_table=own_table)
    path = plan_json(source)
    beside = path.with_name("goal.json")
    if not beside.is_file():
        return plan
    content = load_goal(beside)
    if content["plan_id"] != load_plan(path)["id"]:
        return plan
    x, y, heading = map(float, content["goal"])
    via = tuple((float(x), float(y)) for x, y in content["via"])
    return plan.with_job(Trip((x, y, heading), plan.end, via, float(content["length_over_l"])))


def replan_from(plan: Plan, track: pd.DataFrame) -> Plan:
    """Plan the rest of a plan from the last pose of a track, at rest there; of a trip, the way to its goal.

    Raises:
        InputError: the track cannot be used, it has reached the end, or no way leads on.
    """
    times, poses = poses_of(track, plan.robot)
    if plan.ends_at is None:
        return rest_of(plan, times, poses)
    place, q, kept = place_reached(plan, times, poses), plan.declared.reference.q, plan.kept_clear
    left: list[Sequence[float]] = []
    passed = 0
    for via in plan.job.via:
        passed += int(np.hypot(*(q[passed:] - np.array(via)).T).argmin())
        left += [via] if passed > place else []
    x, y, heading = poses[-1].tolist()
    request = PlanRequest(
        objective=plan.request.objective,
        minimum_dwell=plan.minimum_dwell,
        camera=plan.request.camera,
        space=FreeSpace() if kept is None else kept.free_space,
        feedback=kept is not None and kept.margin < plan.stated_error,
    )
    return to_goal((x, y, math.remainder(heading, math.tau)), plan.ends_at, plan.tracked, request, left)


def poses_of(track: pd.DataFrame, robot: Swimmer) -> tuple[Floats, Floats]:
    """Return times (N,) and poses (N, 3) of a track, in time units, l and rad.

    Raises:
        InputError: a column is missing, a value is no finite number, or times go back.
    """
    table = track_in_tails(track, {"tail_length_m": robot.tail_length, "time_scale_s": robot.time_scale})
    columns = ("time_bar", "x_over_l", "y_over_l", "heading_rad")
    rows = np.stack([numbers_of(table[name]).to_numpy() for name in columns], 1)
    if len(rows) > 1 and np.isnan(rows[-1]).any():
        rows = rows[:-1]  # it is still being written
    bad = np.flatnonzero(~(np.abs(rows) < _LARGEST).all(1))
    if len(bad):
        raise InputError(f"row {bad[0] + 1} of the track has a value that is no finite number; correct the file")
    back = np.flatnonzero(np.diff(rows[:, 0]) < 0)
    if len(back):
        raise InputError(f"the track's time goes back at row {back[0] + 2}; give its rows in order")
    return rows[:, 0], rows[:, 1:]
