"""Processor time and memory of long tables: cups that cool, eight numbers, five effects, and balls that fall.

Half of the traces repeat the others. Each has a start of its own; seven numbers are shared. The noise forgets in
240 s, of an hour. A lag of 30 s is planted, or nothing. The balls are nine, in ten rounds that scatter, with three
effects.

Usage: python -m benchmarks many_readings [READINGS] [TRACES]

Takes 2 minutes.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy.signal import lfilter

import softflagella as sf
from benchmarks.common import heading, row
from tests.oracles.drawn_falls import DIAMETERS, declared, falls

_ROUNDS = 10
_HOUR, _FORGETS = 3600.0, 240.0  # s
_TRUTH = {"rate": 1 / 900, "power": 0.3, "room": 0.2, "slope": 1.0, "swing": 0.1, "of_mass": 0.3, "late": 5.0}
_NULLS = dict.fromkeys(("radiation", "lag", "fill", "drift", "bend"), 0.0)


def cup(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute the temperature of a cup, in closed form."""
    t, mass = columns["t_s"] + p["late"], columns["mass"]
    rate = p["rate"] * (mass / 0.2) ** -p["power"] * (1 + p["fill"] * (mass - 0.2) / 0.2)
    cooled = rate * t
    excess = p["start"] * np.exp(-cooled - p["radiation"] * p["start"] / 300 * -np.expm1(-cooled))
    excess = excess * (1 + p["lag"] * rate * np.exp(-t / 60))
    room = p["room"] + p["slope"] * t / 1e4 + p["swing"] * np.sin(t / 500) + p["of_mass"] * mass
    return {"T": 22 + room + excess + p["drift"] * (t / 1e4) ** 2 + p["bend"] * mass * t / 1e4}


MODEL = sf.Model(
    cup,
    outputs={"T": sf.Output("temperature", unit="K", kind="difference")},
    numbers=[
        sf.Number("rate", 1e-3, unit="1/s", low=1e-5, high=0.1),
        *(sf.Number(name, 0.0, low=-50, high=50) for name in ("power", "room", "slope", "swing", "of_mass")),
        sf.Number("late", 0.0, unit="s", low=-60, high=60),
        sf.Number("start", 60, unit="K", low=1, high=150, per="trace"),
    ],
    effects=[sf.Effect(name, name, low=-20, high=20, typical=size) for name, size in
             {"radiation": 0.3, "lag": 15.0, "fill": 0.1, "drift": 1.0, "bend": 1.0}.items()],
    time="t_s",
)  # fmt: skip


def readings(count: int, traces: int, planted: Mapping[str, float]) -> pd.DataFrame:
    """Draw a table of `count` readings."""
    rng, each = np.random.default_rng(0), count // traces
    time_s = _HOUR * np.arange(1, each + 1) / each
    kept = np.exp(-time_s[0] / _FORGETS)
    tables = []
    for trace in range(traces):
        kind = trace % (traces // 2)
        columns = {"t_s": time_s, "mass": np.full(each, 0.1 + 0.01 * kind)}
        exact = cup(columns, {**_NULLS, **_TRUTH, "start": 40 + 2.0 * kind + rng.normal(), **planted})["T"]
        drawn = np.append(rng.normal(), np.sqrt(1 - kept**2) * rng.normal(size=each - 1))
        slow = lfilter([1.0], [1.0, -kept], drawn)
        tables.append(
            pd.DataFrame({"cup": trace, **columns, "T": exact + 0.3 * slow + 0.1 * rng.normal(size=each)})
        )
    return pd.concat(tables, ignore_index=True)


def main(count: str = "100000", traces: str = "50") -> None:
    print(heading("table", "planted", "rows", "verdict", "processor time", "memory of the process"))
    for planted in ({}, {"lag": 30.0}):
        told("cups", readings(int(count), int(traces), planted), MODEL, planted, trace="cup")
    repeats = max(int(count) // (_ROUNDS * len(DIAMETERS)), 1)
    for planted in ({}, {"wall": 0.2}):
        table = falls(0, rounds=_ROUNDS, repeats=repeats, scatter=0.01, **planted)
        told("balls", table, declared(), planted, session="round")


def told(name: str, table: pd.DataFrame, model: sf.Model, planted: Mapping[str, float], **roles: str) -> None:
    """Calibrate with a table, and print what that took."""
    began = time.process_time()
    verdict: Any = sf.calibrate(table, model, progress=False, **roles)  # type: ignore[arg-type]
    seconds, peak = time.process_time() - began, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    said = f"{verdict.verdict} {' '.join(verdict.effects)}".strip()
    print(row(name, ", ".join(planted) or "nothing", len(table), said, f"{seconds:.0f} s", f"{peak:.1f} GB"))
