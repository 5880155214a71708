"""Distances in which cars stop: a reaction in which they go on, which may lack the braking.

    s = v t + v²/(2 μ g) + s_0 + ε_3 (v/20 mph)³

Brakes take v²/(2 μ g), with μ = 0.3 to 0.7 on a dry road: 1/μ = 1.4 to 3.3; people react in 0.2 to 1.5 s. A tape
that begins elsewhere (s_0) and a term in the cube (ε_3) are the decoys.

Fifty cars of the 1920s, M. Ezekiel (1930), as in datasets::cars and github.com/vincentarelbundock/Rdatasets (GPL).

    softflagella calibrate TABLE --model docs/models/cars.py --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import softflagella as sf

GRAVITY = 32.17  # ft/s²


def stop(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute distances [ft], (n,)."""
    v = columns["speed_mph"] * 5280 / 3600
    braked = p["braking"] * v**2 / (2 * GRAVITY)
    distance = v * p["reaction"] + braked + p["tape"] + p["cube"] * (columns["speed_mph"] / 20) ** 3
    return {"distance_ft": np.maximum(distance, 0.1)}


MODEL = sf.Model(
    stop,
    outputs={"distance_ft": sf.Output("distance", unit="ft")},
    numbers=[sf.Number("reaction", 1.5, title="time of reaction", unit="s", low=0.01, high=10)],
    effects=[
        sf.Effect("braking", "braking", low=0, high=20, unit="1/μ", typical=2),
        sf.Effect("tape", "zero of the tape", low=-5, high=20, unit="ft", typical=3),
        sf.Effect("cube", "cube of the speed", low=-10, high=60, unit="ft", typical=10),
    ],
)
