"""Jobs of a laboratory: `softflagella.tour`, `cover`, `hold` and `fleet`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Unpack

from planner.api.options import (
    AnyVehicle,
    JobOptions,
    Length,
    Region,
    asked,
    length_of,
    places_of,
    region_of,
    seconds_of,
)
from planner.files.fleet_files import distance_apart
from planner.files.regions import refuse_other_unit
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
from planner.paths.units import read_degrees
from planner.planning.plan import Plan
from sim.io.errors import InputError
from sim.io.keywords import checks_keywords


@checks_keywords
def tour(
    places: str | Path | Sequence[Sequence[float] | str],
    robot: AnyVehicle,
    *,
    back: bool = False,
    any_start: bool = False,
    **options: Unpack[JobOptions],
) -> Plan[Visits]:
    """Plan a tour of places in the order that takes the robot the least time, with free headings.

    Args:
        places: X,Y of each, or one CSV or SVG with a point for each; or x, y of each [l]. The tour begins at the
            first one. Up to 12 more are ordered exactly; with more, `job.gap` says how much longer than the
            quickest order the tour may be.
        robot: robot.toml or the name of a preset, or the robot; or a measured vehicle, or its vehicle.toml.
        back: end where the tour began.
        any_start: begin at any of the places.
        options: see `JobOptions`.

    Raises:
        InputError: a place is no pair of finite numbers, is there twice, or cannot be visited.

    Example:
        >>> import softflagella as sf
        >>> tour = sf.tour([(0, 0), (4, 0), (2, 1)], "paper-control", objective="time")
        >>> tour.job.order, tour.job.exact, len(tour.dwells) > 10
        ((0, 2, 1), True, True)
    """
    tracked, request = asked(robot, options)
    visited = places_of(places, options.get("unit"), tracked.robot)
    return plan_tour(visited, tracked, request, any_start=any_start, back=back, progress=options.get("progress"))


@checks_keywords
def cover(
    region: Region,
    width: Length,
    robot: AnyVehicle,
    *,
    holes: Sequence[Region] = (),
    angle: float | str | None = None,
    **options: Unpack[JobOptions],
) -> Plan[Coverage]:
    """Plan lanes and turns that sweep a region with a round footprint about the tracked point.

    Args:
        region: circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH, or a CSV or SVG outline; or a `Circle`, or
            corners (n, 2) [l].
        width: LENGTH, of the footprint, such as 4cm.
        robot: robot.toml or the name of a preset, or the robot; or a measured vehicle, or its vehicle.toml.
        holes: REGION, a part that need not be swept, and may be crossed, as is what `keep_out` has.
        angle: DEGREES, direction of the lanes; a number is in rad (default: the quickest).
        options: see `JobOptions`.

    Raises:
        InputError: the region is empty or needs too many lanes, or the width is too small for this robot.

    Example:
        >>> import softflagella as sf
        >>> swept = sf.cover([[0, 0], [2, 0], [2, 2], [0, 2]], 0.5, "paper-control", objective="time")
        >>> swept.job.share > 0.97, swept.duration > swept.job.bound
        (True, True)
    """
    tracked, request = asked(robot, options)
    swims, unit = tracked.robot, options.get("unit")
    refuse_other_unit(region, unit, swims)
    outline, *crossed = (region_of(each, unit, swims) for each in (region, *holes))
    across = length_of(width, unit, swims, "--width")
    along = read_degrees(angle, "--angle") if isinstance(angle, str) else angle
    field = Field(outline, (*crossed, *request.space.regions))
    return sweep_field(field, across, tracked, request, along, options.get("progress"))


@checks_keywords
def hold(
    place: Sequence[float] | str,
    robot: AnyVehicle,
    *,
    seconds: float | str | None = None,
    **options: Unpack[JobOptions],
) -> Plan[Orbit]:
    """Plan the smallest orbit about a place that the robot can keep with a camera; it repeats.

    Args:
        place: X,Y; or x, y [l].
        robot: robot.toml or the name of a preset, or the robot; or a measured vehicle, or its vehicle.toml.
        seconds: TIME, for so long, such as 30min (default: until told otherwise).
        options: see `JobOptions`.

    Raises:
        InputError: the place is no pair of finite numbers, the time is not above 0, or the body has no room.

    Example:
        >>> import softflagella as sf
        >>> held = sf.hold((2, 1), "paper-control", seconds=1800)
        >>> round(held.job.smallest, 2), round(held.job.radius, 2)
        (0.94, 0.97)
    """
    duration = seconds_of(seconds, "--for")
    tracked, request = asked(robot, options)
    if isinstance(place, str) and "," not in place:
        raise InputError(f"place {place!r}; write X,Y, for example 30cm,15cm")
    (centre,) = places_of([place], options.get("unit"), tracked.robot)
    return orbit(centre, tracked, request, duration, options.get("progress"))


@checks_keywords
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
