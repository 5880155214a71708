"""Spheres that settle in a vessel: Stokes's law, which may lack the wall (Faxén) and inertia (Oseen).

    v = Δρ g d²/(18 μ) × (1 − ε_w (2.104 x − 2.089 x³ + 0.948 x⁵)) / (1 + ε_i 3/16 Re),   x = d/D, Re = ρ v d/μ

A table has one row for each fall: bead, diam_mm, trial, v_mm_s.

    softflagella calibrate TABLE --model docs/models/spheres.py --session trial --specimen bead --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import softflagella as sf

GRAVITY, FLUID, BEAD, VESSEL = 9.81, 1260.0, 2200.0, 0.094  # m/s², kg/m³ of glycerol and Teflon, m


def settle(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute settling speeds [mm/s], (n,)."""
    d = columns["diam_mm"] / 1000
    x = d / VESSEL
    stokes = (BEAD - FLUID) * GRAVITY * d**2 / (18 * p["viscosity"])
    stokes = stokes * (1 - p["wall"] * (2.104 * x - 2.089 * x**3 + 0.948 * x**5))
    slope = p["inertia"] * 3 / 16 * FLUID * d / p["viscosity"]  # of 1 + slope v
    return {"v_mm_s": 1000 * 2 * stokes / (1 + np.sqrt(1 + 4 * slope * stokes))}


MODEL = sf.Model(
    settle,
    outputs={"v_mm_s": sf.Output("speed", unit="mm/s")},
    numbers=[sf.Number("viscosity", 1.0, unit="Pa s", low=0.01, high=100)],
    effects=[
        sf.Effect("wall", "wall of the vessel", low=0, high=2, unit="Faxén's correction", theory=1.0),
        sf.Effect("inertia", "inertia of the fluid", low=0, high=20, unit="Oseen's correction", theory=1.0),
    ],
    settings=["diam_mm"],
)
