"""Model files: everything that a query needs in one file. Reading a file runs no code from it.

A model is a torch file of tensors and plain values (loaded with weights_only). It holds a hash over everything
in it, domain and errors included; a file that was changed is refused. The identity of a table is the start of
this hash, and every plan stores the identity of the table that made it. One model comes with the package
(`SHIPPED`), so that planning works without training.
"""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from sim.io.errors import InputError
from sim.io.files import whole_file
from surrogate.curves import Basis, CurveTable
from surrogate.intervals import Intervals
from surrogate.lookup import Lookup, digest
from surrogate.network import Ensemble
from surrogate.single import load_single
from surrogate.support import Support
from surrogate.table import LookupTable
from surrogate.tails import TailTable

SHIPPED = Path(__file__).parent / "shipped" / "model.pt"
_FORMAT = 4


def content_of(lookup: Lookup) -> dict[str, Any]:
    """A table as nested dictionaries and lists of tensors and plain values."""
    intervals = lookup.intervals
    return {
        "wrench": [None if network is None else _stored(network) for network in lookup.tails.wrench],
        "gap": _stored(lookup.tails.gap),
        "curves": [_stored(network) for network in lookup.curves.networks],
        "bases": {name: {"mean": b.mean, "vectors": b.vectors} for name, b in lookup.curves.bases.items()},
        "support": [None if support is None else vars(support) for support in lookup.support],
        "intervals": None if intervals is None else {k: _plain(v) for k, v in vars(intervals).items()},
        "ranges": {name: list(ends) for name, ends in lookup.ranges.items()},
        "errors": lookup.errors,
        "provenance": lookup.provenance,
    }


def save(lookup: Lookup, path: str | Path) -> None:
    """Write a model file completely or not at all."""
    content = content_of(lookup)
    with whole_file(path) as part:
        torch.save({"format": _FORMAT, "hash": digest(content), "content": content}, part)


def load(path: str | Path | None = None) -> Lookup:
    """Read a model file; by default the one that comes with the package.

    Raises:
        InputError: there is no such file, or it is not a model of this version, or it was changed.
    """
    path = SHIPPED if path is None else path
    if not Path(path).is_file():
        raise InputError(f"no model {path}; train one with python -m surrogate train DATA --out {path}")
    try:
        stored = torch.load(path, weights_only=True, map_location="cpu")
        if stored["format"] != _FORMAT:
            raise InputError(f"{path} has format {stored['format']}, this version reads {_FORMAT}: retrain")
        if stored["hash"] != digest(stored["content"]):
            raise InputError(f"{path} was changed after it was written; train it again")
        return _lookup(stored["content"])
    except InputError:
        raise
    except (RuntimeError, KeyError, TypeError, ValueError, AttributeError, EOFError, pickle.UnpicklingError,
            UnicodeDecodeError, IndexError, OSError) as broken:  # fmt: skip
        raise InputError(f"{path} is not a model file: {type(broken).__name__}; train a new one") from None


def load_table(path: str | Path | None = None) -> LookupTable:
    """A model file, or the table of one robot (.json); by default the one that comes with the package.

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
    return load_single(path) if path is not None and Path(path).suffix == ".json" else load(path)


def _lookup(content: dict[str, Any]) -> Lookup:
    intervals = content["intervals"]
    table = Lookup(
        tails=TailTable(
            tuple(None if part is None else _network(part) for part in content["wrench"]), _network(content["gap"])
        ),
        curves=CurveTable(
            tuple(_network(part) for part in content["curves"]),
            {name: Basis(**part) for name, part in content["bases"].items()},
        ),
        support=tuple(None if part is None else Support(**part) for part in content["support"]),
        intervals=None if intervals is None else Intervals(**intervals),
        ranges={name: (low, high) for name, (low, high) in content["ranges"].items()},
        errors=content["errors"],
        provenance=content["provenance"],
    )
    for network in (*table.tails.wrench, table.tails.gap, *table.curves.networks):
        if network is not None and not all(
            bool(torch.isfinite(part).all()) for part in network.state_dict().values()
        ):
            raise ValueError("weights are not finite")
    return table


def _stored(network: Ensemble) -> dict[str, Any]:
    state = {name: part.detach() for name, part in network.state_dict().items()}
    return {"shape": network.shape, "state": state}


def _network(stored: dict[str, Any]) -> Ensemble:
    network = Ensemble(**stored["shape"], seed=0)
    network.load_state_dict(stored["state"])
    for parameter in network.parameters():
        parameter.requires_grad_(False)
    return network


def _plain(value: Any) -> Any:
    """Mappings as dictionaries, and pairs as lists."""
    if isinstance(value, Tensor):
        return value
    return {name: list(part) if isinstance(part, tuple) else part for name, part in dict(value).items()}
