"""Friction of turbulent flow in a smooth pipe: a constant coefficient, or one that falls with Reynolds's number.

    τ/(ρ U²) = c (Re/10⁵)^−ε (1 + ε_b (1 cm/d − 1)) (1 − ε_g [gas]);   Blasius (1913): ε = 1/4, c = 0.00222

A coefficient that differs with the bore d of the pipe (ε_b), or between gas and water (ε_g), are the decoys.

Brass pipes of 0.36 to 12.6 cm with water and air, T. E. Stanton and J. R. Pannell (1914), as typed in
github.com/atrettel/sheardata, D1914001 (CC BY 4.0). Flow below Re = 4000 is left out. A series is a pipe and a
fluid.

    softflagella calibrate TABLE --model docs/models/pipes.py --session series --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import softflagella as sf


def friction(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute shear stresses over ρ U², (n,)."""
    falls = (columns["Reynolds"] / 1e5) ** -p["exponent"]
    bore = 1 + p["bore"] * (1 / columns["diameter_cm"] - 1)
    return {"friction": p["coefficient"] * falls * bore * (1 - p["gas"] * (columns["fluid"] == "air"))}


MODEL = sf.Model(
    friction,
    outputs={"friction": sf.Output("coefficient of friction")},
    numbers=[sf.Number("coefficient", 2e-3, low=1e-4, high=0.1)],
    effects=[
        sf.Effect("exponent", "fall with Reynolds's number", low=-1, high=1, theory=0.25),
        sf.Effect("bore", "bore of the pipe", low=-0.3, high=0.8, typical=0.1),
        sf.Effect("gas", "gas", low=-0.8, high=0.8, typical=0.1),
    ],
    settings=["Reynolds", "diameter_cm", "fluid"],
)
