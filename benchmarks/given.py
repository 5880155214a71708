"""False physics from numbers as given that are off, and from what is outside the catalogue.

The whole procedure on tables of the linear stand-in (`benchmarks.planted`). "Numbers exact" is the same procedure
with every number as given taken at its word.

Usage: python -m benchmarks.given [TABLES]      a table on the screen
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from joblib import Parallel, delayed

from benchmarks.operating import per_cent
from benchmarks.planted import Linear, Signals, outside, scatter, stand_in
from calibration.loop import Verdict, calibrate
from calibration.misfit import TESTABLE
from calibration.model import Parameter
from sim.arrays import Floats
from sim.motion.batches import available_jobs

STIFFNESS = "youngs_modulus"
_COVERED = "interval covers E"


@dataclass(frozen=True)
class Case:
    """A truth, and what is asked of the verdicts on it."""

    label: str
    model: Linear
    signal: Callable[[int], Floats]  # of a seed, (n, k)
    asked: tuple[str, ...]
    truth: str = ""


def claims(verdict: Verdict, case: Case) -> dict[str, bool]:
    """Every question that can be asked of a verdict."""
    sets = [{e.name for e in c.claimed} for c in verdict.explaining]
    doubted = any(c.doubted for c in verdict.explaining)
    found = {
        "an effect is claimed": bool(sets),
        "claimed without the words": bool(sets) and not doubted,
        "a number is wrong": verdict.verdict == "number",
        "named, or in the set": {case.truth} in sets,
        "another effect": bool(sets) and {case.truth} not in sets,
    }
    if STIFFNESS in verdict.base.names:
        low, high = verdict.base.interval(STIFFNESS)
        true = case.model.given[0].start * math.exp(_shift(case.label))
        found[_COVERED] = low <= true <= high
    return found


def _shift(label: str) -> float:
    return math.log(0.8) if "20 %" in label else math.log(0.6) if "40 %" in label else 0.0


def one(case: Case, seed: int) -> dict[str, bool]:
    """A table, closed."""
    model = case.model
    y = model.prediction + case.signal(seed) + scatter(model.runs, model.prediction.shape[1], seed)
    return claims(calibrate(replace(model, runs=replace(model.runs, y=y)), progress=False), case)


def drawn(G: Floats, given: tuple[Parameter, ...], seed: int) -> Floats:
    """Numbers off by one draw of their priors."""
    sigma = np.array([p.sigma for p in given], dtype=float)
    return np.asarray(G @ (np.random.default_rng(10_000 + seed).normal(size=len(sigma)) * sigma))


def fixed(signal: Floats, seed: int) -> Floats:
    """The same for every seed."""
    return signal


def restated(model: Linear, sigmas: dict[str, float]) -> Linear:
    """The same with other standard deviations; numbers with none are exact."""
    given = tuple(replace(p, sigma=sigmas[p.name]) for p in model.given if sigmas.get(p.name))
    keep = [i for i, p in enumerate(model.given) if sigmas.get(p.name)]
    return replace(model, given=given, G=model.G[..., keep])


def cases(model: Linear) -> list[Case]:
    """All of them."""
    own = {p.name: float(p.sigma or 0.0) for p in model.given}
    exact = restated(model, {})
    place = [p.name for p in model.given].index(STIFFNESS)
    softer, softest = (partial(fixed, model.G[..., place] * math.log(s)) for s in (0.8, 0.6))
    draw = partial(drawn, model.G, model.given)
    tight = {"numbers of the table only": {k: own[k] for k in ("camera_scale", "heading_zero", "tachometer")}}
    alone = restated(model, {**own, STIFFNESS: 0.03})
    all_of = restated(model, {**tight["numbers of the table only"], STIFFNESS: 0.03})
    both = ("an effect is claimed", "a number is wrong")
    found = [
        Case("numbers drawn from their priors", model, draw, both),
        Case("the same, numbers exact", exact, draw, both[:1]),
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
                asked = ("named, or in the set", "another effect")
                found.append(Case(f"one effect, λ = {level:g}", model, signal, asked, effect.name))
    for label, signal_of in outside(model).items():
        for level in (8.0, 16.0):
            signal = partial(fixed, signal_of * (level / signals.beyond_catalogue(signal_of)))
            asked = ("an effect is claimed", "claimed without the words")
            kind = "mimics" if label.startswith("mimic") else "others"
            found.append(Case(f"outside, three {kind}, size {level:g}", model, signal, asked))
    return found


def main(count: str = "60") -> None:
    tables = int(count)
    todo = cases(stand_in())
    sharing = {c.label: sum(d.label == c.label for d in todo) for c in todo}
    work = [(c, s) for c in todo for s in range(max(tables // sharing[c.label], 1))]
    parallel = Parallel(n_jobs=available_jobs(), verbose=1)
    results = parallel(delayed(one)(c, 37 * i) for i, (c, _) in enumerate(work))
    print("| case | tables | asked | share (95 %) |\n|---|---|---|---|")
    for label in sharing:
        of = [(c, r) for (c, _), r in zip(work, results, strict=True) if c.label == label]
        for question in of[0][0].asked:
            hits = sum(r[question] for _, r in of)
            print(f"| {label} | {len(of)} | {question} | {per_cent(hits, len(of))} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
