"""Ambiguous tables decided by a batch of eight proposed runs.

The runs of these tables cannot tell two effects apart: a small table (N = 2 to 4, one tail length, two motor
speeds, both directions, three days: 36 runs) of the linear stand-in with one effect at λ = 8, as often as it takes
to find tables with the verdict "ambiguous" and the truth in the set. The whole procedure then runs on the table
with the proposed batch added, as a new day. For comparison it runs with a factorial of 16 runs: fewest and most
tails, shortest and longest, slow and fast, both directions.

Usage: python -m benchmarks next_batch [TABLES] [FIRST_SEED]      a table on the screen

Takes 15 minutes.
"""

from __future__ import annotations

import itertools
import sys
from collections import Counter
from dataclasses import replace

import numpy as np
import pandas as pd

from benchmarks.calibration.planted import Linear, Signals, linearised, scatter, with_values
from benchmarks.markdown import heading, row
from benchmarks.parallel import in_parallel
from benchmarks.proportions import per_cent
from calibration.statistics.residual_tests import TESTABLE
from calibration.swimmer.measured_table import read_measurements
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from sim.arrays import Floats, Integers

TAILS, LENGTH, RPM, DAYS = (2, 3, 4), 9.0, (110.0, 150.0), 3
GRID_TAILS = (2, 3, 4, 5)
GRID_LENGTHS = (7.0, 8.0, 9.0, 10.0, 11.0, 12.0)
GRID_RPM = (60.0, 105.0, 150.0)
LEVEL = 8.0
_AT_ONCE = 20  # tables that are tried together


def table() -> Linear:
    """The runs that were made, then those that can be made next."""
    made = [(n, LENGTH, s * w, f"day {d}") for d in range(DAYS) for n in TAILS for w in RPM for s in (1, -1)]
    possible = [(n, a, s * w, "next") for n in GRID_TAILS for a in GRID_LENGTHS for w in GRID_RPM for s in (1, -1)]
    rows = pd.DataFrame([*made, *possible], columns=["N", "l_cm", "omega_rpm", "session"])
    model = linearised(read_measurements(with_values(rows, np.random.default_rng(0))))
    new = np.arange(len(made), len(rows))
    return replace(model, next=model.subset(new))


def made(model: Linear) -> Integers:
    """Places of the runs that were made."""
    assert model.next is not None
    return np.arange(len(model.runs) - len(model.next.runs))


def factorial(model: Linear) -> Integers:
    """Places of 16 runs."""
    ends = [GRID_TAILS[::3], GRID_LENGTHS[::5], GRID_RPM[::2], (1, -1)]
    grid: list[tuple[float, ...]] = list(itertools.product(GRID_TAILS, GRID_LENGTHS, GRID_RPM, (1, -1)))
    return np.array([grid.index(setting) for setting in itertools.product(*ends)]) + len(made(model))


def close(all_runs: Linear, signal: Floats, seed: int, more: Integers | None = None) -> Verdict:
    """The verdict on the runs that were made, and on `more`; a run that comes twice is measured twice."""
    parts = [made(all_runs)] if more is None else [made(all_runs), more]
    k = all_runs.prediction.shape[1]
    noise = np.concatenate([scatter(all_runs.subset(p).runs, k, seed + i * 10**6) for i, p in enumerate(parts)])
    rows = np.concatenate(parts)
    model = all_runs.subset(rows)
    y = model.prediction + signal[rows] + noise
    return calibrate(replace(model, runs=replace(model.runs, y=y)), progress=False)


def outcome(verdict: Verdict, truth: str) -> str:
    sets = [{e.name for e in c.claimed} for c in verdict.explaining]
    if len(sets) == 1:
        return "right" if sets[0] == {truth} else "wrong"
    if sets:
        return "still ambiguous" if {truth} in sets else "wrong"
    return verdict.verdict


def compared(model: Linear, effect: int, size: float, seed: int) -> dict[str, str] | None:
    """What the new runs say; None if the table is not ambiguous."""
    truth, signal, first_runs = model.effects[effect].name, model.D[..., effect] * size, made(model)
    first = close(model, signal, seed)
    if first.verdict != "ambiguous" or outcome(first, truth) == "wrong" or first.next.batch is None:
        return None
    batch = np.array([s["run"] for s in first.next.batch.settings]) + len(first_runs)
    results = {"truth": truth, "set": " or ".join("+".join(e.name for e in c.claimed) for c in first.explaining)}
    for name, more in (("8 proposed runs", batch), ("factorial of 16", factorial(model))):
        results[name] = outcome(close(model, signal, seed, more), truth)
    return results


def main(count: str = "20", first: str = "0") -> None:
    model = table()
    signals = Signals(model.subset(made(model)))
    lengths = np.linalg.norm(signals.effects, axis=0)
    survived = signals.survived(model.subset(made(model)).D)
    todo = [
        (j, LEVEL / float(lengths[j]))
        for j, e in enumerate(model.effects)
        if survived[j] >= TESTABLE and e.start + LEVEL / lengths[j] <= e.bounds[1]
    ]
    results: list[dict[str, str]] = []
    tried, seed = 0, int(first)
    while len(results) < int(count) and tried < 50 * int(count):
        work = [(*todo[(tried + k) % len(todo)], seed + tried + k) for k in range(_AT_ONCE)]
        done = in_parallel(compared, [(model, *case) for case in work], quiet=True)
        results += [d for d in done if d]
        tried += _AT_ONCE
        print(f"{len(results)} of {tried} tables are ambiguous", file=sys.stderr)
    results = results[: int(count)]
    print(heading("truth, and what the table says", "tables", "8 proposed runs", "factorial of 16"))
    for pair in dict.fromkeys((d["truth"], d["set"]) for d in results):
        of = [d for d in results if (d["truth"], d["set"]) == pair]
        said = [", ".join(f"{k} {v}" for k, v in Counter(d[w] for d in of).items())
                for w in ("8 proposed runs", "factorial of 16")]  # fmt: skip
        print(row(f"{pair[0]}: {pair[1]}", len(of), *said))
    for way in ("8 proposed runs", "factorial of 16"):
        counts = Counter(d[way] for d in results)
        decided = counts["right"] + counts["wrong"]
        print(f"{way}: decided {per_cent(decided, len(results))}, wrong {per_cent(counts['wrong'], len(results))}")
