"""Jobs of a laboratory: `softflagella.tour`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Unpack

from numpy.typing import ArrayLike

from planner.jobs.tour import tour as plan_tour
from planner.jobs.tour_plan import TourPlan
from planner.paths.obstacles import Circle, FreeSpace
from planner.paths.path import Path2D
from planner.planning.request import PlanRequest, RequestOptions
from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.tracked_point import tracked_vehicle
from softflagella.api.plan import planned_robot
from softflagella.api.robots import OneRobot
from surrogate.interface import LookupTable


def tour(
    places: Sequence[Sequence[float]],
    robot: OneRobot,
    *,
    back: bool = False,
    any_start: bool = False,
    keep_out: Sequence[Circle | Path2D | ArrayLike] = (),
    walls: Path2D | ArrayLike | None = None,
    feedback: bool = False,
    lookup: LookupTable | None = None,
    knowledge: CalibrationKnowledge | None = None,
    progress: Callable[[float], object] | None = None,
    **options: Unpack[RequestOptions],
) -> TourPlan:
    """Plan a tour of places in the order that takes the robot the least time, with free headings.

    Args:
        places: x, y of each [l]; the tour begins at the first one. Up to 12 more are ordered exactly; with more,
            `gap` of the result says how much longer than the quickest order the tour may be.
        robot: the robot, its robot.toml, or the name of a preset.
        back: end where the tour began.
        any_start: begin at any of the places.
        keep_out: circles, and polygons as (n, 2) corners [l], that the robot's body must not touch.
        walls: a polygon (n, 2) that it must not leave.
        feedback: the pose will be measured every 20 flips, so the margin around obstacles is the stated error with
            feedback.
        lookup: trained table, or the table of this one robot; see `plan`.
        knowledge: what a calibration found besides the robot: covariance, current. Default: that of the file.
        progress: called now and then with the share of the path that is done.
        options: point, objective, minimum_dwell, minimum_seconds, dwell, tolerance and seed of `plan`.

    Raises:
        InputError: a place is no pair of finite numbers, is there twice, or cannot be visited.

    Example:
        >>> import softflagella as sf
        >>> tour = sf.tour([(0, 0), (4, 0), (2, 1)], "paper-control", objective="time")
        >>> tour.order, tour.exact, len(tour.plan.dwells) > 10
        ((0, 2, 1), True, True)
    """
    swims, table, known = planned_robot(robot, lookup, knowledge)
    request = PlanRequest(**options)
    tracked = tracked_vehicle(swims, table, request.point, known)
    space = FreeSpace.of(keep_out, walls)
    return plan_tour(places, tracked, request, space, any_start=any_start, back=back, feedback=feedback,
                     progress=progress)  # fmt: skip
