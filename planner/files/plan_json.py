"""plan.json: a plan as plain content. `sim.model.plan_file` checks what the simulator needs, too."""

from __future__ import annotations

import json
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from planner.planning.errors import FEEDBACK_EVERY
from planner.planning.plan import Plan
from sim.io.errors import InputError
from sim.model.plan_file import FORMAT, read_plan_file

_NUMBERS = ("stated_error_over_l", "feedback_error_over_l", "predicted_rms_over_l", "predicted_max_over_l",
            "offset_over_l", "minimum_dwell_bar")  # fmt: skip
_GUARANTEE = "guaranteed_error_over_l"  # null where it is not known
_TABLES = {"reference": 2, "raw_path": 2, "predicted_poses": 3}


def plan_record(result: Plan) -> dict[str, Any]:
    """Return the plan as JSON-like content; `sim.model.schedule.load_schedule` reads its schedule.

    `id` is a digest of all the rest. The other files of the plan have it, too.
    """
    content = _content(result)
    digest = sha256(json.dumps(content).encode()).hexdigest()
    return {"id": f"p{digest[:11]}", **content}  # a letter first: no reader of plan.csv takes it for a number


def _content(result: Plan) -> dict[str, Any]:
    robot, schedule = result.robot, result.schedule()
    declared, errors = result.declared, result.errors
    x, y, heading = schedule.start
    return {
        "format": FORMAT,
        "robot": {
            "name": robot.name,
            "groups": schedule.robot,
            "tail_length_m": robot.tail_length,
            "motor_speed_rad_s": robot.motor_speed,
            "time_scale_s": robot.time_scale,
        },
        "point": result.tracked.point,
        "offset_over_l": result.tracked.offset,
        "first_direction": result.first_direction,
        "start": {"x_over_l": x, "y_over_l": y, "heading_rad": heading},
        "dwell_bar": result.dwells.tolist(),
        "dwell_s": result.seconds.tolist(),
        "predicted_poses": result.poses.tolist(),
        "reference": result.reference.tolist(),
        "raw_path": result.drawn.polyline().tolist(),
        "closed": result.drawn.closed,
        "objective": result.objective,
        "minimum_dwell_bar": result.minimum_dwell,
        "off_drawn_over_l": declared.off_drawn,
        "missed_over_l": declared.missed,
        "zigzag_rms_over_l": result.straight.rms,
        _GUARANTEE: errors.guaranteed,
        "stated_error_over_l": errors.stated,
        "feedback_error_over_l": errors.feedback,
        "feedback_every": FEEDBACK_EVERY,
        "predicted_rms_over_l": errors.predicted_rms,
        "predicted_max_over_l": errors.predicted_max,
        "drawn_rms_over_l": errors.drawn_rms,
        "drawn_max_over_l": errors.drawn_max,
        "closure_over_l": errors.closure,
        "model": result.tracked.model,
        "warnings": list(result.warnings),
    }


def load_plan(path: str | Path) -> dict[str, Any]:
    """Read and check the content of a plan.json.

    Raises:
        InputError: the file is no plan.json of this version, or it has a value that cannot be.
    """
    content = read_plan_file(path)
    try:
        for name in (*_NUMBERS, *([] if content[_GUARANTEE] is None else [_GUARANTEE])):
            if not np.isfinite(float(content[name])):
                raise InputError(f"{path}: {name} = {content[name]} is no finite number; plan again")
        for name, width in _TABLES.items():
            table = np.array(content[name], dtype=float)
            if table.ndim != 2 or table.shape[1] != width or len(table) < 2 or not np.isfinite(table).all():
                raise InputError(
                    f"{path}: {name} must have two or more rows of {width} finite numbers; plan again"
                )
        content["point"]
    except (KeyError, TypeError, ValueError, OverflowError) as broken:
        raise InputError(f"{path} is not a plan.json of the planner ({broken}); plan again") from None
    return content
