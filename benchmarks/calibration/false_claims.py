"""False claims caused by wrong nuisance parameters, and by physics outside the catalogue.

The whole procedure runs on tables of the linear stand-in (`benchmarks.calibration.planted`). "Numbers exact" is
the same procedure with the nuisance parameters fixed to their given values.

A truth "is found" if it is named alone, in a set of effects, or beside a wrong number that does the same.

A number "is wrong" if it explains the residual, alone or beside effects that explain as much.

Usage: python -m benchmarks false_claims [TABLES] [FIRST_SEED] [CASES]      a table on the screen
       CASES: words of the cases to run, separated by |; default all. A case has the same seeds in every run.

Takes 100 minutes of one core.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.stats import chi2, ncx2

from benchmarks.calibration.planted import Linear, Signals, measured, outside, stand_in
from benchmarks.markdown import heading, row
from benchmarks.parallel import in_parallel
from benchmarks.proportions import per_cent
from calibration.statistics.residual_tests import TESTABLE
from calibration.statistics.statistical_model import Parameter
from calibration.statistics.study import middle_session
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from sim.arrays import Floats

STIFFNESS = "youngs_modulus"
_COVERED = "interval covers E"
_OF_AN_EFFECT = (_NAMED, _OTHER, _NUMBER) = (
    "named, or in the set",
    "another effect",
    "a number, and the effect is not named",
)


@dataclass(frozen=True)
class Case:
    """A truth, and what is asked of the verdicts on it."""

    label: str
    model: Linear
    signal: Callable[[int], Floats]  # of a seed, (n, k)
    asked: tuple[str, ...]
    truth: str = ""
    weight: float = 1.0  # tables of this case, as a share of those that are asked for


def claims(verdict: Verdict, case: Case) -> dict[str, bool]:
    """Every question that can be asked of a verdict."""
    sets = [{e.name for e in c.claimed} for c in verdict.explaining]
    uncertain = any(c.uncertain for c in verdict.explaining)
    beside = [{e.name for e in c.claimed} for c in verdict.evidence.rival_effects]
    answers = {
        "an effect is claimed": bool(sets),
        "claimed without the words": bool(sets) and not uncertain,
        "a number is wrong": verdict.verdict == "number" or bool(verdict.evidence.rival_numbers),
        _NAMED: {case.truth} in (*sets, *beside),
        _OTHER: bool(sets) and {case.truth} not in sets,
        _NUMBER: verdict.verdict == "number" and {case.truth} not in beside,
    }
    if STIFFNESS in verdict.base.names:
        low, high = verdict.base.interval(STIFFNESS)
        true = case.model.nuisances[0].start * math.exp(_shift(case.label))
        answers[_COVERED] = low <= true <= high
    return answers


def _shift(label: str) -> float:
    off = next((share for share in (0.1, 0.2, 0.4) if f"off by {100 * share:.0f} %" in label), 0.0)
    return math.log(1 - off)


def closed(case: Case, seed: int) -> tuple[dict[str, bool], float]:
    """Calibrate one table; return the answers and the processor time [s]."""
    began = time.process_time()
    answers = claims(calibrate(measured(case.model, case.signal(seed), seed), progress=False), case)
    return answers, time.process_time() - began


def drawn(G: Floats, given: tuple[Parameter, ...], seed: int) -> Floats:
    """Numbers off by one draw of their priors."""
    sigma = np.array([p.sigma for p in given], dtype=float)
    return np.asarray(G @ (np.random.default_rng(10_000 + seed).normal(size=len(sigma)) * sigma))


def fixed(signal: Floats, seed: int) -> Floats:
    """The same for every seed."""
    return signal


def restated(model: Linear, sigmas: dict[str, float]) -> Linear:
    """The same with other standard deviations; numbers with none are exact."""
    given = tuple(replace(p, sigma=sigmas[p.name]) for p in model.nuisances if sigmas.get(p.name))
    keep = [i for i, p in enumerate(model.nuisances) if sigmas.get(p.name)]
    return replace(model, nuisances=given, G=model.G[..., keep])


def cases(model: Linear) -> list[Case]:
    """All of them."""
    sigmas = {p.name: float(p.sigma or 0.0) for p in model.nuisances}
    exact = restated(model, {})
    place = [p.name for p in model.nuisances].index(STIFFNESS)
    soft, softer, softest = (partial(fixed, model.G[..., place] * math.log(s)) for s in (0.9, 0.8, 0.6))
    draw = partial(drawn, model.G, model.nuisances)
    tight = {"numbers of the table only": {k: sigmas[k] for k in ("camera_scale", "heading_zero", "tachometer")}}
    alone = restated(model, {**sigmas, STIFFNESS: 0.03})
    all_of = restated(model, {**tight["numbers of the table only"], STIFFNESS: 0.03})
    both = ("an effect is claimed", "a number is wrong")
    listed = [
        Case("numbers drawn from their priors", model, draw, both, weight=5.0),
        Case("the same, numbers exact", exact, draw, both[:1]),
        Case("E off by 10 %", model, soft, both[:1]),
        Case("E off by 10 %, numbers exact", exact, soft, both[:1]),
        Case("E off by 20 %", model, softer, (*both, _COVERED)),
        Case("E off by 20 %, numbers exact", exact, softer, both[:1]),
        Case("E off by 40 %", model, softest, both),
        Case("E off by 20 %, its σ 3 %", alone, softer, both),
        Case("the same, other numbers of the robot exact", all_of, softer, both),
    ]
    signals = Signals(model)
    lengths, survived = np.linalg.norm(signals.effects, axis=0), signals.survived(model.D)
    for level in (4.0, 8.0):
        for j, effect in enumerate(model.effects):
            size = level / max(float(lengths[j]), 1e-300)
            if survived[j] >= TESTABLE and effect.start + size <= effect.bounds[1]:
                signal = partial(fixed, model.D[..., j] * size)
                label = f"one effect, λ = {level:g}"
                listed.append(Case(label, model, signal, _OF_AN_EFFECT, effect.name, weight=0.05))
    for label, signal_of in outside(model).items():
        for level in (8.0, 16.0):
            signal = partial(fixed, signal_of * (level / signals.beyond_catalogue(signal_of)))
            asked = ("an effect is claimed", "claimed without the words")
            kind = "mimics" if label.startswith("mimic") else "others"
            listed.append(Case(f"outside, three {kind}, size {level:g}", model, signal, asked, weight=0.5))
    return listed


def ceiling(model: Linear, size: float) -> float:
    """Share of departures that a χ² test of all values notices, at 5 %; it knows the noise, not the shape.

    A claim of a pair for a departure that this test does not notice cannot be told from a true one without
    knowledge of the shape.
    """
    used = int((~middle_session(model.runs)).sum()) * model.prediction.shape[1]
    freedom = used - len(model.coefficients) - 2
    return float(ncx2.sf(chi2.isf(0.05, freedom), freedom, size**2))


Work = list[tuple[Case, int]]


def planned(model: Linear, count: int, first: int) -> Work:
    """Every table: its case and the seed of its noise."""
    todo = [c for c in cases(model) for _ in range(max(round(c.weight * count), 1))]
    return [(c, first + 37 * i) for i, c in enumerate(todo)]


def report(work: Work, results: list[tuple[dict[str, bool], float]]) -> None:
    """Print the table."""
    print(heading("case", "tables", "asked", "share (95 %)"))
    for label in dict.fromkeys(c.label for c, _ in work):
        of = [(c, r) for (c, _), (r, _) in zip(work, results, strict=True) if c.label == label]
        for question in of[0][0].asked:
            hits = sum(r[question] for _, r in of)
            print(row(label, len(of), question, per_cent(hits, len(of))))
    seconds = [s for _, s in results]
    print(f"\nProcessor time of a table: median {np.median(seconds):.1f} s, largest {max(seconds):.1f} s")


def main(count: str = "100", first: str = "0", chosen: str = "") -> None:
    model = stand_in()
    planned_cases = planned(model, int(count), int(first))
    work = [(case, seed) for case, seed in planned_cases if any(word in case.label for word in chosen.split("|"))]
    report(work, in_parallel(closed, work))
    for size in (8.0, 16.0):
        print(f"size {size:g}: a χ² test of all values notices {100 * ceiling(model, size):.0f} %")
