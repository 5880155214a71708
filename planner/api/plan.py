"""Plan for a path, and write plans: `softflagella.plan` and `write_plan`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from numpy.typing import ArrayLike

from planner.api.options import AnyVehicle, Length, PathOptions, asked, length_of, seconds_of
from planner.files.plan_files import write_plan as write_plan_files
from planner.jobs.plan import make_plan
from planner.paths.path import Path2D, smoothed
from planner.paths.path_files import Drawing, read_path
from planner.paths.units import describe, in_lab, in_tails
from planner.planning.plan import Plan
from sim.io.errors import InputError, naming
from sim.io.keywords import checks_keywords

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from planner.jobs.fleet_plan import FleetPlan


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
            polygon:6:2l); or what `read_path` reads, a Path2D, or points (n, 2), in tail lengths l or in `unit`.
        robot: robot.toml or the name of a preset, or the robot, with its motor speed in both directions; or a
            measured vehicle, or its vehicle.toml.
        scale: multiply the path's coordinates.
        shape: which path of an SVG with several.
        closed: join the path's end to its start.
        smooth: LENGTH, smooth the path over this length, such as 1cm.
        arrive: TIME, when the robot is at the end, such as 12min, or in seconds: dwells are changed, or swings or
            waiting circles added; `Plan.arrival` has it.
        loop: a closed path is followed lap after lap, until told otherwise; `Plan.lap` says how well a lap closes,
            whose time is only nearly `arrive`.
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
def write_plan(
    result: Plan | FleetPlan,
    folder: str | Path,
    *,
    pictures: Mapping[str, Figure] | None = None,
) -> list[Path]:
    """Write the files of a plan, all or none, and return their paths.

    Args:
        result: a plan; that of a job has goal.json, tour.json and so on, and a picture besides; a fleet has a
            folder for each robot.
        folder: it is made if it is missing.
        pictures: of a plan, more pictures, by the name of their file, such as "trade_off.svg".

    Raises:
        InputError: a dwell is too short for whole milliseconds, or a file cannot be written.

    Example:
        >>> import tempfile
        >>> from softflagella import circle, plan, write_plan
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     [path.name for path in write_plan(plan(circle(2.0), "paper-control"), folder)]
        ['plan.json', 'plan.csv', 'schedule.h', 'tracker.h', 'plan.svg']
    """
    if isinstance(result, Plan):
        return write_plan_files(result, folder, pictures=pictures)
    if pictures:
        raise InputError("a fleet takes no further pictures; write its plans: result.plans")
    from planner.files.fleet_files import write_fleet

    return write_fleet(result, folder)
