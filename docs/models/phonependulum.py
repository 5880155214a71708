"""A telephone that swings as a pendulum: small angles, which may lack the sine of large ones.

    θ″ + ω² (θ + ε (sin θ − θ)) + θ′ (β + ε_q |θ′|) = 0,   a = −s g (θ + ε (sin θ − θ)) − (g/ω²) θ′ (β + …) + ε_d t

a is the tangential acceleration that the telephone shows without gravity's share, ω = 6.17 rad/s (long) or 7.76
rad/s (short) × (1 + δ), as counted at 5°. By theory ε = 1. The drag of the air (ε_q), a scale of the accelerometer
that the angle does not see (s = 1 + ε_s), and a drift of its zero (ε_d) are the decoys.

Two lengths, let go at 5, 15, 25, 45, 60°, from 5 to 25 s at 10 Hz of 100 Hz, by H. Lee,
github.com/harinlee83/Dynamics-of-Cell-Phone-Pendulum (no licence: the table is not copied).

    softflagella calibrate TABLE --model docs/models/phonependulum.py --trace run --specimen pendulum --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numba as nb
import numpy as np

import softflagella as sf
from common.arrays import Floats

GRAVITY = 9.81
COUNTED = {"long": 6.17, "short": 7.76}  # rad/s, at 5°
STEPS = 4  # between two readings


@nb.njit
def integrate(t: Floats, x: float, v: float, law: Any) -> tuple[Floats, Floats]:
    """Integrate angles and rates, each (n,), by the method of Runge and Kutta."""
    stiffness, finite, linear, square = law
    angles, rates = np.empty_like(t), np.empty_like(t)
    angles[0], rates[0] = x, v
    for i in range(1, len(t)):
        h = (t[i] - t[i - 1]) / STEPS
        for _ in range(STEPS):
            a1 = -stiffness * (x + finite * (np.sin(x) - x)) - v * (linear + square * abs(v))
            y, w = x + h / 2 * v, v + h / 2 * a1
            a2 = -stiffness * (y + finite * (np.sin(y) - y)) - w * (linear + square * abs(w))
            z, u = x + h / 2 * w, v + h / 2 * a2
            a3 = -stiffness * (z + finite * (np.sin(z) - z)) - u * (linear + square * abs(u))
            q, r = x + h * u, v + h * a3
            a4 = -stiffness * (q + finite * (np.sin(q) - q)) - r * (linear + square * abs(r))
            x += h / 6 * (v + 2 * w + 2 * u + r)
            v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        angles[i], rates[i] = x, v
    return angles, rates


def swing(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute accelerations [m/s²], (n,)."""
    t, omega = columns["t_s"], COUNTED[str(columns["pendulum"][0])] * (1 + p["detuning"] / 100)
    law = tuple(map(float, (omega**2, p["finite"], p["damping"], p["quadratic"])))
    x, v = integrate(t, float(p["angle"]), float(p["rate"] * omega), law)
    force = x + p["finite"] * (np.sin(x) - x) + v * (p["damping"] + p["quadratic"] * np.abs(v)) / omega**2
    return {"ax_m_s2": -GRAVITY * (1 + p["scale"]) * force + p["drift"] * t}


MODEL = sf.Model(
    swing,
    outputs={"ax_m_s2": sf.Output("acceleration", unit="m/s²", kind="difference")},
    numbers=[
        sf.Number("detuning", 0, title="frequency over the counted one, less 1", unit="%", low=-10, high=10,
                  per="specimen"),
        sf.Number("damping", 0.01, unit="1/s", low=1e-4, high=1),
        sf.Number("angle", 0.3, title="angle at the start", unit="rad", low=-2, high=2, per="trace"),
        sf.Number("rate", 0, title="rate at the start over ω", unit="rad", low=-2, high=2, per="trace"),
    ],
    effects=[
        sf.Effect("finite", "sine of the angle", low=-1, high=3, theory=1.0),
        sf.Effect("quadratic", "drag of the air", low=-0.05, high=0.2, unit="1/rad", typical=0.01),
        sf.Effect("scale", "scale of the accelerometer", low=-0.5, high=0.5, typical=0.05),
        sf.Effect("drift", "drift of the zero", low=-0.05, high=0.05, unit="m/s³", typical=0.002),
    ],
    settings=["pendulum"],
    time="t_s",
)  # fmt: skip
