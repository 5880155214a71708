"""Write the page that plans, for a robot, with its look-up table."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from planner.files.headers import header_template, schedule_template
from planner.page.first_state import NamedPath, first_options, first_plan, robots_of, shapes_of, slider_ends
from planner.page.page import page_text
from planner.page.table_data import packed_bytes, packed_data, table_data
from planner.paths.path import circle
from planner.planning.request import PlanRequest
from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.from_table import both_directions
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from planner.vehicle.vehicle import Mode
from sim.io.files import write_text
from sim.io.provenance import __version__, code_version
from sim.model.robot import Robot
from surrogate.interface import LookupTable
from surrogate.table import NeuralTable

TITLE = "Plan a path for a soft robot"


def write_page(
    path: str | Path,
    robot: Robot,
    lookup: LookupTable,
    request: PlanRequest,
    *,
    knowledge: CalibrationKnowledge | None = None,
    paths: Sequence[NamedPath] = (),
    smooth: float | None = None,
    title: str = TITLE,
) -> Path:
    """Write one HTML file that plans without a server; the same input gives the same bytes.

    Args:
        path: the file.
        robot: the robot that the page begins with.
        lookup: the table that knows it. A trained table is written into the page, and the robot can be changed
            there; of any other table, and of a robot that a calibration has changed, the vehicle is written, and
            the robot's fields are locked.
        request: the options of the first plan.
        knowledge: what a calibration found besides the robot.
        paths: they are offered besides the shapes, and the first one is planned.
        smooth: length over which a drawn stroke is smoothed [l].
        title: of the page.

    Raises:
        InputError: the table does not know the robot, or the file cannot be written.
    """
    tracked = tracked_vehicle(robot, lookup, request.point, knowledge)
    known = knowledge or CalibrationKnowledge()
    why = _locked(robot, lookup, known)
    shapes = shapes_of(tracked.vehicle.turn_radius * robot.length_scale, paths)
    first = paths[0].path if paths else circle(shapes[0]["size"] / 100)
    plan = first_plan(first.scaled(1 / robot.length_scale), tracked, request)
    data = {
        "robots": robots_of(robot)[: 1 if why else None],
        "limits": slider_ends(robot, lookup.domain),
        "shapes": shapes,
        "first": {
            "robot": robot.name,
            "shape": shapes[0]["name"],
            "options": first_options(request, robot, smooth),
            "plan": plan and packed_bytes(json.dumps(plan, separators=(",", ":"), allow_nan=False).encode()),
        },
        "locked": {"name": robot.name, "why": why} if why else None,
        "planner": {
            "table": _planner_data(lookup, robot, tracked, why),
            "files": {
                "codeVersion": code_version(),
                "headers": packed_bytes(f"{schedule_template()}\f{header_template()}".encode()),
            },
        },
    }
    version = f"softflagella {__version__}"
    footer = (
        f"{version}, code {code_version()}. Robot {robot.name}. Look-up table {lookup.identity}. The page "
        "computes in your browser and sends nothing."
    )
    write_text(path, page_text(title, footer, data, version))
    return Path(path)


def _locked(robot: Robot, lookup: LookupTable, knowledge: CalibrationKnowledge) -> str:
    """Say why the page cannot compute another robot than this one; empty: it can."""
    if robot.effects:
        return f"This robot has effects ({', '.join(robot.effects)}), which the page does not compute anew."
    if robot.correction is not None:
        return "This robot has a calibration's correction, which the page does not compute anew."
    if knowledge.names or any(knowledge.current):
        return "A calibration has measured this robot; the page has its vehicle, and computes no other."
    if not isinstance(lookup, NeuralTable):
        return "The look-up table is of this robot alone, so the page computes no other."
    if lookup.intervals is None or lookup.curve_errors is None:
        return "The look-up table states one error for all robots, which the page does not compute anew."
    return ""


def _shorter(mode: Mode) -> Mode:
    """Round the lags of a mode to four bits, which changes the stated error by less than a per cent."""
    if mode.lag is None:
        return mode
    bits, exponent = np.frexp(mode.lag)
    return replace(mode, lag=np.ldexp(np.round(16 * bits) / 16, exponent))


def _mode_data(mode: Mode) -> dict[str, Any]:
    lag = None if mode.lag is None else list(mode.lag)
    return {"name": mode.name, "twist": mode.twist.tolist(), "lag": lag, "current": mode.current.tolist()}


def _planner_data(lookup: LookupTable, robot: Robot, tracked: TrackedVehicle, why: str) -> Any:
    """Return the look-up table's numbers, or those of the vehicle alone, for the planner in JavaScript."""
    if not why and isinstance(lookup, NeuralTable):
        return json.loads(table_data(lookup))
    vehicle, columns = tracked.vehicle, both_directions(robot.group_values())
    curves, errors = lookup.response(columns), lookup.error_modes(columns)
    content = {
        "identity": lookup.identity,
        "name": robot.name,
        "ownTable": tracked.own_table,
        "calibrated": tracked.calibrated,
        "groups": robot.group_values(),
        "unmeasured": [_mode_data(_shorter(mode)) for mode in tracked.unmeasured],
        "vehicle": {
            "twist": vehicle.twist.tolist(),
            "curves": [
                {name: getattr(curves, name)[i] for name in ("lag", "memory", "rest", "spread")} for i in (0, 1)
            ],
            "before": curves.before,
            "phaseRate": vehicle.phase_rate.tolist(),
            "errors": [
                {"twist": twist.tolist(), "lag": lag, "memory": memory}
                if lag.any() or memory.any()
                else {"twist": twist.tolist(), "lag": None, "memory": None}
                for twist, lag, memory in zip(errors.twist, errors.lag, errors.memory, strict=True)
            ],
            "modes": [_mode_data(mode) for mode in vehicle.modes if not mode.name.startswith("table: ")],
            "current": vehicle.current.tolist(),
            "tailGap": vehicle.tail_gap,
            "leastGap": vehicle.least_gap,
        },
    }
    return json.loads(packed_data(content))
