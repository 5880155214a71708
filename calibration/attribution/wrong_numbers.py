"""A number as given that is wrong: the fit with its prior taken away.

If the runs pull a number beyond `prior.WRONG`, the fit is made again with this number free. Of several that the
runs cannot tell apart, the one is freed that is off by the fewest of its own standard deviations. If what is
left is no more than noise, the number explains the residual, and no effect is claimed for it. An effect is
claimed only if it fits better than a free number by more than one parameter can gain by chance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from calibration.statistics.fit import Fit, fit
from calibration.statistics.forward_model import Model
from calibration.statistics.priors import likeliest, pulls, rivals
from calibration.statistics.residual_tests import Misfit, check_misfit
from calibration.statistics.score_directions import Directions
from sim.arrays import Flags

_MOST = 2  # numbers that may be wrong together


@dataclass(frozen=True)
class Freed:
    """A fit without the priors of the numbers that the runs contradict."""

    fit: Fit
    misfit: Misfit


def free_numbers(model: Model, fitted: Fit, used: Flags) -> Fit:
    """The fit again without the priors of wrong numbers; the same fit if no number is wrong."""
    found = fitted
    while len(found.wrong) < _MOST:
        far = [p for p in pulls(found, model.given) if not p.freed]
        worst = likeliest(far)
        if worst is None:
            break
        wrong = (*found.wrong, rivals(far, worst))
        free = tuple(alike[0].parameter.name for alike in wrong)
        found = replace(fit(model, found.parameters, found.names, used, free=free, title=""), wrong=wrong)
    return found


def freed(
    model: Model, base: Fit, used: Flags, along: Directions, *, level: float, seed: int, draws: int
) -> Freed | None:
    """What is left after the wrong numbers of `base` were freed; None if no number is wrong.

    Args:
        along: directions of the effects.
    """
    found = free_numbers(model, base, used)
    if found is base:
        return None
    return Freed(found, check_misfit(found, model.runs, used, along, level=level, seed=seed, draws=draws))
