"""The explanation of a table: the calibrated model, its residual, and the effects that explain it.

1. The coefficients and the nuisance parameters are fitted, and the residual is tested.
2. A nuisance parameter that leaves its prior is freed, and comes ahead of every effect
   (`calibration.attribution.wrong_numbers`).
3. Single effects (`calibration.attribution.single_effects`), then effects beside a wrong number, then pairs
   (`calibration.attribution.pairs`); each only if nothing before explains the residual.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calibration.attribution.candidate import INDISTINGUISHABLE, Candidate, explaining, unexamined
from calibration.attribution.doubts import with_doubts
from calibration.attribution.pairs import FIRST, pairs
from calibration.attribution.single_effects import examine
from calibration.attribution.wrong_numbers import (
    as_good_as_number,
    beats_number,
    beside_wrong_numbers,
    free_wrong_numbers,
)
from calibration.statistics.fit import Fit, fit
from calibration.statistics.residual_tests import TESTABLE, Misfit, examine_residual
from calibration.statistics.score_directions import directions
from calibration.statistics.study import Study


@dataclass(frozen=True)
class Explained:
    """The fit without effects, its residual, and what explains the residual."""

    base: Fit
    misfit: Misfit  # of the base
    candidates: tuple[Candidate, ...]
    best: tuple[Candidate, ...] = ()  # what explains the residual, best first; more than one: not told apart
    number: Fit | None = None  # the fit with a wrong nuisance parameter freed, if that explains the residual
    rival_effects: tuple[Candidate, ...] = ()  # effects that explain as much as the wrong number does

    @property
    def final(self) -> Fit:
        """The model with the effects of the verdict, or without any."""
        if self.best and self.best[0].refit:
            return self.best[0].refit
        return self.number or self.base

    @property
    def rivals(self) -> tuple[tuple[str, Fit], ...]:
        """Explanations that the runs cannot tell apart, in words, best first; none if there are not two."""
        known = [(c.title, c.refit) for c in (*self.best, *self.rival_effects) if c.refit]
        if self.number and self.rival_effects:
            wrong = ", ".join(alike[0].parameter.title for alike in self.number.wrong_numbers)
            known = [(f"{wrong} as given is wrong", self.number), *known]
        return tuple(known) if len(known) > 1 else ()


def explain(study: Study, guess: Mapping[str, float]) -> Explained:
    """Fit the model, test the residual, and look for what explains it, from the simplest to the least simple.

    Args:
        guess: where the fit starts.
    """
    model, level = study.model, study.level
    began = time.monotonic()
    names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
    base = fit(model, guess, names, study.used, title=study.title("fit"))
    fitted = time.monotonic()
    along = directions(model, base.parameters, model.effects, title=study.title("derivatives"))
    derived = time.monotonic()
    misfit = examine_residual(study, base, along)
    freed = free_wrong_numbers(study, base, along)
    if misfit.p_value >= level and freed is None:
        return Explained(base, misfit, tuple(unexamined(misfit, model.effects, misfit.critical_z)))
    threshold = misfit.critical_z
    if freed is not None:  # every effect that may explain as much as the wrong number does
        gain = base.deviance - freed.fit.deviance
        threshold = min(threshold, math.sqrt(max(gain - INDISTINGUISHABLE, 1.0)))
    if study.progress:
        print(_forecast(misfit, threshold, fitted - began, derived - fitted), file=sys.stderr)
    candidates = examine(study, base, misfit, along, threshold=threshold)
    best = explaining(candidates)
    number_explains = freed is not None and (misfit.p_value >= level or freed.misfit.p_value >= level)
    if freed is not None and number_explains and not beats_number(best, freed.fit):
        rival_effects = tuple(as_good_as_number(candidates, freed.fit, level))
        return Explained(base, misfit, tuple(candidates), (), freed.fit, rival_effects)
    best = (
        best
        or explaining(beside_wrong_numbers(study, base, candidates, along))
        or explaining(pairs(study, candidates))
    )
    return Explained(base, misfit, tuple(candidates), tuple(with_doubts(study, best, base)))


def _forecast(misfit: Misfit, threshold: float, seconds_of_fit: float, seconds_of_directions: float) -> str:
    """Say how long the effects will take, by how long the first fit and the derivatives took."""
    scores = misfit.scores
    count = int(((np.abs(scores.z) >= threshold) & (scores.survived >= TESTABLE)).sum())
    single = count * seconds_of_fit
    pairs_at_most = FIRST * (seconds_of_directions + single)
    return (
        f"there is more than noise: {count} effects to fit, about {_duration(single)}; if none of them explains "
        f"the runs, pairs follow, {_duration(pairs_at_most)} at most, mostly much less"
    )


def _duration(seconds: float) -> str:
    return f"{max(seconds, 1):.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
