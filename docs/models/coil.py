"""Alternating current through a coil: an inductance, which may lack resistance, or whose ammeter may be off.

    I = V/√(R² + (2π f L (f/f_0)^−ε)²) − z,   f_0 = 500 Hz

R is the resistance, ε a loss of inductance with frequency (eddy currents), z the zero of the coarse ammeter, which
read the currents above 0.06 A.

A pair of Helmholtz coils with 124 turns each, by students at Heidelberg (MIT licence, see data/LICENCES.md). With
direct current they measured 1.20 Ω. They state errors of 0.01 to 0.02 A for ten readings, here called coarse, and
of 0.1 mA or less for the others.

    softflagella calibrate docs/models/data/coil.csv --model docs/models/coil.py --out DIR
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

import softflagella as sf


def current(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute the currents that are read [A], (n,)."""
    f = columns["frequency_Hz"]
    reactance = 2 * math.pi * f * p["inductance"] * (f / 500) ** -p["eddies"]
    flows = columns["voltage_V"] / np.hypot(p["resistance"], reactance)
    return {"current_A": np.maximum(flows - p["zero"] * (columns["meter"] == "coarse"), 1e-6)}


MODEL = sf.Model(
    current,
    outputs={"current_A": sf.Output("current", unit="A")},
    numbers=[sf.Number("inductance", 0.03, unit="H", low=1e-4, high=10)],
    effects=[
        sf.Effect("resistance", "resistance", low=0, high=20, unit="Ω", theory=1.2),
        sf.Effect("zero", "zero of the coarse ammeter", low=-0.05, high=0.05, unit="A", typical=0.01),
        sf.Effect("eddies", "eddy currents", low=-0.5, high=0.5, typical=0.05),
    ],
    settings=["frequency_Hz"],
)
