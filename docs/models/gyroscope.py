"""A gyroscope's precession: its period at the speed read at the start, which may lack that the rotor slows down.

    T = 4π² I f̄/(m g l (1 + ε_r 10 g cm/(m l))) + ε_t,   f̄ = f (1 + exp(−δ T))/2

f is read at the start, f̄ the mean of start and end. A run of 14 minutes (1070 to 569 rpm) gave δ = 7.5e-4/s; the
ball has I = 2/5 m r² = 4.30 g m². A torque of the rod (ε_r) and a watch stopped late (ε_t) are the decoys.

Weights at two places on the rod, four speeds each, by students at Heidelberg, github.com/9Strike/ap_praktikum,
PAP21-213s.py (MIT licence).

    softflagella calibrate TABLE --model docs/models/gyroscope.py --session weights --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import softflagella as sf

GRAVITY = 9.81


def precess(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute periods of precession [s], (n,)."""
    lever = columns["mass_g"] * columns["arm_cm"] + 10 * p["rod"]  # g cm
    full = 4 * np.pi**2 * p["inertia"] * 1e-3 * columns["start_rpm"] / 60 / (lever * 1e-5 * GRAVITY)
    period = full
    for _ in range(20):
        period = full * (1 + np.exp(-p["slowing"] / 1e3 * period)) / 2
    return {"period_s": np.maximum(period + p["late"], 1e-3)}


MODEL = sf.Model(
    precess,
    outputs={"period_s": sf.Output("period", unit="s")},
    numbers=[sf.Number("inertia", 4.0, title="moment of inertia", unit="g m²", low=0.1, high=100)],
    effects=[
        sf.Effect("slowing", "slowing of the rotor", low=-3, high=10, unit="1/1000 s", theory=0.75),
        sf.Effect("rod", "torque of the rod", low=-3, high=10, unit="10 g cm", typical=1),
        sf.Effect("late", "watch stopped late", low=-5, high=5, unit="s", typical=0.5),
    ],
)
