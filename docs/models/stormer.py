"""Stormer's viscometer: the time of a hundred turns under a weight, which may lack the friction of its bearings.

    t = b V^(1 − ε_p)/(W − F) + t_0

V is the viscosity, known, W the weight, F what friction takes of it. A watch that starts late (t_0) and a law
other than Newton's (ε_p) are the decoys. The maker's formula has F; Venables and Ripley (2002) fit b = 29.40 ±
0.92 and F = 2.22 ± 0.67 g by least squares of t.

Nine oils under three weights, E. J. Williams (1959), as in MASS::stormer and
github.com/vincentarelbundock/Rdatasets (GPL).

    softflagella calibrate TABLE --model docs/models/stormer.py --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import softflagella as sf


def turns(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute times of the turns [s], (n,)."""
    viscosity = (columns["viscosity_P"] / 100) ** (1 - p["power"])
    time = 100 * p["constant"] * viscosity / (columns["weight_g"] - p["friction"]) + p["late"]
    return {"time_s": np.maximum(time, 1e-3)}


MODEL = sf.Model(
    turns,
    outputs={"time_s": sf.Output("time", unit="s")},
    numbers=[sf.Number("constant", 30, unit="g s/P", low=1, high=1e3)],
    effects=[
        sf.Effect("friction", "friction of the bearings", low=-10, high=15, unit="g", typical=2),
        sf.Effect("late", "watch started late", low=-10, high=10, unit="s", typical=1),
        sf.Effect("power", "power of the viscosity", low=-0.5, high=0.5, typical=0.05),
    ],
)
