"""The verdict on a table of runs: its contents, in one sentence, and as verdict.json.

"none": no departure beyond noise. "number": a number as given is wrong, and explains it. "effect": one effect,
or one pair, explains it. "ambiguous": several do, and the runs cannot tell them apart. "unexplained": there is a
departure, and nothing in the catalogue explains it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from calibration.attribution.refits import Candidate
from calibration.statistics.fit import Fit
from calibration.statistics.forward_model import Predictive
from calibration.statistics.held_out import Delivered
from calibration.statistics.priors import Pull, likeliest, rivals
from calibration.statistics.residual_tests import Misfit
from calibration.verdict.next_runs import Batch, NextRun
from calibration.verdict.residual_regression import Generic
from calibration.verdict.sequential_test import Explanation
from sim.arrays import Flags, Floats
from sim.io.provenance import provenance

_NOTABLE = 2.0  # pull of a number as given beyond which the sentence says so
_NEAR = 0.5  # if no effect explains the residual, the best one is named if it removes at least this share


@dataclass(frozen=True)
class Verdict:
    """What runs say about a model; made by `softflagella.calibrate`.

    Example:
        >>> from softflagella import calibrate
        >>> calibrate("runs.csv", "robot.toml").sentence  # doctest: +SKIP
        'No effect is missing that these runs can show (p = 0.43).'
    """

    verdict: str  # "none", "number", "effect", "ambiguous", "unexplained"
    effects: tuple[str, ...]
    explaining: tuple[Candidate, ...]  # what explains the residual, best first; more than one: not told apart
    base: Fit  # calibrated, without effects
    final: Fit  # the model with the effects of the verdict, or without any
    base_intervals: dict[str, tuple[float, float]]  # 95 %, by profile deviance
    final_intervals: dict[str, tuple[float, float]]
    misfit: Misfit
    draws: int  # of its bootstrap
    candidates: tuple[Candidate, ...]
    numbers: tuple[Pull, ...]  # every number as given in the final model, the farthest first
    instead: tuple[Candidate, ...]  # effects that explain as much as the number that is wrong
    generic: Generic  # correction of the calibrated model's outputs
    predictive: Predictive | None  # what is handed on where nothing explains the residual
    explanations: tuple[Explanation, ...]  # that the runs cannot tell apart, best first; none if there are not two
    next_runs: tuple[NextRun, ...]  # that would tell them apart
    next_batch: Batch | None  # the same, for several runs together
    error_uncalibrated: float
    error_generic: float
    error_predictive: float | None
    error_before: float
    error_after: float
    error_after_interval: tuple[float, float]
    noise_ceiling: float
    locked_p: float  # agreement of the locked runs with the final model
    delivered: Delivered  # the final model fitted to all runs
    errors_by_output: dict[str, dict[str, float]]
    locked: str  # names of the sessions
    sessions: tuple[str, ...]  # names of all sessions
    used: Flags
    uncalibrated: Floats  # (n, k) prediction of the model as given
    untestable: dict[str, str]  # effects that these runs cannot test: what is missing
    plan_hash: str  # of everything fixed before the data was looked at
    set_aside: tuple[str, ...]
    limits: tuple[str, ...]

    @property
    def wrong_numbers(self) -> tuple[tuple[Pull, ...], ...]:
        """Numbers as given that the runs contradict; each with those that may be wrong in its place.

        Where nothing explains the residual there are none: what is missing pulls at the numbers, too.
        """
        if self.verdict == "unexplained":
            return ()
        freed = {p.parameter.name: p for p in self.numbers if p.freed}
        found = tuple((freed[alike[0].parameter.name], *alike[1:]) for alike in self.final.wrong)
        far = [p for p in self.numbers if not p.freed]
        worst = likeliest(far)
        return found if worst is None else (*found, rivals(far, worst))

    @property
    def sentence(self) -> str:
        """The verdict in one sentence with its certainty; a second one for a number as given that is wrong."""
        words = self._number_words
        if self.verdict == "number":
            if not self.instead:
                return f"{words} No effect is claimed."
            names = " or ".join(" and ".join(e.title for e in c.claimed) for c in self.instead)
            return f"{words} No effect is claimed. If the number is right, {names} would explain as much."
        return f"{words} {self._effect_words}" if words else self._effect_words

    @property
    def _number_words(self) -> str:
        """The numbers that are wrong, or the one that is farthest off if it is notable."""
        if self.wrong_numbers:
            said = "; and ".join(", or ".join(p.words for p in alike) for alike in self.wrong_numbers)
            return f"A number as given is wrong: {said}."
        if (
            self.verdict != "unexplained"
            and self.numbers
            and self.numbers[0].learnt
            and abs(self.numbers[0].z) > _NOTABLE
        ):
            return f"{self.numbers[0].words}."
        return ""

    @property
    def _effect_words(self) -> str:
        # The bootstrap resolves no smaller p than 2/(draws + 1).
        relation = "≤" if self.misfit.p_value <= 2.01 / (self.draws + 1) else "="
        p = f"p {relation} {self.misfit.p_value:.2g}"
        if self.verdict == "none":
            return f"No effect is missing that these runs can show ({p})."
        if self.verdict == "effect":
            best = self.explaining[0]
            assert best.refit is not None
            sizes = []
            for effect in best.claimed:
                low, high = self.final_intervals[effect.name]
                like = "something in form like " if effect.name in self.in_form_only else ""
                size = best.refit.parameters[effect.name]
                sizes.append(f"{like}{effect.title}, size {size:.3g} ({low:.3g} to {high:.3g})")
            other = "other effect" if len(sizes) == 1 else "single effect or other pair"
            said = " and ".join(sizes) + self._outside
            return f"The residual ({p}) is consistent with {said}, and with no {other} of the catalogue."
        if self.verdict == "ambiguous":
            names = " or ".join(" and ".join(e.title for e in c.claimed) for c in self.explaining)
            names += self._outside
            return f"The residual ({p}) is explained by {names}: these runs cannot tell them apart."
        none = "no effect and no pair of effects of the catalogue explains"
        return f"There is a residual ({p}) that {none}{self._nearest}.{self._steered}"

    @property
    def _steered(self) -> str:
        """What a robot can be steered with although nothing explains the residual."""
        if self.predictive is None or self.error_predictive is None:
            return ""
        return (
            f" corrected.toml has a correction that describes it: {100 * self.error_predictive:.1f} % on runs "
            f"that it was not learnt from, {100 * self.error_before:.1f} % without it."
        )

    @property
    def in_form_only(self) -> tuple[str, ...]:
        """Named effects whose whole interval is outside the sizes that their source allows."""
        found = []
        for effect in self.explaining[0].claimed if self.explaining else ():
            low, high = self.final_intervals[effect.name]
            if effect.plausible and (high < effect.plausible[0] or low > effect.plausible[1]):
                found.append(effect.name)
        return tuple(found)

    @property
    def _outside(self) -> str:
        """A claim that something outside the catalogue could imitate says so."""
        if not any(c.doubted for c in self.explaining):
            return ""
        many = len(self.explaining) > 1 or len(self.explaining[0].claimed) > 1
        return f", or something outside the catalogue that looks like {'them' if many else 'it'}"

    @property
    def _nearest(self) -> str:
        """The single effect that removes most of the residual, if one was refitted and removes much."""
        refits = [(c.refit.deviance, c.effect.title) for c in self.candidates if c.refit is not None]
        if not refits:
            return ""
        deviance, title = min(refits)
        expected = int(self.used.sum()) * self.base.prediction.shape[1]
        share = (self.base.deviance - deviance) / max(self.base.deviance - expected, 1e-9)
        if share < _NEAR:
            return ""
        return f"; the nearest, {title}, removes {100 * min(share, 1.0):.0f} % of it and leaves more than noise"


def verdict_record(result: Verdict, *, table: str) -> dict[str, Any]:
    """verdict.json."""
    final = result.final
    parameters = {
        name: {
            "value": final.parameters[name],
            "interval": list(result.final_intervals[name]),
            "value_all_runs": result.delivered.parameters[name],
        }
        for name in final.names
    }
    return {
        "verdict": result.verdict,
        "effects": list(result.effects),
        "sentence": result.sentence,
        "parameters": parameters,
        "in_form_only": list(result.in_form_only),
        "imitability": [c.imitable for c in result.explaining],
        "transfer_p": [c.transfer for c in result.explaining],
        "imitable": any(c.doubted for c in result.explaining),
        "effects_instead": [[e.name for e in c.claimed] for c in result.instead],
        "wrong_numbers": [[p.parameter.name for p in alike] for alike in result.wrong_numbers],
        "numbers_as_given": [_number_record(p) for p in result.numbers],
        "error_uncalibrated": result.error_uncalibrated,
        "error_before": result.error_before,
        "error_after": result.error_after,
        "error_generic": result.error_generic,
        "error_predictive": result.error_predictive,
        "error_after_interval": list(result.error_after_interval),
        "noise_ceiling": result.noise_ceiling,
        "errors_by_output": result.errors_by_output,
        "p_value": result.misfit.p_value,
        "p_general": result.misfit.general_p,
        "p_of_each_test": result.misfit.p,
        "critical_z": result.misfit.critical_z,
        "candidates": [
            {
                "effect": c.effect.name,
                "z": c.z,
                "survived_share": c.survived,
                "smallest_detectable": c.detectable,
                "smallest_detectable_if_numbers_were_exact": c.detectable_exact,
                "size": c.refit.parameters[c.effect.name] if c.refit else None,
                "deviance": c.refit.deviance if c.refit else None,
                "session_gain": [c.gain, c.gain_error],
                "verdict": c.verdict,
            }
            for c in result.candidates
        ],
        "untestable": result.untestable,
        "generic_features": list(result.generic.features),
        "correction_terms": list(result.predictive.terms) if result.predictive else [],
        "explanations": [one.record() for one in result.explanations],
        "sessions": list(result.sessions),
        "next_runs": [run.record() for run in result.next_runs],
        "next_batch": result.next_batch.record() if result.next_batch else None,
        "locked_test": result.locked,
        "locked_p_value": result.locked_p,
        "fixed_before": result.plan_hash,
        "rows_set_aside": list(result.set_aside),
        "limits": list(result.limits),
        "table": table,
        "provenance": provenance({"table": table}),
    }


def _number_record(pull: Pull) -> dict[str, Any]:
    one = pull.parameter
    return {
        "name": one.name,
        "title": one.title,
        "given": one.start,
        "sigma": one.sigma,
        "scale": "logarithm" if one.logarithmic else "as it is",
        "change": pull.change,
        "change_error": pull.error,
        "change_by_the_runs_alone": pull.alone,
        "change_by_the_runs_alone_error": pull.alone_error,
        "pull": pull.z,
        "words": pull.words,
    }
