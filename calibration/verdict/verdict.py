"""The verdict on a table of runs: its rule and its sentence.

"none": no departure beyond noise. "number": a nuisance parameter is wrong, and explains it. "effect": one effect,
or one pair, explains it. "ambiguous": several do, and the runs cannot tell them apart. "unexplained": there is a
departure, and nothing in the catalogue explains it. A law may describe it; a law is no claim about the cause.
"partial": the same, but an effect, with a size that may differ between specimens, predicts runs that it has not
seen (`calibration.attribution.nearest`). It is adopted as a description, and claims no cause.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from calibration.attribution.halved_tolerances import overall_gains
from calibration.attribution.moves import StatedMove
from calibration.attribution.nearest import Nearest
from calibration.attribution.refits import Candidate
from calibration.attribution.wrong_numbers import notable_pull, wrong_number
from calibration.statistics.fit import Fit
from calibration.statistics.pull import Pull
from calibration.verdict.contents import Conditions, Corrections, Evidence, Fits, HeldOutErrors, Next
from calibration.verdict.next_runs import NextRun
from calibration.verdict.old_names import OLD_NAMES
from sim.io.deprecated import old_attributes

DISAGREES = 0.01  # p of the held-out runs below which they do not agree with the final model
_NEAR = 0.5  # if no effect explains the residual, the best one is named if it removes at least this share

_LONGEST = 500  # letters of a sentence in a repr


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

    def __repr__(self) -> str:
        sentence = self.sentence if len(self.sentence) <= _LONGEST else f"{self.sentence[:_LONGEST]} …"
        errors = f"as given {_percent(self.error_uncalibrated)}, calibrated {_percent(self.error_before)}"
        if self.effects or self.nearest:
            errors += f", with the {'effects' if self.effects else 'adopted form'} {_percent(self.error_after)}"
        names = ", ".join(self.effects)
        return (
            f"Verdict {self.verdict!r}{f': {names}' if names else ''}\n"
            f"  {sentence}\n"
            f"  error on the held-out runs ({self.conditions.split.names}): {errors}; "
            f"noise of a run {_percent(self.noise_ceiling)}"
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
    def error_generic(self) -> float:
        """Relative error of the calibrated model with a regression of its residual on the held-out runs."""
        return self.errors.rms["generic"]

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

    if not TYPE_CHECKING:
        __getattr__ = old_attributes(OLD_NAMES)

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
    def halved_tolerances(self) -> dict[str, float]:
        """Share by which half of its tolerance lowers the smallest detectable sizes, by nuisance parameter.

        The largest comes first. `evidence.candidates` have the sizes of every effect in `detectable_halved`.
        """
        return overall_gains(self.evidence.candidates)

    @property
    def held_out_error_falls(self) -> bool | None:
        """Whether what is claimed lowers the error on the held-out runs; None where nothing is claimed."""
        return None if self.verdict in ("none", "unexplained") else self.error_after < self.error_before

    @property
    def sentence(self) -> str:
        """The verdict in one sentence with its certainty; a second one for a nuisance parameter that is wrong.

        The first sentence says so if the claim does not lower the error on the held-out runs.
        """
        sentences = self._sentences
        if self.held_out_error_falls is False:
            without, with_claim = 100 * self.error_before, 100 * self.error_after
            sentences[0] = (
                f"{sentences[0].removesuffix('.')}, but the error on the held-out runs does not fall with it "
                f"({without:.2f} % without, {with_claim:.2f} % with it)."
            )
        return " ".join([*self._of_some_runs, *sentences])

    @property
    def _of_some_runs(self) -> list[str]:
        """What is said first: that the held-out runs do not agree, and which numbers differ in some runs."""
        said = [f"{move.words[0].upper()}{move.words[1:]}." for move in self.moves]
        p = self.errors.p_value
        if p < DISAGREES and self.verdict not in ("partial", "unexplained"):
            agree = f"The held-out runs ({self.conditions.split.names}) do not agree with the model (p = {p:.1g})."
            return [agree, *said]
        return said

    @property
    def _sentences(self) -> list[str]:
        """What is wrong with nuisance parameters, and the effects; an unconfirmed claim comes first."""
        number = [self._number_words] if self._number_words else []
        if self.verdict == "number":
            rivals = " or ".join(c.title for c in self.evidence.rival_effects)
            instead = [f"If the number is right, {rivals} would explain as much."] if rivals else []
            return [*number, "No effect is claimed.", *instead]
        if self.held_out_error_falls is False and not self.wrong_numbers:
            return [self._effect_words, *number]
        return [*number, self._effect_words]

    @property
    def _number_words(self) -> str:
        """The nuisance parameters that are wrong, or the one that is farthest off if it is notable."""
        if self.wrong_numbers:
            said = "; and ".join(", or ".join(p.words for p in alike) for alike in self.wrong_numbers)
            return f"A nuisance parameter is wrong: {said}."
        learnt = [p for p in self.fits.pulls if p.learnt]
        if (
            not learnt
            or self.verdict in ("partial", "unexplained")
            or abs(learnt[0].z) <= notable_pull(len(learnt))
        ):
            return ""
        return f"{learnt[0].words}."

    @property
    def _effect_words(self) -> str:
        misfit = self.evidence.misfit
        # The bootstrap resolves no smaller p than 2/(draws + 1).
        relation = "≤" if misfit.p_value <= 2.01 / (self.evidence.draws + 1) else "="
        p = f"p {relation} {misfit.p_value:.2g}"
        if self.verdict == "none":
            return f"No effect is missing that these runs can show ({p})."
        if self.verdict == "effect":
            best = self.explaining[0]
            assert best.refit is not None
            sizes = []
            for effect in best.claimed:
                low, high = self.fits.final_intervals[effect.name]
                like = "something in form like " if effect.name in self.in_form_only else ""
                size = best.refit.parameters[effect.name]
                sizes.append(f"{like}{effect.words}, size {size:.3g} ({low:.3g} to {high:.3g})")
            rivals = "other effect" if len(sizes) == 1 else "single effect or other pair"
            said = " and ".join(sizes) + self._outside
            return (
                f"The residual ({p}) is consistent with {said}, and with no {rivals} of the catalogue."
                f"{self._beside}"
            )
        if self.verdict == "ambiguous":
            names = " or ".join(c.words for c in self.explaining)
            names += self._outside + self._or_number
            return f"The residual ({p}) is explained by {names}: these runs cannot tell them apart.{self._beside}"
        if self.nearest:
            return f"{self._adopted(p)}{self._steered}"
        none = "no effect and no pair of effects of the catalogue explains"
        return (
            f"There is a residual ({p}) that {none}{self._nearest}.{self._small}{self._described}{self._steered}"
        )

    def _adopted(self, p: str) -> str:
        """The words for a form that is adopted, with what it leaves and the errors before and after."""
        nearest = self.nearest
        assert nearest is not None
        low, high = nearest.interval
        size = f"{nearest.size:.3g} ({low:.3g} to {high:.3g})"
        if nearest.sizes:
            values = [value for value, _, _ in nearest.sizes.values()]
            size = f"differs between specimens: {size} at the mean, from {min(values):.3g} to {max(values):.3g}"
        else:
            size = f"is {size}"
        others = f" {' or '.join(nearest.as_well)} would do as well." if nearest.as_well else ""
        left = "nothing beyond the noise"
        if nearest.remainder > 0:
            left = f"{_percent(nearest.remainder)} beyond the noise, most of it in {nearest.largest_along}"
        falls = ""
        if self.held_out_error_falls:
            falls = (
                f" The error on the held-out runs falls from {_percent(self.error_before)} to "
                f"{_percent(self.error_after)}; noise alone makes {_percent(self.noise_ceiling)}."
            )
        if "new_specimen" in self.errors.rms:
            falls += (
                f" With the mean size, as for a new specimen, it is {_percent(self.errors.rms['new_specimen'])}."
            )
        return (
            f"Something is surely missing ({p}), and no effect and no pair of effects of the catalogue explains "
            f"all of it. The nearest form, {nearest.effect.words}, is adopted as a description: it removes "
            f"{_share(nearest.removed)} of it on runs that it was not fitted to. Its size {size}. It leaves "
            f"{left}.{others} This is no claim about the cause.{falls}"
        )

    @property
    def harmless(self) -> bool:
        """Whether an unexplained residual is so small that predictions do not suffer from it.

        If noise and departure add in squares, the departure is smaller than the noise of a run where the error on
        the held-out runs is below √2 times that noise. The whole 95 % interval of the error must be below it, the
        interval must reach down to the noise, and the held-out runs must agree with the calibrated model.
        """
        low, high = self.errors.after_interval
        small = low <= self.noise_ceiling and high < math.sqrt(2) * self.noise_ceiling
        return self.verdict == "unexplained" and small and self.errors.p_value >= DISAGREES

    @property
    def _small(self) -> str:
        """The words for a residual that does not matter for prediction."""
        if not self.harmless:
            return ""
        error, noise = _percent(self.error_before), _percent(self.noise_ceiling)
        return (
            " It is smaller than the noise of a run, and harmless for prediction between these runs: on the "
            f"held-out runs the calibrated model is off by {error}, and noise alone makes {noise}."
        )

    @property
    def described(self) -> bool:
        """Whether a law describes a residual that nothing explains, and leaves no more than noise."""
        law = self.corrections.law
        return self.verdict == "unexplained" and law is not None and law.complete

    @property
    def _described(self) -> str:
        """What laws say about the residual, with the error of the best one."""
        law = self.corrections.law
        if law is None:
            return ""
        if not law.complete:
            return f" {law.sentence}"
        with_law, without = 100 * self.errors.rms["law"], 100 * self.error_before
        errors = f"{with_law:.2f} % with it, {without:.2f} % without it"
        return f" {law.sentence} This is no claim about the cause. The error on the held-out runs is {errors}."

    @property
    def _steered(self) -> str:
        """The correction by which a robot can be steered although nothing explains the residual."""
        if self.error_predictive is None:
            return ""
        return (
            f" corrected.toml has a correction that describes it: {100 * self.error_predictive:.1f} % on runs "
            f"that it was not learnt from, {100 * self.error_before:.1f} % without it."
        )

    @property
    def in_form_only(self) -> tuple[str, ...]:
        """Named effects whose whole interval is outside the sizes that their source allows."""
        names = []
        for effect in self.explaining[0].claimed if self.explaining else ():
            low, high = self.fits.final_intervals[effect.name]
            if effect.plausible and (high < effect.plausible[0] or low > effect.plausible[1]):
                names.append(effect.name)
        return tuple(names)

    @property
    def _outside(self) -> str:
        """The words for a claim that something outside the catalogue could imitate."""
        if not any(c.uncertain for c in self.explaining):
            return ""
        many = len(self.explaining) > 1 or len(self.explaining[0].claimed) > 1
        return f", or something outside the catalogue that looks like {'them' if many else 'it'}"

    @property
    def _or_number(self) -> str:
        """The words for numbers that explain as much, but would be off by too many of their tolerances."""
        numbers = (
            f"{p.parameter.title} that is {p.departure} ({p.tolerances:.0f} of its tolerances)"
            for p in self.evidence.rival_numbers
        )
        said = " and ".join(numbers)
        return f", or by {said}" if said else ""

    @property
    def _beside(self) -> str:
        """What the search for laws says about an uncertain claim."""
        return f" {self.corrections.law.beside(self.final)}" if self.corrections.law else ""

    @property
    def _nearest(self) -> str:
        """The single effect that removes most of the residual, if one was refitted and removes much."""
        refits = [(c.refit.deviance, c.effect.title) for c in self.evidence.candidates if c.refit is not None]
        if not refits:
            return ""
        deviance, title = min(refits)
        expected = int(self.conditions.split.fitted.sum()) * self.fits.base.prediction.shape[1]
        share = (self.fits.base.deviance - deviance) / max(self.fits.base.deviance - expected, 1e-9)
        if share < _NEAR:
            return ""
        return f"; the nearest, {title}, removes {_share(share)} of it and leaves more than noise"


def _percent(error: float) -> str:
    return f"{100 * error:.2f} %"


def _share(share: float) -> str:
    return "nearly all" if share > 0.995 else f"{100 * share:.0f} %"
