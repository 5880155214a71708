"""Speed of a motor against throttle and voltage: proportional, or with a dead zone, or a resistance.

    n = K (V δ − R I/δ),   δ = s + δ_0,   s = (signal − 1000 µs)/1000 µs

s is the throttle, which the controller turns into the share δ of the time in which the motor has the voltage V;
I is the current of the supply, I/δ that of the motor, R the resistance, K the constant of the motor.

One motor (EMAX RS2205S, 2600 rpm/V by its maker) with eight propellers at two voltages, by P. Cao and J. Strawson
(MIT licence, see data/LICENCES.md).

    softflagella calibrate docs/models/data/propellers.csv --model docs/models/motor.py --session test --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

import softflagella as sf


def speed(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute speeds of the field [rpm], (n,)."""
    share = np.maximum(columns["esc_us"] / 1000 - 1 + p["zone"], 1e-3)
    voltage = columns["voltage_V"] * share - p["resistance"] * columns["current_A"] / share
    return {"electrical_rpm": p["constant"] * np.maximum(voltage, 1e-3)}


MODEL = sf.Model(
    speed,
    outputs={"electrical_rpm": sf.Output("speed of the field", unit="rpm")},
    numbers=[sf.Number("constant", 2000, unit="rpm/V", low=100, high=1e5)],
    effects=[
        sf.Effect("zone", "dead zone of the throttle", low=-0.04, high=1, typical=0.1),
        sf.Effect("resistance", "resistance", low=0, high=0.2, unit="Ω", typical=0.1),
    ],
)


def read(path: str) -> pd.DataFrame:
    """Read what has a known speed."""
    table = sf.read_table(path)
    return table[table["electrical_rpm"] > 0].drop(columns=["optical_rpm", "time_s", "thrust_gf"])
