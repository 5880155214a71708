"""Plan from one pose to another: `softflagella.to_goal`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

from numpy.typing import ArrayLike

from planner.goal.to_goal import to_goal as plan_to_goal
from planner.goal.trip import Trip
from planner.paths.obstacles import Circle, FreeSpace, Polygon
from planner.paths.path import Path2D
from planner.planning.planned import Plan
from planner.planning.request import DwellOptions, PlanRequest
from planner.vehicle.calibration_table import CalibrationKnowledge
from sim.io.keywords import checks_keywords
from sim.robot_rows import OneRobot
from softflagella.api.vehicles import vehicle_of
from surrogate.interface import LookupTable


@checks_keywords()
def to_goal(
    start: Sequence[float],
    goal: Sequence[float],
    robot: OneRobot,
    *,
    via: Sequence[Sequence[float]] = (),
    keep_out: Sequence[Circle | Polygon | Path2D | ArrayLike] = (),
    walls: Polygon | Path2D | ArrayLike | None = None,
    feedback: bool = False,
    arrive_seconds: float | None = None,
    lookup: LookupTable | None = None,
    own_table: bool = False,
    knowledge: CalibrationKnowledge | None = None,
    **options: Unpack[DwellOptions],
) -> Plan[Trip]:
    """Plan the motor's switching times from one pose to another.

    Args:
        start: x, y [l] and heading [rad] of the head's centre, at rest.
        goal: the same at the end.
        robot: the robot, its robot.toml, or the name of a preset; its motor speed is used in both directions.
        via: places x, y [l] that the pivot passes on its way, in this order.
        keep_out: circles, and polygons as (n, 2) corners [l], that the robot's body must not touch.
        walls: a polygon that it must not leave.
        feedback: the robot's pose will be measured (`Tracker`), so the margin around obstacles is the stated error
            with feedback.
        arrive_seconds: the time from start to goal. Dwells are changed, or swings and waiting circles are added,
            until the plan takes this time.
        lookup: trained table, or the table of this one robot. Default: the one that comes with the package. Where
            that one does not know the robot, the robot's own table is simulated, and kept beside its file.
        own_table: simulate the robot's own table in any case.
        knowledge: what a calibration found besides the robot: covariance, current. Default: that of the file.
        options: objective (default: "time"), minimum_dwell, minimum_seconds, dwell, tolerance, seed and camera of
            `plan`.

    Raises:
        NoWayError: there is no way to the goal; it is an `InputError`.
        InputError: a pose or a region is bad, or the robot cannot be simulated.

    Example:
        >>> import softflagella as sf
        >>> trip = sf.to_goal((0, 0, 0), (4, 1, 0), "paper-control")
        >>> trip.job.end_error[0] < 0.01
        True
    """
    options.setdefault("objective", "time")
    request = PlanRequest(
        space=FreeSpace.of(keep_out, walls), feedback=feedback, arrive_seconds=arrive_seconds,
        **options,
    )  # fmt: skip
    tracked = vehicle_of(robot, lookup, knowledge, request.point, own_table=own_table)
    return plan_to_goal(start, goal, tracked, request, via)
