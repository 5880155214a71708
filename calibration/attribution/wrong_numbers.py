"""Wrong nuisance parameters: how far the runs pull them, and fits without the priors of those that are wrong.

The pull of a nuisance parameter with prior variance σ² is

    z = x / √(σ² − V),   x its change, V the variance of x after the fit,

which is standard normal if its value was drawn from the prior. Parameters that the runs cannot tell apart (E and
μ0) have the same pull. What the runs alone say of it, with its own prior taken away and the others kept, is
x σ²/(σ² − V), with variance V σ²/(σ² − V). Source: pulls of nuisance parameters as in particle physics, e.g.
Demortier and Lyons (2002).

If the runs pull a nuisance parameter beyond WRONG (`calibration.statistics.fit`), the fit is made again without
its prior. Of several that the runs cannot tell apart, the one is freed that is off by the fewest of its own
standard deviations. If the fit then leaves no more than noise, the wrong number explains the residual, and no
effect is claimed for it. An effect is claimed only if it fits better than the freed number by more than one
parameter can gain by chance. A smaller pull is mentioned only if it is notable among so many (`notable_pull`).

A number that would have to be off by more than is credible (`rules.IMPLAUSIBLE`) does not come ahead of effects
that explain as much. They come first, and the number is named after them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from scipy.special import ndtri

from calibration.attribution.effects import lowest_ebic, measures_of
from calibration.attribution.hypothesis import Evidence, Hypothesis, Origin
from calibration.attribution.rules import INDISTINGUISHABLE, RULES, Trial, judge
from calibration.statistics.budget import skipped
from calibration.statistics.fit import Fit, Pull, UnsolvedError, fit
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.statistical_model import Parameter
from calibration.statistics.study import Study

_NOTABLE = 0.05  # share of tables with nothing wrong whose verdict names a nuisance parameter, at most
_MOST = 2  # numbers that may be wrong together
_TRIED = 3  # effects that are fitted once more beside wrong numbers


def pulls(fitted: Fit, nuisances: Sequence[Parameter]) -> tuple[Pull, ...]:
    """Compute the pull of every nuisance parameter, the farthest first.

    A parameter whose prior was taken away has its value from the runs. One with a grid has no pull: the runs show
    its differences only, as a turn of all courses is another direction of the current.
    """
    computed = []
    for nuisance in nuisances:
        if nuisance.sigma is None or nuisance.grid or nuisance.name not in fitted.names:
            continue
        place = fitted.names.index(nuisance.name)
        x, variance = (float(part[place]) for part in fitted.tested)
        prior = nuisance.sigma**2
        if fitted.fitted[place].sigma is None:
            error = math.sqrt(variance)
            computed.append(Pull(nuisance, x, error, x, error, x / math.sqrt(prior + variance), True))
            continue
        variance = min(variance, prior * (1 - 1e-6))
        learnt = prior - variance
        alone, alone_error = x * prior / learnt, math.sqrt(variance * prior / learnt)
        computed.append(Pull(nuisance, x, math.sqrt(variance), alone, alone_error, x / math.sqrt(learnt), False))
    return tuple(sorted(computed, key=lambda p: -abs(p.z) * p.learnt))


def wrong_number(candidates: Sequence[Pull]) -> tuple[Pull, ...]:
    """Find the parameter that is most likely wrong, and after it those that may be wrong in its place; () if none.

    To take a prior away lowers the deviance by z². Differences below `INDISTINGUISHABLE` are no evidence. So of
    those as far out as the farthest, the one comes first that is off by the fewest of its own standard deviations.
    """
    wrong = [p for p in candidates if p.wrong]
    if not wrong:
        return ()
    farthest = wrong[0]
    likeliest = min((p for p in wrong if farthest.z**2 - p.z**2 < INDISTINGUISHABLE), key=lambda p: p.tolerances)
    alike = [p for p in wrong if p is not likeliest and likeliest.z**2 - p.z**2 < INDISTINGUISHABLE]
    return (likeliest, *sorted(alike, key=lambda p: p.tolerances))


def notable_pull(count: int) -> float:
    """Compute the pull that the farthest of `count` nuisance parameters exceeds by chance in one table in twenty.

    Šidák (1967): the probability is at most that of independent pulls, also where pulls are correlated.
    """
    return float(-ndtri((1 - (1 - _NOTABLE) ** (1 / count)) / 2))


def wrong_number_as_hypothesis(study: Study, base: Fit, tangents: Directions) -> Hypothesis | None:
    """Fit without the priors of wrong numbers, and judge whether they explain the residual; None if none is wrong.

    Args:
        tangents: the directions of the effects.
    """
    freed = without_wrong_priors(study, base)
    if freed is base:
        return None
    off = tuple(p for p in pulls(freed, study.model.nuisances) if p.freed)
    wrong = tuple(alike[0].parameter for alike in freed.wrong_numbers)
    measures = {"remainder": lambda h: examine_residual(study, h.fitted, tangents, decide=study.level)}
    return judge(Hypothesis(Origin.NUMBER, wrong, freed, Evidence(pulls=off)), Trial(study, base, measures), RULES)


def without_wrong_priors(study: Study, fitted: Fit, *, target: float = math.inf) -> Fit:
    """Fit again without the priors of wrong numbers, see `fit`; the same fit if no number is wrong."""
    while len(fitted.wrong_numbers) < _MOST:
        alike = wrong_number([p for p in pulls(fitted, study.model.nuisances) if not p.freed])
        if not alike:
            break
        wrong, used = (*fitted.wrong_numbers, alike), study.split.fitted
        start, names = fitted.parameters, fitted.names
        fitted = fit(study.model, start, names, used, wrong_numbers=wrong, target=target, title="")
    return fitted


def beside_wrong_numbers(
    study: Study, base: Fit, candidates: Sequence[Hypothesis], directions: Directions
) -> list[Hypothesis]:
    """Fit the most promising effects once more, without the priors of nuisance parameters that they contradict.

    An effect beside a wrong number is a pair: its extended BIC must be lower than that of every single effect with
    all priors.
    """
    names, trial = [e.name for e in study.effects], Trial(study, base, single=lowest_ebic(study, candidates))
    promising = []
    for candidate in candidates:
        if candidate.fit is not None and not candidate.fit.stopped:
            alike = wrong_number(pulls(candidate.fit, study.model.nuisances))
            if alike:
                promising.append((candidate.fit.deviance - alike[0].z ** 2, candidate.effect.name, candidate))
    judged = []
    for _, name, candidate in sorted(promising, key=lambda p: p[:2])[:_TRIED]:
        if skipped(f"{candidate.title} beside a wrong number"):
            continue
        target = study.noise_at_most(len(candidate.fitted.names))
        try:
            refit = without_wrong_priors(study, candidate.fitted, target=target)
        except UnsolvedError:
            continue
        measures = measures_of(study, base, directions.without(names.index(name)))
        beside = replace(candidate, origin=Origin.PAIR, fit=refit, evidence=candidate.evidence.of_score())
        judged.append(judge(beside, replace(trial, measures=measures), RULES))
    return judged


def as_good_as_number(candidates: Sequence[Hypothesis], number: Fit, level: float) -> list[Hypothesis]:
    """Return the effects that leave no more than noise and fit as well as a wrong number, best first.

    If the best of them does, so do those that cannot be told from it.
    """
    near = sorted(
        (c.fit.deviance, index)
        for index, c in enumerate(candidates)
        if c.fit and c.fit.converged and c.evidence.remainder and c.evidence.remainder.p_value >= level / 2
    )
    if not near or near[0][0] >= number.deviance + INDISTINGUISHABLE:
        return []
    most = max(number.deviance, near[0][0]) + INDISTINGUISHABLE
    return [candidates[index] for deviance, index in near if deviance < most]
