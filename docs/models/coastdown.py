"""A light electric car that coasts: rolling friction alone, which may lack the drag of the air.

    dv/dt = −g (C − i w) − ρ A v²/(2 m) − β v

A = C_D A_f is the area of drag, 0.0642 m² by the authors (C_D = 0.150 of a flow simulation, A_f = 0.429 m²), m =
76 kg. A road that falls by i in one direction (w = ±1), and a friction in proportion to the speed (β), are the
decoys. Such tyres are sold with C = 0.001 to 0.003; the authors expect up to 0.01.

Two runs in each direction, read once a second until 4 km/h, by A. Baiquni,
github.com/Abaiquni/Finding-Rolling-Resistance-for-Electric-Car (no licence: the table is not copied).

    softflagella calibrate TABLE --model docs/models/coastdown.py --trace run --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numba as nb
import numpy as np

import softflagella as sf
from common.arrays import Floats

MASS, AIR, GRAVITY = 76.0, 1.2, 9.8


@nb.njit
def coasting(t: Floats, v: float, law: Any) -> Floats:
    """Integrate speeds (n,) by Heun's method, two steps between readings."""
    constant, linear, square = law
    speeds = np.empty_like(t)
    speeds[0] = v
    for i in range(1, len(t)):
        h = (t[i] - t[i - 1]) / 2
        for _ in range(2):
            first = -constant - linear * v - square * v * abs(v)
            u = v + h * first
            v += h / 2 * (first - constant - linear * u - square * u * abs(u))
        speeds[i] = v
    return speeds


def coast(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute speeds [m/s], (n,)."""
    constant = GRAVITY * (p["rolling"] - p["slope"] * float(columns["way"][0])) / 100
    law = tuple(map(float, (constant, p["linear"], AIR * p["area"] / (2 * MASS))))
    return {"speed_m_s": coasting(columns["t_s"], float(p["start"]), law)}


MODEL = sf.Model(
    coast,
    outputs={"speed_m_s": sf.Output("speed", unit="m/s", kind="difference")},
    numbers=[
        sf.Number("rolling", 0.5, title="rolling friction", unit="%", low=0.01, high=5),
        sf.Number("start", 8, title="speed at the start", unit="m/s", low=4, high=12, per="trace"),
    ],
    effects=[
        sf.Effect("area", "drag of the air", low=0, high=1, unit="m²", theory=0.0642),
        sf.Effect("slope", "slope of the road", low=-1, high=1, unit="%", typical=0.05),
        sf.Effect("linear", "friction in proportion to the speed", low=0, high=0.1, unit="1/s", typical=0.005),
    ],
    settings=["way"],
    time="t_s",
)
