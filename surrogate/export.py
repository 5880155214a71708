"""Model files: everything that a query needs in one file. Reading a file runs no code from it.

A model is a torch file of tensors and plain values (loaded with weights_only). Its identity is the hash of its
weights; every plan stores the identity of the model that made it. One model comes with the package (`SHIPPED`), so
that planning works without training.
"""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import torch

from sim.io.errors import InputError
from sim.io.files import whole_file
from surrogate.lookup import Lookup
from surrogate.network import Ensemble
from surrogate.single import load_single
from surrogate.table import LookupTable

SHIPPED = Path(__file__).parent / "shipped" / "model.pt"
_FORMAT = 1
_NETWORKS = ("steady", "response")


def save(lookup: Lookup, path: str | Path) -> None:
    """Write a model file completely or not at all."""
    content: dict[str, Any] = {
        "format": _FORMAT,
        "tail_counts": lookup.tail_counts,
        "effects": lookup.effects,
        "domain": {name: list(ends) for name, ends in lookup.domain.items()},
        "errors": lookup.errors,
        "provenance": lookup.provenance,
    }
    for name in _NETWORKS:
        network: Ensemble = getattr(lookup, name)
        content[name] = {"state": network.state_dict(), "shape": _shape(network)}
    with whole_file(path) as part:
        torch.save(content, part)


def load(path: str | Path | None = None) -> Lookup:
    """Read a model file; by default the one that comes with the package.

    Raises:
        InputError: there is no such file, or it is not a model of this version.
    """
    path = SHIPPED if path is None else path
    if not Path(path).is_file():
        raise InputError(f"no model {path}; train one with python -m surrogate train DATA --out {path}")
    try:
        content = torch.load(path, weights_only=True, map_location="cpu")
        if content["format"] != _FORMAT:
            raise InputError(f"{path} has format {content['format']}, this version reads {_FORMAT}: retrain")
        networks = {name: _network(content[name]) for name in _NETWORKS}
    except (RuntimeError, KeyError, TypeError, EOFError, pickle.UnpicklingError) as broken:
        raise InputError(f"{path} is not a model file: {type(broken).__name__}; train a new one") from None
    return Lookup(
        **networks,
        tail_counts=content["tail_counts"],
        effects=content["effects"],
        domain={name: (low, high) for name, (low, high) in content["domain"].items()},
        errors=content["errors"],
        provenance=content["provenance"],
    )


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


def _shape(network: Ensemble) -> dict[str, int]:
    first, last = network.weights[0], network.weights[-1]
    return {
        "inputs": last.shape[1],
        "outputs": last.shape[2],
        "width": first.shape[2],
        "depth": len(network.weights) - 2,
        "members": first.shape[0],
    }


def _network(stored: dict[str, Any]) -> Ensemble:
    network = Ensemble(**stored["shape"], seed=0)
    network.load_state_dict(stored["state"])
    return network
