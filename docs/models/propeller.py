r"""Thrust of a propeller on a stand: in proportion to the speed of rotation, which may lack the square.

    T = c n^(1 + ε),   n in units of 10,000 rpm; by the theory of airscrews T = C_T ρ n² D⁴, ε = 1

or with a zero error of the load cell, or a loss near the speed of sound at the tips.

Eight propellers on one motor at two voltages, by P. Cao and J. Strawson (MIT licence, see data/LICENCES.md). The
speed is that of the electric field, which the stand measures; rows in which it found none are left out.

    softflagella calibrate docs/models/data/propellers.csv --model docs/models/propeller.py --session test \
        --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

import softflagella as sf


def thrust(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute thrusts in grams of force, (n,)."""
    n = columns["electrical_rpm"] / 1e4
    lost = np.exp(-p["tips"] * n**4)
    return {"thrust_gf": np.maximum(p["coefficient"] * n ** (1 + p["square"]) * lost + p["zero"], 1e-3)}


MODEL = sf.Model(
    thrust,
    outputs={"thrust_gf": sf.Output("thrust", unit="gf")},
    numbers=[sf.Number("coefficient", 100, unit="gf", low=1, high=1e4)],
    effects=[
        sf.Effect("square", "square of the speed", low=-0.9, high=3, theory=1.0),
        sf.Effect("zero", "zero of the load cell", low=-3, high=5, unit="gf"),
        sf.Effect("tips", "loss at the tips", low=-0.05, high=0.2, typical=0.02),
    ],
    settings=["esc_us", "cell_volts"],
)


def read(path: str) -> pd.DataFrame:
    """Read what was measured at a known speed."""
    table = sf.read_table(path)
    return table[table["electrical_rpm"] > 0].drop(columns=["optical_rpm", "time_s", "current_A", "voltage_V"])
