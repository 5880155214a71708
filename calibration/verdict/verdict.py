"""The verdict on a table of runs: its rule, and what it contains.

"none": no departure beyond noise. "number": a nuisance parameter is wrong, and explains it. "effect": one effect,
or one pair, explains it. "ambiguous": several do, and the runs cannot tell them apart. "unexplained": there is a
departure, and nothing in the catalogue explains it. A law may describe it; a law is no claim about the cause.
"partial": the same, but an effect, with a size that may differ between specimens, predicts runs that it has not
seen (`calibration.attribution.nearest`). It is adopted as a description, and claims no cause.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

from calibration.attribution.claim_checks import NumberCheck
from calibration.attribution.moves import StatedMove
from calibration.attribution.nearest import Nearest
from calibration.attribution.refits import Candidate
from calibration.attribution.wrong_numbers import wrong_number
from calibration.statistics.fit import Fit, Pull
from calibration.statistics.held_out import FinalRefit
from calibration.statistics.residual_regression import Regression
from calibration.statistics.residual_tests import Misfit
from calibration.statistics.statistical_model import Runs
from calibration.statistics.study import Split, Study, summary_of_excluded
from calibration.verdict.next_runs import Batch, NextRun, Rival
from calibration.verdict.record import facts
from calibration.verdict.sequential_test import Explanation
from calibration.words.quantities import percent
from calibration.words.render import sentence
from sim.arrays import Floats

_DISAGREES = 0.01  # p of the held-out runs below which they do not agree with the final model
_LONGEST = 500  # letters of a sentence in a repr


class LearntCorrection(Protocol):
    """A correction that predicts runs that no effect explains."""

    @property
    def prediction(self) -> Floats:
        """(n, k), learnt without the held-out runs."""
        ...

    @property
    def terms(self) -> tuple[str, ...]:
        """What it depends on, in words."""
        ...


class Describe(Protocol):
    """Looks for laws that describe a residual."""

    def __call__(self, study: Study, base: Fit, *, beside_claim: bool) -> Description | None:
        """Describe what a fit without effects leaves; `beside_claim`: an effect is claimed for it."""
        ...


class Description(Protocol):
    """Laws that describe runs which no effect explains, or only one that something else could imitate."""

    @property
    def complete(self) -> bool:
        """Whether the best law leaves no more than noise."""
        ...

    @property
    def prediction(self) -> Floats:
        """(n, k) of the best law, fitted without the held-out runs; without a law, of the calibrated model."""
        ...

    @property
    def rivals(self) -> tuple[Rival, ...]:
        """Laws that the runs cannot tell apart, best first; none if there are not two."""
        ...

    def as_good_as(self, claim: Fit) -> tuple[Rival, ...]:
        """Laws that leave no more than noise and fit as well as a claimed effect, best first."""
        ...

    def to_dict(self, claim: Fit | None = None) -> dict[str, Any]:
        """Return the record for verdict.json; beside a claimed effect it has the laws that fit as well."""
        ...


@dataclass(frozen=True)
class Evidence:
    """The residual of the calibrated model, and what every effect makes of it."""

    misfit: Misfit  # tests of the residual
    draws: int  # of its bootstrap
    candidates: tuple[Candidate, ...]  # all effects of the catalogue
    explaining: tuple[Candidate, ...]  # what explains the residual, best first; more than one: not told apart
    rival_effects: tuple[Candidate, ...]  # effects that explain as much as the number that is wrong
    untestable: dict[str, str]  # effects that these runs cannot test: what is missing
    rival_numbers: tuple[Pull, ...] = ()  # numbers that explain as much, but would be too far off to come first
    number_check: NumberCheck | None = None  # of the wrong number, where it comes ahead of effects


@dataclass(frozen=True)
class Fits:
    """The calibrated model (base), that with the effects of the verdict (final), and its refit to all runs."""

    uncalibrated: Floats  # (n, k) prediction of the model as given
    base: Fit  # the calibrated model
    base_intervals: dict[str, tuple[float, float]]  # 95 %, by profile deviance
    final: Fit  # that with the effects of the verdict
    final_intervals: dict[str, tuple[float, float]]  # 95 %, by profile deviance
    final_refit: FinalRefit  # the final model, fitted to all runs
    pulls: tuple[Pull, ...]  # of every nuisance parameter in the final model, the farthest first


@dataclass(frozen=True)
class HeldOutErrors:
    """How far each model is from the held-out runs, relative rms, and how far noise alone would be.

    The models are "uncalibrated", "before" (calibrated), "after" (with the effects of the verdict), "generic"
    (with a regression of the residual), and, if there are such, "law" (with the best law), "predictive" (with a
    learnt correction) and "new_specimen" (the adopted form with its mean size for every specimen).
    """

    rms: dict[str, float]  # of each model, over all outputs
    by_output: dict[str, dict[str, float]]  # model -> output -> relative rms
    after_interval: tuple[float, float]  # 95 %
    noise: float  # of a run, from the repeats
    p_value: float  # agreement of the held-out runs with the final model


@dataclass(frozen=True)
class Corrections:
    """Descriptions of the residual that do not explain it."""

    regression: Regression  # of the calibrated model's outputs
    learnt: LearntCorrection | None  # what is handed on where nothing explains or describes the residual
    law: Description | None = None  # laws, where they were looked for


@dataclass(frozen=True)
class Next:
    """Explanations that the runs cannot tell apart, and the runs that would; none if there are not two."""

    explanations: tuple[Explanation, ...] = ()  # best first
    runs: tuple[NextRun, ...] = ()  # single settings, the best first
    batch: Batch | None = None  # the same, for several runs together


@dataclass(frozen=True)
class Conditions:
    """What was fixed before the runs were looked at, and what weakens the conclusion."""

    split: Split  # fitted and held-out runs
    sessions: tuple[str, ...]  # names of all sessions
    hash: str  # of everything that was fixed
    excluded: tuple[str, ...]  # rows and columns that were not used, and why
    rows: int  # of the table, used or not
    caveats: tuple[str, ...]  # what weakens the conclusion, in words
    not_tried: tuple[str, ...] = ()  # because no time was left; such a verdict is provisional
    little_weight: tuple[int, ...] = ()  # rows of the table whose runs have less than half of the usual weight

    @property
    def summary_of_excluded(self) -> list[str]:
        """What was excluded, by reason, with the number of rows."""
        return summary_of_excluded(self.excluded, self.rows)


def reach_verdict(evidence: Evidence, level: float, *, number_explains: bool) -> str:
    """Decide the verdict; this is the rule of the whole calibration.

    A wrong nuisance parameter comes ahead of every effect that is not better, or it is one of several explanations
    (`Evidence.rival_numbers`). Without one, a residual within the noise is "none". Beyond it, the number of
    explanations that the runs cannot tell apart decides. What new runs say about an "ambiguous" verdict is decided
    by `calibration.verdict.sequential_test.standings`. An "unexplained" verdict becomes "partial" where a form is
    adopted.

    Args:
        level: α of the residual's p-value.
        number_explains: whether a wrong nuisance parameter explains the residual.
    """
    if number_explains and not evidence.explaining:
        return "number"
    if evidence.misfit.p_value >= level:
        return "none"
    explanations = len(evidence.explaining) + bool(evidence.rival_numbers)
    return ("unexplained", "effect", "ambiguous")[min(explanations, 2)]


@dataclass(frozen=True, repr=False)
class Verdict:
    """What runs say about a model; made by `softflagella.calibrate`.

    Example:
        >>> from softflagella import calibrate
        >>> calibrate("runs.csv", "robot.toml").sentence  # doctest: +SKIP
        'No effect is missing that these runs can show (p = 0.43).'
    """

    verdict: str  # "none", "number", "effect", "ambiguous", "partial", "unexplained"; see `reach_verdict`
    evidence: Evidence  # the residual, and what explains it
    fits: Fits  # the fitted models
    errors: HeldOutErrors  # on the held-out runs
    corrections: Corrections  # descriptions of the residual
    next: Next  # runs to make next
    conditions: Conditions  # what was fixed before the fit
    nearest: Nearest | None  # the form that is adopted, of a partial verdict
    moves: tuple[StatedMove, ...]  # numbers that differ in some runs
    runs: Runs  # that were calibrated with

    def __repr__(self) -> str:
        said = self.sentence
        said = said if len(said) <= _LONGEST else f"{said[:_LONGEST]} …"
        names = ", ".join(self.effects)
        return f"Verdict {self.verdict!r}{f': {names}' if names else ''}\n  {said}\n  {self.errors_in_words}"

    @property
    def errors_in_words(self) -> str:
        """The errors on the held-out runs, in a line."""
        added = ""
        if self.described:
            added = f", with the law {percent(self.errors.rms['law'])}"
        elif self.effects or self.nearest:
            added = f", with the {'effects' if self.effects else 'adopted form'} {percent(self.error_after)}"
        return (
            f"error on the held-out runs ({self.conditions.split.names}): as given "
            f"{percent(self.error_uncalibrated)}, calibrated {percent(self.error_before)}{added}; noise of a run "
            f"{percent(self.noise_ceiling)}"
        )

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that explain the residual."""
        return tuple(dict.fromkeys(e.name for c in self.explaining for e in c.claimed))

    @property
    def explaining(self) -> tuple[Candidate, ...]:
        """What explains the residual, best first."""
        return self.evidence.explaining

    @property
    def base(self) -> Fit:
        """The calibrated model, without effects."""
        return self.fits.base

    @property
    def final(self) -> Fit:
        """The model with the effects of the verdict, with the form that is adopted, or without any."""
        return self.fits.final

    @property
    def error_uncalibrated(self) -> float:
        """Relative error of the model as given on the held-out runs."""
        return self.errors.rms["uncalibrated"]

    @property
    def error_before(self) -> float:
        """Relative error of the calibrated model on the held-out runs."""
        return self.errors.rms["before"]

    @property
    def error_after(self) -> float:
        """Relative error of the model with the effects of the verdict on the held-out runs."""
        return self.errors.rms["after"]

    @property
    def error_predictive(self) -> float | None:
        """Relative error with the learnt correction on the held-out runs, if there is one."""
        return self.errors.rms.get("predictive")

    @property
    def error_corrected(self) -> float:
        """Relative error of the corrected robot on the held-out runs."""
        if self.described:
            return self.errors.rms["law"]
        if self.nearest and not self.held_out_error_falls and self.error_predictive is None:
            return self.error_before
        return self.error_after if self.error_predictive is None else self.error_predictive

    @property
    def noise_ceiling(self) -> float:
        """Relative error that noise alone makes."""
        return self.errors.noise

    @property
    def next_runs(self) -> tuple[NextRun, ...]:
        """Runs that would tell several explanations apart."""
        return self.next.runs

    @property
    def wrong_numbers(self) -> tuple[tuple[Pull, ...], ...]:
        """Nuisance parameters that the runs contradict; each with those that may be wrong in its place.

        Where nothing explains the residual there are none: what is missing pulls at them, too.
        """
        if self.verdict in ("partial", "unexplained"):
            return ()
        freed = {p.parameter.name: p for p in self.fits.pulls if p.freed}
        known = tuple((freed[alike[0].parameter.name], *alike[1:]) for alike in self.fits.final.wrong_numbers)
        further = wrong_number([p for p in self.fits.pulls if not p.freed])
        return (*known, further) if further else known

    @property
    def held_out_error_falls(self) -> bool | None:
        """Whether what is claimed lowers the error on the held-out runs; None where nothing is claimed."""
        return None if self.verdict in ("none", "unexplained") else self.error_after < self.error_before

    @property
    def held_out_runs_agree(self) -> bool:
        """Whether the held-out runs agree with the final model."""
        return self.errors.p_value >= _DISAGREES

    @property
    def sentence(self) -> str:
        """The verdict in one sentence with its certainty; a second one for a nuisance parameter that is wrong."""
        return sentence(facts(self))

    @property
    def harmless(self) -> bool:
        """Whether an unexplained residual is so small that predictions do not suffer from it.

        If noise and departure add in squares, the departure is smaller than the noise of a run where the error on
        the held-out runs is below √2 times that noise. The whole 95 % interval of the error must be below it, the
        interval must reach down to the noise, and the held-out runs must agree with the calibrated model.
        """
        low, high = self.errors.after_interval
        small = low <= self.noise_ceiling and high < math.sqrt(2) * self.noise_ceiling
        return self.verdict == "unexplained" and small and self.held_out_runs_agree

    @property
    def described(self) -> bool:
        """Whether a law describes a residual that nothing explains, and leaves no more than noise."""
        law = self.corrections.law
        return self.verdict == "unexplained" and law is not None and law.complete

    @property
    def in_form_only(self) -> tuple[str, ...]:
        """Named effects whose whole interval is outside the sizes that their source allows."""
        names = []
        for effect in self.explaining[0].claimed if self.explaining else ():
            low, high = self.fits.final_intervals[effect.name]
            if effect.plausible and (high < effect.plausible[0] or low > effect.plausible[1]):
                names.append(effect.name)
        return tuple(names)
