"""Wrong nuisance parameters: fits with their priors taken away, alone and beside an effect.

If the runs pull a nuisance parameter beyond `priors.WRONG`, the fit is made again without its prior. Of several
that the runs cannot tell apart, the one is freed that is off by the fewest of its own standard deviations. If the
fit then leaves no more than noise, the wrong number explains the residual, and no effect is claimed for it. An
effect is claimed only if it fits better than the freed number by more than one parameter can gain by chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from calibration.attribution.candidate import INDISTINGUISHABLE, Candidate
from calibration.attribution.judge import judge
from calibration.statistics.fit import Fit, fit
from calibration.statistics.pulls import pulls, wrong_number
from calibration.statistics.residual_tests import Misfit, examine_residual
from calibration.statistics.score_directions import Directions
from calibration.statistics.study import Study

_MOST = 2  # numbers that may be wrong together
_TRIED = 3  # effects that are fitted once more beside wrong numbers


@dataclass(frozen=True)
class Freed:
    """A fit without the priors of the nuisance parameters that the runs contradict."""

    fit: Fit
    misfit: Misfit


def free_wrong_numbers(study: Study, base: Fit, directions: Directions) -> Freed | None:
    """Free the wrong numbers of `base` and test what is left; None if no number is wrong.

    Args:
        directions: of the effects.
    """
    freed = _without_priors(study, base)
    return None if freed is base else Freed(freed, examine_residual(study, freed, directions))


def beside_wrong_numbers(
    study: Study, base: Fit, candidates: Sequence[Candidate], directions: Directions
) -> list[Candidate]:
    """Refit the most promising effects once more, without the priors of nuisance parameters that they contradict.

    Args:
        directions: of the effects.
    """
    names = [e.name for e in study.model.effects]
    promising = []
    for candidate in candidates:
        if candidate.refit is not None:
            alike = wrong_number(pulls(candidate.refit, study.model.nuisances))
            if alike:
                promising.append((candidate.refit.deviance - alike[0].z ** 2, candidate.effect.name, candidate))
    judged = []
    for _, name, candidate in sorted(promising, key=lambda p: p[:2])[:_TRIED]:
        assert candidate.refit is not None
        refit = _without_priors(study, candidate.refit)
        judged.append(judge(study, candidate, base, refit, directions.without(names.index(name))))
    return judged


def _without_priors(study: Study, fitted: Fit) -> Fit:
    """Fit again without the priors of wrong numbers; the same fit if no number is wrong."""
    while len(fitted.wrong_numbers) < _MOST:
        alike = wrong_number([p for p in pulls(fitted, study.model.nuisances) if not p.freed])
        if not alike:
            break
        wrong = (*fitted.wrong_numbers, alike)
        fitted = fit(study.model, fitted.parameters, fitted.names, study.used, wrong_numbers=wrong, title="")
    return fitted


def beats_number(best: Sequence[Candidate], number: Fit) -> bool:
    """Tell whether the best effect fits better than a wrong number by more than chance."""
    refit = best[0].refit if best else None
    return refit is not None and refit.deviance < number.deviance - INDISTINGUISHABLE


def as_good_as_number(candidates: Sequence[Candidate], number: Fit, level: float) -> list[Candidate]:
    """Return the effects that leave no more than noise and fit as well as a wrong number, best first."""
    near = [
        (c.refit.deviance, place)
        for place, c in enumerate(candidates)
        if c.refit and c.refit.converged and c.refit.deviance < number.deviance + INDISTINGUISHABLE
        if c.refit_misfit and c.refit_misfit.p_value >= level / 2
    ]
    return [candidates[place] for _, place in sorted(near)]
