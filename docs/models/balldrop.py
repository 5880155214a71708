"""Balls that are dropped from a bridge: free fall, which may lack the drag of the air.

    h = h_0 − (1 + ε) s(t − t_0),   s = ln(e^(−b t/2) (cosh k t + b/2k sinh k t))/c,   k = √(b²/4 + c g′)

is the fall from rest of d²s/dt² = g′ − b ds/dt − c (ds/dt)² with c = C_D ρ A/2m and b = C_1 ρ A U/2m, U = 10 m/s,
begun at the time t_0 when the ball is let go. A sphere has C_D = 0.4 to 0.5 at Reynolds numbers of 10³ to 2·10⁵. A
drag that is linear in the speed (C_1) and a wrong scale of the film (ε) are what else one may think of. The air
lifts the ball and is accelerated with it: g′ = g (1 − α ρ/ρ_b)/(1 + α ρ/2ρ_b), by theory α = 1, with less drag.

Ten balls, twice each, filmed at 15 Hz, by B. de Silva et al. (2020; MIT licence, see data/LICENCES.md).

    softflagella calibrate docs/models/data/balldrop.csv --model docs/models/balldrop.py --trace trace
        --specimen ball --held-out second --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

import softflagella as sf

AIR = 1.2  # kg/m³
SPEED = 10.0  # m/s
SMALL = 1e-6  # 1/m, below which a drag is none


def fall(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute heights [m], (n,)."""
    mass, radius = columns["mass_g"] / 1e3, columns["circumference_cm"] / 200 / np.pi
    air = p["carried"] * AIR * 4 / 3 * np.pi * radius**3 / mass
    gravity, heavier = p["gravity"] * (1 - air) / (1 + air / 2), 1 + air / 2
    share = AIR * np.pi * radius**2 / (2 * mass) / heavier
    b, c = share * p["linear_drag"] * SPEED, np.maximum(share * p["quadratic_drag"], SMALL)
    t = np.maximum(columns["t_s"] - p["release"], 0)
    k = np.sqrt(b**2 / 4 + c * gravity)
    s = (np.log(np.cosh(k * t) + b / (2 * k) * np.sinh(k * t)) - b * t / 2) / c
    return {"h_m": p["height"] - (1 + p["scale"]) * s}


MODEL = sf.Model(
    fall,
    outputs={"h_m": sf.Output("height", unit="m", kind="difference")},
    numbers=[
        sf.Number("gravity", 9.8, unit="m/s²", low=9, high=10.5, sigma="0.1 %"),
        sf.Number("height", 47, title="height at the start", unit="m", low=30, high=60, per="trace"),
        sf.Number("release", 0.1, title="time of release", unit="s", low=-0.5, high=1, per="trace"),
    ],
    effects=[
        sf.Effect("quadratic_drag", "drag of a sphere", low=0, high=3, unit="C_D", typical=0.45),
        sf.Effect("linear_drag", "linear drag", low=0, high=3, unit="C_1", typical=0.5),
        sf.Effect("scale", "scale of the film", low=-0.5, high=0.5, typical=0.02),
        sf.Effect("carried", "lift and inertia of the air", low=-1, high=10, theory=1.0),
    ],
    settings=["mass_g", "circumference_cm"],
    time="t_s",
)


def read(path: str) -> pd.DataFrame:
    """Read the falls: which ball, and whether it was its second fall."""
    table = sf.read_table(path)
    return table.assign(
        ball=table["trace"].str.rsplit("_", n=1).str[0], second=table["trace"].str.endswith("_2").astype(int)
    )
