"""The judgement on an effect that was refitted. It is kept if

the fit converged,
the residual that it leaves passes the general tests and the scores of all other effects (at half of the
level, so that a true effect is not lost too often),
its interval excludes the null, and
it predicts left-out sessions better, by more than the uncertainty of that gain.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from calibration.attribution.candidate import Candidate
from calibration.statistics.fit import Fit
from calibration.statistics.forward_model import Parameter, Runs
from calibration.statistics.priors import prior_rows
from calibration.statistics.residual_tests import examine_residual
from calibration.statistics.score_directions import Directions
from calibration.statistics.splits import groups, leave_one_group_out
from calibration.statistics.study import Study
from sim.arrays import Flags, Floats

_DRAWS = 400  # of the bootstrap, for the residual that an effect leaves


def judge(study: Study, candidate: Candidate, base: Fit, refit: Fit, others: Directions) -> Candidate:
    """Add to a candidate its refit, and the reason why that is kept or not.

    Args:
        base: the fit without the effect.
        others: directions of all other effects.
    """
    again = study.reseeded(1)
    after = examine_residual(again, refit, others, draws=_DRAWS, decide=study.level / 2)
    gain, error = _session_gain(study, base, refit)
    low, high = interval_at_second(refit, candidate.effect)
    verdict = "kept"
    if not refit.converged:
        verdict = "its fit did not converge"
    elif after.p_value < study.level / 2:
        verdict = f"leaves a residual (p ≤ {after.p_value:.1g})"
    elif low <= candidate.effect.start <= high:
        verdict = "its interval includes the null"
    elif gain <= error:
        verdict = "does not predict left-out sessions better"
    return replace(candidate, refit=refit, refit_misfit=after, gain=gain, gain_error=error, verdict=verdict)


def interval_at_second(refit: Fit, effect: Parameter) -> tuple[float, float]:
    """Compute the 95 % interval of an effect, with its second number as it was fitted.

    A weak effect's size and second number cannot be told apart, and the interval over both would hold the null.
    """
    if effect.second is None:
        return refit.interval(effect.name)
    i, j = refit.names.index(effect.name), refit.names.index(effect.second.name)
    V = refit.covariance
    share = 1 - V[i, j] ** 2 / (V[i, i] * V[j, j])
    half = refit.half_width(i) * math.sqrt(max(share, 0.0))
    return refit.parameters[effect.name] - half, refit.parameters[effect.name] + half


def _session_gain(study: Study, base: Fit, refit: Fit) -> tuple[float, float]:
    """Sum the gain in log likelihood over left-out sessions, with its standard error (linearised refits).

    With whitened residuals r of the refit and r + d of the base, a session gains ½|d|² + d·r, |d| of it by noise.
    """
    gain, variance = 0.0, 0.0
    for learn, out in leave_one_group_out(groups(study.runs)[0], study.used):
        before, after = (_left_out_residual(study.runs, fitted, refit, learn, out) for fitted in (base, refit))
        gain += 0.5 * float(before @ before - after @ after)
        variance += float(((before - after) ** 2).sum())
    return gain, float(np.sqrt(variance))


def _left_out_residual(data: Runs, fitted: Fit, refit: Fit, learn: Flags, out: Flags) -> Floats:
    """Whiten the residuals of a left-out session, for a model fitted to the others, in the noise of `refit`."""
    white = refit.noise.whitener(data.session[learn])
    residual = data.y - fitted.prediction
    rows, prior = prior_rows(fitted.fitted, fitted.parameters)
    derivative = np.concatenate([white(fitted.jacobian[learn]), rows])
    step = np.linalg.lstsq(derivative, np.concatenate([white(residual[learn]), prior]), rcond=None)[0]
    predicted = residual[out] - fitted.jacobian[out] @ step
    return np.asarray(refit.noise.whitener(data.session[out])(predicted))
