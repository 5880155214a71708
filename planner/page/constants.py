"""Constants that the page takes from Python: the module `constants.js`, written when a page is put together."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np

from common import units
from planner.page.first_state import camel
from planner.paths.path_files import READERS
from planner.planning.request import PlanRequest
from planner.vehicle.measured import MeasuredVehicle
from sim.knowledge import UNMEASURED
from sim.model import uncertainty
from sim.model.entries import ENTRIES

_NAMES = {  # of each module; a leading underscore is left out
    "planner.goal.last_dwells": "STEP LAST DROPPED CHANGE REACHED MISSED CONVERGED MOST_STEPS DAMPING EXACT",
    "planner.goal.route": "RANGE DETOUR LINK LONGEST_LINK STEP CELLS MOST_POSES LEVELS ROUNDS PLACES ENOUGH "
    "AROUND GRAIN",
    "planner.goal.trip": "SPACING SHORTER ZIGZAGS",
    "planner.files.headers": "MOST_MS CHECKPOINTS",
    "planner.paths.distance": "TIE",
    "planner.paths.dubins": "ROUNDING",
    "planner.paths.path_files": "KINDS ADVICE",
    "planner.paths.nearest_path": "SPACING MOST_POSES COARSEST WEIGHTS ITERATIONS ALONG POINTS_A_POSE ROUNDS "
    "LEAST EVEN SHORT SHORTEST_STEP",
    "planner.paths.path": "CIRCLE_POINTS LARGEST MOST_SMOOTHED EVEN",
    "planner.paths.svg_drawing": "LENGTHS SIZES PIXELS GROUPS UNDRAWN MOVING READ UNREAD HARMLESS TRANSFORMS",
    "planner.paths.tractrix": "BACK LAPS MOST_SLIP POINTS_A_ROD",
    "planner.planning.declare": "WARN FAR SCALES MOST_WORK SMOOTHINGS FIRST CORNER AS_DRAWN ROOMS TIGHTEST "
    "LOST ROUNDED SMALL NOISY FEWEST_POSES FILLET_ROOM SPACING MOST_POINTS MINIMAX ROUNDING POINTS_A_POSE",
    "planner.planning.stated_error": "LEVEL WOBBLE DRAWS BLOCKS WITHIN KEPT ZIGZAG PLACE COURSE STRETCH WEYL "
    "FIRST SECOND MIDDLE TAIL",
    "planner.guidance.law": "EXACT LARGEST_STEP LARGEST_TURN TURNS MOST_BIAS HALVINGS MOST_LOOKS",
    "planner.guidance.line_of_sight": "MOST_SWITCHES PATIENCE EVERY QUICKEST TIGHTEST PAIRS_AHEAD",
    "planner.planning.plan": "WIDE OWN_TABLE_FROM",
    "planner.planning.solve": "WORTH SAVED LENGTHENED_FROM MORE GROWS MARGINS OTHERS",
    "planner.vehicle.from_table": "ODD TIME_STEPS STEP",
    "planner.vehicle.measured": "SUBSTEPS",
    "planner.vehicle.vehicle": "SHORTEST STEP TIMES BEFORE_KNOTS",
    "planner.vehicle.zigzag": "PAIRS TRIES QUICK LONGEST KEPT NEARLY COMPARED WIDEST COUNT LONGER",
    "common.run_columns": "RUN RUN_SYNONYMS MEASURED RUN_NOTES RUN_SIGMAS RUN_COLUMNS",
    "common.number_words": "NUMBER MISSING COMMA POINT THOUSANDS WHOLE_LINE THREE OTHER FORMULA",
    "common.quantities": "CLOCK EPOCH LATEST",
    "common.tables": "COMMENT MARKED_NUMBER BLANKS SEPARATORS",
    "common.units": "UNITS TEXTS SPELLINGS MOST_PARTS",
    "sim.model.groups": "MOST_TAILS LEAST_SLENDERNESS",
    "sim.model.response": "DWELLS BEFORE FORGOTTEN",
    "sim.model.robot_toml": "LARGEST SIGMA HEADER NOTES NO_EFFECTS SI",
    "surrogate.error_modes": "NORMAL_90 LAGS",
    "surrogate.held_out": "RELATIVE",
    "surrogate.intervals": "NOVELTY",
    "surrogate.table": "OF_TAILS",
    "surrogate.response": "PARTS SMALL_SURGE OF_HEAD LEAST_FORM",
    "surrogate.domain": "DEGREE DEGREE_OF_MANY MANY MOST_TAILS",
    "surrogate.balance": "STEPS CORRECTION ACCEPTED DIFFERENCE MIN_SHARE FIRST_SPIN MAX_TURN",
    "surrogate.tails": "SOFT SMALL_DEFLECTION SMALL_SURGE MIN_SURGE TINY THRUST THRUST_SOFT THRUST_POWER "
    "TORQUE_SOFT TORQUE_POWER",
}

_NOT_ASKED = ("camera", "space", "feedback", "loop")  # of a plan that the page makes


def constants() -> dict[str, dict[str, Any]]:
    """Return the constants by the last name of their module."""
    found: dict[str, dict[str, Any]] = {}
    for module, names in _NAMES.items():
        found.setdefault(module.rpartition(".")[2], {}).update(_of(module, names.split()))
    request = PlanRequest()
    options = [name for name in vars(request) if name not in _NOT_ASKED]
    found["request"] = {"DEFAULTS": {camel(name): getattr(request, name) for name in options}}
    found["path_files"]["READ"] = list(READERS)
    found["paths_units"] = _of("planner.paths.units", ["LONGEST", "SMALLEST"])
    found["stated_error"]["CAMERA"] = request.camera.to_dict()
    found["units"]["SIGNS"] = {chr(sign): str(word) for sign, word in units._SIGNS.items()}
    found["measured"]["MODEL"] = MeasuredVehicle.MODEL
    found["knowledge"] = {
        "UNMEASURED": dict(zip(UNMEASURED.names, np.sqrt(np.diag(UNMEASURED.covariance)).tolist(), strict=True))
    }
    found["robot_toml"] |= {
        "ENTRIES": [entry._replace(field=camel(entry.field)) for entry in ENTRIES],
        "MEASURED": [camel(field) for field in uncertainty.DEFAULTS],
        "LARGEST_SIGMA": uncertainty._LARGEST,
    }
    return found


def constants_module() -> str:
    """Write the constants as a module of JavaScript; patterns become those of JavaScript."""
    text = json.dumps(_plain(constants()), ensure_ascii=False)
    text = re.sub(r'\{"pattern": ("(?:[^"\\]|\\.)*"), "flags": ("\w*")\}', r"new RegExp(\1, \2)", text)
    return f"const CONSTANTS = {text};\nexport {{ CONSTANTS }};\n"


def _of(module: str, names: list[str]) -> dict[str, Any]:
    parts = vars(import_module(module))
    return {name: parts[name] if name in parts else parts[f"_{name}"] for name in names}


def _plain(value: Any) -> Any:
    """Write arrays as lists, named tuples and patterns as dictionaries."""
    if hasattr(value, "_asdict"):
        return _plain(value._asdict())
    if isinstance(value, re.Pattern):
        flags = "".join(letter for letter, flag in (("i", re.I), ("m", re.M)) if value.flags & flag)
        return {"pattern": value.pattern, "flags": flags}
    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value
