"""A telephone that falls or is thrown up: a drag in proportion to the speed, which may be one in its square.

    dv/dt = −g − d(v),   d = b v |v/U|^n + c v |v|,   a = a_0 + a_1 t − d(v(t − s))

v is the speed upwards, a what the accelerometer shows, nothing in free fall, U = 5 m/s. By theory n = 1: the drag
is turbulent, not laminar. A turbulent drag beside the laminar one (c), a drift of the accelerometer (a_1), and one
that is late (s) are what else one may think of.

Twenty-two drops and sixteen throws of one telephone, by F. Saliby (CC0, see data/LICENCES.md), arXiv 2410.14172.

    softflagella calibrate docs/models/data/phonefall.csv --model docs/models/phonefall.py --trace trace
        --held-out thrown --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy.integrate import odeint

import softflagella as sf

GRAVITY = 9.8  # m/s²
SPEED = 5.0  # m/s, towards the end of a fall


def drag(v: Any, p: Mapping[str, float]) -> Any:
    """Compute by how much [m/s²] the air decelerates at a speed v [m/s]."""
    return v * (p["laminar"] * abs(v / SPEED) ** p["turbulent"] + p["square"] * abs(v))


def fall(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute what the accelerometer shows [m/s²], (n,)."""
    t = columns["t_s"]
    v = odeint(lambda v, _: -GRAVITY - drag(v.item(), p), p["start"], t, rtol=1e-8, atol=1e-8)[:, 0]
    shown = drag(v, p)
    return {"az_mps2": p["zero"] + p["drift"] * t - shown + p["late"] * np.gradient(shown, t)}


MODEL = sf.Model(
    fall,
    outputs={"az_mps2": sf.Output("proper acceleration", unit="m/s²", kind="difference")},
    numbers=[
        sf.Number("laminar", 0.1, title="rate of a laminar drag", unit="1/s", low=1e-3, high=2),
        sf.Number("start", 0, title="speed at the start", unit="m/s", low=-10, high=10, per="trace"),
        sf.Number("zero", 0, title="zero of the accelerometer", unit="m/s²", low=-1, high=1, per="trace"),
    ],
    effects=[
        sf.Effect("turbulent", "drag in the square of the speed", low=-0.9, high=3, theory=1.0),
        sf.Effect("square", "such a drag beside a laminar one", low=0, high=0.3, unit="1/m", typical=0.05),
        sf.Effect("drift", "drift of the zero", low=-3, high=3, unit="m/s³", typical=0.3),
        sf.Effect("late", "late accelerometer", low=-0.1, high=0.3, unit="s", typical=0.02),
    ],
    settings=["thrown"],
    time="t_s",
)


def read(path: str) -> pd.DataFrame:
    """Read the falls, and whether the telephone was thrown."""
    table = sf.read_table(path)
    return table.assign(thrown=table["trace"].str.startswith("updown").astype(int))
