"""Model files: everything that a query needs in one safetensors file (`surrogate.table.tensor_file`).

A file holds a hash over everything in it, domain and errors included; a file that was changed is refused. The
identity of a table is the start of this hash, and every plan stores the identity of the table that made it. One
model comes with the package (`SHIPPED`), so that planning works without training.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from shlex import quote
from typing import Any

from sim.io.errors import InputError
from sim.io.keywords import checks_keywords
from surrogate.interface import LookupTable
from surrogate.networks.ensemble import Ensemble
from surrogate.one_robot.robot_table import load_robot_table
from surrogate.table import tensor_file
from surrogate.table.curve_errors import CURVE_ERRORS, CurveErrors
from surrogate.table.intervals import Intervals
from surrogate.table.lookup import FORMAT, NeuralTable
from surrogate.table.model_form import IncompleteError, check_form
from surrogate.table.response_table import Basis, ResponseTable
from surrogate.table.support import Support
from surrogate.table.wrench_table import WrenchTable

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
