"""Which single effect explains the residual: candidates and their refits.

Every effect that the runs can test is a candidate. If its score exceeds the critical |z|
(`calibration.statistics.residual_tests`), with a sign that its bounds allow, the effect is fitted together with
the coefficients and judged (`calibration.attribution.judge`).

Scores hold near the fit only. If a coefficient ran to an end of its range because an effect is missing, scores say
nothing. Then every effect is fitted, starting from the model as given.

Kept effects cannot be told apart if their deviances differ by less than one parameter can gain by chance (6.63).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from tqdm import tqdm

from calibration.attribution.candidate import UNSEEN, Candidate, unexamined
from calibration.attribution.judge import judge
from calibration.statistics.fit import Fit, fit
from calibration.statistics.forward_model import ForwardModel, Parameter, Parameters
from calibration.statistics.residual_tests import TESTABLE, Misfit
from calibration.statistics.score_directions import Directions
from calibration.statistics.study import Study

_CURVED = 0.3  # share of the best score's z² below which an effect is not refitted if it leaves too much
_FAR = 6.0  # standard deviations of χ²


def examine(
    study: Study,
    base: Fit,
    misfit: Misfit,
    directions: Directions,
    *,
    threshold: float | None = None,
    beside: tuple[Parameter, ...] = (),
) -> list[Candidate]:
    """Refit and judge every effect that is not in the model yet, best score first.

    Args:
        base: the fit without them.
        misfit: of its residual.
        directions: of the effects there.
        threshold: |z| that a refit needs; the critical one of `misfit` if not given.
        beside: effects that `base` has already.
    """
    needed = misfit.critical_z if threshold is None else threshold
    effects = [e for e in study.model.effects if e not in beside]
    local = coefficients_within_range(study.model, base.parameters)
    scored = unexamined(misfit, effects, needed, beside)
    examined = []
    title = " ".join(("effects", *(f"beside {e.title}" for e in beside)))
    order = np.argsort(-np.abs(misfit.scores.z)).tolist()
    for j in tqdm(order, desc=title, unit="effect", delay=1.0, disable=not study.progress):
        effect, candidate = effects[j], scored[j]
        guess = effect.start
        if local:
            guess = base.parameters[effect.name] + candidate.z / max(float(misfit.scores.length[j]), 1e-300)
            reason = _reason_not_to_refit(study, candidate, base, misfit, guess, needed)
            if reason:
                examined.append(replace(candidate, verdict=reason))
                continue
        size = {effect.name: min(max(guess, effect.bounds[0]), effect.bounds[1])}
        if effect.second is not None:
            size[effect.second.name] = float(misfit.second[j]) if local else effect.second.start
        start = {**(base.parameters if local else study.start), **size}
        refit = fit(study.model, start, (*base.names, *size), study.used, title="")
        examined.append(judge(study, candidate, base, refit, directions.without(j)))
    return examined


def _reason_not_to_refit(
    study: Study, candidate: Candidate, base: Fit, misfit: Misfit, guess: float, needed: float
) -> str:
    """Say why an effect with this score and the size `guess` is not worth a refit; empty if it is."""
    effect, z = candidate.effect, candidate.z
    low, high = effect.bounds
    if candidate.detectable > UNSEEN:
        return "it changes nothing in these runs"
    if candidate.survived < TESTABLE:
        return "the coefficients absorb it: not testable with these runs"
    if abs(z) < needed:
        return "score within the noise"
    if not low <= guess <= high and (guess < low) == (effect.start == low):
        return "its score has a sign that the effect cannot have"
    # A refit takes z² from the deviance if the model is linear. `_CURVED` allows for its curvature.
    freedom = int(study.used.sum()) * base.prediction.shape[1] - len(base.names)
    remainder = base.deviance - z**2 / _CURVED - freedom
    best = float(np.max(np.where(misfit.scores.survived >= TESTABLE, misfit.scores.z**2, 0.0)))
    if z**2 < _CURVED * best and remainder > _FAR * math.sqrt(2 * freedom):
        return "leaves far more than noise, by its score"
    return ""


def coefficients_within_range(model: ForwardModel, fitted: Parameters) -> bool:
    """Tell whether no coefficient ran to an end of its range."""
    return all(1.5 * p.bounds[0] < fitted[p.name] < p.bounds[1] / 1.5 for p in model.coefficients)
