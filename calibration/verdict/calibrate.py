"""The whole calibration: split, fit, test, attribute, refit, and open the locked test once.

1. Whole sessions are locked away before anything is looked at (by default the middle one).
   Runs with gross errors are set aside (`calibration.statistics.outliers`).
2. Covariance from the repeats and the sessions (`calibration.statistics.noise`).
3. Fit of the coefficients to the other sessions (`calibration.statistics.fit`).
   Numbers as given are fitted with them, within their priors (`calibration.statistics.priors`); one that leaves
   its prior is freed, and comes ahead of every effect (`calibration.attribution.wrong_numbers`).
4. Lack of fit, kernel score and projected scores (`calibration.statistics.residual_tests`).
5. Refit with each effect that passes; keep what explains (`calibration.attribution.refits`).
6. Verdict: "none" (no departure beyond noise), "number" (a number as given is wrong), "effect" (one explains
it), "ambiguous" (several do and the runs
   cannot tell them apart), "unexplained" (there is a departure, and no effect in the catalogue explains it).
7. If no single effect explains it, pairs are tried. If several explain it, next runs that would tell them apart.
   If nothing explains it, the best predictive model, for steering (`calibration.swimmer.head_correction`).
8. Errors on the locked runs: as given, calibrated, with the effect, with a generic correction of the calibrated
   model (`calibration.verdict.residual_regression`), and from noise alone. Whether the locked runs agree with the
   final model (`calibration.statistics.held_out`).
9. For use, the model is fitted once more to all runs, the locked ones included.
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass, replace

import numpy as np

from calibration.attribution.refits import (
    FIRST,
    INDISTINGUISHABLE,
    Candidate,
    beside_wrong_numbers,
    detectable_sizes,
    examine,
    explaining,
    inside,
    pairs,
    with_doubts,
)
from calibration.attribution.wrong_numbers import Freed, freed
from calibration.statistics.fit import Fit, fit
from calibration.statistics.forward_model import Model, Parameter, Predictive, Runs, start_values
from calibration.statistics.held_out import error_interval, errors, fitted_to_all, locked_p_value, middle_session
from calibration.statistics.outliers import gross_errors
from calibration.statistics.priors import pulls
from calibration.statistics.profile_intervals import profile_intervals
from calibration.statistics.residual_tests import DRAWS, TESTABLE, Misfit, check_misfit
from calibration.statistics.score_directions import directions
from calibration.statistics.splits import divided, groups, limits
from calibration.verdict.next_runs import NextRun, next_runs
from calibration.verdict.residual_regression import correct
from calibration.verdict.sequential_test import Explanation
from calibration.verdict.verdict import Verdict, verdict_record
from sim.arrays import Flags, Floats
from sim.io.provenance import fingerprint

__all__ = ["LEVEL", "Verdict", "calibrate", "verdict_record"]

LEVEL = (
    0.04  # α of every claim; below 0.05, since noise is estimated and false claims must stay below one in twenty
)


@dataclass(frozen=True)
class _Task:
    """The divided runs, and everything that is fixed before they are looked at."""

    model: Model
    level: float
    seed: int
    draws: int
    progress: bool
    locked: Flags  # (n,) kept for the test
    locked_names: str
    start: dict[str, float]  # the model as given
    uncalibrated: Floats  # (n, k) its prediction
    gross: Flags  # (n,) set aside
    reasons: tuple[str, ...]

    @property
    def runs(self) -> Runs:
        return self.model.runs

    @property
    def used(self) -> Flags:
        """(n,) runs that are fitted."""
        return ~self.locked & ~self.gross

    @property
    def test(self) -> Flags:
        """(n,) runs of the locked test."""
        return self.locked & ~self.gross

    def title(self, words: str) -> str:
        """Of a progress bar."""
        return words if self.progress else ""

    @property
    def fixed(self) -> str:
        """Hash of everything that was fixed beforehand."""
        catalogue = [effect.name for effect in self.model.effects]
        fixed = {"level": self.level, "seed": self.seed, "catalogue": catalogue, "locked": self.locked_names}
        return fingerprint(fixed)


@dataclass(frozen=True)
class _Explained:
    """The fit without effects, its residual, and the effects that explain the residual."""

    base: Fit
    misfit: Misfit
    candidates: tuple[Candidate, ...]
    best: tuple[Candidate, ...]
    freed: Freed | None = None  # a number as given is wrong; it is freed in the final model
    instead: tuple[Candidate, ...] = ()  # effects that explain as much as the wrong number does

    @property
    def final(self) -> Fit:
        """The model with the effects of the verdict, or without any."""
        if self.best and self.best[0].refit:
            return self.best[0].refit
        return self.freed.fit if self.freed else self.base


def calibrate(
    model: Model,
    *,
    locked: Flags | None = None,
    level: float = LEVEL,
    seed: int = 0,
    draws: int = DRAWS,
    progress: bool = True,
) -> Verdict:
    """Calibrate a model with its runs, and find what it lacks.

    Args:
        model: its parameters' starts are the model "as given" (uncalibrated).
        locked: (n,) runs kept for the test, whole sessions; default `locked.middle_session`.
        level: α of every claim.
        seed: of the bootstrap; the same seed gives the same result.
        draws: of the bootstrap. It resolves no smaller p-value than 2/(draws + 1).
        progress: show progress bars.
    """
    task = _prepare(model, locked, level, seed, draws, progress)
    found = _explain(task)
    final = found.final
    base_intervals = profile_intervals(model, found.base, task.used, title=task.title("intervals"))
    final_intervals = base_intervals
    if final is not found.base:
        final_intervals = profile_intervals(model, final, task.used, title=task.title("intervals"))
    generic = correct(task.runs, found.base.prediction, task.used)
    noise = found.base.noise.run
    rivals = _rivals(found)
    wanted: list[NextRun] = []
    batch = None
    if rivals:
        wanted, batch = next_runs(model, [fitted for _, fitted in rivals], seed=seed)
    verdict = "none"
    if found.freed and not found.best:
        verdict = "number"
    elif found.misfit.p_value < level:
        verdict = ("unexplained", "effect", "ambiguous")[min(len(found.best), 2)]
    predictive = None
    if verdict == "unexplained":
        predictive = model.predictive(found.base, task.used, ~task.gross, task.test)
    error = _errors(task, found, found.base.prediction + generic.correction, predictive)
    return Verdict(
        verdict=verdict,
        effects=tuple(dict.fromkeys(e.name for c in found.best for e in (*c.beside, c.effect))),
        explaining=found.best,
        base=found.base,
        final=final,
        base_intervals=base_intervals,
        final_intervals=final_intervals,
        misfit=found.misfit,
        candidates=found.candidates,
        numbers=pulls(final, model.given),
        draws=draws,
        instead=found.instead,
        generic=generic,
        predictive=predictive,
        explanations=tuple(Explanation.of(title, fitted, task.runs.outputs) for title, fitted in rivals),
        next_runs=tuple(wanted),
        next_batch=batch,
        error_uncalibrated=error["uncalibrated"][0],
        error_before=error["before"][0],
        error_generic=error["generic"][0],
        error_predictive=error["predictive"][0] if predictive else None,
        error_after=error["after"][0],
        error_after_interval=error_interval(task.runs, final.prediction, task.test, seed),
        noise_ceiling=float(np.sqrt(np.trace(noise) / len(noise))),
        errors_by_output={name: by_output for name, (_, by_output) in error.items()},
        locked_p=locked_p_value(final, task.runs, task.test, seed=seed + 3),
        delivered=fitted_to_all(model, final, ~task.gross, moved=predictive is None),
        locked=task.locked_names,
        sessions=task.runs.session_names,
        used=task.used,
        uncalibrated=task.uncalibrated,
        untestable=dict(model.untestable),
        plan_hash=task.fixed,
        set_aside=(*task.runs.set_aside, *task.reasons),
        limits=(*task.runs.limits, *limits(task.runs, task.locked), *_unfinished(model, found.base, final)),
    )


def _prepare(model: Model, locked: Flags | None, level: float, seed: int, draws: int, progress: bool) -> _Task:
    """Lock sessions away, set gross errors aside, refuse runs in wrong units."""
    data = model.runs
    locked = middle_session(data) if locked is None else locked
    group, names = groups(data) if divided(data, locked) else (data.session, data.session_names)
    start = start_values(model)
    uncalibrated = model.predict([start], title="as given" if progress else "")[0]
    model.check(uncalibrated)
    gross, reasons = gross_errors(data, uncalibrated)
    locked_names = ", ".join(names[g] for g in np.unique(group[locked]))
    return _Task(
        model, level, seed, draws, progress, locked, locked_names, start, uncalibrated, gross, tuple(reasons)
    )


def _explain(task: _Task) -> _Explained:
    """Fit the coefficients and test the residual. If it is more than noise, examine single effects, then pairs."""
    model, used, level, seed = task.model, task.used, task.level, task.seed
    began = time.monotonic()
    guess = model.guess(dict(task.start), used)
    coefficients = tuple(p.name for p in (*model.coefficients, *model.given))
    base = fit(model, guess, coefficients, used, title=task.title("fit"))
    fitted = time.monotonic()
    along = directions(model, base.parameters, model.effects, title=task.title("derivatives"))
    derived = time.monotonic()
    misfit = check_misfit(base, task.runs, used, along, level=level, seed=seed, draws=task.draws)
    without = freed(model, base, used, along, level=level, seed=seed, draws=task.draws)
    if misfit.p_value >= level and without is None:
        return _Explained(base, misfit, _unexamined(misfit, model.effects), ())
    tested = misfit
    if without is not None:  # every effect that may explain as much as the wrong number does
        rivalling = math.sqrt(max(base.deviance - without.fit.deviance - INDISTINGUISHABLE, 1.0))
        tested = replace(misfit, critical_z=min(misfit.critical_z, rivalling))
    if task.progress:
        print(_forecast(tested, fitted - began, derived - fitted), file=sys.stderr)
    found = examine(
        model, base, tested, model.effects, along, used, task.start, level=level, seed=seed, progress=task.progress
    )
    best = explaining(found)
    number = without is not None and (misfit.p_value >= level or without.misfit.p_value >= level)
    if without is not None and number and not _better(best, without.fit):
        return _Explained(base, misfit, tuple(found), (), without, tuple(_as_good(found, without.fit, level)))
    if not best:
        best = explaining(beside_wrong_numbers(model, base, found, used, along, level=level, seed=seed))
    if not best:
        found_pairs = pairs(
            model, found, used, task.start, level=level, seed=seed, draws=task.draws, progress=task.progress
        )
        best = explaining(found_pairs)
    best = with_doubts(model, best, base, used, seed)
    return _Explained(base, misfit, tuple(found) or _unexamined(misfit, model.effects), tuple(best))


def _forecast(misfit: Misfit, of_a_fit: float, of_directions: float) -> str:
    """How long the effects will take, in words, by how long the first fit and the derivatives took [s]."""
    scores = misfit.scores
    count = int(((np.abs(scores.z) >= misfit.critical_z) & (scores.survived >= TESTABLE)).sum())
    single = count * of_a_fit
    more = FIRST * (of_directions + single)
    return (
        f"there is more than noise: {count} effects to fit, about {_duration(single)}; if none of them explains "
        f"the runs, pairs follow, {_duration(more)} at most, mostly much less"
    )


def _duration(seconds: float) -> str:
    return f"{max(seconds, 1):.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def _better(best: list[Candidate], number: Fit) -> bool:
    """Whether the best effect fits better than a wrong number by more than chance."""
    refit = best[0].refit if best else None
    return refit is not None and refit.deviance < number.deviance - INDISTINGUISHABLE


def _as_good(found: list[Candidate], number: Fit, level: float) -> list[Candidate]:
    """Effects that leave no more than noise and fit as well as a wrong number, best first."""
    near = [
        (c.refit.deviance, place)
        for place, c in enumerate(found)
        if c.refit and c.refit.arrived and c.refit.deviance < number.deviance + INDISTINGUISHABLE
        if c.refit_misfit and c.refit_misfit.p_value >= level / 2
    ]
    return [found[place] for _, place in sorted(near)]


def _errors(
    task: _Task, found: _Explained, generic: Floats, predictive: Predictive | None
) -> dict[str, tuple[float, dict[str, float]]]:
    """Errors of the models on the locked runs: all outputs together, and by output."""
    predictions = {
        "uncalibrated": task.uncalibrated,
        "before": found.base.prediction,
        "after": found.final.prediction,
        "generic": generic,
    }
    if predictive is not None:
        predictions["predictive"] = predictive.prediction
    return {name: errors(task.runs, prediction, task.test) for name, prediction in predictions.items()}


def _rivals(found: _Explained) -> tuple[tuple[str, Fit], ...]:
    """Explanations that the runs cannot tell apart, in words, best first; none if there are not two."""
    rivals = [(" and ".join(e.title for e in c.claimed), c.refit) for c in (*found.best, *found.instead)]
    known = [(title, fitted) for title, fitted in rivals if fitted]
    if found.freed and found.instead:
        wrong = ", ".join(alike[0].parameter.title for alike in found.freed.fit.wrong)
        known = [(f"{wrong} as given is wrong", found.freed.fit), *known]
    return tuple(known) if len(known) > 1 else ()


def _unfinished(model: Model, base: Fit, final: Fit) -> tuple[str, ...]:
    """Reasons why a fit may not be the best one, in words."""
    found = [f"{name} is at the end of its range: these runs do not determine it" for name in final.at_bounds]
    if not inside(model, base.parameters):
        found.append(
            "without effects the coefficients run to the end of their range, so every effect was refitted from "
            "the model as given, and it is less sure which effect it is"
        )
    if not final.arrived:
        found.append("the fit did not arrive at a minimum: do not trust its coefficients")
    return tuple(found)


def _unexamined(misfit: Misfit, effects: tuple[Parameter, ...]) -> tuple[Candidate, ...]:
    scores = misfit.scores
    return tuple(
        Candidate(e, (), float(z), float(s), *detectable_sizes(misfit, j), None, None, 0.0, 0.0, "not needed")
        for j, (e, z, s) in enumerate(zip(effects, scores.z, scores.survived, strict=True))
    )  # fmt: skip
