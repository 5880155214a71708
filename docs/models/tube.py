r"""Balls that sink in a tube of oil: Stokes's law, which may lack the wall of the tube and the inertia of the oil.

    v = v_S (1 − ε_w (2.104 x − 2.089 x³ + 0.948 x⁵)) / (1 + ε_i 3/16 Re),   v_S = Δρ g d²/(18 μ)

with x = d/D and Re = ρ v d/μ. The wall is Faxén's (1922), the inertia Oseen's (1910): by theory both sizes are 1.
A watch that is stopped late is a third candidate.

Two tables of students at Heidelberg, of 2017 and 2019 (MIT licence, data/LICENCES.md): nine balls of 1.5 to 9 mm,
each five times down a tube of 75 mm. In 2019 a capillary viscometer gave 0.1946 Pa s.

    softflagella calibrate docs/models/data/tube-2019.csv --model docs/models/tube.py --session repeat --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

import softflagella as sf


def sink(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute speeds of fall [m/s], (n,)."""
    d, x = columns["diameter_mm"] / 1e3, columns["diameter_mm"] / columns["tube_mm"]
    fluid = columns["rho_fluid_kg_m3"]
    stokes = (columns["rho_ball_kg_m3"] - fluid) * 9.81 * d**2 / (18 * p["viscosity"])
    stokes = stokes * (1 - p["wall"] * (2.104 * x - 2.089 * x**3 + 0.948 * x**5))
    slope = p["inertia"] * 3 / 16 * fluid * d / p["viscosity"]  # v (1 + slope v) = Stokes's speed
    v = 2 * stokes / (1 + np.sqrt(1 + 4 * slope * stokes))
    return {"v": v / (1 + p["late"] * v / columns["distance_mm"] * 1e3)}


MODEL = sf.Model(
    sink,
    outputs={"v": sf.Output("speed", unit="m/s")},
    numbers=[sf.Number("viscosity", 1.0, unit="Pa s", low=0.01, high=100)],
    effects=[
        sf.Effect("wall", "wall of the tube", low=0, high=3, unit="Faxén's correction", theory=1.0),
        sf.Effect("inertia", "inertia of the oil", low=0, high=20, unit="Oseen's correction", theory=1.0),
        sf.Effect("late", "watch stopped late", low=-0.5, high=2, unit="s", typical=0.2),
    ],
    settings=["diameter_mm", "rho_ball_kg_m3"],
)


def read(path: str) -> pd.DataFrame:
    """Read falls: the speed is distance over time."""
    table = sf.read_table(path)
    return table.assign(v=table["distance_mm"] / 1e3 / table["time_s"]).drop(columns="time_s")
