"""A body on a spiral spring, off its axis: a constant period, which may lack the theorem of Steiner.

    T = 2π √(J (1 + ε_l x + ε_q x⁴)/D + ε m a²/D),   x = a/36.8 mm; by theory ε = 1

a is the distance of the body's axis, m = 0.679 kg; D = 0.0229 N m/rad is known from weights on a lever (0.0230)
and from a disk (0.0227). A moment of inertia that grows in proportion to a (ε_l), or in its fourth power (ε_q),
are the decoys.

Six distances, each timed three times over twenty periods, by students at Heidelberg,
github.com/9Strike/ap_praktikum, PAP1-12.py (MIT licence).

    softflagella calibrate TABLE --model docs/models/steiner.py --session round --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

import softflagella as sf

MASS, STIFFNESS = 0.679, 0.0229  # kg, N m/rad


def period(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute periods [s], (n,)."""
    a = columns["offset_mm"] / 1e3
    own = p["inertia"] * 1e-3 * (1 + p["lever"] * a / 0.0368 + p["fourth"] * (a / 0.0368) ** 4)
    return {"T": 2 * np.pi * np.sqrt((own + p["steiner"] * MASS * a**2) / STIFFNESS)}


MODEL = sf.Model(
    period,
    outputs={"T": sf.Output("period", unit="s")},
    numbers=[sf.Number("inertia", 3.0, title="moment of inertia", unit="g m²", low=0.1, high=100)],
    effects=[
        sf.Effect("steiner", "theorem of Steiner", low=-0.9, high=5, unit="m a²", theory=1.0),
        sf.Effect("lever", "in proportion to the distance", low=-0.5, high=2, typical=0.1),
        sf.Effect("fourth", "fourth power of the distance", low=-0.5, high=2, typical=0.1),
    ],
)


def read(path: str) -> pd.DataFrame:
    """Read the periods: a twentieth of what was timed."""
    table = sf.read_table(path)
    return table.assign(T=table["twenty_periods_s"] / 20).drop(columns="twenty_periods_s")
