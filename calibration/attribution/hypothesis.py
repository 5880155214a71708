"""A hypothesis: the model and something more, fitted to the runs, with the evidence for it and against it.

Whatever may explain a residual is one: a number that is wrong, or differs in some runs; an effect, or a pair; an
effect as a description, with a size that may differ between specimens, or with that of theory; a law. They come
from different sources, and `calibration.attribution.rules` judges all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np

from calibration.attribution.left_out import PairedGain
from calibration.statistics.fit import Fit, Pull
from calibration.statistics.residual_tests import Misfit
from calibration.statistics.statistical_model import ForwardModel, Parameter

Sizes = Mapping[str, tuple[float, float, float]]


@dataclass(frozen=True)
class SetErrors:
    """Relative rms errors on runs to which a model was not fitted, and their agreement with it."""

    names: str
    before: float  # of the model without what is added
    after: float
    p_value: float
    determined: bool = True  # no number of the model runs to a bound without these runs


class Origin(StrEnum):
    """What a hypothesis adds to the model."""

    NUMBER = "a number is wrong"
    MOVE = "a number differs in some runs"
    EFFECT = "an effect"
    PAIR = "two effects, or one beside a wrong number"
    FORM = "an effect as a description"
    THEORY = "the same, of the size of theory"
    LAW = "a law"


class Reason(StrEnum):
    """Whether a hypothesis is kept; if not, why, in the words of the report; and what makes one uncertain."""

    KEPT = "kept"
    NOT_NEEDED = "not needed"
    NO_CHANGE = "it changes nothing in these data"
    ABSORBED = "the coefficients absorb it: not testable with these data"
    NOISE = "score within the noise"
    WRONG_SIGN = "its score has a sign that the effect cannot have"
    LEAVES_MUCH = "leaves far more than noise, by its score"
    NO_TIME = "no time was left for its fit"
    NOT_SOLVED = "with it the model is not solved directly everywhere"
    NOT_CONVERGED = "its fit did not converge"
    LEAVES_RESIDUAL = "leaves a residual"
    INCLUDES_NULL = "its interval includes the null"
    ALL_INCLUDE_NULL = "the intervals of all its numbers include the null"
    AT_THE_END = "a number is at the end of its range"
    NO_GAIN = "its BIC is not smaller than that without a law"
    NO_LEVER = "its lever is not told from none: a side force at the disc"  # unless that one fits worse
    NOT_PREDICTIVE = "does not predict left-out sessions better"
    COSTS_MORE = "costs more than it gains beside a single effect"
    REMOVES_LITTLE = "removes less than half of what is beyond noise"
    VAGUE = "its interval spans orders of magnitude"
    GAINS_LITTLE = "gains no more than one parameter can by chance"
    NOT_CREDIBLE = "no such number is off by so much"
    ONE_OF_MANY = "chosen among many pairs, whose shapes lie densely"
    IMITABLE = "something outside the catalogue could imitate it"
    DOES_NOT_TRANSFER = "its size does not carry over to other data"
    IMPLAUSIBLE = "off by more of its tolerances than an error of measurement makes credible"
    REFUTED = "data that it was not fitted to refute it"


@dataclass(frozen=True)
class Evidence:
    """What was tested of a hypothesis. None: it was not, for the reason that its hypothesis has."""

    score: float | None = None  # z, in standard deviations of the noise
    survived: float | None = None  # share of its signal that the fit cannot absorb
    detectable: float | None = None  # size that is found half of the time: critical |z| / signal per unit
    detectable_exact: float | None = None  # the same if every nuisance parameter were exact
    expected: float | None = None  # size, by the score
    remainder: Misfit | None = None  # tests of the residual that it leaves
    session_gain: tuple[float, float] | None = None  # over left-out sessions, in log likelihood; standard error
    paired: PairedGain | None = None  # the same over conditions
    cost: float | None = None  # its extended BIC
    bic_gain: float | None = None  # BIC of the model without it less that with it
    held_out_error: tuple[float, float, float] | None = None  # relative rms on held-out runs, with 95 % interval
    left_out: float | None = None  # error on left-out runs over that without it
    left_out_error: float | None = None  # relative rms on left-out runs
    removed: float | None = None  # share of what is beyond noise that it removes on left-out runs
    remaining: float | None = None  # relative rms beyond noise that it leaves there
    interval: tuple[float, float] | None = None  # 95 % of the size, or of the mean of sizes that differ
    differs: bool | None = None  # whether the sizes that specimens ask for have a mean that is not the null
    birge: float = 1.0  # by which what it leaves widens the noise
    spread: float = 0.0  # of sizes that differ, on the scale of the fit
    sizes: Sizes = field(default_factory=dict)  # of each fitted specimen, with its interval; empty: one size
    pulls: tuple[Pull, ...] = ()  # of wrong numbers
    instead: tuple[str, ...] = ()  # what cannot be told from it, in words
    imitable: float | None = None  # imitability index
    transfer: float | None = None  # p-value that it carries over to other runs
    held_out: tuple[SetErrors, ...] | None = None  # on runs to which it was not fitted, before and after

    def of_score(self) -> Evidence:
        """Return what the score alone says, for another fit."""
        names = ("score", "survived", "detectable", "detectable_exact", "expected")
        return Evidence(**{name: getattr(self, name) for name in names})


@dataclass(frozen=True)
class Hypothesis:
    """The base model and something more, fitted and judged."""

    origin: Origin
    added: tuple[Parameter, ...]  # to the base model: those that it had before, and the new one last
    fit: Fit | None = None
    evidence: Evidence = field(default_factory=Evidence)
    reason: Reason = Reason.NOT_NEEDED
    doubts: tuple[Reason, ...] = ()  # what makes it uncertain
    said: str = ""  # of a law: in words, with its exponents
    law: Mapping[str, Any] = field(default_factory=dict)  # what makes its model of one without the law

    def seen(self, **evidence: Any) -> Hypothesis:
        """Add evidence."""
        return replace(self, evidence=replace(self.evidence, **evidence))

    @property
    def fitted(self) -> Fit:
        """The fit of a hypothesis that has one."""
        assert self.fit is not None
        return self.fit

    @property
    def model(self) -> ForwardModel:
        """The model that has it, which is fitted."""
        return self.fitted.model

    @property
    def effect(self) -> Parameter:
        """What is added last."""
        return self.added[-1]

    @property
    def size(self) -> float:
        """The fitted size of what is added last; the mean where sizes differ."""
        return float(self.fitted.parameters[self.effect.name])

    @property
    def score(self) -> float:
        """Its score; 0 if it has none."""
        return self.evidence.score or 0.0

    @property
    def kept(self) -> bool:
        return self.reason is Reason.KEPT

    @property
    def no_fit(self) -> bool:
        """Whether there is no fit of it from which anything could be concluded."""
        return self.reason in (Reason.NOT_SOLVED, Reason.NOT_CONVERGED)

    @property
    def at_theory(self) -> bool:
        return self.origin is Origin.THEORY

    @property
    def at_an_end(self) -> bool:
        """Whether the fitted size of one of the effects is at an end of its range."""
        names, sizes = self.fitted.names, self.fitted.parameters
        free = [e for e in self.added if e.name in names]
        return any(np.isclose(sizes[e.name], e.bounds, atol=0.0).any() for e in free)

    @property
    def logarithmic(self) -> bool:
        """Whether its sizes differ in their logarithm."""
        fitted = self.fitted.fitted
        return bool(self.evidence.sizes) and next(p for p in fitted if p.name == self.effect.name).logarithmic

    @property
    def title(self) -> str:
        """What is added, in words, with its size if theory gives it."""
        if self.said:
            return self.said
        title = " and ".join(e.title for e in self.added)
        if self.origin is Origin.NUMBER:
            return f"the stated value of {', '.join(e.title for e in self.added)} is wrong"
        if not self.at_theory:
            return title
        sizes = " and ".join(f"{e.theory:g}" for e in self.added)
        return f"{title} at the size{'s' * (len(self.added) > 1)} of theory, {sizes}"

    @property
    def words(self) -> str:
        """Titles and names of all that is added."""
        return self.said or " and ".join(e.words for e in self.added)

    @property
    def why(self) -> str:
        """Why it is kept or not, in words."""
        if self.reason is Reason.LEAVES_RESIDUAL and self.evidence.remainder:
            return f"{self.reason} (p ≤ {self.evidence.remainder.p_value:.1g})"
        return str(self.reason)
