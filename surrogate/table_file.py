"""Model files: everything that a query needs in one safetensors file (`surrogate.tensor_file`).

A file holds a hash over everything in it, domain and errors included; a file that was changed is refused. The
identity of a table is the start of this hash, and every plan stores the identity of the table that made it. One
model comes with the package (`SHIPPED`), so that planning works without training.

Compiled loops do not check the bounds of arrays. So a content of another form is refused before it is used:
`_form` says what each part must be.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np

from common.errors import InputError
from common.keywords import checks_keywords
from sim.model.response import BEFORE, LAGS
from surrogate import tensor_file
from surrogate.domain import ROBOT, Support, monomial_count
from surrogate.error_modes import CURVE_ERRORS, CurveErrors
from surrogate.interface import LookupTable
from surrogate.intervals import GROUPS, THIRDS, Intervals
from surrogate.motions import FEATURES, INPUT_COUNTS, WrenchTable
from surrogate.network import Ensemble, state_shapes
from surrogate.response import COUNTS, FLIP_INPUTS, PARTS, SHAPES, Basis, ResponseTable
from surrogate.robot_table import load_robot_table
from surrogate.table import FORMAT, NeuralTable
from surrogate.tails import INPUTS, TYPICAL

SHIPPED = Path(__file__).parent / "shipped" / "model.safetensors"


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
        _check(content, _form(content), "")
        return _lookup(content)
    except KeyError as missing:
        lack = f": it has no {missing}"
    except WrongFormError as wrong:
        lack = f": {wrong}"
    except (RuntimeError, TypeError, ValueError, AttributeError, IndexError, OverflowError):
        lack = ""
    raise InputError(f"{path} is no complete look-up table{lack}; {remedy}")


@checks_keywords
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


def as_table(table: LookupTable | str | Path | None) -> LookupTable:
    """Return a table that is given by itself, by its file, or by nothing: the one that comes with the package."""
    return load_table(table) if table is None or isinstance(table, str | Path) else table


def trained_table(table: LookupTable | str | Path | None) -> NeuralTable:
    """Return `as_table`.

    Raises:
        InputError: it is the table of a single robot.
    """
    lookup = as_table(table)
    if not isinstance(lookup, NeuralTable):
        raise InputError("this is the table of a single robot; give a trained one")
    return lookup


def _lookup(content: dict[str, Any]) -> NeuralTable:
    intervals, errors = content["intervals"], content.get(CURVE_ERRORS)
    wrench, curves = (
        [None if part is None else Ensemble.from_state(part["state"]) for part in content[name]]
        for name in ("wrench", "curves")
    )
    bases = {name: Basis(**part) for name, part in content["bases"].items()}
    return NeuralTable(
        tails=WrenchTable(tuple(wrench), Ensemble.from_state(content["gap"]["state"])),
        curves=ResponseTable(tuple(filter(None, curves)), bases),
        support=tuple(None if part is None else Support(**part) for part in content["support"]),
        intervals=None if intervals is None else Intervals(**intervals),
        ranges={name: (float(low), float(high)) for name, (low, high) in content["ranges"].items()},
        errors=content["errors"],
        provenance=content["provenance"],
        curve_errors=None if errors is None else CurveErrors(**errors | {"widths": Intervals(**errors["widths"])}),
    )


class WrongFormError(Exception):
    """A part of a content has not the form that a query needs; the message names it."""


def _form(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the parts of a content must be, see `_check`."""
    sizes = [part and _input_count(part, may) for part, may in zip(content["wrench"], INPUT_COUNTS, strict=True)]
    if not any(sizes):
        raise WrongFormError("it has no networks")
    counts = {name: len(content["bases"][name]["vectors"]) for name in SHAPES}
    curves = [_network_form(network, FLIP_INPUTS, sum(counts[name] for name in names))
              for network, names in zip(content["curves"], PARTS, strict=True)]  # fmt: skip
    form = {
        "wrench": [size and _network_form(part, size, len(TYPICAL[0]))
                   for part, size in zip(content["wrench"], sizes, strict=True)],
        "gap": _network_form(content["gap"], len(INPUTS) + 1, 1),
        "curves": curves,
        "bases": {name: {"mean": (size,), "vectors": (counts[name], size)} for name, size in COUNTS.items()},
        "support": [size and _support_form(size) for size in sizes],
        "intervals": content["intervals"] and _intervals_form(content["intervals"]),
        "ranges": dict.fromkeys(ROBOT, _is_range),
        "errors": {name: _are_numbers for name in content["errors"] or ("v_z",)},
        "provenance": {"rows": _are_numbers},
    }  # fmt: skip
    if CURVE_ERRORS in content:
        part = content[CURVE_ERRORS]
        widths = _intervals_form(part["widths"], LAGS)
        curves_form = (len(part["curves"]), len(BEFORE) + 1, *SHAPES["lag"])
        form[CURVE_ERRORS] = {"widths": widths, "curves": curves_form, "simulator": _is_size}
    return form


