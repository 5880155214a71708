"""Energies of characteristic X-rays against the atomic number, which may lack the screening of the nucleus.

    E = s R (Z − σ)² (1 + ε_g E_0/20 keV) + ε_z,   E_0 = s R Z²;   s = 3/4 for K_α, 8/9 for K_β

Moseley (1913): σ = 1 for K_α; R = 13.606 eV. A detector whose gain varies with the energy (ε_g) or whose zero is
off (ε_z) are the decoys.

Titanium to silver, each once by two groups of students at Heidelberg, 2017 (github.com/woskar/pap2-lab-training,
v256) and 2019 (github.com/9Strike/ap_praktikum, PAP22-256j.py), both MIT licence.

    softflagella calibrate TABLE --model docs/models/moseley.py --session group --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import softflagella as sf


def energy(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute energies of lines [keV], (n,)."""
    unit = np.where(columns["peak"] == "alpha", 3 / 4, 8 / 9) * p["rydberg"] / 1e3
    full, screened = unit * columns["Z"] ** 2, unit * (columns["Z"] - p["screening"]) ** 2
    return {"energy_keV": np.maximum(screened * (1 + p["gain"] * full / 20) + p["zero"], 1e-3)}


MODEL = sf.Model(
    energy,
    outputs={"energy_keV": sf.Output("energy", unit="keV")},
    numbers=[sf.Number("rydberg", 13, title="energy of Rydberg", unit="eV", low=5, high=30)],
    effects=[
        sf.Effect("screening", "screening of the nucleus", low=-3, high=8, theory=1.0),
        sf.Effect("gain", "gain of the detector", low=-0.3, high=0.5, typical=0.03),
        sf.Effect("zero", "zero of the detector", low=-1.5, high=1.5, unit="keV", typical=0.2),
    ],
    settings=["Z", "peak"],
)
