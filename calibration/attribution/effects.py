"""Which effects explain the residual: single ones and pairs, refitted and judged.

Every effect that the runs can test is a candidate. If its score exceeds the critical |z|
(`calibration.statistics.residual_tests`), with a sign that its bounds allow, the effect is fitted together with
the coefficients, and judged by `calibration.attribution.rules`.

Scores hold near the fit only. Where a fit did not converge, they are those of the rough model, if there is one. If
a coefficient ran to an end of its range because an effect is missing, scores say nothing. Then every effect is
fitted, starting from the model as given.

Kept effects cannot be told apart if their deviances differ by less than one parameter can gain by chance (6.63).
If no single effect is kept, a second one is looked for beside each of the best few.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from calibration.attribution.hypothesis import Evidence, Hypothesis, Origin, Reason
from calibration.attribution.left_out import session_gain
from calibration.attribution.rules import INDISTINGUISHABLE, RULES, Stage, Trial, judge
from calibration.statistics.budget import clock, skipped
from calibration.statistics.fit import Fit, UnsolvedError, fit
from calibration.statistics.residual_tests import Directions, Misfit, directions, examine_residual
from calibration.statistics.statistical_model import ForwardModel, Parameter, Parameters, start_values
from calibration.statistics.study import Study
from common.errors import InputError
from common.progress import progress_bar

FIRST = 3  # number of single effects to which a second one is added
_DRAWS = 400  # of the bootstrap, for the residual that an effect leaves
_NOT_YET = (0.9, 0.8, 0.7)  # shares of a size, so that nobody knows its prediction yet
_SHORTEST = 1e-3  # s: what a prediction takes at least, as a clock is no finer
_MARGIN = 0.01  # share of the range of a number that is its end


def scores(
    study: Study, fitted: Fit, effects: Sequence[Parameter], tangents: Directions, misfit: Misfit | None = None
) -> tuple[Misfit, Fit]:
    """Test the residual of a fit where its scores hold, and return the fit there: of a rough model if it is far.

    Args:
        tangents: directions of the effects at the fit.
        misfit: of the fit, if it is at hand.
    """
    rough = getattr(study.model, "rough", None)
    if rough is None or not fitted.far:
        return misfit or examine_residual(study, fitted, tangents), fitted
    used, wrong = study.split.fitted, fitted.wrong_numbers
    near = fit(rough, fitted.parameters, fitted.names, used, wrong_numbers=wrong, title="")
    tangents = directions(rough, near.parameters, effects, quick=True)
    return examine_residual(replace(study, model=rough), near, tangents), near


def scored(
    misfit: Misfit, base: Fit, effects: Sequence[Parameter], threshold: float, beside: tuple[Parameter, ...] = ()
) -> list[Hypothesis]:
    """Describe every effect by its score alone; a claim needs a |z| above `threshold`."""
    scores = misfit.scores
    length = np.maximum(scores.length, 1e-300)
    return [
        Hypothesis(
            Origin.PAIR if beside else Origin.EFFECT,
            (*beside, effect),
            evidence=Evidence(
                score=float(scores.z[j]),
                survived=float(scores.survived[j]),
                detectable=threshold / float(length[j]),
                detectable_exact=threshold / max(float(misfit.exact_length[j]), 1e-300),
                expected=base.parameters[effect.name] + float(scores.z[j] / length[j]),
            ),
        )
        for j, effect in enumerate(effects)
    ]


def explaining(candidates: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return the kept effects that the runs cannot tell from the best one, best first."""
    kept = sorted((c for c in candidates if c.kept), key=penalised_deviance)
    return [c for c in kept if penalised_deviance(c) - penalised_deviance(kept[0]) < INDISTINGUISHABLE]


def penalised_deviance(candidate: Hypothesis) -> float:
    """Return the deviance of a fit plus what second numbers cost, because each may gain as much by chance."""
    seconds = sum(e.second is not None for e in candidate.added)
    return candidate.fitted.deviance + INDISTINGUISHABLE * seconds


