"""Constants that the page takes from Python: the module `constants.js`, written when a page is put together."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np

from planner.page.first_state import CAMEL
from planner.planning.request import PlanRequest
from planner.vehicle.calibration_table import UNMEASURED
from sim.io import units
from sim.model import uncertainty
from sim.model.robot_toml import ENTRIES

_NAMES = {  # of each module; a leading underscore is left out
    "planner.draws": "WEYL FIRST SECOND MIDDLE TAIL",
    "planner.files.plan_files": "MOST_MS CHECKPOINTS",
    "planner.files.tracker_header": "LARGEST",
    "planner.paths.distance": "TIE",
    "planner.paths.fillets": "CORNER",
    "planner.paths.nearest_feasible": "SPACING MOST_POSES COARSEST WEIGHTS ITERATIONS ALONG POINTS_A_POSE ROUNDS "
    "LEAST",
    "planner.paths.path": "CIRCLE_POINTS LARGEST MOST_SMOOTHED EVEN",
    "planner.paths.pose_equations": "EVEN SHORT SHORTEST_STEP",
    "planner.paths.tractrix": "LAPS MOST_SLIP",
    "planner.planning.declared_path": "WARN FAR",
    "planner.planning.feasible": "AS_DRAWN ROOMS TIGHTEST LOST ROUNDED SMALL NOISY FEWEST_POSES FILLET_ROOM "
    "SPACING MOST_POINTS MINIMAX ROUNDING POINTS_A_POSE",
    "planner.planning.feedback_error": "WITHIN KEPT ZIGZAG PLACE COURSE STRETCH",
    "planner.planning.line_of_sight": "EXACT LARGEST_STEP TURNS MOST_BIAS HALVINGS MOST_LOOKS",
    "planner.planning.planned": "WIDE OWN_TABLE_FROM",
    "planner.planning.remedy": "SCALES MOST_WORK SMOOTHINGS FIRST",
    "planner.planning.schedule": "MOST_SWITCHES PATIENCE EVERY",
    "planner.planning.solve": "WORTH SAVED LENGTHENED_FROM",
    "planner.planning.stated_error": "LEVEL WOBBLE DRAWS BLOCKS TIGHTEST PAIRS_AHEAD",
    "planner.tracking.guidance": "NEAR ERRORS",
    "planner.tracking.kalman_filter": "PRIOR MOST CURRENT MOST_CURRENT MARKER MOST_MARKER STATES",
    "planner.vehicle.coefficient_modes": "STEP",
    "planner.vehicle.dwell_choice": "QUICK LONGEST KEPT NEARLY COMPARED WIDEST COUNT LONGER",
    "planner.vehicle.from_table": "ODD TIME_STEPS",
    "planner.vehicle.vehicle": "SHORTEST STEP TIMES BEFORE_KNOTS",
    "planner.vehicle.zigzag": "PAIRS TRIES",
    "sim.io.units": "UNITS TEXTS SPELLINGS MOST_PARTS",
    "sim.model.groups": "MOST_TAILS LEAST_SLENDERNESS",
    "sim.model.response": "DWELLS BEFORE FORGOTTEN",
    "sim.model.robot_toml": "LARGEST SIGMA HEADER NOTES NO_EFFECTS SI",
    "surrogate.error_modes": "NORMAL_90 SIZES",
    "surrogate.errors": "RELATIVE",
    "surrogate.intervals": "HALVED",
    "surrogate.table": "NOT_OF_HEAD",
    "surrogate.response": "PARTS SMALL_SURGE OF_HEAD",
    "surrogate.domain": "DEGREE DEGREE_OF_MANY MANY",
    "surrogate.motions": "LEAST_SURGE",
    "surrogate.balance": "STEPS CORRECTION ACCEPTED DIFFERENCE MIN_SHARE FIRST_SPIN MAX_TURN",
    "surrogate.tails": "SOFT SMALL_DEFLECTION SMALL_SURGE TINY THRUST THRUST_SOFT THRUST_POWER TORQUE_SOFT "
    "TORQUE_POWER",
}

_NOT_ASKED = ("camera", "space", "feedback", "arrive_seconds", "loop")  # of a plan that the page makes


def constants() -> dict[str, dict[str, Any]]:
    """Return the constants by the last name of their module."""
    found = {module.rpartition(".")[2]: _of(module, names.split()) for module, names in _NAMES.items()}
    request = PlanRequest()
    options = [name for name in vars(request) if name not in _NOT_ASKED]
    found["request"] = {"DEFAULTS": {_camel(name): getattr(request, name) for name in options}}
    found["paths_units"] = _of("planner.paths.units", ["LONGEST", "SMALLEST"])
    found["feedback_error"]["CAMERA"] = request.camera.to_dict()
    found["units"]["SIGNS"] = {chr(sign): str(word) for sign, word in units._SIGNS.items()}
    found["calibration_table"] = {
        "UNMEASURED": dict(zip(UNMEASURED.names, np.sqrt(np.diag(UNMEASURED.covariance)).tolist(), strict=True))
    }
    found["robot_toml"] |= {
        "ENTRIES": [entry._replace(field=CAMEL[entry.field]) for entry in ENTRIES],
        "MEASURED": [CAMEL[field] for field in uncertainty.DEFAULTS],
        "LARGEST_SIGMA": uncertainty._LARGEST,
    }
    return found


def constants_module() -> str:
    """Write the constants as a module of JavaScript."""
    return f"const CONSTANTS = {json.dumps(_plain(constants()), ensure_ascii=False)};\nexport {{ CONSTANTS }};\n"


def _of(module: str, names: list[str]) -> dict[str, Any]:
    parts = vars(import_module(module))
    return {name: parts[name] if name in parts else parts[f"_{name}"] for name in names}


def _camel(name: str) -> str:
    first, *rest = name.split("_")
    return first + "".join(word.title() for word in rest)


def _plain(value: Any) -> Any:
    """Write arrays as lists, and named tuples as dictionaries."""
    if hasattr(value, "_asdict"):
        return _plain(value._asdict())
    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value
