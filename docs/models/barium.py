"""Counts of barium-137m: one decay. Nothing is missing here but, perhaps, a background.

    n = n_0 + a r/(1 + ε_t a r),   r = 2^(−(t/T)^(1 − ε_s))

Counts are compared as 2 √(n + 3/8), whose deviation is 1. ¹³⁷ᵐBa lives 153.1 s by half. A background (n_0), a
counter that misses (ε_t), and a stretched decay (ε_s) are what one may think of; the lab notes name none.

Two runs of C. Lant, github.com/caspar/PhysicsLab, 16_HalfLifeofBA137m (MIT licence).

    softflagella calibrate TABLE --model docs/models/barium.py --trace run --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

import softflagella as sf


def decay(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute transformed counts, (n,)."""
    rate = p["activity"] * 2 ** -((columns["t_s"] / p["half_life"]) ** (1 - p["stretched"]))
    counts = rate / (1 + p["missed"] / 1e3 * rate)
    return {"root": 2 * np.sqrt(np.maximum(p["background"] + counts, 0) + 3 / 8)}


MODEL = sf.Model(
    decay,
    outputs={"root": sf.Output("twice the root of the counts", kind="difference", sigma=1.0)},
    numbers=[
        sf.Number("half_life", 100, title="half-life", unit="s", low=10, high=1000),
        sf.Number("activity", 800, unit="counts", low=10, high=1e5, per="trace"),
    ],
    effects=[
        sf.Effect("background", "background", low=-100, high=300, unit="counts", typical=20),
        sf.Effect("missed", "counts missed", low=-0.3, high=3, unit="1/1000", typical=0.1),
        sf.Effect("stretched", "stretched decay", low=-0.9, high=0.9, typical=0.1),
    ],
    settings=[],
    time="t_s",
)


def read(path: str) -> pd.DataFrame:
    """Read counts, with the transformation that makes their noise equal."""
    table = sf.read_table(path)
    return table.assign(root=2 * np.sqrt(table["counts"] + 3 / 8)).drop(columns="counts")
