"""Balls dropped from a tower: free fall, which may lack the drag of the air.

    t = √(2 h/g);   with quadratic drag   t = τ arcosh(e^(h/ℓ)),   ℓ = 2 m/(C_D ρ π r²),   τ = √(ℓ/g)

or with a drag that is linear in the speed, at a rate k (from Lambert's W), or with a watch that is started early.

The times were made by a simulation with a noise of 0.1 s, one fall for each setting, as an example of SEPIA (Los
Alamos, BSD licence, see data/LICENCES.md): their truth is a drag in the square of the speed.

    softflagella calibrate docs/models/data/tower.csv --model docs/models/tower.py --session ball_kg_m3 --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.special import lambertw

import softflagella as sf

SMALL = 1e-4  # below which a drag is none


def times(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute times of fall [s], (n,)."""
    h, g = columns["height_m"], p["gravity"]
    mass_over_area = 4 / 3 * columns["ball_radius_m"] * columns["ball_kg_m3"]
    x = np.maximum(p["quadratic_drag"] * columns["air_kg_m3"] / (2 * mass_over_area) * h, SMALL)
    slower = np.arccosh(np.exp(x)) / np.sqrt(2 * x)  # than in free fall
    k = np.maximum(p["linear_drag"], SMALL)
    a = 1 + k**2 * h / g
    linear = (a + lambertw(-np.exp(-a)).real) / k  # h = g/k (t − (1 − e^(−k t))/k)
    return {"time_s": slower * linear + p["late"]}


MODEL = sf.Model(
    times,
    outputs={"time_s": sf.Output("time of fall", unit="s", kind="difference", sigma=0.1)},
    numbers=[sf.Number("gravity", 9.81, unit="m/s²", low=9, high=10.5, sigma="0.1 %")],
    effects=[
        sf.Effect("quadratic_drag", "drag of a sphere", low=0, high=3, unit="C_D", typical=0.5),
        sf.Effect("linear_drag", "linear drag", low=0, high=2, unit="1/s", typical=0.1),
        sf.Effect("late", "watch stopped late", low=-1, high=1, unit="s", typical=0.2),
    ],
    settings=["ball_radius_m", "ball_kg_m3", "height_m"],
)
