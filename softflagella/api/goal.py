"""Plan from one pose to another: `softflagella.to_goal`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypedDict, Unpack

from numpy.typing import ArrayLike

from planner.goal.goal_plan import GoalPlan
from planner.goal.to_goal import to_goal as plan_to_goal
from planner.paths.obstacles import Circle, Polygon
from planner.paths.path import Path2D
from planner.planning.camera import Camera
from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.dwell_choice import Objective
from sim.io.keywords import checks_keywords
from sim.robot_rows import OneRobot
from softflagella.api.vehicles import robot_with_table
from surrogate.interface import LookupTable


class GoalOptions(TypedDict, total=False):
    """Keyword arguments of `to_goal` besides the table and what a calibration found."""

    via: Sequence[Sequence[float]]
    keep_out: Sequence[Circle | Polygon | Path2D | ArrayLike]
    walls: Polygon | Path2D | ArrayLike | None
    objective: Objective
    minimum_dwell: float | None
    minimum_seconds: float | None
    tolerance: float | None
    feedback: bool
    arrive_seconds: float | None
    seed: int
    camera: Camera


@checks_keywords()
def to_goal(
    start: Sequence[float],
    goal: Sequence[float],
    robot: OneRobot,
    *,
    lookup: LookupTable | None = None,
    own_table: bool = False,
    knowledge: CalibrationKnowledge | None = None,
    **options: Unpack[GoalOptions],
) -> GoalPlan:
    """Plan the motor's switching times from one pose to another.

    Args:
        start: x, y [l] and heading [rad] of the head's centre, at rest.
        goal: the same at the end.
        robot: the robot, its robot.toml, or the name of a preset; its motor speed is used in both directions.
        lookup: trained table, or the table of this one robot. Default: the one that comes with the package. Where
            that one does not know the robot, the robot's own table is simulated, and kept beside its file.
        own_table: simulate the robot's own table in any case.
        knowledge: what a calibration found besides the robot: covariance, current. Default: that of the file.
        options: any of

            - via: places x, y [l] that the pivot passes on its way, in this order.
            - keep_out: circles, and polygons as (n, 2) corners, that the robot's body must not touch.
            - walls: a polygon that it must not leave.
            - objective: what decides the dwell: short "time" (default), small "error", or few "flips".
            - minimum_dwell: shortest time between flips [μ0 l⁴/EI] that the motor allows.
            - minimum_seconds: the same in seconds; the larger one counts.
            - tolerance: largest acceptable stated error [l].
            - feedback: the robot's pose will be measured (`Tracker`), so the margin around
              obstacles is the stated error with feedback.
            - arrive_seconds: the time from start to goal. Dwells are changed, or swings and waiting circles are
              added, until the plan takes this time.
            - seed: of the random robots from which the stated error is computed.
            - camera: of the stated error with feedback, see `Camera`.

    Raises:
        NoWayError: there is no way to the goal; it is an `InputError`.
        InputError: a pose or a region is bad, or the robot cannot be simulated.

    Example:
        >>> import softflagella as sf
        >>> trip = sf.to_goal((0, 0, 0), (4, 1, 0), "paper-control")
        >>> trip.end_error[0] < 0.01
        True
    """
    swims, table, known = robot_with_table(robot, lookup, knowledge, own_table=own_table)
    return plan_to_goal(start, goal, swims, lookup=table, knowledge=known, **options)
