"""The whole calibration: split, fit, test, attribute, refit, and open the held-out test once.

1. Whole sessions are held out before anything is looked at (by default the middle one).
   Outliers are excluded (`calibration.statistics.outliers`).
2. Covariance from the repeats and the sessions (`calibration.statistics.noise`).
3. Fit to the other sessions, tests of the residual, and what explains it (`calibration.attribution.explain`).
4. The verdict (`calibration.verdict.verdict.reach_verdict`).
5. If several explanations are left, next runs that would tell them apart (`calibration.verdict.next_runs`).
   If nothing explains the residual, a correction that is handed on for steering, where there is one.
6. Errors on the held-out runs: as given, calibrated, with the effect, with a regression of the residual
   (`calibration.verdict.residual_regression`), and from noise alone. Whether the held-out runs agree with the
   final model (`calibration.statistics.held_out`).
7. For use, the model is fitted once more to all runs, the held-out ones included.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from calibration.attribution.explain import Explained, explain
from calibration.attribution.single_effects import coefficients_within_range
from calibration.statistics.fit import Fit
from calibration.statistics.forward_model import ForwardModel
from calibration.statistics.held_out import error_interval, errors, held_out_p_value, refit_to_all
from calibration.statistics.outliers import find_outliers
from calibration.statistics.profile_intervals import profile_intervals
from calibration.statistics.pulls import pulls
from calibration.statistics.splits import Split, held_out_names, middle_session, split_caveats
from calibration.statistics.study import DRAWS, LEVEL, Study
from calibration.verdict.experiment import Experiment, LearntCorrection
from calibration.verdict.next_runs import next_runs
from calibration.verdict.residual_regression import regress_residual
from calibration.verdict.sequential_test import Explanation
from calibration.verdict.verdict import (
    Conditions,
    Corrections,
    Evidence,
    Fits,
    HeldOutErrors,
    Next,
    Verdict,
    reach_verdict,
)
from sim.arrays import Flags, Floats

Subject = TypeVar("Subject", bound=Experiment)


def calibrate(
    model: Subject,
    *,
    held_out: Flags | None = None,
    correction: Callable[[Subject, Fit, Split], LearntCorrection | None] | None = None,
    level: float = LEVEL,
    seed: int = 0,
    draws: int = DRAWS,
    progress: bool = True,
) -> Verdict:
    """Calibrate a model with its runs, and find what it lacks.

    Args:
        model: its parameters' starts are the model "as given" (uncalibrated).
        held_out: (n,) runs kept for the test, whole sessions; default `splits.middle_session`.
        correction: learns a correction of the calibrated model where nothing explains the residual, such as
            `calibration.swimmer.head_correction.learn_head_correction`.
        level: α of every claim.
        seed: of the bootstrap; the same seed gives the same result.
        draws: of the bootstrap. It resolves no smaller p-value than 2/(draws + 1).
        progress: show progress bars.
    """
    held_out = middle_session(model.runs) if held_out is None else held_out
    plain = Study(model, Split(held_out, np.zeros_like(held_out)), level, seed, draws, progress)
    uncalibrated = model.predict([plain.start], title=plain.title("as given"))[0]
    model.check(uncalibrated)
    outliers, reasons = find_outliers(model.runs, uncalibrated)
    split = Split(held_out, outliers, held_out_names(model.runs, held_out), reasons)
    study = Study(model, split, level, seed, draws, progress)
    explained = explain(study, model.guess(study.start, study.used))
    evidence = Evidence(
        misfit=explained.misfit,
        draws=draws,
        candidates=explained.candidates,
        explaining=explained.best,
        rival_effects=explained.rival_effects,
        untestable=dict(model.untestable),
    )
    verdict = reach_verdict(evidence, level, number_explains=explained.number is not None)
    learnt = correction(model, explained.base, split) if correction and verdict == "unexplained" else None
    corrections = Corrections(regress_residual(model.runs, explained.base.prediction, split.fitted), learnt)
    caveats = (*split_caveats(model.runs, held_out), *_caveats_of_fits(model, explained.base, explained.final))
    return Verdict(
        verdict=verdict,
        evidence=evidence,
        fits=_fits(study, explained, uncalibrated, moved=learnt is None),
        errors=_errors(study, explained, uncalibrated, corrections),
        corrections=corrections,
        next=_next_runs(model, explained.rivals, seed),
        conditions=Conditions(
            split=split,
            sessions=model.runs.session_names,
            hash=study.fixed,
            excluded=(*model.runs.excluded, *reasons),
            caveats=(*model.runs.caveats, *caveats),
        ),
    )


def _fits(study: Study, explained: Explained, uncalibrated: Floats, *, moved: bool) -> Fits:
    """Add intervals to the fits, and fit the final model once more to all runs if it may be `moved`."""
    base, final = explained.base, explained.final
    base_intervals = profile_intervals(study.model, base, study.used, title=study.title("intervals"))
    final_intervals = base_intervals
    if final is not base:
        final_intervals = profile_intervals(study.model, final, study.used, title=study.title("intervals"))
    return Fits(
        uncalibrated=uncalibrated,
        base=base,
        base_intervals=base_intervals,
        final=final,
        final_intervals=final_intervals,
        final_refit=refit_to_all(study.model, final, study.split.kept, moved=moved),
        pulls=pulls(final, study.model.nuisances),
    )


def _next_runs(model: Experiment, rivals: tuple[tuple[str, Fit], ...], seed: int) -> Next:
    """Plan the runs that would tell rival explanations apart; none if there are no rivals."""
    if not rivals:
        return Next()
    runs, batch = next_runs(model, [fitted for _, fitted in rivals], seed=seed)
    outputs = model.runs.outputs
    return Next(tuple(Explanation.of(title, fitted, outputs) for title, fitted in rivals), runs, batch)


def _errors(study: Study, explained: Explained, uncalibrated: Floats, corrections: Corrections) -> HeldOutErrors:
    """State the errors of every model on the held-out runs."""
    base, final, test = explained.base, explained.final, study.split.test
    predictions = {
        "uncalibrated": uncalibrated,
        "before": base.prediction,
        "after": final.prediction,
        "generic": base.prediction + corrections.regression.correction,
    }
    if corrections.learnt is not None:
        predictions["predictive"] = corrections.learnt.prediction
    stated = {name: errors(study.runs, prediction, test) for name, prediction in predictions.items()}
    noise = base.noise.run
    return HeldOutErrors(
        rms={name: rms for name, (rms, _) in stated.items()},
        by_output={name: each for name, (_, each) in stated.items()},
        after_interval=error_interval(study.runs, final.prediction, test, study.seed),
        noise=float(np.sqrt(np.trace(noise) / len(noise))),
        p_value=held_out_p_value(final, study.runs, test, seed=study.seed + 3),
    )


def _caveats_of_fits(model: ForwardModel, base: Fit, final: Fit) -> tuple[str, ...]:
    """Say why a fit may not be the best one."""
    caveats = [f"{name} is at the end of its range: these runs do not determine it" for name in final.at_bounds]
    if not coefficients_within_range(model, base.parameters):
        caveats.append(
            "without effects the coefficients run to the end of their range, so every effect was refitted from "
            "the model as given, and it is less sure which effect it is"
        )
    if not final.converged:
        caveats.append("the fit did not converge: do not trust its coefficients")
    return tuple(caveats)
