"""Train the look-up table on a data set.

A fixed hash of a row's number puts it into one of three sets: training (80 %), validation (10 %, for early
stopping) and held-out (10 %, never used in training; the errors on these rows are printed and stored). The loss is
the mean square of the standardised targets. The optimiser is Adam with a cosine step size. Every member keeps the
weights of its best validation epoch. Rows that failed or did not converge, and the few robots that move backwards,
are left out. Rows whose tails touch are used.
"""

from __future__ import annotations

import copy
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd
import torch
from torch import Tensor
from tqdm import tqdm

from dataset.schema import INPUTS
from dataset.store import read, read_manifest, usable
from sim.arrays import Floats, Integers
from sim.io.errors import InputError
from sim.io.provenance import provenance
from surrogate.evaluate import held_out_errors
from surrogate.lookup import Lookup
from surrogate.network import Ensemble, features, response_targets, steady_targets

_FEWEST_ROWS = 64


@dataclass(frozen=True)
class Settings:
    """How to train; the seeds make it repeatable."""

    width: int = 128
    depth: int = 3
    members: int = 4
    epochs: int = 1200
    patience: int = 250  # epochs without a better validation loss
    batch: int = 512
    learning_rate: float = 4e-3
    seed: int = 1


def split(rows: Integers) -> Integers:
    """0 training, 1 validation, 2 held out: a fixed pseudo-random split by row number."""
    mixed = (rows.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(40)
    tenth = mixed % np.uint64(10)
    return np.where(tenth == 8, 1, np.where(tenth == 9, 2, 0))


def train(folder: str, settings: Settings | None = None, *, title: str = "train") -> Lookup:
    """A look-up table from a finished data set.

    Args:
        folder: data set written by `python -m dataset build`.
        settings: network and optimiser.
        title: of the progress bars; empty for none.

    Raises:
        InputError: there is no data set, or it has too few usable rows.

    Example:
        >>> from softflagella import train
        >>> table = train("data/sweep")  # doctest: +SKIP
    """
    chosen = settings or Settings()
    manifest = read_manifest(folder)
    rows = usable(read(folder)).drop(columns="reason")  # the one column of words
    positive = rows[["v_x", "v_z", "omega_yr_bar", "tail_gap"]].to_numpy() > 0
    rows = rows[positive.all(1) & (rows["omega_h_bar"].to_numpy() < 0)]
    if len(rows) < _FEWEST_ROWS:
        raise InputError(f"{folder} has {len(rows)} usable rows; training needs {_FEWEST_ROWS}")
    columns = {str(name): rows[name].to_numpy(dtype=float) for name in rows}
    part = split(rows["row"].to_numpy())
    tail_counts = sorted({int(n) for n in columns["N"]})
    effects = list(manifest["effects"])
    steady = _fit(
        features(columns, tail_counts, effects, dwell=False),
        steady_targets(columns),
        part,
        chosen,
        f"{title} steady" if title else "",
    )
    response = _fit(
        features(columns, tail_counts, effects, dwell=True),
        response_targets(columns),
        part,
        chosen,
        f"{title} response" if title else "",
    )
    lookup = Lookup(
        steady=steady,
        response=response,
        tail_counts=tail_counts,
        effects=effects,
        domain=_domain(rows, manifest),
        errors={},
        provenance={
            **provenance(asdict(chosen)),
            "data_hash": manifest["config_hash"],
            "data_code_version": manifest["code_version"],
            "rows": {n: int((part == i).sum()) for i, n in enumerate(("train", "validate", "held_out"))},
        },
    )
    held = rows[part == 2]
    return lookup.with_errors(held_out_errors(lookup, held))


def _domain(rows: pd.DataFrame, manifest: dict[str, Any]) -> dict[str, tuple[float, float]]:
    swept = manifest["config"]["inputs"]
    names = [c.name for c in INPUTS] + list(manifest["effects"])
    table = {n: rows[n].to_numpy(dtype=float) for n in names}
    fixed = {n: (float(v.min()), float(v.max())) for n, v in table.items()}
    return {n: tuple(swept[n]["range"]) if n in swept else fixed[n] for n in names}


def _fit(inputs: Tensor, targets: Floats, part: Integers, settings: Settings, title: str) -> Ensemble:
    outputs = torch.tensor(targets, dtype=torch.float32)
    learn, check = torch.from_numpy(part == 0), torch.from_numpy(part == 1)
    network = Ensemble(
        inputs.shape[1],
        outputs.shape[1],
        width=settings.width,
        depth=settings.depth,
        members=settings.members,
        seed=settings.seed,
    )
    network.standardise(inputs[learn], outputs[learn])
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network.to(device)
    inputs = inputs.to(device)
    wanted = ((outputs - network.output_mean.cpu()) / network.output_scale.cpu()).to(device)
    x, y, x_check, y_check = inputs[learn], wanted[learn], inputs[check], wanted[check]
    optimiser = torch.optim.AdamW(network.parameters(), lr=settings.learning_rate, weight_decay=1e-5)
    batches = -(-len(x) // settings.batch)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, settings.epochs * batches)
    generator = torch.Generator().manual_seed(settings.seed)
    best = torch.full((settings.members,), torch.inf, device=device)
    kept = copy.deepcopy(network.state_dict())
    stale = 0
    with tqdm(total=settings.epochs, desc=title, unit="epoch", delay=1.0, disable=not title) as bar:
        for _ in range(settings.epochs):
            for rows in torch.randperm(len(x), generator=generator).to(device).chunk(batches):
                optimiser.zero_grad(set_to_none=True)
                (network(x[rows]) - y[rows]).square().mean((1, 2)).sum().backward()
                optimiser.step()
                schedule.step()
            with torch.no_grad():
                loss = (network(x_check) - y_check).square().mean((1, 2))
            better = loss < best
            stale = 0 if bool(better.any()) else stale + 1
            best = torch.minimum(loss, best)
            _keep(kept, network, better)
            bar.set_postfix_str(f"validation rms {best.mean().sqrt():.4f}", refresh=False)
            bar.update()
            if stale >= settings.patience:
                break
    network.load_state_dict(kept)
    return network.cpu()


def _keep(kept: dict[str, Tensor], network: Ensemble, members: Tensor) -> None:
    """Copy the weights of the chosen members."""
    for name, value in network.state_dict().items():
        if name.startswith(("weights", "biases")):
            kept[name][members] = value[members]
