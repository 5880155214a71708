"""A model of a ship that rolls and is left alone: linear damping, which may lack what grows with the angle.

    φ″ + ω² (φ + ε_3 φ³ − φ_0) + φ′ (β + β_U U + ε_2 |φ′| + ε_d φ′²) + ε_c φ′/√(φ′² + v²) = 0

ω = ω_0 (1 + δ), ω_0 = 2.47 rad/s as counted. Eddies at the bilges damp with ε_2 (Ikeda), the lift of a hull with a
speed U with β_U. Upright sides stiffen (ε_3). Dry friction (ε_c), a damping in the cube of the rate (ε_d), and a
list (φ_0) are what else one may think of.

KVLCC2 at a scale of 1:68, two tests at rest and one at 15.5 knots (of the ship), in the basin of SSPA, by
M. Alexandersson et al. (2021; MIT licence, see data/LICENCES.md).

    softflagella calibrate docs/models/data/shiproll.csv --model docs/models/shiproll.py --trace test
        --held-out 21338 --out DIR
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numba as nb
import numpy as np

import softflagella as sf
from common.arrays import Floats

COUNTED = 2.47  # rad/s
STEPS = 2  # between two readings
SLOW = 5e-3  # rad/s, where dry friction turns


@nb.njit
def acceleration(x: float, v: float, law: Any) -> float:
    """Compute φ″ at an angle and its rate."""
    stiffness, cubic, list_, damping, quadratic, cube, dry = law
    restoring = stiffness * (x + cubic * x**3 - list_)
    return -restoring - v * (damping + quadratic * abs(v) + cube * v**2) - dry * v / math.sqrt(v**2 + SLOW**2)


@nb.njit
def integrate(t: Floats, x: float, v: float, law: Any) -> Floats:
    """Integrate the angle of roll, (n,), by the method of Runge and Kutta."""
    angles = np.empty_like(t)
    angles[0] = x
    for i in range(1, len(t)):
        h = (t[i] - t[i - 1]) / STEPS
        for _ in range(STEPS):
            a1 = acceleration(x, v, law)
            v2 = v + h / 2 * a1
            a2 = acceleration(x + h / 2 * v, v2, law)
            v3 = v + h / 2 * a2
            a3 = acceleration(x + h / 2 * v2, v3, law)
            v4 = v + h * a3
            a4 = acceleration(x + h * v3, v4, law)
            x += h / 6 * (v + 2 * v2 + 2 * v3 + v4)
            v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        angles[i] = x
    return angles


def roll(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute angles of roll [rad], (n,)."""
    damping = p["damping"] + p["lift"] * float(columns["speed_kn"][0])
    stiffness = (COUNTED * (1 + p["detuning"] / 100)) ** 2
    law = stiffness, p["stiffening"], p["list"], damping, p["quadratic"], p["cubic"], p["dry"]
    return {"phi_rad": integrate(columns["t_s"], p["angle"], p["rate"], tuple(map(float, law)))}


MODEL = sf.Model(
    roll,
    outputs={"phi_rad": sf.Output("angle of roll", unit="rad", kind="difference")},
    numbers=[
        sf.Number("detuning", 0, title="frequency over the counted one, less 1", unit="%", low=-2, high=2),
        sf.Number("damping", 0.03, title="linear damping", unit="1/s", low=1e-3, high=1),
        sf.Number("lift", 2e-3, title="damping by lift", unit="1/s", low=-0.01, high=0.05),
        sf.Number("angle", 0.15, title="angle at the start", unit="rad", low=-0.5, high=0.5, per="trace"),
        sf.Number("rate", 0, title="rate at the start", unit="rad/s", low=-1, high=1, per="trace"),
    ],
    effects=[
        sf.Effect("quadratic", "damping by eddies", low=-0.3, high=2, unit="1/rad", typical=0.1),
        sf.Effect("stiffening", "stiffening by the sides", low=-5, high=10, unit="1/rad²", typical=1),
        sf.Effect("cubic", "damping in the cube of the rate", low=-1, high=10, unit="s/rad²", typical=0.5),
        sf.Effect("dry", "dry friction", low=-0.02, high=0.1, unit="rad/s²", typical=0.003),
        sf.Effect("list", "list", low=-0.05, high=0.05, unit="rad", typical=0.002),
    ],
    settings=["speed_kn"],
    time="t_s",
)
