"""plan(path, robot): from a path to a frozen plan, without simulating.

The look-up table gives the vehicle: both directions, and the memory of the last dwell
(`planner.vehicle.from_table`). The path that the robot can follow and that is nearest to the drawn one is declared
(`planner.planning.declare`). Its tractrix is the pivot's reference (`planner.paths.tractrix`).
`planner.planning.solve` follows it. What is not asked for is not loaded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Unpack

from numpy.typing import ArrayLike

from common.errors import InputError, naming
from common.keywords import checks_keywords
from planner.goal.last_dwells import looped
from planner.options import AnyVehicle, Length, PathOptions, asked, length_of
from planner.paths.path import Path2D, smoothed
from planner.paths.path_files import Drawing, read_path
from planner.paths.tractrix import Drift
from planner.paths.units import check_size, describe, in_lab, in_tails
from planner.planning.declare import Feasibility, FeasiblePath, make_feasible
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest
from planner.planning.solve import PathTask, solve
from planner.progress import ProgressCallback
from planner.vehicle.tracked_point import TrackedVehicle


@checks_keywords
def plan(
    path: Path2D | Drawing | ArrayLike | str | Path,
    robot: AnyVehicle,
    *,
    scale: float = 1.0,
    shape: str | None = None,
    closed: bool = False,
    smooth: Length | None = None,
    loop: bool = False,
    tell: Callable[[str], object] | None = None,
    **options: Unpack[PathOptions],
) -> Plan[None]:
    """Plan the motor's switching times for a path.

    Args:
        path: CSV with x, y, SVG, DXF, GeoJSON and others; or circle:RADIUS, square:SIDE, triangle:SIDE,
            polygon:CORNERS:SIDE (square:24cm, polygon:6:2l). In Python also what `read_path` reads, a Path2D, or
            points (n, 2), in tail lengths l or in `unit`.
        robot: robot.toml or the name of a preset, with its motor speed in both directions; or the vehicle.toml of
            a measured vehicle. In Python also the robot, the vehicle, or the verdict of a calibration: its
            corrected robot, with an error that holds for each robot that the runs cannot tell from it.
        scale: multiply the path's coordinates.
        shape: which path of a file with several, such as the layer of a DXF.
        closed: join the path's end to its start.
        smooth: LENGTH, smooth the path over this length, such as 1cm.
        loop: a closed path is followed lap after lap, until told otherwise. In Python `Plan.lap` says how well a
            lap closes.
        tell: is told which path is planned, a line at a time.
        options: see `PathOptions`.

    Raises:
        InputError: the path is bad or too tight, the dwell too short, the tolerance too small, there is no way
            around an obstacle, or the robot cannot be simulated.

    Example:
        >>> import softflagella as sf
        >>> result = sf.plan(sf.circle(2.0), "paper-control")
        >>> len(result.dwells) > 100, result.predicted_rms < 0.03
        (True, True)
    """
    tracked, request = asked(robot, options, loop=loop)
    swims, unit, say = tracked.robot, options.get("unit"), tell or (lambda line: None)
    if not 0 < scale < float("inf"):
        raise InputError(f"--scale {scale}; give a number above 0")
    if isinstance(path, str | Path):
        source, path = path, read_path(path, closed=closed or None, shape=shape)
    else:
        source = ""
    with naming(source or None):
        if isinstance(path, Drawing):
            of_obstacles = path.unit is not None and not request.space.empty  # files of these may have no unit
            drawn = path.in_tails(swims, None if of_obstacles else unit)
        else:
            drawn = path if isinstance(path, Path2D) else Path2D.of(path)
            drawn = drawn if unit is None else drawn.scaled(in_tails(unit, swims))
    drawn = drawn.scaled(scale)
    if smooth is not None:
        length = length_of(smooth, unit, swims, "--smooth")
        drawn, moved = smoothed(drawn, length)
        say(f"smoothed over {in_lab(length, swims)}, which moves the path by up to {in_lab(moved, swims)}")
    say(f"path: {describe(drawn, swims)}")
    if drawn.looks_closed:
        say("it ends as near to its start as its points are to each other; --closed joins them")
    return make_plan(drawn, tracked, request, options.get("progress"))


def make_plan(
    drawn: Path2D, tracked: TrackedVehicle, request: PlanRequest, progress: ProgressCallback | None = None
) -> Plan[None]:
    """Plan for a path [l] that the tracked point follows, see `plan`."""
    if request.loop and not drawn.closed:
        raise InputError("a path that repeats is closed; join its end to its start (--closed), or plan it once")
    check_size(drawn, tracked.robot, tracked.vehicle.turn_radius, tracked.vehicle.speed)

    @cache
    def nearest(drift: Drift) -> FeasiblePath:
        vehicle, corner = tracked.vehicle, request.corner
        feasibility = Feasibility(tracked.robot, vehicle, tracked.rod, drift, corner, request.time_weight)
        return make_feasible(drawn, feasibility, progress)

    task = PathTask(source=lambda trial: nearest(trial.drift), drawn=drawn, quickest=request.space.empty)
    if not request.space.empty:
        from planner.jobs.detours import Around  # loads SciPy's graphs

        task = replace(task, avoid=Around(request.space, drawn))
    once = solve(task, tracked, request, progress)
    if not request.loop:
        return once
    return looped(once, progress)