def _check(part: Any, form: Any, place: str) -> None:
    """Compare a part of a content with its form.

    Args:
        part: the part.
        form: a shape, for finite numbers; a list or dictionary of forms; a function that says whether the part may
            be so; or the part itself.
        place: of the part, by its names.

    Raises:
        WrongFormError: it is not so.
    """
    if isinstance(form, dict | list):
        if isinstance(form, list) and len(part) != len(form):
            raise WrongFormError(f"{place} has {len(part)} parts, not {len(form)}")
        for name, inner in form.items() if isinstance(form, dict) else enumerate(form):
            _check(part[name], inner, f"{place}.{name}".removeprefix("."))
    elif isinstance(form, tuple):
        numbers = isinstance(part, np.ndarray) and part.dtype == np.float64 and part.shape == form
        if not numbers or not np.isfinite(part).all():
            raise WrongFormError(f"{place} is not {' × '.join(map(str, form))} finite numbers")
    elif not (form(part) if callable(form) else part == form and type(part) is type(form)):
        raise WrongFormError(f"{place} is wrong")


def _input_count(stored: Mapping[str, Any], possible: tuple[int, ...]) -> int:
    """Return the number of inputs that a network must have: its own, if that is possible."""
    own = len(stored["state"]["shift"])
    return own if own in possible else possible[0]


def _network_form(stored: Mapping[str, Any], inputs: int, outputs: int) -> dict[str, Any]:
    state = stored["state"]
    depth = sum(name.startswith("weights.") for name in state) - 1
    members, width = len(state["bypass"]), state["weights.0"].shape[-1]
    shape = {"inputs": inputs, "outputs": outputs, "width": width, "depth": depth, "members": members}
    shape = {name: max(size, 1) for name, size in shape.items()}
    return {"shape": shape, "state": state_shapes(**shape)}


def _support_form(inputs: int) -> dict[str, Any]:
    terms = monomial_count(inputs)
    return {"shift": (inputs,), "scale": (inputs,), "factor": (terms, terms), "limit": _is_size}


def _intervals_form(part: Mapping[str, Any], needed: tuple[str, ...] = ()) -> dict[str, Any]:
    names = {*part["factor"], *needed}
    terms = 1 + FEATURES + FEATURES * (FEATURES + 1) // 2
    return {
        "shift": (FEATURES,), "scale": (FEATURES,), "speeds": (2,), "middle": (THIRDS,),
        "weights": dict.fromkeys(names, (terms,)), "bounds": dict.fromkeys(names, _is_ordered),
        "factor": dict.fromkeys(names, partial(_is_factor, 1 if needed else GROUPS)),
    }  # fmt: skip


def _is_size(part: Any) -> bool:
    return isinstance(part, float) and 0 <= part < math.inf


def _is_ordered(part: Any) -> bool:
    return -math.inf < part[0] <= part[1] < math.inf


def _is_range(part: Any) -> bool:
    return bool(part[0] >= 0 and _is_ordered(part))


def _is_factor(groups: int, part: Any) -> bool:
    """Whether a part is q of an interval in each group; infinite where there were no rows."""
    return part.shape == (groups,) and not np.isnan(part).any()


def _are_numbers(part: Any) -> bool:
    return bool(part) and all(isinstance(number, int | float) for number in part.values())
