"""Ambiguous tables decided by a batch of eight proposed runs.

The runs of these tables cannot tell two effects apart: a small table (N = 2 to 4, one tail length, two motor
speeds, both directions, three days: 36 runs) of the linear stand-in with one effect at λ = 8, as often as it takes
to find tables with the verdict "ambiguous" and the truth in the set. The whole procedure then runs on the table
with the proposed batch added, as a new day.

Usage: python -m benchmarks next_batch [TABLES] [FIRST_SEED]

Takes 15 minutes.
"""

from __future__ import annotations

import itertools
import sys
from collections import Counter
from dataclasses import replace

import numpy as np
import pandas as pd

from benchmarks.calibration.planted import LinearSwimmer, Signals, linearised, scatter, with_values
from benchmarks.common import heading, in_parallel, per_cent, row
from calibration.swimmer.measured_table import read_measurements
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from common.arrays import Floats, Integers

MADE = ((2, 3, 4), (9.0,), (110.0, 150.0), (1, -1))  # N, tail length [cm], motor speed [rpm], direction
POSSIBLE = ((2, 3, 4, 5), (7.0, 8.0, 9.0, 10.0, 11.0, 12.0), (60.0, 105.0, 150.0), (1, -1))
DAYS, LEVEL = 3, 8.0
_AT_ONCE = 20  # tables that are tried together


def table() -> tuple[LinearSwimmer, int]:
    """Return the runs that were made and then those that can be made next; how many were made."""
    made = [(n, a, s * w, f"day {d}") for d in range(DAYS) for n, a, w, s in itertools.product(*MADE)]
    possible = [(n, a, s * w, "next") for n, a, w, s in itertools.product(*POSSIBLE)]
    rows = pd.DataFrame([*made, *possible], columns=["N", "l_cm", "omega_rpm", "session"])
    model = linearised(read_measurements(with_values(rows, np.random.default_rng(0))))
    return replace(model, next=model.subset(np.arange(len(made), len(rows)))), len(made)


def close(all_runs: LinearSwimmer, signal: Floats, seed: int, *parts: Integers) -> Verdict:
    """Calibrate the runs of some parts; a run that comes twice is measured twice."""
    k = all_runs.prediction.shape[1]
    noise = np.concatenate([scatter(all_runs.subset(p).runs, k, seed + i * 10**6) for i, p in enumerate(parts)])
    rows = np.concatenate(parts)
    model = all_runs.subset(rows)
    y = model.prediction + signal[rows] + noise
    return calibrate(replace(model, runs=replace(model.runs, y=y)), progress=False)


def outcome(verdict: Verdict, truth: str) -> str:
    sets = [{e.name for e in c.added} for c in verdict.claims]
    if not sets:
        return verdict.verdict
    if {truth} not in sets:
        return "wrong"
    return "right" if len(sets) == 1 else "still ambiguous"


def decided(model: LinearSwimmer, count: int, effect: int, size: float, seed: int) -> tuple[str, str] | None:
    """Return what the table says and what it says with the new runs; None if it is not ambiguous."""
    truth, signal, made = model.effects[effect].name, model.D[..., effect] * size, np.arange(count)
    first = close(model, signal, seed, made)
    if first.verdict != "ambiguous" or outcome(first, truth) == "wrong" or first.next_batch is None:
        return None
    batch = np.array([s["run"] for s in first.next_batch.settings]) + count
    said = " or ".join("+".join(e.name for e in c.added) for c in first.claims)
    return f"{truth}: {said}", outcome(close(model, signal, seed, made, batch), truth)


def main(wanted: str = "20", first: str = "0") -> None:
    model, count = table()
    made = model.subset(np.arange(count))
    signals = Signals(made)
    lengths, survived = np.linalg.norm(signals.effects, axis=0), signals.survived(made.D)
    truths = [
        (j, LEVEL / float(lengths[j]))
        for j, e in enumerate(model.effects)
        if survived[j] >= model.runs.least_surviving and e.start + LEVEL / lengths[j] <= e.bounds[1]
    ]
    found: list[tuple[str, str]] = []
    tried, seed = 0, int(first)
    while len(found) < int(wanted) and tried < 50 * int(wanted):
        work = [(model, count, *truths[i % len(truths)], seed + i) for i in range(tried, tried + _AT_ONCE)]
        found += [each for each in in_parallel(decided, work, quiet=True) if each]
        tried += _AT_ONCE
        print(f"{len(found)} of {tried} tables are ambiguous", file=sys.stderr)
    found = found[: int(wanted)]
    print(heading("truth, and what the table says", "with 8 proposed runs", "tables"))
    for (words, said), number in Counter(found).items():
        print(row(words, said, number))
    counts = Counter(said for _, said in found)
    print(f"right {per_cent(counts['right'], len(found))}, wrong {per_cent(counts['wrong'], len(found))}")