def examine(
    study: Study,
    base: Fit,
    misfit: Misfit,
    directions: Directions,
    *,
    threshold: float | None = None,
    near: Fit | None = None,
    beside: tuple[Parameter, ...] = (),
    single: float = math.inf,
    after_first: Callable[[int, float], None] | None = None,
) -> list[Hypothesis]:
    """Fit and judge every effect that is not in the model yet, best score first.

    Args:
        base: the fit without them.
        misfit: of its residual, or of that of `near`.
        directions: of the effects at `base`.
        threshold: |z| that a fit needs; the critical one of `misfit` if not given.
        near: the fit whose scores they are (`scores`), by default `base`.
        beside: effects that `base` has already.
        single: extended BIC of the best single effect, which a pair must not cost.
        after_first: is told, after the first fit, how many there are, and how much processor time all may take.
    """
    needed = misfit.critical_z if threshold is None else threshold
    effects = [e for e in study.effects if e not in beside]
    near = near or base
    local = coefficients_within_range(study.model, near.parameters)
    testable = misfit.scores.survived >= study.model.runs.least_surviving
    largest = float(np.max(np.abs(misfit.scores.z), where=testable, initial=0.0))
    trial = Trial(study, base, {}, needed, largest, study.noise_at_most(len(base.names)), single)
    candidates = scored(misfit, near, effects, needed, beside)
    if local:
        candidates = [judge(candidate, trial, RULES, Stage.SCORE) for candidate in candidates]
    examined = []
    title = " ".join(("effects", *(f"beside {e.title}" for e in beside)))
    order = np.argsort(-np.abs(misfit.scores.z)).tolist()
    with progress_bar(title, unit="effect", total=len(order), disable=not study.progress) as bar:
        for j in order:
            candidate, began = candidates[j], clock()
            if candidate.reason is Reason.NOT_NEEDED:
                bar.set_postfix_str(candidate.title, refresh=False)
                candidate = _fitted(study, near, candidate, float(misfit.second[j]), local=local)
                if candidate.fit:
                    measures = measures_of(study, base, directions.without(j))
                    candidate = judge(candidate, replace(trial, measures=measures), RULES)
                if candidate.fit and after_first:
                    of_first, first = clock() - began, _cost(study, near, candidate)
                    costs = [_cost(study, near, c) for c in candidates if c.reason is Reason.NOT_NEEDED]
                    after_first(len(costs), of_first * sum(costs) / first)
                    after_first = None
            examined.append(candidate)
            bar.update()
    return with_look_alikes(examined)


def _cost(study: Study, near: Fit, candidate: Hypothesis) -> float:
    """Measure the processor time of a prediction with an effect [s]; all effects need about as many of them.

    It is the least of some, since on a busy machine a function of one's own seems to wait. A robot that cannot be
    simulated costs what it took to notice.
    """
    size, (low, high) = candidate.evidence.expected or candidate.effect.typical, candidate.effect.bounds
    least = math.inf
    for share in _NOT_YET:
        began = clock()
        with suppress(InputError):
            study.model.predict([{**near.parameters, candidate.effect.name: min(max(share * size, low), high)}])
        least = min(least, clock() - began)
    return least + _SHORTEST


