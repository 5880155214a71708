"""The form of the content of a model file: which entries, which arrays, of which shapes.

Compiled loops do not check the bounds of arrays. So a content of another form must be refused before it is used.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sim.model.response import BEFORE
from surrogate.input_ranges import ROBOT
from surrogate.networks.ensemble import state_shapes
from surrogate.table.curve_errors import CURVE_ERRORS, SIZES
from surrogate.table.intervals import GROUPS
from surrogate.table.intervals import PARTS as INTERVAL_PARTS
from surrogate.table.response_table import PARTS, SHAPES
from surrogate.table.support import monomial_count
from surrogate.table.wrench_table import CLASSES, INPUT_COUNTS
from surrogate.wrench.tails import TYPICAL

_ENTRIES = ("wrench", "gap", "curves", "bases", "support", "intervals", "ranges", "errors", "provenance")
_GAP_INPUTS, _CURVE_INPUTS, _WIDTH_FEATURES = 8, 15, 11  # as wrench_table, response_table and lookup give them


class IncompleteError(Exception):
    """What a content lacks."""


def check_form(content: Mapping[str, Any]) -> None:
    """Refuse a content with which a query would not work.

    Raises:
        IncompleteError: the message says what is missing or wrong.
    """
    for name in _ENTRIES:
        if name not in content:
            raise IncompleteError(f"it has no {name!r}")
    wrench, support = content["wrench"], content["support"]
    if len(wrench) != len(CLASSES) or all(part is None for part in wrench):
        raise IncompleteError("it has no networks")
    if [part is None for part in wrench] != [part is None for part in support]:
        raise IncompleteError("its networks and their domains do not belong together")
    if len(content["curves"]) != len(PARTS) or set(content["bases"]) != set(SHAPES):
        raise IncompleteError("it has no response to a flip")
    _check_numbers(content)
    for part, inputs in zip(wrench, INPUT_COUNTS, strict=True):
        if part is not None:
            _check_network(part, inputs, len(TYPICAL[0]))
    _check_network(content["gap"], _GAP_INPUTS, 1)
    _check_curves(content["curves"], content["bases"])
    for part, inputs in zip(support, INPUT_COUNTS, strict=True):
        if part is not None:
            _check_support(part, inputs)
    if content["intervals"] is not None:
        _check_intervals(content["intervals"])
    if CURVE_ERRORS in content:
        _check_curve_errors(content[CURVE_ERRORS])


def _check_numbers(content: Mapping[str, Any]) -> None:
    """Refuse ranges and errors that are none, and numbers that are not finite."""
    for name in ROBOT:
        low, high = content["ranges"].get(name, (1.0, 0.0))
        if not 0 <= low <= high < math.inf:
            raise IncompleteError(f"it has no range of {name}")
    errors = content["errors"]
    if "rows" not in content["provenance"] or not errors:
        raise IncompleteError("it states no errors")
    if not all(isinstance(size, int | float) for kinds in errors.values() for size in kinds.values()):
        raise IncompleteError("its errors are no numbers")
    numbers = [content[name] for name in ("wrench", "gap", "curves", "bases", "support")]
    widths = content["intervals"] or {}
    if not _all_finite([*numbers, *(widths[name] for name in widths if name != "factor")]):
        raise IncompleteError("some of its numbers are not finite")
    if any(np.isnan(part).any() for part in widths.get("factor", {}).values()):  # infinite: no rows
        raise IncompleteError("some of its intervals are no numbers")


def _check_network(stored: Mapping[str, Any], inputs: int, outputs: int) -> None:
    shape, state = stored["shape"], stored["state"]
    sizes = state["bypass"].shape + state["weights.0"].shape[2:]
    stated = tuple(shape[name] for name in ("members", "inputs", "outputs", "width"))
    whole = all(type(size) is int and size > 0 for size in shape.values())
    if not whole or sizes != stated or shape["depth"] > len(state):
        raise IncompleteError("a network has another shape than is said")
    if shape["inputs"] != inputs or shape["outputs"] != outputs:
        raise IncompleteError("a network has other inputs or outputs than are needed")
    for name, expected in state_shapes(**shape).items():
        _check_array(state[name], expected)


def _check_curves(networks: list[Any], bases: Mapping[str, Any]) -> None:
    for name, basis in bases.items():
        points = math.prod(SHAPES[name])
        _check_array(basis["mean"], (points,))
        _check_array(basis["vectors"], (len(basis["vectors"]), points))
    for names, network in zip(PARTS, networks, strict=True):
        _check_network(network, _CURVE_INPUTS, sum(len(bases[name]["vectors"]) for name in names))


def _check_support(part: Mapping[str, Any], inputs: int) -> None:
    size = monomial_count(inputs)
    for name, shape in (("shift", (inputs,)), ("scale", (inputs,)), ("factor", (size, size))):
        _check_array(part[name], shape)
    if not isinstance(part["limit"], float) or not part["limit"] > 0:
        raise IncompleteError("its domain has no limit")


def _check_intervals(part: Mapping[str, Any]) -> None:
    terms = 1 + _WIDTH_FEATURES + _WIDTH_FEATURES * (_WIDTH_FEATURES + 1) // 2
    for name, shape in (("shift", (_WIDTH_FEATURES,)), ("scale", (_WIDTH_FEATURES,)), ("middle", (3,))):
        _check_array(part[name], shape)
    if not set(part["factor"]) <= set(part["weights"]) & set(part["bounds"]):
        raise IncompleteError("its intervals are incomplete")
    for name, factor in part["factor"].items():
        groups = GROUPS if len(factor) > INTERVAL_PARTS else 1
        _check_array(factor, (groups * INTERVAL_PARTS,))
        _check_array(part["weights"][name], (terms,))
        low, high = part["bounds"][name]
        if not low <= high:
            raise IncompleteError("its intervals have no bounds")


def _check_curve_errors(part: Mapping[str, Any]) -> None:
    _check_intervals(part["widths"])
    curves, simulator = part["curves"], part["simulator"]
    if not set(SIZES) <= set(part["widths"]["factor"]):
        raise IncompleteError("the errors of its response have no sizes")
    _check_array(curves, (len(curves), len(BEFORE) + 1, *SHAPES["lag"]))
    if (
        not isinstance(simulator, float)
        or not 0 <= simulator < math.inf
        or not _all_finite([part["widths"], curves])
    ):
        raise IncompleteError("the errors of its response are no finite numbers")


def _check_array(part: Any, shape: tuple[int, ...]) -> None:
    if not isinstance(part, np.ndarray) or part.dtype != np.float64 or part.shape != shape:
        raise IncompleteError(f"an array is not one of {' × '.join(map(str, shape))} numbers")


def _all_finite(part: Any) -> bool:
    if isinstance(part, Mapping | list):
        return all(_all_finite(own) for own in (part.values() if isinstance(part, Mapping) else part))
    return part is None or bool(np.isfinite(part).all())
