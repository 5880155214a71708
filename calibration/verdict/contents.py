"""What a verdict contains: the evidence, the fits, the errors, the corrections, and what was fixed before."""

from __future__ import annotations

from dataclasses import dataclass

from calibration.attribution.refits import Candidate
from calibration.statistics.exclusions import summary_of_excluded
from calibration.statistics.fit import Fit
from calibration.statistics.held_out import FinalRefit
from calibration.statistics.pull import Pull
from calibration.statistics.residual_regression import Regression
from calibration.statistics.residual_tests import Misfit
from calibration.statistics.study import Split
from calibration.verdict.experiment import Description, LearntCorrection
from calibration.verdict.next_runs import Batch, NextRun
from calibration.verdict.sequential_test import Explanation
from sim.arrays import Floats


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
    little_weight: tuple[int, ...] = ()  # rows of the table whose runs have less than half of the usual weight

    @property
    def summary_of_excluded(self) -> list[str]:
        """What was excluded, by reason, with the number of rows."""
        return summary_of_excluded(self.excluded, self.rows)
