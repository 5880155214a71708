"""The content of plan.json and goal.json, and a plan made again from it, to be tracked or planned on.

plan.json has the schedule, the declared path with the pivot's headings, the guidance, the errors, and the robot's
groups, scales and calibration (`Plan.to_dict`). The vehicle is asked for again of a look-up table: that of the
package, or the robot's own, simulated where the plan was made with one and kept beside plan.json. goal.json has
the trip (`Trip.to_dict`) and the identity of the plan beside it.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from common.errors import InputError
from common.keywords import checks_keywords
from common.reading import expecting, read_bytes, read_json
from planner.goal.trip import FORMAT, Trip
from planner.guidance.line_of_sight import Guidance
from planner.paths.obstacles import FreeSpace
from planner.paths.path import Path2D
from planner.paths.tractrix import Reference
from planner.planning.conditions import KeptClear, Lap
from planner.planning.declare import FeasiblePath
from planner.planning.plan import GUARANTEE, KINDS, Plan
from planner.planning.request import DOCUMENTED, Camera, PlanRequest
from planner.planning.stated_error import PlanErrors, predicted_error
from planner.vehicle.from_table import table_for
from planner.vehicle.measured import MeasuredVehicle
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from planner.vehicle.vehicle import Switches, roll_out
from planner.vehicle.zigzag import Objective, Zigzag
from sim.knowledge import CalibrationKnowledge
from sim.model.groups import GROUP_COLUMNS, OPTIONAL_COLUMNS
from sim.model.robot import Robot
from sim.model.schedule import PLAN_FILE, check_format, read_plan_file
from surrogate.interface import LookupTable
from surrogate.table_file import load_table

_JOBS = tuple(f"{kind}.json" for kind in KINDS)  # beside the plan.json whose id they name
_LARGEST = 1e100  # of a number, so that sums and squares of them are finite


@checks_keywords
def load_plan(path: str | Path) -> dict[str, Any]:
    """Read and check the content of a plan.json, which is that of `Plan.to_dict`.

    Args:
        path: the file, written by `write_plan`.

    Raises:
        InputError: the file is no plan.json of this version, or it has a value that cannot be.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> from softflagella import circle, load_plan, load_robot, plan, write_plan
        >>> result = plan(circle(2.0), load_robot("paper-control"))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     paths = write_plan(result, folder)
        ...     load_plan(paths[0])["id"] == result.to_dict()["id"]
        True
    """
    content = read_plan_file(path)
    _check_plan(content, path)
    return content


@checks_keywords
def load_goal(path: str | Path) -> dict[str, Any]:
    """Read and check the content of a goal.json, which is that of `Trip.to_dict`.

    Args:
        path: the file, written by `write_plan`.

    Returns:
        The content, and in `plan_id` the `id` of the plan.json that was written with it.

    Raises:
        InputError: the file is no goal.json of this version, or it has a value that cannot be.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> from softflagella import load_goal, load_plan, to_goal, write_plan
        >>> trip = to_goal((0, 0, 0), (3, 1, 1), "paper-control")
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     paths = write_plan(trip, folder)
        ...     goal = load_goal(Path(folder, "goal.json"))
        ...     goal["goal"], goal["plan_id"] == load_plan(Path(folder, "plan.json"))["id"]
        ([3.0, 1.0, 1.0], True)
    """
    with expecting("a goal.json of the planner", path, "plan again"):
        content = read_json(path)
        if content["format"] != FORMAT:
            raise InputError(f"{path} has format {content['format']}, this version reads {FORMAT}: plan again")
        for key in ("end_error_over_l", "end_error_rad", "length_over_l", "margin_over_l"):
            _check(content, key)
        if content["predicted_clearance_over_l"] is not None:
            _check(content, "predicted_clearance_over_l")
        for key in ("start", "goal", "predicted_end"):
            _check(content, key, 3)
        _check(content, "via", 2, rows=0)
        FreeSpace.from_dict(content)
        if not isinstance(content["plan_id"], str):
            raise InputError("plan_id must be text; plan again")
    return dict(content)


@checks_keywords
def restore_plan(
    source: Mapping[str, Any] | str | Path,
    *,
    lookup: LookupTable | str | Path | None = None,
    own_table: bool = False,
) -> Plan:
    """Make a plan again from its plan.json, to track it or to go on from where a robot is.

    Args:
        source: a plan.json, a goal.json or tour.json beside it, their folder, or the content that `load_plan`
            returns.
        lookup: the look-up table with which the plan was made, or its file. Default: that of the package, or the
            robot's own.
        own_table: simulate the robot's own table in any case.

    Returns:
        The plan; of a trip whose goal.json is beside it, with the trip as its `job`.

    Raises:
        InputError: the file is no plan, or its robot cannot be simulated.

    Example:
        >>> import tempfile
        >>> import softflagella as sf
        >>> result = sf.plan(sf.circle(2.0), "paper-control")
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = sf.write_plan(result, folder)[0]
        ...     same = sf.restore_plan(path)
        >>> abs(sf.Tracker(same).command.flip_at - sf.Tracker(result).command.flip_at) < 1e-6
        True
    """
    if isinstance(source, Mapping):
        name, kept, content = "the plan", None, dict(source)
        check_format(content, name)
        _check_plan(content, name)
    else:
        path = plan_json(source)
        name, kept, content = str(path), str(path), load_plan(path)
    with expecting(PLAN_FILE, name, "plan again"), np.errstate(over="raise", invalid="raise"):
        robot = _robot(content["robot"])
        knowledge = CalibrationKnowledge.from_dict(content.get("calibration", {}), name)
        own = own_table or bool(content.get("own_table", False))
        table = load_table(lookup) if isinstance(lookup, str | Path) else lookup
        if table is None and isinstance(robot, Robot):
            table = table_for(robot, kept, knowledge, own=own)
        tracked = tracked_vehicle(robot, table, content["point"], knowledge)
        plan = _plan(content, tracked)
    if tracked.model != content.get("model") and not tracked.own_table:
        made = content.get("model")
        print(f"warning: {name} was made with look-up table {made}; this one is {tracked.model}", file=sys.stderr)
    beside = None if kept is None else Path(kept).with_name("goal.json")
    if beside is None or not beside.is_file() or (goal := load_goal(beside))["plan_id"] != content["id"]:
        return plan
    x, y, heading = map(float, goal["goal"])
    via = tuple((float(x), float(y)) for x, y in goal["via"])
    return plan.with_job(Trip((x, y, heading), plan.end, via, float(goal["length_over_l"])))


def is_plan(path: str | Path) -> bool:
    """Tell whether a file is JSON, or a folder has a plan.json: then it is no path to plan, but a plan."""
    place = Path(path)
    if place.is_dir():
        return (place / "plan.json").is_file()
    try:
        return read_bytes(place, first=512).removeprefix(b"\xef\xbb\xbf").lstrip()[:1] == b"{"
    except InputError:
        return False


def plan_json(source: str | Path) -> Path:
    """Find the plan.json that is meant.

    Raises:
        InputError: a file of a job does not name the plan beside it.
    """
    path = Path(source)
    if path.name == "cover.json":
        raise InputError(f"{path}: coverage of an area is planned no longer; give the plan.json beside it")
    if path.is_dir():
        return path / "plan.json"
    if path.name not in _JOBS:
        return path
    beside = path.with_name("plan.json")
    with expecting("a file of a plan", path, "give the plan.json beside it"):
        named = read_json(path)["plan_id"]
    if load_plan(beside)["id"] != named:
        raise InputError(f"{path} is of plan {named}, and {beside} is another one; plan again")
    return beside


def _robot(content: Mapping[str, Any]) -> Robot | MeasuredVehicle:
    """Make a robot of the groups and scales in a plan.json, or the vehicle that was measured.

    A robot's Young's modulus and viscosity are nominal: they count through the unit of time alone.
    """
    if "vehicle" in content:
        return MeasuredVehicle.from_dict(content["vehicle"])
    groups = {name: float(value) for name, value in content["groups"].items()}
    effects = {name: value for name, value in groups.items() if name not in (*GROUP_COLUMNS, *OPTIONAL_COLUMNS)}
    length, time = float(content["tail_length_m"]), float(content["time_scale_s"])
    head, radius = length / groups["l_over_R"], length / groups["l_over_r0"]
    return Robot(
        name=str(content["name"]),
        tails=round(groups["N"]),
        tail_length=length,
        tail_radius=radius,
        youngs_modulus=length**4 / (time * math.pi * radius**4 / 4),
        head_radius=head,
        head_length=groups["L_over_R"] * head,
        viscosity=1.0,
        motor_speed=abs(groups["omega_bar"]) / time,
        C_t=groups["C_t"],
        C_r=groups["C_r"],
        C_yr=groups["C_yr"],
        disc_offset=groups["a_over_R"] * head,
        effects=effects,
    )


def _plan(content: Mapping[str, Any], tracked: TrackedVehicle) -> Plan[None]:
    """Put the parts of a plan together."""
    if "arrival" in content:
        raise InputError("it was made to arrive at a time (--arrive), which is planned no longer; plan again")
    poses, dwells = np.array(content["predicted_poses"], dtype=float), np.array(content["dwell_bar"], dtype=float)
    if dwells.shape != (len(poses) - 1,) or not (np.isfinite(dwells) & (dwells > 0)).all():
        raise ValueError("dwell_bar needs a number above 0 between two of predicted_poses")
    first = content["first_direction"]
    if first not in (-1, 1):
        raise ValueError(f"first_direction = {first}")
    switches = Switches(int(first), dwells, poses)
    objective = content.get("objective", "error")
    if objective not in get_args(Objective):
        raise ValueError(f"objective = {objective}")
    raw, closed = np.array(content["raw_path"], dtype=float), bool(content["closed"])
    drawn = Path2D(raw[:-1] if closed else raw, closed)
    declared, straight, guidance = _guidance(content, tracked)
    errors = _errors(content, tracked, drawn, declared, switches)
    kept_clear = KeptClear.from_dict(content["kept_clear"]) if "kept_clear" in content else None
    camera = Camera.from_dict(content["camera"]) if "camera" in content else DOCUMENTED
    request = PlanRequest(point=tracked.point, objective=objective, camera=camera)
    lap = Lap.from_dict(content["lap"]) if "lap" in content else None
    parts = (tracked, request, drawn, declared, straight, guidance, switches, errors)
    plan: Plan[None] = Plan(*parts, kept_clear, lap)
    said = tuple(str(warning) for warning in content["warnings"] if warning not in plan.warnings)
    return replace(plan, declared=replace(declared, warnings=said))


def _guidance(content: Mapping[str, Any], tracked: TrackedVehicle) -> tuple[FeasiblePath, Zigzag, Guidance]:
    """Read the reference and the numbers of the guidance."""
    saved, p = content["guidance"], np.array(content["reference"], dtype=float)
    straight, heading = Zigzag.from_dict(saved["straight"]), np.array(saved["heading_rad"], dtype=float)
    reference = Reference.of_path(p, heading, tracked.rod, closed=bool(content["closed"]))
    to_pose = content[GUARANTEE] is None  # its arcs turn as much as the robot can, which asks for no look-ahead
    curvature = 0.0 if to_pose else float(np.abs(reference.curvature).max())
    declared = FeasiblePath(
        reference, curvature, float(content["off_drawn_over_l"]), float(content["missed_over_l"]), ()
    )
    dwell, ahead, swing = content["minimum_dwell_bar"], saved["look_ahead_over_l"], saved["swing_rad"]
    guidance = Guidance(float(dwell), float(ahead), float(swing))
    finite = np.isfinite(guidance).all() and np.isfinite(heading).all()
    if not (finite and min(guidance) > 0 and straight.speed > 0):
        raise ValueError("a number of the guidance is not above 0, or not finite")
    return declared, straight, guidance


def _errors(
    content: Mapping[str, Any], tracked: TrackedVehicle, drawn: Path2D, declared: FeasiblePath, switches: Switches
) -> PlanErrors:
    """Read the errors that are stated, and predict the track again."""
    guaranteed, closure, path = content[GUARANTEE], content["closure_over_l"], declared.reference.p
    track = roll_out(tracked.vehicle, switches, tracked.offset).track
    return PlanErrors(
        track=track,
        distance=predicted_error(path, track, closed=drawn.closed).distance,
        dwells=switches.dwells,
        declared=path,
        drawn=drawn,
        stated=float(content["stated_error_over_l"]),
        guaranteed=None if guaranteed is None else float(guaranteed),
        closure=None if closure is None else float(closure),
        table_share=float(content.get("table_share", 1.0)),
    )


def _check_plan(content: Mapping[str, Any], name: str | Path) -> None:
    """Check the errors and tables of a plan.json; `name` is that of the file in messages."""
    with expecting(PLAN_FILE, name, "plan again"):
        errors = [
            f"{each}_over_l" for each in ("stated_error", "feedback_error", "predicted_rms", "predicted_max")
        ]
        for key in (*errors, "offset_over_l", "minimum_dwell_bar"):
            _check(content, key)
        if content[GUARANTEE] is not None:
            _check(content, GUARANTEE)
        for key, width in (("reference", 2), ("raw_path", 2), ("predicted_poses", 3)):
            _check(content, key, width, rows=2)
        content["point"]


def _check(content: Mapping[str, Any], key: str, width: int | None = None, *, rows: int | None = None) -> None:
    """Check an entry: a number, `width` numbers, or a table of as many columns with so many rows or more.

    Raises:
        InputError: it is something else, or a number is not finite.
        KeyError: there is no such entry.
    """
    given, wanted = content[key], "a finite number" if width is None else f"{width} finite numbers"
    try:
        values = np.array(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        values = np.array(math.nan)
    shape: tuple[int, ...] = () if width is None else (width,)
    if rows is not None:
        wanted = f"{rows} or more rows of {wanted}"
        shape = (max(rows, len(given) if isinstance(given, list) else 0), *shape)
        values = values.reshape(shape) if not values.size and not shape[0] else values
    if values.shape != shape or not (np.abs(values) < _LARGEST).all():
        raise InputError(f"{key} must be {wanted} below {_LARGEST:g}; plan again")
