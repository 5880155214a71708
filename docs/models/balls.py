"""Balls dropped from a bridge: a model whose missing effect may differ from ball to ball.

A body that falls from rest has the speed v at the depth h below its release:

    free fall        v² = 2 g h,
    quadratic drag   v² = (g/c) (1 − exp(−2 c h)),   c = C_D ρ π r²/(2 m),
    linear drag      v = (g/k) (1 + W(−exp(−1 − k² h/g))),

with Lambert's W. Of two kinds of drag the factors are multiplied.

    softflagella calibrate TABLE --model docs/models/balls.py --session drop --specimen ball --out DIR
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import lambertw

import softflagella as sf

AIR = 1.19  # kg/m³
SMALL = 1e-3  # k √(2 h/g) below which a series is more exact than W; least depth [m] and share of gravity


def speed(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute speeds [m/s], (n,)."""
    mass, radius = columns["mass_kg"], columns["radius_m"]
    gravity = p["gravity"] * np.maximum(1 - p["buoyancy"] * AIR * 4 / 3 * math.pi * radius**3 / mass, SMALL)
    depth = np.maximum(columns["depth_m"] + p["release"], SMALL)
    exponent = np.maximum(p["quadratic_drag"] * AIR * math.pi * radius**2 / mass * depth, 1e-12)
    s = p["linear_drag"] * np.sqrt(2 * depth / gravity)
    large = np.maximum(s, SMALL)
    exact = (1 + lambertw(-np.exp(-1 - large**2 / 2)).real) / large
    slower = np.where(s > SMALL, exact, 1 - s / 3 + s**2 / 36) * np.sqrt(-np.expm1(-exponent) / exponent)
    return {"speed_m_s": np.sqrt(2 * gravity * depth) * slower}


MODEL = sf.Model(
    speed,
    outputs={"speed_m_s": sf.Output("speed", unit="m/s")},
    numbers=[sf.Number("gravity", 9.81, unit="m/s²", low=1, high=100, sigma="0.1 %")],
    effects=[
        sf.Effect("quadratic_drag", "quadratic drag", low=0, high=5, unit="C_D", typical=0.2),
        sf.Effect("linear_drag", "linear drag", low=0, high=5, unit="1/s", typical=0.2),
        sf.Effect("release", "release above its mark", low=-1, high=1, unit="m", typical=0.1),
        sf.Effect("buoyancy", "buoyancy of the air", low=0, high=5, unit="displaced air", theory=1.0),
    ],
    settings=["mark_m", "radius_m", "mass_kg"],
)


def read(path: str) -> pd.DataFrame:
    """Read falls: the speeds of a ball near one mark are repeats."""
    return at_marks(sf.read_table(path))


def at_marks(table: pd.DataFrame) -> pd.DataFrame:
    """Add to each depth of a ball the mark, the mean of those of its place over the drops."""
    place = table.groupby(["ball", "drop"])["depth_m"].rank()
    return table.assign(mark_m=table["depth_m"].groupby([table["ball"], place]).transform("mean"))
