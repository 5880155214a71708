"""What a calibration finds: the rule of its verdict, and the numbers.

"none": no departure beyond noise. "number": a nuisance parameter is wrong, and explains it. "effect": one effect,
or one pair, explains it. "ambiguous": several do, and the runs cannot tell them apart. "unexplained": there is a
departure, and nothing in the catalogue explains it. A law may describe it; a law is no claim about the cause.
"partial": the same, but an effect, with a size that may differ between specimens, predicts runs that it has not
seen (`calibration.attribution.nearest`). It is adopted as a description, and claims no cause.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from calibration.attribution.attribution import Attribution
from calibration.attribution.hypothesis import Hypothesis
from calibration.attribution.rules import REJECTED
from calibration.attribution.wrong_numbers import wrong_number
from calibration.findings.held_out import HeldOutErrors
from calibration.findings.next_runs import Batch, Explanation, NextRun
from calibration.statistics.fit import Fit, Pull
from calibration.statistics.statistical_model import Parameter
from calibration.statistics.study import FinalRefit, Split
from calibration.table.between_repeats import Difference
from calibration.table.excluded import Excluded, count_of_rows, summary_of_excluded
from calibration.table.runs import Runs
from common.arrays import Floats

_HALF = 0.5  # of an error on left-out runs
_SHORT = 30  # letters of what is added to a model, in the model's name


class Description(Protocol):
    """What describes a residual that nothing explains, such as laws (`calibration.laws`)."""

    @property
    def kept(self) -> Sequence[Hypothesis]:
        """Those that are kept, best first."""
        ...

    @property
    def complete(self) -> bool:
        """Whether the best one leaves no more than noise."""
        ...

    @property
    def prediction(self) -> Floats:
        """(n, k) of the best one."""
        ...

    @property
    def rivals(self) -> tuple[Hypothesis, ...]:
        """Those that the runs cannot tell apart; none if there are not two."""
        ...

    def as_good_as(self, claim: Fit) -> tuple[Hypothesis, ...]:
        """List those that fit as well as a claimed effect."""
        ...

    def to_dict(self, claim: Fit | None = None) -> dict[str, Any]:
        """Return the record for verdict.json."""
        ...


@dataclass(frozen=True, repr=False)
class Findings:
    """What runs say about a model, in numbers."""

    verdict: str  # "none", "number", "effect", "ambiguous", "partial", "unexplained"; see `Attribution.verdict`
    runs: Runs  # that were calibrated with
    split: Split  # fitted and held-out runs
    attribution: Attribution  # the residual, and what explains it
    differences: tuple[Difference, ...]  # what repeats and identities say without the model
    errors: HeldOutErrors  # on the held-out runs
    base_intervals: dict[str, tuple[float, float]]  # 95 %, by profile deviance
    final_intervals: dict[str, tuple[float, float]]  # the same, of the final model
    pulls: tuple[Pull, ...]  # of every nuisance parameter in the final model, the farthest first
    final_refit: FinalRefit  # the final model, fitted to all runs
    law: Description | None  # laws, where they were looked for
    explanations: tuple[Explanation, ...]  # that the runs cannot tell apart, best first; none if there are not two
    next_runs: tuple[NextRun, ...]  # single settings that would, the best first
    next_batch: Batch | None  # the same, for several runs together
    numbers: tuple[str, ...]  # names of the model's own coefficients and nuisance parameters
    catalogue: tuple[str, ...]  # names of its effects
    untestable: dict[str, str]  # effects that these runs cannot test: what is missing
    draws: int  # of the bootstrap
    fixed_before: str  # hash of what was fixed before the runs were looked at
    little_weight: tuple[int, ...]  # rows of the table whose runs have less than half of the usual weight
    not_tried: tuple[str, ...]  # because no time was left; such a verdict is provisional
    caveats: tuple[str, ...]  # what weakens the conclusion, in words

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that explain the residual."""
        return tuple(dict.fromkeys(e.name for c in self.claims for e in c.added))

    @property
    def claims(self) -> tuple[Hypothesis, ...]:
        """What explains the residual, best first."""
        return self.attribution.claims

    @property
    def nearest(self) -> Hypothesis | None:
        """The form that is adopted, of a partial verdict."""
        return self.attribution.nearest

    @property
    def forms(self) -> tuple[Hypothesis, ...]:
        """Forms that left-out runs cannot tell apart, those at the size of theory first; none if there is one."""
        return self.attribution.forms

    @property
    def moves(self) -> tuple[Hypothesis, ...]:
        """Numbers that differ in some runs."""
        return self.attribution.moves

    @property
    def withdrawn(self) -> tuple[Hypothesis, ...]:
        """Claims that held-out runs refuted, in order."""
        return self.attribution.withdrawn

    @property
    def not_fitted(self) -> tuple[Hypothesis, ...]:
        """Effects that may be missing, by their scores, of which there is no fit."""
        least = self.attribution.misfit.critical_z if self.runs.noise_known else 0.0
        return tuple(c for c in self.attribution.candidates if c.no_fit and abs(c.score) > least)

    @property
    def halving(self) -> str | None:
        """Title of the form that halves the error on left-out runs, the best one; None if none does."""
        left_out = {
            c.title: c.evidence.left_out for c in self.attribution.candidates if c.evidence.left_out is not None
        }
        best = min(left_out, key=left_out.__getitem__, default=None)
        return best if best is not None and left_out[best] < _HALF else None

    @property
    def certain(self) -> tuple[Parameter, ...]:
        """Effects that all explanations have in common, where they are several."""
        first, *others = [c.added for c in self.claims] or [()]
        return tuple(e for e in first if others and all(e in claimed for claimed in others))

    @property
    def undecided(self) -> tuple[tuple[Parameter, ...], ...]:
        """What each explanation has beside them, where something is certain; nothing: none is needed."""
        certain = self.certain
        return tuple(tuple(e for e in c.added if e not in certain) for c in self.claims) if certain else ()

    @property
    def paths(self) -> tuple[Any, ...]:
        """Errors on paths, of a robot for which they were asked."""
        return ()

    @property
    def handed_on(self) -> tuple[Parameter, ...]:
        """What was fitted to all runs and any other run has, too."""
        return tuple(p for p in self.final_refit.fitted if p.name in (*self.numbers, *self.catalogue))

    @property
    def base(self) -> Fit:
        """The calibrated model, without effects."""
        return self.attribution.base

    @property
    def final(self) -> Fit:
        """The model with the effects of the verdict, with the form that is adopted, or without any."""
        return self.attribution.final

    @property
    def models(self) -> dict[str, str]:
        """What each model with an error on the held-out runs is called; "after" only where it adds something."""
        named = {"uncalibrated": "model unchanged", "before": "refitted"}
        if self.verdict == "number":
            free = " and ".join(of.title for of in self.attribution.explanations[0].added)
            named["after"] = f"refitted, {free} free"
        elif adopted := self.nearest or next(iter(self.claims), None):
            title, several = " and ".join(of.title for of in adopted.added), len(adopted.added) > 1
            short = title if len(title) <= _SHORT else "the effects" if several else "the effect"
            named["after"] = f"refitted with {short}"
        return named | {"law": "refitted with the best law"} if "law" in self.errors.rms else named

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
    def error_corrected(self) -> float:
        """Relative error of the corrected robot on the held-out runs."""
        if self.described:
            return self.errors.rms["law"]
        return self.error_before if self.nearest and not self.held_out_error_falls else self.error_after

    @property
    def noise_ceiling(self) -> float:
        """Relative error that noise alone makes."""
        return self.errors.noise

    @property
    def excluded(self) -> tuple[Excluded, ...]:
        """Rows and columns that were not used, and why."""
        return (*self.runs.excluded, *self.split.outliers)

    @property
    def rows(self) -> int:
        """Number of rows of the table, used or not."""
        return len(self.runs) + count_of_rows(self.runs.excluded)

    @property
    def summary_of_excluded(self) -> list[str]:
        """What was excluded, by reason, with the number of rows."""
        return summary_of_excluded(self.excluded, self.rows)

    @property
    def wrong_numbers(self) -> tuple[tuple[Pull, ...], ...]:
        """Nuisance parameters that the runs contradict; each with those that may be wrong in its place.

        Where nothing explains the residual there are none: what is missing pulls at them, too.
        """
        if self.verdict in ("partial", "unexplained"):
            return ()
        freed = {p.parameter.name: p for p in self.pulls if p.freed}
        known = tuple((freed[alike[0].parameter.name], *alike[1:]) for alike in self.final.wrong_numbers)
        further = wrong_number([p for p in self.pulls if not p.freed])
        return (*known, further) if further else known

    @property
    def held_out_error_falls(self) -> bool | None:
        """Whether what is claimed lowers the error on the held-out runs; None where nothing is claimed."""
        return None if self.verdict in ("none", "unexplained") else self.errors.fall

    @property
    def gain_is_certain(self) -> bool | None:
        """Whether the 95 % interval of that fall is above zero; None where nothing is claimed."""
        interval = self.errors.gain_interval
        return None if interval is None else interval[0] > 0

    @property
    def advice(self) -> str:
        """Which model to use: "as given", "corrected", or "wait" for new runs, with neither until then.

        Where numbers differ in some runs, these may be the reason why held-out runs depart from the model.
        """
        corrected_is_without = self.nearest is not None and not self.held_out_error_falls
        claimed = self.held_out_error_falls is not None and not corrected_is_without
        no_gain = self.held_out_error_falls is False or self.gain_is_certain is False
        described = self.verdict in ("partial", "unexplained")  # more than noise is left anyway
        if not self.moves and self.error_corrected >= self.error_uncalibrated:
            return "wait" if self.halving else "as given"
        if (claimed and no_gain) or not (self.held_out_runs_agree or described or self.moves):
            return "wait"
        return "corrected"

    @property
    def held_out_runs_agree(self) -> bool:
        """Whether the held-out runs agree with the final model."""
        return self.errors.p_value >= REJECTED or not self.runs.noise_known

    @property
    def harmless(self) -> bool:
        """Whether an unexplained residual is so small that predictions do not suffer from it.

        If noise and departure add in squares, the departure is smaller than the noise of a run where the error on
        the held-out runs is below √2 times that noise. The whole 95 % interval of the error must be below it, the
        interval must reach down to the noise, and the held-out runs must agree with the calibrated model.
        """
        low, high = self.errors.after_interval
        small = low <= self.noise_ceiling and high < math.sqrt(2) * self.noise_ceiling
        return self.verdict == "unexplained" and self.runs.noise_known and small and self.held_out_runs_agree

    @property
    def described(self) -> bool:
        """Whether a law describes a residual that nothing explains, and leaves no more than noise."""
        return self.verdict == "unexplained" and self.law is not None and self.law.complete

    @property
    def in_form_only(self) -> tuple[str, ...]:
        """Named effects whose whole interval is outside the sizes that their source allows."""
        names = []
        for effect in self.claims[0].added if self.claims else ():
            low, high = self.final_intervals[effect.name]
            if effect.plausible and (high < effect.plausible[0] or low > effect.plausible[1]):
                names.append(effect.name)
        return tuple(names)
