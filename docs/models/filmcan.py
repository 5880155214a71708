"""Water that cools in a film can: Newton's law, which may lack the heat of the can, or be another law.

    (m c + C) dT/dt = −k u (|u|/20 K)^ε_p (1 + ε_q u/20 K) (1 + ε_a (m − m_0)/m_0) − P,   u = T − T_room(t)

The can of 5.1 g of plastic (1.9 J/g K) has C = 10 J/K by theory. Free convection has ε_p = 1/4, radiation a small
ε_q; water that evaporates takes P; the wetted wall grows with the mass m (ε_a), m_0 = 20 g.

Three cans of water, with a thermometer in the room, as in github.com/mpc-physical-science/projects (labs-testing/
cooling). No licence was found, so the table is not copied here. Its columns are trace, t_s, T_C, Tenv_C.

    softflagella calibrate TABLE --model docs/models/filmcan.py --trace trace --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

import softflagella as sf

HEAT = 4.186  # J/g K, of water
WATER = {"can_1": 22.6, "can_2": 26.0, "can_3": 16.4}  # g
USUAL = 20.0  # K, and g


def cool(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute temperatures of the water [°C], (n,), by Heun's method."""
    water = float(columns["water_g"][0])
    rate = p["loss"] * (1 + p["wetted"] * (water - USUAL) / USUAL) / (water * HEAT + p["can"])
    steady = p["evaporation"] / (water * HEAT + p["can"])

    def slope(excess: float) -> float:
        law = max(excess / USUAL, 1e-3) ** p["convection"] * (1 + p["radiation"] * excess / USUAL)
        return -rate * excess * law - steady

    times, room = columns["t_s"].tolist(), columns["Tenv_C"].tolist()
    temperatures = [p["start"]]
    for i, h in enumerate(np.diff(times).tolist()):
        last = temperatures[-1]
        first = slope(last - room[i])
        temperatures.append(last + h / 2 * (first + slope(last + h * first - room[i + 1])))
    return {"T_C": np.array(temperatures)}


MODEL = sf.Model(
    cool,
    outputs={"T_C": sf.Output("temperature of the water", unit="°C", kind="difference")},
    numbers=[
        sf.Number("loss", 0.08, unit="W/K", low=1e-3, high=1),
        sf.Number("start", 45, title="temperature at the start", unit="°C", low=20, high=100, per="trace"),
    ],
    effects=[
        sf.Effect("can", "heat of the can", low=0, high=60, unit="J/K", theory=10.0),
        sf.Effect("convection", "free convection", low=-0.9, high=2, theory=0.25),
        sf.Effect("radiation", "radiation", low=-0.5, high=2, typical=0.1),
        sf.Effect("evaporation", "evaporation", low=-1, high=2, unit="W", typical=0.1),
        sf.Effect("wetted", "wetted wall", low=-1, high=3, typical=0.5),
    ],
    settings=["water_g"],
    time="t_s",
)


def read(path: str) -> pd.DataFrame:
    """Read the temperatures, with the water that each can had."""
    table = sf.read_table(path)
    return table.assign(water_g=table["trace"].map(WATER))
