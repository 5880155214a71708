"""A plan made again from its plan.json, so that it can be tracked, drawn and planned on from.

The file has the schedule, the declared path with the pivot's headings, the guidance, the errors, and the robot's
groups, scales and calibration. The vehicle is asked for again of a look-up table: that of the package, or the
robot's own, simulated where the plan was made with one and kept beside plan.json.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from planner.files.own_table import table_for
from planner.files.plan_json import check_numbers, load_plan
from planner.paths.obstacles import FreeSpace
from planner.paths.path import Path2D
from planner.paths.tractrix import Reference
from planner.planning.camera import DOCUMENTED, Camera
from planner.planning.conditions import Arrival, Detour, KeptClear, Lap
from planner.planning.declare import Declared
from planner.planning.errors import PlanErrors, predicted_error
from planner.planning.line_of_sight import Guidance
from planner.planning.plan import GUARANTEE, KINDS, Plan
from planner.planning.request import PlanRequest
from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.measured import MeasuredVehicle
from planner.vehicle.rollout import Switches, trace
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from planner.vehicle.zigzag import Objective, Zigzag
from sim.io.errors import InputError, naming
from sim.io.keywords import checks_keywords
from sim.io.reading import ContentError, read_json
from sim.model.plan_file import check_format
from sim.model.robot import Robot
from surrogate.interface import LookupTable

_JOBS = tuple(f"{kind}.json" for kind in KINDS)  # beside the plan.json whose id they name
_GROUPS = ("C_t", "C_r", "C_yr", "l_over_R", "L_over_R", "l_over_r0", "omega_bar", "N", "a_over_R")


def is_plan(path: str | Path) -> bool:
    """Tell whether a file is JSON, or a folder has a plan.json: then it is no path to plan, but a plan."""
    place = Path(path)
    if place.is_dir():
        return (place / "plan.json").is_file()
    try:
        with open(place, "rb") as file:
            return file.read(512).removeprefix(b"\xef\xbb\xbf").lstrip()[:1] == b"{"
    except (OSError, ValueError):
        return False


@checks_keywords
def restore_plan(
    source: Mapping[str, Any] | str | Path, *, lookup: LookupTable | None = None, own_table: bool = False
) -> Plan[None]:
    """Make a plan again from its plan.json, to track it or to go on from where a robot is.

    Args:
        source: a plan.json, a goal.json, tour.json or cover.json beside it, their folder, or the content that
            `load_plan` returns.
        lookup: the look-up table with which the plan was made. Default: that of the package, or the robot's own.
        own_table: simulate the robot's own table in any case.

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
        check_numbers(content, name)
    else:
        path = plan_json(source)
        name, kept, content = str(path), str(path), load_plan(path)
    try:
        with naming(name), np.errstate(over="raise", invalid="raise"):
            robot = _robot(content["robot"])
            knowledge = CalibrationKnowledge.from_dict(content.get("calibration", {}), name)
            own = own_table or bool(content.get("own_table", False))
            table = lookup
            if lookup is None and isinstance(robot, Robot):
                table = table_for(robot, kept, knowledge, own=own)
            tracked = tracked_vehicle(robot, table, content["point"], knowledge)
            plan = _plan(content, tracked)
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, ArithmeticError) as broken:
        raise InputError(f"{name} lacks what is needed to go on with it ({broken}); plan again") from None
    if tracked.model != content.get("model") and not tracked.own_table:
        made = content.get("model")
        print(f"warning: {name} was made with look-up table {made}; this one is {tracked.model}", file=sys.stderr)
    return plan


def plan_json(source: str | Path) -> Path:
    """Find the plan.json that is meant.

    Raises:
        InputError: a file of a job does not name the plan beside it.
    """
    path = Path(source)
    if path.is_dir():
        return path / "plan.json"
    if path.name not in _JOBS:
        return path
    beside = path.with_name("plan.json")
    try:
        named = read_json(path)["plan_id"]
    except (ContentError, KeyError, TypeError):
        raise InputError(f"{path} names no plan; give the plan.json beside it") from None
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
    effects = {name: value for name, value in groups.items() if name not in _GROUPS}
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
    kept_clear = _kept_clear(content["kept_clear"]) if "kept_clear" in content else None
    arrival = None
    if "arrival" in content:
        arrival, swing = Arrival.from_dict(content["arrival"], tracked.robot)
        declared = replace(declared, swing=swing)
    camera = Camera.from_dict(content["camera"]) if "camera" in content else DOCUMENTED
    request = PlanRequest(point=tracked.point, objective=objective, camera=camera)
    lap = Lap.from_dict(content["lap"]) if "lap" in content else None
    parts = (tracked, request, drawn, declared, straight, guidance, switches, errors)
    plan: Plan[None] = Plan(*parts, kept_clear, arrival, lap)
    said = tuple(str(warning) for warning in content["warnings"] if warning not in plan.warnings)
    return replace(plan, declared=replace(declared, warnings=said))


def _guidance(content: Mapping[str, Any], tracked: TrackedVehicle) -> tuple[Declared, Zigzag, Guidance]:
    """Read the reference and the numbers of the guidance."""
    saved, p = content["guidance"], np.array(content["reference"], dtype=float)
    straight, heading = Zigzag.from_dict(saved["straight"]), np.array(saved["heading_rad"], dtype=float)
    reference = Reference.of_path(p, heading, tracked.rod, closed=bool(content["closed"]))
    to_pose = content[GUARANTEE] is None  # its arcs turn as much as the robot can, which asks for no look-ahead
    curvature = 0.0 if to_pose else float(np.abs(reference.curvature).max())
    declared = Declared(
        reference, curvature, float(content["off_drawn_over_l"]), float(content["missed_over_l"]), ()
    )
    dwell, ahead, swing = content["minimum_dwell_bar"], saved["look_ahead_over_l"], saved["swing_rad"]
    guidance = Guidance(float(dwell), float(ahead), float(swing))
    finite = np.isfinite(guidance).all() and np.isfinite(heading).all()
    if not (finite and min(guidance) > 0 and straight.speed > 0):
        raise ValueError("a number of the guidance is not above 0, or not finite")
    return declared, straight, guidance


def _errors(
    content: Mapping[str, Any], tracked: TrackedVehicle, drawn: Path2D, declared: Declared, switches: Switches
) -> PlanErrors:
    """Read the errors that are stated, and predict the track again."""
    guaranteed, closure, path = content[GUARANTEE], content["closure_over_l"], declared.reference.p
    track = trace(tracked.vehicle, switches, tracked.offset)
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


def _kept_clear(content: Mapping[str, Any]) -> KeptClear:
    """Read what a plan keeps clear of."""
    detours = []
    for row in content["detours"]:
        (x, y), (join_x, join_y) = row["leaves"], row["joins"]
        lengths = (float(row[name]) for name in ("length_over_l", "replaced_over_l", "farthest_over_l"))
        detours.append(Detour((float(x), float(y)), (float(join_x), float(join_y)), *lengths))
    margin, clearance = float(content["margin_over_l"]), float(content["predicted_clearance_over_l"])
    return KeptClear(FreeSpace.from_dict(content), margin, clearance, tuple(detours))
