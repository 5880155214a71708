"""A telephone that falls or is thrown up: a drag in proportion to the speed, which may be one in its square.

    dv/dt = −g − d(v),   d = b v |v/U|^n + c v |v|,   a = a_0 + a_1 t − d(v(t − s))

v is the speed upwards, a what the accelerometer shows, nothing in free fall, U = 5 m/s. By theory n = 1: the drag
is turbulent, not laminar. A turbulent drag beside the laminar one (c), a drift of the accelerometer (a_1), and one
that is late (s) are what else one may think of. Drops start at about −0.5 m/s, throws at 4 m/s, as their author
guesses, here to within 1 m/s.

Twenty-two drops and sixteen throws of one telephone, by F. Saliby (CC0, see data/LICENCES.md), arXiv 2410.14172.

    softflagella calibrate docs/models/data/phonefall.csv --model docs/models/phonefall.py --trace trace
        --held-out third --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numba as nb
import numpy as np
import pandas as pd

import softflagella as sf
from common.arrays import Floats

GRAVITY = 9.8  # m/s²
SPEED = 5.0  # m/s, towards the end of a fall


@nb.njit
def drag(v: float, law: Any) -> float:
    """Compute by how much [m/s²] the air decelerates at a speed v [m/s]."""
    laminar, turbulent, square = law
    return v * (laminar * abs(v / SPEED) ** turbulent + square * abs(v))


@nb.njit
def drags(t: Floats, v: float, law: Any) -> Floats:
    """Compute decelerations by the air (n,), from a speed v at the start, by the method of Runge and Kutta."""
    along = np.empty_like(t)
    for i in range(len(t)):
        along[i] = drag(v, law)
        h = t[min(i + 1, len(t) - 1)] - t[i]
        a1 = -GRAVITY - along[i]
        a2 = -GRAVITY - drag(v + h / 2 * a1, law)
        a3 = -GRAVITY - drag(v + h / 2 * a2, law)
        a4 = -GRAVITY - drag(v + h * a3, law)
        v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return along


def fall(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute what the accelerometer shows [m/s²], (n,)."""
    t = columns["t_s"]
    along = drags(
        t,
        float(columns["start_mps"][0] + p["start"]),
        tuple(float(p[name]) for name in ("laminar", "turbulent", "square")),
    )
    return {"az_mps2": p["zero"] + p["drift"] * t - along + p["late"] * np.gradient(along, t)}


MODEL = sf.Model(
    fall,
    outputs={"az_mps2": sf.Output("proper acceleration", unit="m/s²", kind="difference")},
    numbers=[
        sf.Number("laminar", 0.1, title="rate of a laminar drag", unit="1/s", low=1e-3, high=2),
        sf.Number("start", 0, title="start over the guess", unit="m/s", low=-5, high=5, sigma=1.0, per="trace"),
        sf.Number("zero", 0, title="zero of the accelerometer", unit="m/s²", low=-1, high=1, per="trace"),
    ],
    effects=[
        sf.Effect("turbulent", "drag in the square of the speed", low=-0.9, high=3, theory=1.0),
        sf.Effect("square", "such a drag beside a laminar one", low=0, high=0.3, unit="1/m", typical=0.05),
        sf.Effect("drift", "drift of the zero", low=-3, high=3, unit="m/s³", typical=0.3),
        sf.Effect("late", "late accelerometer", low=-0.1, high=0.3, unit="s", typical=0.02),
    ],
    settings=["start_mps"],
    time="t_s",
)


def read(path: str) -> pd.DataFrame:
    """Read the falls, the speed with which each of the two kinds starts about, and which third is for the test."""
    table = sf.read_table(path)
    kind, number = table["trace"].str.split("_", expand=True).to_numpy().T
    return table.assign(
        start_mps=np.where(kind == "fall", -0.5, 4.0), third=(number.astype(int) % 3 == 0).astype(int)
    )
