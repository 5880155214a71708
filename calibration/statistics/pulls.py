"""Pulls: how far the runs move the nuisance parameters, and which of these may be wrong.

The pull of a nuisance parameter with prior variance σ² is

    z = x / √(σ² − V),   x its change, V the variance of x after the fit,

which is standard normal if its value was drawn from the prior. Parameters that the runs cannot tell apart (E and
μ0) have the same pull. What the runs alone say of it, with its own prior taken away and the others kept, is
x σ²/(σ² − V), with variance V σ²/(σ² − V). Source: pulls of nuisance parameters as in particle physics, e.g.
Demortier and Lyons (2002).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from calibration.statistics.fit import Fit
from calibration.statistics.forward_model import Parameter
from calibration.statistics.priors import Pull, change

_ALIKE = 6.63  # χ² with one degree of freedom, 99 %


def pulls(fitted: Fit, nuisances: Sequence[Parameter]) -> tuple[Pull, ...]:
    """Compute the pull of every nuisance parameter, the farthest first.

    A parameter whose prior was taken away has its value from the runs.
    """
    computed = []
    for nuisance in nuisances:
        if nuisance.sigma is None or nuisance.name not in fitted.names:
            continue
        place = fitted.names.index(nuisance.name)
        variance = fitted.covariance[place, place] / fitted.inflation
        x, prior = change(nuisance, fitted.parameters[nuisance.name]), nuisance.sigma**2
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
    """Find the parameter that is most likely wrong, and after it those that may be wrong in its place.

    To take a prior away lowers the deviance by z². Differences below `_ALIKE` are no evidence. So of those as far
    out as the farthest, the one comes first that is off by the fewest of its own standard deviations.

    Returns:
        Nothing if no parameter is wrong.
    """
    wrong = [p for p in candidates if p.wrong]
    if not wrong:
        return ()
    farthest = wrong[0]
    likeliest = min((p for p in wrong if farthest.z**2 - p.z**2 < _ALIKE), key=_standardised_change)
    alike = [p for p in wrong if p is not likeliest and likeliest.z**2 - p.z**2 < _ALIKE]
    return (likeliest, *sorted(alike, key=_standardised_change))


def _standardised_change(pull: Pull) -> float:
    assert pull.parameter.sigma is not None
    return abs(pull.alone) / pull.parameter.sigma