def with_look_alikes(examined: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Keep effects that fit as well as a kept one, and miss its gain over left-out sessions by chance."""
    best = min((penalised_deviance(c) for c in examined if c.kept), default=-math.inf)
    return [
        replace(c, reason=Reason.KEPT)
        if c.reason is Reason.NOT_PREDICTIVE and penalised_deviance(c) - best < INDISTINGUISHABLE
        else c
        for c in examined
    ]


def _fitted(study: Study, base: Fit, candidate: Hypothesis, second: float, *, local: bool) -> Hypothesis:
    """Fit an effect from where its score points to, or from the model as given where scores say nothing.

    Args:
        second: value of its second number at its score.
        local: whether scores say something.
    """
    effect, expected, beside = candidate.effect, candidate.evidence.expected, candidate.added[:-1]
    assert expected is not None
    if skipped(f"a second effect beside {beside[0].title}" if beside else effect.title):
        return replace(candidate, reason=Reason.NO_TIME)
    guess = expected if local else effect.start
    size = {effect.name: min(max(guess, effect.bounds[0]), effect.bounds[1])}
    if effect.second is not None:
        size[effect.second.name] = second if local else effect.second.start
    start = {**(base.parameters if local else start_values(study.model)), **size}
    names = (*base.names, *size)
    target = study.noise_at_most(len(names))
    try:
        refit = fit(study.model, start, names, study.split.fitted, target=target, title="")
    except UnsolvedError:
        return replace(candidate, reason=Reason.NOT_SOLVED)
    return replace(candidate, fit=refit)


def measures_of(study: Study, base: Fit, others: Directions) -> dict[str, Callable[[Hypothesis], Any]]:
    """Say how the evidence about a fitted effect is measured, in view of the directions of all `others`."""
    return {
        "remainder": lambda h: examine_residual(
            replace(study, seed=study.seed + 1), h.fitted, others, draws=_DRAWS, decide=study.level / 2
        ),
        "session_gain": lambda h: session_gain(study, base, h.fitted),
        "cost": lambda h: ebic(study, h.fitted, len(h.added) + len(h.fitted.wrong_numbers)),
    }


def coefficients_within_range(model: ForwardModel, fitted: Parameters) -> bool:
    """Tell whether no coefficient ran to an end of its range."""
    return all(low < fitted[p.name] < high for p in model.coefficients for low, high in [_within(p)])


def _within(number: Parameter) -> tuple[float, float]:
    """Return the range of a number less its ends."""
    low, high = number.bounds
    margin = _MARGIN * (high - low)
    return (1.5 * low, high / 1.5) if number.logarithmic else (low + margin, high - margin)


def pairs(study: Study, candidates: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Add second effects to the best fits with a single one; of those kept each is worth more than one effect."""
    again = replace(study, seed=study.seed + 2)
    title = "second effects" if study.progress else ""
    single, second = lowest_ebic(study, candidates), []
    for first in sorted((c for c in candidates if c.fit), key=penalised_deviance)[:FIRST]:
        if skipped(f"a second effect beside {first.title}"):
            continue
        others = [e for e in study.effects if e.name != first.effect.name]
        tangents = directions(study.model, first.fitted.parameters, others, title=title, quick=True)
        misfit, near = scores(again, first.fitted, others, tangents)
        second += examine(again, first.fitted, misfit, tangents, near=near, beside=first.added, single=single)
    judged: dict[frozenset[str], Hypothesis] = {}
    for pair in second:  # each is met from both sides
        names = frozenset(e.name for e in pair.added)
        if names not in judged or (pair.kept and not judged[names].kept):
            judged[names] = pair
    return list(judged.values())


def lowest_ebic(study: Study, candidates: Sequence[Hypothesis]) -> float:
    """Return the lowest extended BIC of a single effect that was fitted; infinity if none was."""
    return min((ebic(study, c.fit, 1) for c in candidates if c.fit), default=math.inf)


def ebic(study: Study, refit: Fit, count: int) -> float:
    """Add to the deviance of a fit with `count` effects what they cost: k ln n + 2 ln (number of such sets).

    A nuisance parameter that lost its prior counts once more among the k numbers.

    Source: Chen and Chen (2008), γ = 1.
    """
    sets = max(math.comb(len(study.effects), count), 1)  # a number may stand for an effect
    numbers = len(refit.names) + len(refit.wrong_numbers)
    return refit.deviance + numbers * math.log(study.values) + 2 * math.log(sets)
