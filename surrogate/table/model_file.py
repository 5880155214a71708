"""Model files: everything that a query needs in one safetensors file (`surrogate.table.tensor_file`).

A file holds a hash over everything in it, domain and errors included; a file that was changed is refused. The
identity of a table is the start of this hash, and every plan stores the identity of the table that made it. One
model comes with the package (`SHIPPED`), so that planning works without training.

Compiled loops do not check the bounds of arrays. So a content of another form is refused before it is used.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np

from sim.io.errors import InputError
from sim.io.keywords import checks_keywords
from sim.model.response import BEFORE
from surrogate.input_ranges import ROBOT
from surrogate.interface import LookupTable
from surrogate.networks.ensemble import Ensemble, state_shapes
from surrogate.one_robot.robot_table import load_robot_table
from surrogate.table import tensor_file
from surrogate.table.curve_errors import CURVE_ERRORS, SIZES, CurveErrors
from surrogate.table.intervals import GROUPS, Intervals
from surrogate.table.intervals import PARTS as INTERVAL_PARTS
from surrogate.table.lookup import FORMAT, NeuralTable
from surrogate.table.response_table import PARTS, SHAPES, Basis, ResponseTable
from surrogate.table.support import Support, monomial_count
from surrogate.table.wrench_table import CLASSES, INPUT_COUNTS, WrenchTable
from surrogate.wrench.tails import TYPICAL

SHIPPED = Path(__file__).parents[1] / "shipped" / "model.safetensors"


def load(path: str | Path | None = None) -> NeuralTable:
    """Read a model file; by default the one that comes with the package.

    Raises:
        InputError: there is no such file, or it is not a model of this version, or it was changed.
    """
    path = SHIPPED if path is None else path
    if not Path(path).is_file():
        raise InputError(f"no model {path}; train one with softflagella train DATA --out {quote(str(path))}")
    remedy = "train it again with softflagella train"
    content = tensor_file.read(path, FORMAT, remedy)
    try:
        return _lookup(content)
    except IncompleteError as lack:
        raise InputError(f"{path} is no complete look-up table: {lack}; {remedy}") from None
    except (RuntimeError, KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError):
        raise InputError(f"{path} is no complete look-up table; {remedy}") from None


@checks_keywords()
def load_table(path: str | Path | None = None) -> LookupTable:
    """Read a model file, or the table of one robot (.json); by default the one that comes with the package.

    Args:
        path: a file written by `surrogate train` or `surrogate robot`.

    Raises:
        InputError: there is no such file, or it is not a table of this version.

    Example:
        >>> import numpy as np
        >>> from softflagella import load_robot, load_table
        >>> groups = {k: np.array([v]) for k, v in load_robot("paper-control").group_values().items()}
        >>> load_table().query(groups)["omega_yr_bar"].round(3).tolist()
        [0.049]
    """
    return load_robot_table(path) if path is not None and Path(path).suffix == ".json" else load(path)


def _lookup(content: dict[str, Any]) -> NeuralTable:
    check_form(content)
    intervals, of_curves = content["intervals"], content.get(CURVE_ERRORS)
    widths = None if of_curves is None else Intervals(**of_curves["widths"])
    return NeuralTable(
        tails=WrenchTable(
            tuple(None if part is None else _network(part) for part in content["wrench"]), _network(content["gap"])
        ),
        curves=ResponseTable(
            tuple(_network(part) for part in content["curves"]),
            {name: Basis(**part) for name, part in content["bases"].items()},
        ),
        support=tuple(None if part is None else Support(**part) for part in content["support"]),
        intervals=None if intervals is None else Intervals(**intervals),
        ranges={name: (float(low), float(high)) for name, (low, high) in content["ranges"].items()},
        errors=content["errors"],
        provenance=content["provenance"],
        curve_errors=None if of_curves is None else CurveErrors(**of_curves | {"widths": widths}),
    )


def _network(stored: Mapping[str, Any]) -> Ensemble:
    return Ensemble.from_state(stored["state"])


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
