"""Drag of a sphere at Reynolds's numbers of 5 to 1000: Stokes's law, which may lack the inertia of the fluid.

    C = s 24/Re (1 + ε 0.15 Re^0.687 + ε_O 3/16 Re) + ε_N

By Schiller and Naumann (1933) ε = 1, and s = 1. Oseen's term (ε_O), right below Re = 1 only, and a constant
coefficient (ε_N) are the decoys.

Spheres towed in water and glycerine, F. W. Roos and W. W. Willmarth (1971), as typed in
github.com/atrettel/sheardata, E1971001 (CC BY 4.0).

    softflagella calibrate TABLE --model docs/models/spheredrag.py --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import softflagella as sf


def drag(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute coefficients of drag, (n,)."""
    Re = columns["Reynolds"]
    inertia = p["inertia"] * 0.15 * Re**0.687 + p["oseen"] * 3 / 16 * Re
    return {"drag": np.maximum(p["scale"] * 24 / Re * (1 + inertia) + p["constant"], 1e-4)}


MODEL = sf.Model(
    drag,
    outputs={"drag": sf.Output("coefficient of drag")},
    numbers=[sf.Number("scale", 1.0, title="scale of Stokes's law", low=0.05, high=50)],
    effects=[
        sf.Effect("inertia", "inertia of the fluid", low=0, high=20, unit="Schiller and Naumann's", theory=1.0),
        sf.Effect("oseen", "Oseen's inertia", low=0, high=5, theory=1.0),
        sf.Effect("constant", "constant coefficient", low=-0.1, high=2, typical=0.4),
    ],
)
