"""Plan, write plans, and check tracks: `softflagella.plan`, `write_plan` and `check`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import pandas as pd
from numpy.typing import ArrayLike

from planner.files.fleet_files import write_fleet
from planner.files.plan_files import write_plan as write_plan_files
from planner.files.plan_json import load_plan
from planner.files.replan import replan_from, saved_trip
from planner.files.tracking_error import TrackingError, tracking_error
from planner.jobs.fleet_plan import FleetPlan
from planner.jobs.plan import make_plan
from planner.paths.obstacles import Circle, FreeSpace
from planner.paths.path import Path2D
from planner.paths.path_files import Drawing, read_path
from planner.paths.units import in_tails
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest, RequestOptions
from planner.vehicle.calibration_table import CalibrationKnowledge
from sim.io.errors import InputError, naming
from sim.io.keywords import checks_keywords
from sim.io.tables import read_table
from sim.model.robot import Robot
from sim.robot_rows import OneRobot
from softflagella.api.vehicles import vehicle_of
from surrogate.interface import LookupTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@checks_keywords()
def plan(
    path: Path2D | Drawing | ArrayLike | str | Path,
    robot: OneRobot,
    *,
    unit: str | None = None,
    lookup: LookupTable | None = None,
    own_table: bool = False,
    knowledge: CalibrationKnowledge | None = None,
    progress: Callable[[float], object] | None = None,
    keep_out: Sequence[Circle | Path2D | ArrayLike] = (),
    walls: Path2D | ArrayLike | None = None,
    feedback: bool = False,
    arrive_seconds: float | None = None,
    loop: bool = False,
    **options: Unpack[RequestOptions],
) -> Plan[None]:
    """Plan the motor's switching times for a path.

    Args:
        path: (n, 2) points or a Path2D, lengths in tail lengths l; or what `read_path` reads, or its file; or a
            shape in words, such as "square:24cm" or "polygon:6:3l".
        robot: the robot, its robot.toml, or the name of a preset; its motor speed is used in both directions.
        unit: "m", "cm", "mm" or "l", of lengths of the path that do not say theirs.
        lookup: trained table, or the table of this one robot. Default: the one that comes with the package. Where
            that one does not know the robot, the robot's own table is simulated, and kept beside its file.
        own_table: simulate the robot's own table in any case. For long paths it is the better model, since the
            errors of a table add up over the flips.
        knowledge: what a calibration found besides the robot: covariance, current. Default: that of the file.
        progress: called now and then with the share of the path that is done.
        keep_out: circles, and polygons as (n, 2) corners [l], that the robot's body must not touch. Where they
            stand on the path, a way around is chosen; `Plan.kept_clear` has it.
        walls: a polygon (n, 2) that the body must not leave.
        feedback: the pose will be measured for a tracker, so the margin around obstacles is the stated error with
            feedback.
        arrive_seconds: the time from start to end. Dwells are changed, or swings and waiting circles are added,
            until the plan takes this time; `Plan.arrival` has it. Default: as the objective says.
        loop: of a closed path: the schedule repeats until told otherwise; `Plan.lap` says how well a lap closes.
            Its time is only nearly `arrive_seconds`.
        options: any of

            - point: which point must follow the path: "head_centre" (default), "head_tip" or "pivot".
            - corner: what to do with places that are too tight: declare the nearest path that can be followed, by
              root mean square ("nearest", the default) or by its largest distance ("minimax"), round corners
              ("fillet"), or refuse ("error").
            - time_weight: for "nearest" and "minimax": the mean squared distance [l²] from the drawn path that is
              worth as much as the time in which the whole path is followed; 0 (default): distance alone counts.
            - objective: what decides the dwell: small "error" (default), short "time", or few "flips"; see
              `planner.vehicle.dwell_choice`.
            - minimum_dwell: shortest time between flips [μ0 l⁴/EI] that the motor allows.
            - minimum_seconds: the same in seconds; the larger one counts.
            - dwell: this shortest dwell, and not the one that the objective would choose.
            - tolerance: largest acceptable stated error [l]; the dwell is shortened until it is kept.
            - seed: of the random robots from which the stated error is computed.
            - camera: of the stated error with feedback, see `Camera`.

    Raises:
        InputError: the path is bad or too tight, the dwell too short, the tolerance too small, there is no way
            around an obstacle, no plan is as fast as `arrive_seconds`, or the robot cannot be simulated.

    Example:
        >>> import softflagella as sf
        >>> result = sf.plan(sf.circle(2.0), "paper-control")
        >>> len(result.dwells) > 100, result.predicted_rms < 0.03
        (True, True)
    """
    space = FreeSpace.of(keep_out, walls)
    request = PlanRequest(space=space, feedback=feedback, arrive_seconds=arrive_seconds, loop=loop, **options)
    tracked = vehicle_of(robot, lookup, knowledge, request.point, own_table=own_table)
    return make_plan(_in_tails(path, tracked.robot, unit), tracked, request, progress)


def _in_tails(path: Path2D | Drawing | ArrayLike | str | Path, robot: Robot, unit: str | None) -> Path2D:
    """Read a path where a file is given, and convert it to tail lengths."""
    if isinstance(path, str | Path):
        with naming(path):
            return read_path(path).in_tails(robot, unit)
    if isinstance(path, Drawing):
        return path.in_tails(robot, unit)
    drawn = path if isinstance(path, Path2D) else Path2D.of(path)
    return drawn if unit is None else drawn.scaled(in_tails(unit, robot))


@checks_keywords()
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


@checks_keywords()
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
    return write_fleet(result, folder)


@checks_keywords()
def replan(
    plan: Plan | str | Path, track: pd.DataFrame | str | Path, *, lookup: LookupTable | None = None
) -> Plan:
    """Plan the rest of a plan from where a robot is now: the last pose of its track, at rest.

    The track tells which part of the path the robot has followed. Where it is away from its path, the rest begins
    with a way back, which leaves out as little of the path as is worth its length. Of a trip to a goal the way to
    the goal is planned again, through the places that are left.

    Args:
        plan: a plan, or the path of its plan.json or of its folder.
        track: `time_s`, `x_cm`, `y_cm`, `heading_deg` of the head's centre so far, or in other units, or the
            columns that `replay` returns; or its file. One row is enough.
        lookup: the look-up table with which a saved plan was made; see `restore_plan`.

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
    old = saved_trip(plan, lookup=lookup) if isinstance(plan, str | Path) else plan
    with naming(track):
        return replan_from(old, track if isinstance(track, pd.DataFrame) else read_table(track))
