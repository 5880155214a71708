"""What explains the residual of a fit, and the rule of the verdict."""

from __future__ import annotations

from dataclasses import dataclass

from calibration.attribution.hypothesis import Hypothesis, Origin
from calibration.statistics.fit import Fit, Pull
from calibration.statistics.residual_tests import Directions, Misfit

EXPLAINING = (Origin.EFFECT, Origin.PAIR)


@dataclass(frozen=True)
class LoopTurn:
    """One turn of the loop: what was adopted, and what is left."""

    error: float  # relative rms on the held-out runs
    named: str  # what was adopted; empty: nothing yet
    left: str  # output and input along which most is left; empty: no more than noise


@dataclass(frozen=True)
class Attribution:
    """The fit without effects, its residual, and the hypotheses about it."""

    base: Fit
    misfit: Misfit  # of the base
    tangents: Directions  # of the effects
    candidates: tuple[Hypothesis, ...]  # all effects of the catalogue
    explanations: tuple[Hypothesis, ...] = ()  # effects and a wrong number, best first; several: not told apart
    nearest: Hypothesis | None = None  # the form that is adopted where nothing explains the residual
    forms: tuple[Hypothesis, ...] = ()  # that left-out runs cannot tell from what is claimed or adopted
    moves: tuple[Hypothesis, ...] = ()  # numbers that differ in some runs
    turns: tuple[LoopTurn, ...] = ()  # of the loop, where a form was adopted
    withdrawn: tuple[Hypothesis, ...] = ()  # what held-out runs refuted, in order
    best_rejected: Fit | None = None  # the best fit with effects, where none explains the residual
    noise_known: bool = True

    @property
    def number(self) -> Hypothesis | None:
        """The wrong numbers, if they explain the residual."""
        return next((h for h in self.explanations if h.origin is Origin.NUMBER), None)

    @property
    def number_leads(self) -> bool:
        """Whether the wrong numbers come ahead of effects that explain as much."""
        return bool(self.explanations) and self.explanations[0].origin is Origin.NUMBER

    @property
    def claims(self) -> tuple[Hypothesis, ...]:
        """Effects that are claimed, best first; none where wrong numbers come ahead of them."""
        return () if self.number_leads else self._effects

    @property
    def rival_effects(self) -> tuple[Hypothesis, ...]:
        """Effects that explain as much as the wrong numbers ahead of them."""
        return self._effects if self.number_leads else ()

    @property
    def rival_numbers(self) -> tuple[Pull, ...]:
        """The wrong numbers, where effects come ahead of them."""
        return self.number.evidence.pulls if self.number and not self.number_leads else ()

    @property
    def _effects(self) -> tuple[Hypothesis, ...]:
        return tuple(h for h in self.explanations if h.origin in EXPLAINING)

    @property
    def final(self) -> Fit:
        """The model with what explains the residual, with the form that is adopted, or without any."""
        if self.nearest:
            return self.nearest.fitted
        return self.explanations[0].fitted if self.explanations else self.base

    def verdict(self, level: float) -> str:
        """Decide the verdict; this is the rule of the whole calibration.

        A wrong nuisance parameter comes ahead of every effect that is not better, or it is one of several
        explanations. Without one, a residual within the noise is "none". Beyond it, the number of explanations
        that the runs cannot tell apart decides. Where the noise is unknown nothing is claimed, but a form may be
        adopted for its predictions. What new runs say about an "ambiguous" verdict is decided by
        `calibration.findings.next_runs.standings`.

        Args:
            level: α of the residual's p-value.
        """
        if self.number_leads:
            return "number"
        if not self.noise_known:
            return "partial" if self.nearest else "none"
        if self.misfit.p_value >= level:
            return "none"
        count = len(self.claims) + bool(self.rival_numbers)
        return ("partial" if self.nearest else "unexplained", "effect", "ambiguous")[min(count, 2)]
