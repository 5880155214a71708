"""Where a robot is, and where it goes from there: `softflagella.check`, `replan` and `swim`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from planner.files.plan_json import load_plan
from planner.files.replan import replan_from, saved_trip
from planner.files.tracking_error import TrackingError, tracking_error
from planner.planning.camera import Camera
from planner.planning.plan import Plan
from planner.tracking.swim import Swim
from planner.tracking.swim import swim as swim_under
from planner.tracking.tracker import Tracker
from sim.io.errors import naming
from sim.io.keywords import checks_keywords
from sim.io.tables import read_table
from sim.model.robot import Robot
from sim.robot_rows import OneRobot, one_robot
from surrogate.interface import LookupTable
from surrogate.table_file import load_table


@checks_keywords
def check(
    plan: Plan | Mapping[str, Any] | str | Path,
    track: pd.DataFrame | str | Path,
) -> TrackingError:
    """Compare a replayed or measured track with its plan.

    Args:
        plan: a plan, the path of its plan.json, or its content.
        track: `time_s`, `x_cm`, `y_cm`, `heading_deg` of the head's centre, as a camera gives them, or the columns
            that `replay` returns; or its file.

    Returns:
        Distances of the tracked point from the declared path: `rms` and `largest`, with the `stated` error; from
        the path as drawn: `raw_rms` and `raw_largest` [l]. `line` says it in words.

    Raises:
        InputError: the track has no such columns, or values that are not finite.

    Example:
        >>> import softflagella as sf
        >>> result = sf.plan(sf.circle(1.2), "paper-control", objective="flips")
        >>> error = sf.check(result, sf.replay(result))
        >>> error.rms < error.largest < error.stated
        True
    """
    content = (
        load_plan(plan) if isinstance(plan, str | Path) else plan if isinstance(plan, Mapping) else plan.to_dict()
    )
    with naming(track):
        return tracking_error(dict(content), track if isinstance(track, pd.DataFrame) else read_table(track))


@checks_keywords
def replan(
    plan: Plan | str | Path,
    track: pd.DataFrame | str | Path,
    *,
    lookup: LookupTable | str | Path | None = None,
    own_table: bool = False,
) -> Plan:
    """Plan the rest of a plan from where a robot is now: the last pose of its track, at rest.

    The track tells which part of the path the robot has followed. Where it is away from its path, the rest begins
    with a way back, which leaves out as little of the path as is worth its length. Of a trip to a goal the way to
    the goal is planned again, through the places that are left.

    Args:
        plan: a plan, or the path of its plan.json or of its folder.
        track: `time_s`, `x_cm`, `y_cm`, `heading_deg` of the head's centre so far, or in other units, or the
            columns that `replay` returns; or its file. One row is enough.
        lookup: the look-up table with which a saved plan was made, or its file; see `restore_plan`.
        own_table: a saved plan was made with the robot's own table, which is simulated.

    Returns:
        A plan whose first dwell begins now; its `job` is a `Trip` for a trip to a goal.

    Raises:
        InputError: the file is no plan, the track cannot be used or has reached the end, or no way leads on.

    Example:
        >>> import pandas as pd
        >>> import softflagella as sf
        >>> result = sf.plan([[0, 0], [4, 0]], "paper-control")
        >>> track = pd.DataFrame({"time_s": [600.0], "x_cm": [22.0], "y_cm": [1.0], "heading_deg": [10.0]})
        >>> rest = sf.replan(result, track)
        >>> round(rest.start[0], 6), len(rest.dwells) < len(result.dwells)
        (2.0, True)
    """
    if isinstance(plan, str | Path):
        table = load_table(lookup) if isinstance(lookup, str | Path) else lookup
        plan = saved_trip(plan, lookup=table, own_table=own_table)
    with naming(track):
        return replan_from(plan, track if isinstance(track, pd.DataFrame) else read_table(track))


@checks_keywords
def swim(
    pilot: Plan | Tracker,
    truth: OneRobot | None = None,
    camera: Camera | None = None,
    *,
    current_cm_s: tuple[float, float] = (0.0, 0.0),
    longest: float = 3.0,
) -> Swim:
    """Simulate a robot under a tracker's orders, seen by a camera: a closed loop.

    Args:
        pilot: a tracker that has not begun, or a plan, which gets a tracker that knows the camera's noise.
        truth: the robot that swims; default: the one that the plan was made for. A measured vehicle moves as
            planned.
        camera: what sees it; default: that of the plan.
        current_cm_s: of the fluid, in x and y [cm/s], which the tracker does not know.
        longest: times the planned duration after which the swim ends in any case.

    Returns:
        Times, poses, distances from the declared path, the tracker's bounds on them, and dwells as ordered.

    Raises:
        InputError: the robot cannot be simulated.

    Example:
        >>> import softflagella as sf
        >>> result = sf.plan(sf.circle(1.2), "paper-control", objective="flips")
        >>> track = sf.swim(result, camera=sf.Camera(delay_s=0.5))
        >>> track.finished, track.rms() < 0.1
        (True, True)
    """
    plan = pilot.plan if isinstance(pilot, Tracker) else pilot
    camera = camera or plan.request.camera
    tracker = pilot if isinstance(pilot, Tracker) else Tracker(plan, noise=camera.noise)
    unit = plan.robot.time_scale / (100 * plan.robot.tail_length)
    robot = plan.robot if truth is None else one_robot(truth)
    return swim_under(
        tracker,
        plan,
        robot if isinstance(robot, Robot) else plan.tracked.vehicle,
        camera,
        start=tracker.start,
        current=(unit * current_cm_s[0], unit * current_cm_s[1]),
        longest=longest,
    )
