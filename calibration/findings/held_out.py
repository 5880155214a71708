"""What the held-out runs say: the errors of each model on them, and which claims they refute.

**Two sets.** The held-out sessions are opened once, with the final model. Beside them a quarter of the conditions,
or of the specimens (`study.quarter_of_conditions`), tells whether a model predicts other settings: it is fitted
again without them, by one linear step. The choice of the effect has seen them; its numbers have not.

**Withdrawn claims.** A claim is withdrawn if with it the error on one of these sets rises, and these runs reject
the model that has it; where the noise is unknown, in that which the model leaves (`rules.refuting`). The search
goes on as if the effect were not in the catalogue. Each withdrawal has looked at the held-out runs once more,
which is stated. A form that fits also predicts the same conditions, so this works on extrapolation alone;
`calibration.attribution.forms` compares forms elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calibration.attribution.hypothesis import Hypothesis, SetErrors
from calibration.attribution.rules import RULES, Stage, Trial, judge
from calibration.statistics.fit import Fit, birge
from calibration.statistics.study import (
    Study,
    error_interval,
    errors,
    gain_interval,
    held_out_p_value,
    quarter_of_conditions,
)
from common.arrays import Floats


@dataclass(frozen=True)
class HeldOutErrors:
    """How far each model is from the held-out runs, relative rms, and how far noise alone would be.

    The models are "uncalibrated", "before" (calibrated), "after" (with the effects of the verdict), and, if there
    are such, "law" (with the best law) and "new_specimen" (the adopted form, of mean size for every specimen).
    """

    rms: dict[str, float]  # of each model, over all outputs
    by_output: dict[str, dict[str, float]]  # model -> output -> relative rms
    after_interval: tuple[float, float]  # 95 %
    noise: float  # of a run, from the repeats
    p_value: float  # agreement of the held-out runs with the final model
    gain_interval: tuple[float, float] | None = None  # 95 %, before less after, paired over conditions
    of_conditions: SetErrors | None = None  # None: too few

    @property
    def fall(self) -> bool:
        """Whether what is claimed or adopted lowers the error."""
        return self.rms["after"] < self.rms["before"]


def held_out_errors(study: Study, predictions: dict[str, Floats], before: Fit, final: Fit) -> HeldOutErrors:
    """State the errors of models, by name, on the held-out runs."""
    runs, test = study.model.runs, study.split.test
    stated = {name: errors(runs, prediction, test) for name, prediction in predictions.items()}
    claimed = final is not before
    return HeldOutErrors(
        rms={name: rms for name, (rms, _) in stated.items()},
        by_output={name: each for name, (_, each) in stated.items()},
        after_interval=error_interval(runs, final.prediction, test, study.seed),
        noise=float(np.sqrt((runs.deviations(before.noise.run_covariance, test) ** 2).mean())),
        p_value=held_out_p_value(final, runs, test, seed=study.seed + 3),
        gain_interval=gain_interval(runs, before.prediction, final.prediction, test, study.seed)
        if claimed
        else None,
        of_conditions=errors_of_conditions(study, before, final),
    )


def errors_of_conditions(study: Study, before: Fit, final: Fit) -> SetErrors | None:
    """State the errors on a quarter of the conditions, of two models fitted without them; None if they are few."""
    runs, used = study.model.runs, study.split.fitted
    out, names = quarter_of_conditions(runs, used)
    if not out.any():
        return None
    fits = [fitted.refitted(runs, used & ~out) for fitted in (before, final)]
    rms_before, rms_after = (errors(runs, fitted.prediction, out)[0] for fitted in fits)
    p = held_out_p_value(_in_its_noise(study, fits[1]), runs, out, seed=study.seed + 7)
    determined = not (fits[1].held & ~final.held).any()
    return SetErrors(names, rms_before, rms_after, p, determined)


def tested_on_held_out(study: Study, before: Fit, claim: Hypothesis) -> Hypothesis:
    """Judge a claim by the runs that it was not fitted to, against the model `before` it."""

    def sets(claim: Hypothesis) -> tuple[SetErrors, ...]:
        of_conditions = errors_of_conditions(study, before, claim.fitted)
        return (_errors_of_sessions(study, before, claim.fitted), *([of_conditions] if of_conditions else []))

    return judge(claim, Trial(study, before, {"held_out": sets}), RULES, Stage.HELD_OUT)


def _errors_of_sessions(study: Study, before: Fit, final: Fit) -> SetErrors:
    """State the errors on the held-out sessions, and whether these reject a model with which the error rises."""
    runs, test = study.model.runs, study.split.test
    rms_before, rms_after = (errors(runs, fitted.prediction, test)[0] for fitted in (before, final))
    own = _in_its_noise(study, final)
    p = held_out_p_value(own, runs, test, seed=study.seed + 3) if rms_after > rms_before else 1.0
    return SetErrors(study.split.names, rms_before, rms_after, p)


def _in_its_noise(study: Study, fitted: Fit) -> Fit:
    """Return a fit in the noise that it leaves, where none is known."""
    if study.model.runs.noise_known:
        return fitted
    b = birge(study.model.runs, fitted, study.split.fitted)
    noise = replace(fitted.noise, run_covariance=b * fitted.noise.run_covariance)
    return replace(fitted, noise=noise, covariance=b * fitted.covariance)
