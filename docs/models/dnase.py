"""Optical density in an assay of an enzyme: in proportion to its concentration, which may lack saturation.

    d = k c/(1 + ε c) · (c/1 ng/ml)^−ε_p + d_0 − ε_q k c²

Binding sites fill up: ε = 1/K. A logistic curve in ln c (Pinheiro and Bates 2000, same data) has K = exp(1.48) =
4.4 ng/ml and an exponent of 0.96, so ε = 0.23 ml/ng. A power law (ε_p), a background (d_0) and quenching (ε_q) are
the decoys.

Recombinant DNase in rat serum, eleven runs of eight concentrations in duplicate, M. Davidian and D. Giltinan
(1995), as in datasets::DNase and github.com/vincentarelbundock/Rdatasets (GPL).

    softflagella calibrate TABLE --model docs/models/dnase.py --session assay --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import softflagella as sf


def density(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute optical densities, (n,)."""
    c = columns["conc_ng_ml"]
    bound = p["slope"] * c / (1 + p["saturation"] * c) * c ** -p["power"]
    return {"density": np.maximum(bound + p["background"] - p["quenching"] * p["slope"] * c**2, 1e-4)}


MODEL = sf.Model(
    density,
    outputs={"density": sf.Output("optical density")},
    numbers=[sf.Number("slope", 0.3, unit="ml/ng", low=0.01, high=10)],
    effects=[
        sf.Effect("saturation", "saturation", low=0, high=5, unit="ml/ng", typical=0.1),
        sf.Effect("power", "power law", low=-1, high=1, typical=0.3),
        sf.Effect("background", "background", low=-0.02, high=0.3, typical=0.02),
        sf.Effect("quenching", "quenching", low=-0.05, high=0.07, unit="ml/ng", typical=0.02),
    ],
)
