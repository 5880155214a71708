"""Counts of silver that neutrons have activated: one decay, which may lack the second isotope.

    n = n_0 + a r/(1 + ε_t a r),   r = 2^(−(t/T)^(1 − ε_s)) + ε 2^(−t/142.9 s)

Counts in 10 s are compared as 2 √(n + 3/8), whose deviation is 1 (Anscombe 1948). Silver has two isotopes: ¹¹⁰Ag
lives 24.6 s by half, ¹⁰⁸Ag 142.9 s (here given). A counter that misses (ε_t), and a stretched decay (ε_s), are the
decoys. Forty-nine readings without silver gave n_0 = 5.20 ± 0.27.

Four runs of one foil at Heidelberg, 2017, github.com/woskar/pap2-lab-training, v252 (MIT licence).

    softflagella calibrate TABLE --model docs/models/silver.py --trace run --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

import softflagella as sf

LONG = 142.9  # s, half the life of ¹⁰⁸Ag


def decay(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute transformed counts, (n,)."""
    t = columns["t_s"]
    rate = 2 ** -((t / p["half_life"]) ** (1 - p["stretched"])) + p["second"] * 2 ** (-t / LONG)
    counts = p["activity"] * rate / (1 + p["missed"] / 1e3 * p["activity"] * rate)
    return {"root": 2 * np.sqrt(np.maximum(p["background"] + counts, 0) + 3 / 8)}


MODEL = sf.Model(
    decay,
    outputs={"root": sf.Output("twice the root of the counts", kind="difference")},
    numbers=[
        sf.Number("activity", 150, unit="counts", low=1, high=1e4),
        sf.Number("half_life", 30, title="half-life", unit="s", low=5, high=200),
        sf.Number("background", 5.2, unit="counts", low=0.1, high=50, sigma=0.27),
    ],
    effects=[
        sf.Effect("second", "second isotope", low=0, high=3, typical=0.2),
        sf.Effect("missed", "counts missed", low=-2, high=10, unit="10 ms", typical=0.5),
        sf.Effect("stretched", "stretched decay", low=-0.9, high=0.9, typical=0.1),
    ],
    settings=[],
    time="t_s",
)


def read(path: str) -> pd.DataFrame:
    """Read counts, with the transformation that makes their noise equal."""
    table = sf.read_table(path)
    return table.assign(root=2 * np.sqrt(table["counts"] + 3 / 8)).drop(columns="counts")
