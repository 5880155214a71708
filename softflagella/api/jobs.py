"""Jobs of a laboratory: `softflagella.tour`, `cover`, `fleet` and `hold`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Unpack

from numpy.typing import ArrayLike

from planner.files.fleet_files import distance_apart
from planner.jobs.cover import Coverage
from planner.jobs.cover import cover as sweep_field
from planner.jobs.fleet import Member
from planner.jobs.fleet import fleet as keep_apart
from planner.jobs.fleet_plan import FleetPlan
from planner.jobs.hold import Orbit
from planner.jobs.hold import hold as orbit
from planner.jobs.region import Field
from planner.jobs.tour import Visits
from planner.jobs.tour import tour as plan_tour
from planner.paths.obstacles import Circle, FreeSpace
from planner.paths.path import Path2D
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest, RequestOptions
from planner.vehicle.calibration_table import CalibrationKnowledge
from sim.io.errors import InputError
from sim.io.keywords import checks_keywords
from sim.robot_rows import OneRobot
from softflagella.api.vehicles import vehicle_of
from surrogate.interface import LookupTable


@checks_keywords()
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
    own_table: bool = False,
    knowledge: CalibrationKnowledge | None = None,
    progress: Callable[[float], object] | None = None,
    **options: Unpack[RequestOptions],
) -> Plan[Visits]:
    """Plan a tour of places in the order that takes the robot the least time, with free headings.

    Args:
        places: x, y of each [l]; the tour begins at the first one. Up to 12 more are ordered exactly; with more,
            `job.gap` of the result says how much longer than the quickest order the tour may be.
        robot: the robot, its robot.toml, or the name of a preset.
        back: end where the tour began.
        any_start: begin at any of the places.
        keep_out: circles, and polygons as (n, 2) corners [l], that the robot's body must not touch.
        walls: a polygon (n, 2) that it must not leave.
        feedback: the pose will be measured for a tracker, so the margin around obstacles is the stated error with
            feedback.
        lookup: trained table, or the table of this one robot; see `plan`.
        own_table: simulate the robot's own table in any case.
        knowledge: what a calibration found besides the robot: covariance, current. Default: that of the file.
        progress: called now and then with the share of the path that is done.
        options: point, objective, minimum_dwell, minimum_seconds, dwell, tolerance, seed and camera of `plan`.

    Raises:
        InputError: a place is no pair of finite numbers, is there twice, or cannot be visited.

    Example:
        >>> import softflagella as sf
        >>> tour = sf.tour([(0, 0), (4, 0), (2, 1)], "paper-control", objective="time")
        >>> tour.job.order, tour.job.exact, len(tour.dwells) > 10
        ((0, 2, 1), True, True)
    """
    request = PlanRequest(space=FreeSpace.of(keep_out, walls), feedback=feedback, **options)
    tracked = vehicle_of(robot, lookup, knowledge, request.point, own_table=own_table)
    return plan_tour(places, tracked, request, any_start=any_start, back=back, progress=progress)


@checks_keywords()
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
    own_table: bool = False,
    knowledge: CalibrationKnowledge | None = None,
    progress: Callable[[float], object] | None = None,
    **options: Unpack[RequestOptions],
) -> Plan[Coverage]:
    """Plan lanes and turns that sweep a region with a round footprint about the tracked point.

    Args:
        region: a circle, or a polygon as (n, 2) corners [l].
        width: of the footprint [l].
        robot: the robot, its robot.toml, or the name of a preset.
        holes: parts of the region that need not be swept, and may be crossed.
        angle: direction of the lanes [rad]; default: the quickest one.
        keep_out: regions that the robot's body must not touch; they are holes, too.
        walls: a polygon (n, 2) that it must not leave.
        feedback: the pose will be measured for a tracker.
        lookup: trained table, or the table of this one robot; see `plan`.
        own_table: simulate the robot's own table in any case.
        knowledge: what a calibration found besides the robot: covariance, current. Default: that of the file.
        progress: called now and then with the share of the path that is done.
        options: point, objective, minimum_dwell, minimum_seconds, dwell, tolerance, seed and camera of `plan`.

    Raises:
        InputError: the region is empty or needs too many lanes, or the width is too small for this robot.

    Example:
        >>> import softflagella as sf
        >>> swept = sf.cover([[0, 0], [2, 0], [2, 2], [0, 2]], 0.5, "paper-control", objective="time")
        >>> swept.job.share > 0.97, swept.duration > swept.job.bound
        (True, True)
    """
    request = PlanRequest(space=FreeSpace.of(keep_out, walls), feedback=feedback, **options)
    tracked = vehicle_of(robot, lookup, knowledge, request.point, own_table=own_table)
    (outline,) = FreeSpace.of([region]).regions
    field = Field(outline, (*FreeSpace.of(holes).regions, *request.space.regions))
    return sweep_field(field, width, tracked, request, angle, progress)


@checks_keywords()
def hold(
    place: Sequence[float],
    robot: OneRobot,
    *,
    seconds: float | None = None,
    keep_out: Sequence[Circle | Path2D | ArrayLike] = (),
    walls: Path2D | ArrayLike | None = None,
    feedback: bool = False,
    lookup: LookupTable | None = None,
    own_table: bool = False,
    knowledge: CalibrationKnowledge | None = None,
    progress: Callable[[float], object] | None = None,
    **options: Unpack[RequestOptions],
) -> Plan[Orbit]:
    """Plan the smallest orbit about a place that the robot can keep with a camera; it repeats.

    Args:
        place: x, y [l].
        robot: the robot, its robot.toml, or the name of a preset.
        seconds: for so long; default: until told otherwise.
        keep_out: circles, and polygons as (n, 2) corners [l], that the robot's body must not touch.
        walls: a polygon (n, 2) that it must not leave.
        feedback: the pose will be measured for a tracker: the margin around obstacles is the stated error with
            feedback.
        lookup: trained table, or the table of this one robot; see `plan`.
        own_table: simulate the robot's own table in any case.
        knowledge: what a calibration found besides the robot: covariance, current. Default: that of the file.
        progress: called now and then with the share of the path that is done.
        options: point, objective, minimum_dwell, minimum_seconds, dwell, tolerance, seed and camera of `plan`.

    Raises:
        InputError: the place is no pair of finite numbers, the time is not above 0, or the body has no room.

    Example:
        >>> import softflagella as sf
        >>> held = sf.hold((2, 1), "paper-control", seconds=1800)
        >>> round(held.job.smallest, 2), round(held.job.radius, 2)
        (0.94, 0.97)
    """
    request = PlanRequest(space=FreeSpace.of(keep_out, walls), feedback=feedback, **options)
    tracked = vehicle_of(robot, lookup, knowledge, request.point, own_table=own_table)
    return orbit(place, tracked, request, seconds, progress)


@checks_keywords()
def fleet(
    plans: Sequence[Plan],
    apart: float | str,
    *,
    names: Sequence[str] | None = None,
    delays_s: Sequence[float] | None = None,
    feedback: bool = False,
    progress: Callable[[float], object] | None = None,
) -> FleetPlan:
    """Time plans of several robots in one tank so that their bodies keep apart, open loop or with feedback.

    Each robot keeps its path. Of two robots that would come too near to each other the later one of the list gives
    way: it begins later, or makes waiting circles. If that leads nowhere, the other one does. Robots that rest at
    their start or end count, too.

    Args:
        plans: of two or more robots, in one frame of the tank; where possible, the first ones have priority.
        apart: least distance between bodies, as "10cm"; a number is in tail lengths, if all robots have the same.
            It is kept although both robots are off by their errors in place.
        names: of the robots; default: robot-1, robot-2 and so on.
        delays_s: times before which they do not begin.
        feedback: the poses will be measured (`Tracker`, with `begin` at the robot's start).
        progress: called now and then with the share of what is done.

    Raises:
        InputError: the robots cannot keep apart by waiting; the message says which two, and why.

    Example:
        >>> import softflagella as sf
        >>> right = sf.plan([(0, 0), (3, 0)], "paper-control", objective="time")
        >>> up = sf.plan([(1.5, -2.5), (1.5, 2.5)], "paper-control", objective="time")
        >>> both = sf.fleet([right, up], apart="5cm")
        >>> both.sure_m >= 0.05, both.begin_s[0] == 0 or both.begin_s[1] == 0
        (True, True)
    """
    plans = list(plans)
    names = [f"robot-{k + 1}" for k in range(len(plans))] if names is None else list(names)
    delays = [0.0] * len(plans) if delays_s is None else list(delays_s)
    if not len(plans) == len(names) == len(delays):
        raise InputError(
            f"{len(plans)} plans, {len(names)} names and {len(delays)} delays; give one of each a robot"
        )
    if len(set(names)) < len(names):
        raise InputError("two robots have the same name; give each a name of its own")
    members = [Member(*member) for member in zip(names, plans, delays, strict=True)]
    if not members:
        raise InputError("no robots; a fleet has two or more")
    distance = distance_apart(apart, None, [member.plan.robot for member in members])
    return keep_apart(members, distance, feedback=feedback, progress=progress)
