"""An enzyme: a rate in proportion to the substrate, which may lack saturation.

    v = k c/(1 + ε c) · (c/0.1 ppm)^−ε_p + v_0 − ε_i k c²

By Michaelis and Menten (1913) ε = 1/K_m, and V = k/ε. A power law (ε_p, Freundlich's), a background (v_0) and an
inhibition by the substrate (ε_i) are the decoys. Bates and Watts (1988) fit V = 212.7 ± 7.0 and K_m = 0.0641 ±
0.0083 ppm for the treated enzyme, V = 160.3 ± 6.5 and K_m = 0.0477 ± 0.0078 ppm for the untreated one.

Cells of one liver, treated with puromycin and untreated, M. Treloar (1974), as in datasets::Puromycin and
github.com/vincentarelbundock/Rdatasets (GPL).

    softflagella calibrate TABLE --model docs/models/puromycin.py --specimen state --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import softflagella as sf


def velocity(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute rates of the reaction [counts/min²], (n,)."""
    c = columns["conc_ppm"]
    rate = p["slope"] * c / (1 + p["saturation"] * c) * (c / 0.1) ** -p["power"]
    return {"rate": np.maximum(rate + p["background"] - p["inhibition"] * p["slope"] * c**2, 1e-3)}


MODEL = sf.Model(
    velocity,
    outputs={"rate": sf.Output("rate of the reaction", unit="counts/min²")},
    numbers=[sf.Number("slope", 1000, unit="counts/min²/ppm", low=10, high=1e5, per="specimen")],
    effects=[
        sf.Effect("saturation", "saturation", low=0, high=200, unit="1/ppm", typical=10),
        sf.Effect("power", "power law", low=-1, high=1, typical=0.3),
        sf.Effect("background", "background", low=-40, high=100, unit="counts/min²", typical=20),
        sf.Effect("inhibition", "inhibition by the substrate", low=-0.5, high=0.9, unit="1/ppm", typical=0.3),
    ],
)
