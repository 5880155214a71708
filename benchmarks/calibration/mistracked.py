"""Calibrations of tables with mis-tracked runs, with weights of the runs and without.

Tables of the paper's design by the linear stand-in (`benchmarks.calibration.planted`), in which 0, 2, 5 and 10 %
of the runs are off by 10 to 30 %: one output of half of them, all outputs of the others. Nothing is planted, or
one effect at λ = 8. "Without" takes the noise for one normal distribution. Stated are the noise of a run (2.5 % of
a well-tracked one), and the verdicts; where these are right, errors of the coefficients, half widths of their 95 %
intervals, and how often these contain the truth.

Usage: python -m benchmarks mistracked [TABLES] [FIRST_SEED]

Takes a quarter of an hour.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from unittest.mock import patch

import numpy as np

from benchmarks.calibration.operating import each_at_eight, judge
from benchmarks.calibration.planted import Case, Linear, measured, nulls, stand_in
from benchmarks.markdown import heading, row
from benchmarks.parallel import in_parallel
from benchmarks.proportions import per_cent
from calibration.statistics.statistical_model import start_values
from calibration.verdict.calibrate import calibrate
from sim.arrays import Floats

SHARES = (0.0, 0.02, 0.05, 0.10)
OFF = (0.10, 0.30)  # relative
DRAWS = 200  # of the bootstrap
HEADING = (
    "mis-tracked",
    "weights",
    "noise",
    "excluded; of little weight",
    "errors of C_t, C_r, C_yr, rms",
    "half widths",
    "contain the truth (95 %)",
    "right (95 %)",
    "wrong (95 %)",
)


@dataclass(frozen=True)
class Outcome:
    """What came out of a table."""

    group: tuple[
        bool, float, bool
    ]  # whether an effect is planted, share of mis-tracked runs, whether weights are used
    judgement: str
    noise: float  # of a run, as it is stated
    errors: Floats  # (3,) of ln C
    halves: Floats  # (3,) half widths of their intervals
    covered: Floats  # (3,)
    excluded: int  # runs
    little: int  # runs of a weight below one half


def with_mistracked(model: Linear, share: float, seed: int) -> Linear:
    """Move a share of the runs, at random, by 10 to 30 % in one output or in all."""
    rng = np.random.default_rng((seed, 1))
    y = model.runs.y.copy()
    for run in np.flatnonzero(rng.random(len(y)) < share):
        off = rng.uniform(*OFF) * rng.choice((-1, 1))
        outputs = [rng.integers(y.shape[1])] if rng.random() < 0.5 else slice(None)
        y[run, outputs] += off
    return replace(model, runs=replace(model.runs, y=y))


@contextmanager
def one_normal_distribution() -> Iterator[None]:
    """Give no run a weight."""
    with patch("calibration.statistics.weighted_fit.estimate", lambda *_: None):
        yield


def run(model: Linear, case: Case, share: float, seed: int, weighted: bool) -> Outcome:
    """Calibrate one table."""
    table = with_mistracked(measured(model, case.signal, seed), share, seed)
    with nullcontext() if weighted else one_normal_distribution():
        verdict = calibrate(table, seed=seed, draws=DRAWS, progress=False)
    start, final = start_values(model), verdict.final
    errors = np.array([np.log(final.parameters[p.name] / start[p.name]) for p in model.coefficients])
    halves = np.array([final.half_width(final.names.index(p.name)) for p in model.coefficients])
    return Outcome(
        (bool(case.sizes), share, weighted), judge(verdict, case), verdict.noise_ceiling, errors, halves,
        np.abs(errors) <= halves, len(verdict.conditions.split.reasons), len(verdict.conditions.little_weight),
    )  # fmt: skip


def main(count: str = "100", first: str = "0") -> None:
    model = stand_in()
    null, effects = nulls(model, 1)[0], each_at_eight(model)
    work = []
    for share in SHARES:
        for i in range(int(count)):
            seed = int(first) + i
            for case in (null, effects[i % len(effects)]):
                work += [(model, case, share, seed, weighted) for weighted in (True, False)]
    outcomes = in_parallel(run, work)
    for planted in (False, True):
        print(f"\n{'One effect, λ = 8' if planted else 'Nothing planted'}: {count} tables each\n")
        print(heading(*HEADING))
        for share in SHARES:
            for weighted in (False, True):
                print(summary([o for o in outcomes if o.group == (planted, share, weighted)], share, weighted))


def summary(found: list[Outcome], share: float, weighted: bool) -> str:
    """A row of the table; intervals are judged where the verdict is right."""
    good = [o for o in found if o.judgement in ("exact", "none", "in the set")]
    sure = [o for o in found if o.judgement in ("exact", "none")]
    wrong = [o for o in found if o.judgement == "number" or o.judgement.startswith(("wrong", "claimed"))]
    covered = np.array([o.covered for o in sure])
    return row(
        f"{100 * share:.0f} %",
        "yes" if weighted else "no",
        f"{100 * np.mean([o.noise for o in found]):.2f} %",
        f"{np.mean([o.excluded for o in found]):.1f}; {np.mean([o.little for o in found]):.1f}",
        " ".join(f"{100 * e:.2f}" for e in np.sqrt(np.mean([o.errors**2 for o in sure], 0))) + " %",
        " ".join(f"{100 * e:.2f}" for e in np.mean([o.halves for o in sure], 0)) + " %",
        per_cent(int(covered.sum()), covered.size),
        per_cent(len(good), len(found)),
        per_cent(len(wrong), len(found)),
    )
