"""A disk between two springs that turns and is left alone: viscous damping, which may lack dry friction.

    φ″ + ω² (φ − φ_0) + (β + β_m [magnet]) φ′ + ω² ε φ′/√(φ′² + v²) + ε_q φ′ |φ′| + ω² ε_3 (φ − φ_0)³ = 0

ω = 4.4 rad/s (1 + δ) as counted. Dry friction holds the disk anywhere within ±ε of φ_0: without a magnet it comes
to rest up to 0.47 rad from where it was set to zero, and its maxima fall by equal steps of about 0.39 rad = 4 ε a
period, so ε is about 0.1 rad. The drag of the air (ε_q) and stiffening springs (ε_3) are the decoys.

Ten runs without and ten with a magnet, six seconds from the first maximum, by S. van den Bergh,
github.com/Sven-vandenBergh/M24-25-Lab-OSC-data (no licence: the table is not copied).

    softflagella calibrate TABLE --model docs/models/disk.py --trace run --out DIR
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numba as nb
import numpy as np

import softflagella as sf
from common.arrays import Floats

COUNTED = 4.4  # rad/s
STEPS = 4  # between two readings
SLOW = 0.05  # rad/s, where dry friction turns


@nb.njit
def acceleration(x: float, v: float, law: Any) -> float:
    """Compute φ″ at an angle and its rate."""
    stiffness, damping, dry, quadratic, cubic = law
    held = dry * v / math.sqrt(v**2 + SLOW**2)
    return -stiffness * (x + cubic * x**3 + held) - v * (damping + quadratic * abs(v))


@nb.njit
def integrate(t: Floats, x: float, v: float, law: Any) -> Floats:
    """Integrate angles from rest (n,) by the midpoint method."""
    angles = np.empty_like(t)
    angles[0] = x
    for i in range(1, len(t)):
        h = (t[i] - t[i - 1]) / STEPS
        for _ in range(STEPS):
            half = v + h / 2 * acceleration(x, v, law)
            change = h * acceleration(x + h / 2 * v, half, law)
            x += h * half
            v += change
        angles[i] = x
    return angles


def swing(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute angles [rad], (n,)."""
    stiffness = (COUNTED * (1 + p["detuning"] / 100)) ** 2
    damping = p["damping"] + p["magnet"] * float(columns["magnet"][0])
    law = tuple(map(float, (stiffness, damping, p["dry"], p["quadratic"], p["cubic"])))
    turned = integrate(columns["t_s"], float(p["angle"] - p["zero"]), float(p["rate"]), law)
    return {"angle_rad": p["zero"] + turned}


MODEL = sf.Model(
    swing,
    outputs={"angle_rad": sf.Output("angle", unit="rad", kind="difference")},
    numbers=[
        sf.Number("detuning", 0, title="frequency over the counted one, less 1", unit="%", low=-20, high=20),
        sf.Number("damping", 0.3, title="viscous damping", unit="1/s", low=1e-3, high=5),
        sf.Number("magnet", 0, title="damping by the magnet", unit="1/s", low=-2, high=5),
        sf.Number("angle", 3, title="angle at the start", unit="rad", low=0.5, high=8, per="trace"),
        sf.Number("rate", 0, title="rate at the start", unit="rad/s", low=-3, high=3, per="trace"),
        sf.Number("zero", 0, title="angle of rest", unit="rad", low=-1, high=1, per="trace"),
    ],
    effects=[
        sf.Effect("dry", "dry friction", low=-0.1, high=0.5, unit="rad", typical=0.05),
        sf.Effect("quadratic", "drag of the air", low=-0.1, high=0.5, unit="1/rad", typical=0.02),
        sf.Effect("cubic", "stiffening springs", low=-0.02, high=0.1, unit="1/rad²", typical=0.005),
    ],
    settings=["magnet"],
    time="t_s",
)
