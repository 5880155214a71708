"""Jobs of a laboratory: `softflagella.tour` and `cover`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Unpack

from numpy.typing import ArrayLike

from planner.jobs.cover import cover as sweep_field
from planner.jobs.coverage_plan import CoveragePlan
from planner.jobs.region import Field
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


def cover(
    region: Circle | Path2D | ArrayLike,
    width: float,
    robot: OneRobot,
    *,
    holes: Sequence[Circle | Path2D | ArrayLike] = (),
    angle: float | None = None,
    keep_out: Sequence[Circle | Path2D | ArrayLike] = (),
    walls: Path2D | ArrayLike | None = None,
    feedback: bool = False,
    lookup: LookupTable | None = None,
    knowledge: CalibrationKnowledge | None = None,
    progress: Callable[[float], object] | None = None,
    **options: Unpack[RequestOptions],
) -> CoveragePlan:
    """Plan lanes and turns that sweep a region with a round footprint about the tracked point.

    Args:
        region: a circle, or a polygon as (n, 2) corners [l].
        width: of the footprint [l].
        robot: the robot, its robot.toml, or the name of a preset.
        holes: parts of the region that need not be swept, and may be crossed.
        angle: direction of the lanes [rad]; default: the quickest one.
        keep_out: regions that the robot's body must not touch; they are holes, too.
        walls: a polygon (n, 2) that it must not leave.
        feedback: the pose will be measured every 20 flips.
        lookup: trained table, or the table of this one robot; see `plan`.
        knowledge: what a calibration found besides the robot: covariance, current. Default: that of the file.
        progress: called now and then with the share of the path that is done.
        options: point, objective, minimum_dwell, minimum_seconds, dwell, tolerance and seed of `plan`.

    Raises:
        InputError: the region is empty or needs too many lanes, or the width is too small for this robot.

    Example:
        >>> import softflagella as sf
        >>> swept = sf.cover([[0, 0], [2, 0], [2, 2], [0, 2]], 0.5, "paper-control", objective="time")
        >>> swept.share > 0.97, swept.plan.duration > swept.bound
        (True, True)
    """
    swims, table, known = planned_robot(robot, lookup, knowledge)
    request = PlanRequest(**options)
    tracked = tracked_vehicle(swims, table, request.point, known)
    space = FreeSpace.of(keep_out, walls)
    (outline,) = FreeSpace.of([region]).regions
    field = Field(outline, (*FreeSpace.of(holes).regions, *space.regions))
    return sweep_field(field, width, tracked, request, space, angle=angle, feedback=feedback, progress=progress)
