"""The public functions of the planner, which `softflagella` has and the commands call.

Numbers and words mean what `planner.options` says. Plans of paths load what they need; jobs load theirs when
called.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from numpy.typing import ArrayLike

from planner.jobs.plan import make_plan
from planner.options import (
    AnyVehicle,
    CornerOptions,
    GoalOptions,
    JobOptions,
    Length,
    PathOptions,
    Region,
    asked,
    length_of,
    place_of,
    places_of,
    pose_of,
    region_of,
    request_of,
    seconds_of,
    swimmer_of,
    table_of,
)
from planner.paths.path import Path2D, shape_of, smoothed
from planner.paths.path_files import Drawing, read_path
from planner.paths.units import describe, in_lab, in_tails, read_degrees
from planner.planning.plan import Plan
from planner.planning.request import Camera
from planner.vehicle.zigzag import Objective
from sim.io.errors import InputError, InputWarning, naming
from sim.io.keywords import checks_keywords
from sim.io.track_options import TrackOptions
from sim.model.robot import Robot
from sim.robot_rows import OneRobot, one_robot
from surrogate.interface import LookupTable

if TYPE_CHECKING:
    import pandas as pd

    from planner.files.tracks import TrackingError
    from planner.goal.trip import Trip
    from planner.jobs.cover import Coverage
    from planner.jobs.fleet_plan import FleetPlan
    from planner.jobs.hold import Orbit
    from planner.jobs.tour import Visits
    from planner.tracking.swim import Swim
    from planner.tracking.tracker import Tracker


@checks_keywords
def plan(
    path: Path2D | Drawing | ArrayLike | str | Path,
    robot: AnyVehicle,
    *,
    scale: float = 1.0,
    shape: str | None = None,
    closed: bool = False,
    smooth: Length | None = None,
    arrive: float | str | None = None,
    loop: bool = False,
    tell: Callable[[str], object] | None = None,
    **options: Unpack[PathOptions],
) -> Plan[None]:
    """Plan the motor's switching times for a path.

    Args:
        path: CSV with x, y; SVG; or circle:RADIUS, square:SIDE, triangle:SIDE, polygon:CORNERS:SIDE (square:24cm,
            polygon:6:2l). In Python also what `read_path` reads, a Path2D, or points (n, 2), in tail lengths l or
            in `unit`.
        robot: robot.toml or the name of a preset, with its motor speed in both directions; or the vehicle.toml of
            a measured vehicle. In Python also the robot or the vehicle.
        scale: multiply the path's coordinates.
        shape: which path of an SVG with several.
        closed: join the path's end to its start.
        smooth: LENGTH, smooth the path over this length, such as 1cm.
        arrive: TIME, when the robot is at the end, such as 12min: dwells are changed, or swings or waiting circles
            added. In Python also in seconds; `Plan.arrival` has it.
        loop: a closed path is followed lap after lap, until told otherwise; the time of a lap is only nearly
            that of `arrive`. In Python `Plan.lap` says how well a lap closes.
        tell: is told which path is planned, a line at a time.
        options: see `PathOptions`.

    Raises:
        InputError: the path is bad or too tight, the dwell too short, the tolerance too small, there is no way
            around an obstacle, no plan is as fast as `arrive`, or the robot cannot be simulated.

    Example:
        >>> import softflagella as sf
        >>> result = sf.plan(sf.circle(2.0), "paper-control")
        >>> len(result.dwells) > 100, result.predicted_rms < 0.03
        (True, True)
    """
    tracked, request = asked(robot, options, arrive_seconds=seconds_of(arrive, "--arrive"), loop=loop)
    swims, unit, say = tracked.robot, options.get("unit"), tell or (lambda line: None)
    if not 0 < scale < float("inf"):
        raise InputError(f"--scale {scale}; give a number above 0")
    if isinstance(path, str | Path):
        source, path = path, read_path(path, closed=closed or None, shape=shape)
    else:
        source = ""
    with naming(source or None):
        if isinstance(path, Drawing):
            drawn = path.in_tails(swims, unit)
        else:
            drawn = path if isinstance(path, Path2D) else Path2D.of(path)
            drawn = drawn if unit is None else drawn.scaled(in_tails(unit, swims))
    drawn = drawn.scaled(scale)
    if smooth is not None:
        length = length_of(smooth, unit, swims, "--smooth")
        drawn, moved = smoothed(drawn, length)
        say(f"smoothed over {in_lab(length, swims)}, which moves the path by up to {in_lab(moved, swims)}")
    say(f"path: {describe(drawn, swims)}")
    return make_plan(drawn, tracked, request, options.get("progress"))


@checks_keywords
def to_goal(
    start: Sequence[Length],
    goal: Sequence[Length],
    robot: AnyVehicle,
    *,
    via: Sequence[tuple[Length, Length]] = (),
    arrive: float | str | None = None,
    objective: Objective = "time",
    progress: Callable[[float], object] | None = None,
    **options: Unpack[GoalOptions],
) -> Plan[Trip]:
    """Plan the motor's switching times from one pose to another.

    Args:
        start: x, y [l] and heading [rad] of the head's centre, at rest; or words: X, Y and degrees.
        goal: the same at the end.
        robot: robot.toml or the name of a preset, with its motor speed in both directions; or the vehicle.toml of
            a measured vehicle. In Python also the robot or the vehicle.
        via: X Y, of a place that the pivot passes on its way.
        arrive: TIME, when the robot is at the goal, such as 12min: dwells are changed, or swings or waiting
            circles added. In Python also in seconds.
        objective: what decides the dwell: small error, short time, or few flips.
        progress: called now and then with the share of what is done.
        options: see `GoalOptions`.

    Raises:
        NoWayError: there is no way to the goal; it is an `InputError`.
        InputError: a pose or a region is bad, or the robot cannot be simulated.

    Example:
        >>> import softflagella as sf
        >>> trip = sf.to_goal((0, 0, 0), (4, 1, 0), "paper-control")
        >>> trip.job.end_error[0] < 0.01
        True
    """
    from planner.goal.trip import to_goal as plan_to_goal

    swims, unit = swimmer_of(robot), options.get("unit")
    ends = (pose_of(start, unit, swims, "--start"), pose_of(goal, unit, swims, "--goal"))
    places = [place_of(place, unit, swims, "--via") for place in via]
    own = {"objective": objective, "arrive_seconds": seconds_of(arrive, "--arrive")}
    return plan_to_goal(*ends, *asked(robot, options, **own), places, progress)


@checks_keywords
def tour(
    places: str | Path | Sequence[Sequence[float] | str],
    robot: AnyVehicle,
    *,
    back: bool = False,
    any_start: bool = False,
    **options: Unpack[JobOptions],
) -> Plan[Visits]:
    """Visit places in the order that takes the robot the least time, with free headings.

    Args:
        places: X,Y of each, or one CSV or SVG with a point for each. The tour begins at the first one. Up to 12
            more are ordered exactly; of more it is stated how much longer than the quickest order the tour may
            be. In Python, `job.gap` states it, and a place may be x, y [l].
        robot: robot.toml or the name of a preset, or the vehicle.toml of a measured vehicle. In Python also the
            robot or the vehicle.
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
    from planner.jobs.tour import tour as plan_tour

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
    """Sweep a region, in lanes and turns, with a camera, magnet or sampler under the robot.

    Args:
        region: circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH, or a CSV or SVG outline. In Python also a `Circle`, or
            corners (n, 2) [l].
        width: LENGTH, of the round footprint about the tracked point, such as 4cm.
        robot: robot.toml or the name of a preset, or the vehicle.toml of a measured vehicle. In Python also the
            robot or the vehicle.
        holes: REGION, a part that need not be swept, and may be crossed, as is what `keep_out` has.
        angle: DEGREES, direction of the lanes (default: the quickest). In Python also a number in rad.
        options: see `JobOptions`.

    Raises:
        InputError: the region is empty or needs too many lanes, or the width is too small for this robot.

    Example:
        >>> import softflagella as sf
        >>> swept = sf.cover([[0, 0], [2, 0], [2, 2], [0, 2]], 0.5, "paper-control", objective="time")
        >>> swept.job.share > 0.97, swept.duration > swept.job.bound
        (True, True)
    """
    from planner.jobs.cover import Field
    from planner.jobs.cover import cover as sweep_field

    tracked, request = asked(robot, options)
    swims, unit = tracked.robot, options.get("unit")
    outline = region_of(region, unit, swims, agree=True)
    crossed = [region_of(each, unit, swims) for each in holes]
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
    """Stay about a place, on the smallest orbit that the robot can keep with a camera; it repeats.

    Args:
        place: X,Y. In Python also x, y [l].
        robot: robot.toml or the name of a preset, or the vehicle.toml of a measured vehicle. In Python also the
            robot or the vehicle.
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
    from planner.jobs.hold import hold as orbit

    duration = seconds_of(seconds, "--for")
    tracked, request = asked(robot, options)
    centre = place_of(place, options.get("unit"), tracked.robot)
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
    from planner.files.fleet_files import distance_apart
    from planner.jobs.fleet import Member
    from planner.jobs.fleet import fleet as keep_apart

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


@checks_keywords
def check(
    plan: Plan | Mapping[str, Any] | str | Path,
    track: pd.DataFrame | str | Path,
    **options: Unpack[TrackOptions],
) -> TrackingError:
    """Compare a replayed or measured track with its plan.

    Args:
        plan: plan.json. In Python also its content, or a plan.
        track: table with `time_s`, `x_cm`, `y_cm`, `heading_deg` of the head's centre, as a camera gives them, or
            with the columns that `replay` writes.
        options: of a file that another program has written, see `TrackOptions`.

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
    from planner.files.saved_plan import load_plan
    from planner.files.tracks import tracking_error

    content = load_plan(plan) if isinstance(plan, str | Path) else plan
    with naming(track):
        poses = _poses(track, options)
        return tracking_error(content.to_dict() if isinstance(content, Plan) else content, poses)


