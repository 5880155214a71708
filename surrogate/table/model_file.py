"""Model files: everything that a query needs in one safetensors file (`surrogate.table.tensor_file`).

A file holds a hash over everything in it, domain and errors included; a file that was changed is refused. The
identity of a table is the start of this hash, and every plan stores the identity of the table that made it. One
model comes with the package (`SHIPPED`), so that planning works without training.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from sim.io.errors import InputError
from surrogate.input_ranges import ROBOT
from surrogate.interface import LookupTable
from surrogate.networks.ensemble import Ensemble
from surrogate.one_robot.robot_table import load_robot_table
from surrogate.table import tensor_file
from surrogate.table.intervals import Intervals
from surrogate.table.lookup import FORMAT, NeuralTable
from surrogate.table.response_table import PARTS, SHAPES, Basis, ResponseTable
from surrogate.table.support import Support
from surrogate.table.wrench_table import CLASSES, WrenchTable

SHIPPED = Path(__file__).parents[1] / "shipped" / "model.safetensors"


def load(path: str | Path | None = None) -> NeuralTable:
    """Read a model file; by default the one that comes with the package.

    Raises:
        InputError: there is no such file, or it is not a model of this version, or it was changed.
    """
    path = SHIPPED if path is None else path
    if not Path(path).is_file():
        raise InputError(f"no model {path}; train one with softflagella train DATA --out {path}")
    remedy = "train it again with softflagella train"
    content = tensor_file.read(path, FORMAT, remedy)
    try:
        return _lookup(content)
    except _IncompleteError as lack:
        raise InputError(f"{path} is no complete look-up table: {lack}; {remedy}") from None
    except (RuntimeError, KeyError, TypeError, ValueError, AttributeError, IndexError):
        raise InputError(f"{path} is no complete look-up table; {remedy}") from None


class _IncompleteError(Exception):
    """What a content lacks."""


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
    _check(content)
    intervals = content["intervals"]
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
    )


def _check(content: Mapping[str, Any]) -> None:
    """Refuse a content with which a query would not work."""
    wanted = ("wrench", "gap", "curves", "bases", "support", "intervals", "ranges", "errors", "provenance")
    for name in wanted:
        if name not in content:
            raise _IncompleteError(f"it has no {name!r}")
    wrench, support = content["wrench"], content["support"]
    if len(wrench) != len(CLASSES) or all(part is None for part in wrench):
        raise _IncompleteError("it has no networks")
    if [part is None for part in wrench] != [part is None for part in support]:
        raise _IncompleteError("its networks and their domains do not belong together")
    if len(content["curves"]) != len(PARTS) or set(content["bases"]) != set(SHAPES):
        raise _IncompleteError("it has no response to a flip")
    for name in ROBOT:
        low, high = content["ranges"].get(name, (1.0, 0.0))
        if not low <= high:
            raise _IncompleteError(f"it has no range of {name}")
    if "rows" not in content["provenance"] or not content["errors"]:
        raise _IncompleteError("it states no errors")
    numbers = [content[name] for name in ("wrench", "gap", "curves", "bases", "support")]
    widths = content["intervals"] or {}
    if not _all_finite([*numbers, *(widths[name] for name in widths if name != "factor")]):
        raise _IncompleteError("some of its numbers are not finite")
    if any(bool(torch.isnan(part).any()) for part in widths.get("factor", {}).values()):  # infinite: no rows
        raise _IncompleteError("some of its intervals are no numbers")


def _all_finite(part: Any) -> bool:
    if isinstance(part, Mapping | list):
        return all(_all_finite(own) for own in (part.values() if isinstance(part, Mapping) else part))
    return part is None or bool(torch.isfinite(torch.as_tensor(part)).all())


def _network(stored: Mapping[str, Any]) -> Ensemble:
    shape, state = stored["shape"], stored["state"]
    sizes = state["bypass"].shape + state["weights.0"].shape[2:]
    if sizes != tuple(shape[name] for name in ("members", "inputs", "outputs", "width")) or shape["depth"] > len(
        state
    ):
        raise _IncompleteError("a network has another shape than is said")
    network = Ensemble(**shape, seed=0)
    network.load_state_dict(state)
    for parameter in network.parameters():
        parameter.requires_grad_(False)
    return network
