"""A pump, a tank that empties into another, and that one: Torricelli's law, which may lack that they overflow.

    dx_1/dt = k u′ − q_1 − o_1,   dx_2/dt = q_1 + o_1 − q_2 − o_2,   q_i = a_i (x_i + z)^(1/2 + ε)

o_i = w_i (x_i − B) above the brim B, else nothing, u′ = u − u_0. All is in volts of the sensor of the lower tank,
which shows x_2. The tanks are taken as equal, and w_i are the rates at which they overflow, the upper one into the
lower one. Outlets below the level at which the sensor shows nothing (z), another exponent (ε), and a dead zone of
the pump (u_0) are what else one may think of.

The benchmark of M. Schoukens et al. (2016), one record to estimate and one to validate, as in github.com/forgi86/
sysid-neural-structures-fitting (MIT licence, see data/LICENCES.md). Its authors say that both tanks overflow, and
part of the upper one's water into the lower one.

    softflagella calibrate docs/models/data/tanks.csv --model docs/models/tanks.py --trace record --held-out val
        --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numba as nb
import numpy as np

import softflagella as sf
from common.arrays import Floats

BRIM = 10.0  # V, at which the sensor stays


@nb.njit
def rates(x: Any, pump: float, law: Any) -> Any:
    """Compute the rates of change [V/s] of both levels."""
    gain, upper, lower, below, exponent, over_upper, over_lower = law
    out = upper * max(x[0] + below, 0.0) ** exponent + over_upper * max(x[0] - BRIM, 0.0)
    lost = lower * max(x[1] + below, 0.0) ** exponent + over_lower * max(x[1] - BRIM, 0.0)
    return gain * pump - out, out - lost


@nb.njit
def integrate(t: Floats, pump: Floats, x1: float, x2: float, law: Any) -> Floats:
    """Integrate the level of the lower tank [V], (n,), by the midpoint rule, with the pump as read."""
    levels = np.empty_like(t)
    for i in range(len(t)):
        levels[i] = x2
        h = t[min(i + 1, len(t) - 1)] - t[i]
        r1, r2 = rates((x1, x2), pump[i], law)
        r1, r2 = rates((x1 + h / 2 * r1, x2 + h / 2 * r2), pump[i], law)
        x1 += h * r1
        x2 += h * r2
    return levels


def level(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute levels of the lower tank [V], (n,)."""
    names = "gain", "upper_outlet", "lower_outlet", "below"
    law = *(p[name] for name in names), 0.5 + p["exponent"], p["upper_brim"], p["lower_brim"]
    pump = np.asarray(columns["pump_V"] - p["dead_zone"])
    return {"level_V": integrate(columns["t_s"], pump, p["upper"], p["lower"], tuple(map(float, law)))}


MODEL = sf.Model(
    level,
    outputs={"level_V": sf.Output("level of the lower tank", unit="V", kind="difference")},
    numbers=[
        sf.Number("gain", 0.05, title="gain of the pump", unit="1/s", low=1e-3, high=1),
        sf.Number("upper_outlet", 0.05, title="outlet of the upper tank", unit="V^0.5/s", low=1e-3, high=1),
        sf.Number("lower_outlet", 0.05, title="outlet of the lower tank", unit="V^0.5/s", low=1e-3, high=1),
        sf.Number("upper", 5, title="upper level at the start", unit="V", low=0.1, high=20, per="trace"),
        sf.Number("lower", 5, title="lower level at the start", unit="V", low=0.1, high=12, per="trace"),
    ],
    effects=[
        sf.Effect("lower_brim", "overflow of the lower tank", low=0, high=0.45, unit="1/s", typical=0.1),
        sf.Effect("upper_brim", "overflow of the upper tank", low=0, high=0.45, unit="1/s", typical=0.1),
        sf.Effect("exponent", "another exponent of the outlets", low=-0.45, high=1, typical=0.1),
        sf.Effect("below", "outlets below the sensor's zero", low=-0.5, high=20, unit="V", typical=1),
        sf.Effect("dead_zone", "dead zone of the pump", low=-2, high=2, unit="V", typical=0.3),
    ],
    settings=["pump_V"],
    time="t_s",
)
