"""Missing physics named by information criteria, stepwise and sparse regression.

Every way fits the coefficients, the nuisance parameters with their priors, and a set of effects to the runs that
are not held out, by generalised least squares with the same noise. What differs is which set is taken:

    best AIC, best BIC, EBIC    the least deviance + cost over no effect, every single one and every pair
    stepwise                    one more effect as long as BIC falls
    identification              localised residual, sparse regression on a library, F tests on the other half of
                                the repeats (`benchmarks.calibration.sparse_identification`)
    generic correction          none; a regression of the outputs on the inputs

Tables are those of the linear stand-in (`benchmarks.calibration.false_claims`). A claim is wrong if the truth is
not among the sets that are named. "Error" is the median of that on the held-out runs over the noise of a run.

Usage: python -m benchmarks model_selection [TABLES] [FIRST_SEED]      a table on the screen

Takes 10 minutes of one core.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from benchmarks.calibration.false_claims import Case, cases
from benchmarks.calibration.planted import Linear, measured, stand_in
from benchmarks.calibration.sparse_identification import identify
from benchmarks.markdown import heading, row
from benchmarks.parallel import in_parallel
from benchmarks.proportions import per_cent
from calibration.statistics.fit import Fit, fit
from calibration.statistics.held_out import errors
from calibration.statistics.residual_regression import regress_residual
from calibration.statistics.residual_tests import TESTABLE
from calibration.statistics.statistical_model import repeat_covariance, start_values
from calibration.statistics.study import middle_session
from calibration.verdict.calibrate import calibrate
from sim.arrays import Floats

KINDS = {
    "numbers drawn from their priors": "nothing is missing",
    "one effect, λ = 8": "one effect, λ = 8",
    "one effect, λ = 4": "one effect, λ = 4",
    "outside, three mimics, size 16": "outside the catalogue",
    "outside, three others, size 16": "outside the catalogue",
}
_MOST = 4  # effects of the stepwise way


@dataclass(frozen=True)
class Found:
    """What one way made of a table."""

    claims: tuple[
        frozenset[str], ...
    ]  # sets of effects, each of which may be the truth; the procedure may name several
    error: float  # on the held-out runs, over the noise


class _Sets:
    """Fits with sets of effects, each made once."""

    def __init__(self, model: Linear):
        self.model, self.locked = model, middle_session(model.runs)
        self.used = ~self.locked
        self.common = tuple(p.name for p in (*model.coefficients, *model.nuisances))
        run = repeat_covariance(model.runs.y, model.runs.condition)
        self.noise = float(np.sqrt(np.trace(run) / len(run)))
        self.values = int(self.used.sum()) * model.prediction.shape[1]
        self.names = [e.name for e in model.effects]
        self._fits: dict[frozenset[str], Fit] = {}

    def fit(self, effects: frozenset[str]) -> Fit:
        if effects not in self._fits:
            names = (*self.common, *sorted(effects))
            self._fits[effects] = fit(self.model, start_values(self.model), names, self.used, title="")
        return self._fits[effects]

    def cost(self, effects: frozenset[str], way: str) -> float:
        count = len(effects)
        deviance = self.fit(effects).deviance
        if way == "best AIC":
            return deviance + 2 * count
        sets = math.comb(len(self.names), count) if way == "EBIC" else 1
        return deviance + count * math.log(self.values) + 2 * math.log(sets)

    def error(self, prediction: Floats) -> float:
        return errors(self.model.runs, prediction, self.locked)[0] / self.noise


def ways(model: Linear) -> dict[str, Found]:
    """Every way on one table."""
    sets = _Sets(model)
    testable = [n for n, s in zip(sets.names, _survived(sets), strict=True) if s >= TESTABLE]
    every = [frozenset(c) for count in (0, 1, 2) for c in itertools.combinations(testable, count)]
    results = {}
    for way in ("best AIC", "best BIC", "EBIC"):
        best = min(every, key=lambda effects: sets.cost(effects, way))
        results[way] = Found(_claims(best), sets.error(sets.fit(best).prediction))
    taken: frozenset[str] = frozenset()
    while len(taken) < _MOST:
        best = min((taken | {n} for n in testable if n not in taken), key=lambda e: sets.cost(e, "stepwise"))
        if sets.cost(best, "stepwise") >= sets.cost(taken, "stepwise"):
            break
        taken = best
    results["stepwise"] = Found(_claims(taken), sets.error(sets.fit(taken).prediction))
    identified = identify(model, sets.used, testable)
    results["identification"] = Found(_claims(identified), sets.error(sets.fit(identified).prediction))
    base = sets.fit(frozenset()).prediction
    generic = base + regress_residual(model.runs, base, sets.used).correction
    results["generic correction"] = Found((), sets.error(generic))
    verdict = calibrate(model, progress=False)
    named = tuple(
        frozenset(e.name for e in c.claimed) for c in (*verdict.explaining, *verdict.evidence.rival_effects)
    )
    results["this procedure"] = Found(named, verdict.error_after / verdict.noise_ceiling)
    return results


def _claims(effects: frozenset[str]) -> tuple[frozenset[str], ...]:
    return (effects,) if effects else ()


def _survived(sets: _Sets) -> Floats:
    """Share of every effect that coefficients leave, (e,); nuisance parameters are kept at their values."""
    model = sets.model
    white = np.linalg.qr(model.J[sets.used].reshape(-1, model.J.shape[-1]))[0]
    D = model.D[sets.used].reshape(-1, model.D.shape[-1])
    unabsorbed = D - white @ (white.T @ D)
    return np.asarray(np.linalg.norm(unabsorbed, axis=0) / np.maximum(np.linalg.norm(D, axis=0), 1e-300))


def compared(case: Case, seed: int) -> dict[str, Found]:
    """Apply every method to one table."""
    return ways(measured(case.model, case.signal(seed), seed))


def main(count: str = "30", first: str = "0") -> None:
    todo = [c for c in cases(stand_in()) if c.label in KINDS]
    share = {kind: sum(KINDS[c.label] == kind for c in todo) for kind in KINDS.values()}
    work = [(c, s) for c in todo for s in range(max(int(count) // share[KINDS[c.label]], 1))]
    results = in_parallel(compared, [(c, int(first) + 37 * i) for i, (c, _) in enumerate(work)])
    print(heading("tables", "way", "named right", "wrong claim", "error / noise"))
    for kind in share:
        of = [(c, r) for (c, _), r in zip(work, results, strict=True) if KINDS[c.label] == kind]
        for way in of[0][1]:
            truths = [frozenset({c.truth}) if c.truth else None for c, _ in of]
            claims = [r[way].claims for _, r in of]
            right = sum(t is not None and c == (t,) for t, c in zip(truths, claims, strict=True))
            wrong = sum(bool(c) and t not in c for t, c in zip(truths, claims, strict=True))
            error = float(np.median([r[way].error for _, r in of]))
            named = per_cent(right, len(of)) if any(truths) else ""
            print(row(f"{kind}, {len(of)}", way, named, per_cent(wrong, len(of)), f"{error:.2f}"))