def _poses(track: pd.DataFrame | str | Path, options: TrackOptions) -> pd.DataFrame:
    """Read a track, and warn of poses that are lost."""
    from planner.files.tracks import read_track

    poses = read_track(track, **options)
    for line in poses.attrs.get("lost", ()):
        warnings.warn(line, InputWarning, stacklevel=4)
    return poses


@checks_keywords
def replan(
    plan: Plan | str | Path,
    track: pd.DataFrame | str | Path,
    *,
    lookup: LookupTable | str | Path | None = None,
    own_table: bool = False,
    **options: Unpack[TrackOptions],
) -> Plan:
    """Plan the rest of a plan from where a robot is now: the last pose of its track, at rest.

    The track tells which part of the path the robot has followed. Where it is away from its path, the rest begins
    with a way back, which leaves out as little of the path as is worth its length. Of a trip to a goal the way to
    the goal is planned again, through the places that are left.

    Args:
        plan: plan.json, its folder, or a goal.json, tour.json or cover.json beside it. In Python also a plan.
        track: table of the robot so far: `time_s`, `x_cm`, `y_cm`, `heading_deg` of the head's centre, or in other
            units, or the columns that `replay` writes; in its last row the robot is now, at rest.
        lookup: the look-up table with which a saved plan was made, or its file; see `restore_plan`.
        own_table: a saved plan was made with the robot's own table, which is simulated.
        options: of a track that another program has written, see `TrackOptions`.

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
    from planner.files.saved_plan import restore_plan
    from planner.files.tracks import replan_from

    if isinstance(plan, str | Path):
        plan = restore_plan(plan, lookup=lookup, own_table=own_table)
    with naming(track):
        return replan_from(plan, _poses(track, options))


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
    from planner.tracking.swim import swim as swim_under
    from planner.tracking.tracker import Tracker

    plan = pilot.plan if isinstance(pilot, Tracker) else pilot
    camera = camera or plan.request.camera
    tracker = pilot if isinstance(pilot, Tracker) else Tracker(plan, noise=camera.noise)
    unit = plan.robot.time_scale / (100 * plan.robot.length_scale)
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


@checks_keywords
def write_page(
    path: str | Path,
    robot: OneRobot = "paper-control",
    *,
    paths: Mapping[str, Path2D | ArrayLike] | Sequence[str] = (),
    smooth: Length | None = None,
    title: str | None = None,
    **options: Unpack[CornerOptions],
) -> Path:
    """Write one HTML file in which a path is drawn and planned, without a server or a network.

    Args:
        path: the file.
        robot: robot.toml or the name of a preset, that the page begins with. Robots with effects or a calibration
            cannot be changed in the page. In Python also the robot.
        paths: a path that the page offers: CSV, SVG, or a shape such as circle:20cm; the first one is planned when
            the page opens. In Python also points (n, 2) or a Path2D by name, in tail lengths l.
        smooth: LENGTH, smooth drawn strokes over this length, such as 1cm.
        title: of the page.
        options: of the first plan, see `CornerOptions`.

    Raises:
        InputError: the table does not know the robot, an option cannot be, or the file cannot be written.

    Example:
        >>> import tempfile
        >>> import softflagella as sf
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     page = sf.write_page(f"{folder}/page.html", paths={"my circle": sf.circle(2.0)})
        ...     0.5e6 < page.stat().st_size < 1.6e6
        True
    """
    from planner.page.first_state import NamedPath
    from planner.page.write_page import TITLE
    from planner.page.write_page import write_page as write

    swims, unit = one_robot(robot), options.get("unit")
    named = []
    if isinstance(paths, Mapping):
        for name, each in paths.items():
            drawn = each if isinstance(each, Path2D) else Path2D.of(each)
            named.append(NamedPath(name, drawn.scaled(swims.length_scale)))
    else:
        for name in paths:
            with naming(name):
                drawn = read_path(name).in_tails(swims, unit)
            short = Path(name).stem if shape_of(name) is None else name
            named.append(NamedPath(short, drawn.scaled(swims.length_scale)))
    table, known = table_of(robot, swims, options)
    over = None if smooth is None else length_of(smooth, unit, swims, "--smooth")
    request = request_of(options, swims)
    return write(path, swims, table, request, knowledge=known, paths=named, smooth=over, title=title or TITLE)
