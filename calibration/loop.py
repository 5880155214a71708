"""The whole loop: split, fit, test, attribute, refit, and open the locked test once.

1. Whole sessions are locked away before anything is looked at (by default the middle one); rows are never split.
   Runs with gross errors are set aside (`calibration.gross`).
2. Covariance from the repeats and the sessions (`calibration.noise`).
3. Fit of the coefficients to the other sessions (`calibration.fit`).
4. Lack of fit, kernel score and projected scores (`calibration.misfit`).
5. Refit with each effect that passes; keep what explains (`calibration.attribute`).
6. Verdict: "none" (no departure beyond noise), "effect" (one explains it), "ambiguous" (several do and the runs
   cannot tell them apart), "unexplained" (there is a departure, and no effect in the catalogue explains it).
7. Where no single effect explains it, pairs; where several do, the runs that would tell them apart.
8. Errors on the locked runs: as given, calibrated, with the effect, with a generic correction of the calibrated
   model (`calibration.generic`), and the noise ceiling; and whether they agree with the final model
   (`calibration.locked`).
9. For use, the model is fitted once more to all runs, the locked ones included.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.attribute import Candidate, examine, explaining, inside, pairs
from calibration.discriminate import NextRun, next_runs
from calibration.fit import Fit, fit
from calibration.generic import Generic, correct
from calibration.gross import gross_errors
from calibration.locked import error_interval, errors, fitted_to_all, locked_p_value, middle_session
from calibration.misfit import DRAWS, Misfit, check_misfit
from calibration.model import Floats, Model, Parameter, start_values
from calibration.profile import profile_intervals
from calibration.sessions import divided, groups, limits
from sim.io.provenance import fingerprint, provenance

LEVEL = 0.04  # α of every claim: noise is estimated, and false claims shall stay below one in twenty
_NEAR = 0.5  # share of the residual that an effect must take away to be worth a word where none explains


@dataclass(frozen=True)
class Verdict:
    """What runs say about a model."""

    verdict: str  # "none", "effect", "ambiguous", "unexplained"
    effects: tuple[str, ...]
    explaining: tuple[Candidate, ...]  # what explains the residual, best first; more than one: not told apart
    base: Fit  # calibrated, without effects
    final: Fit  # the model to go on with
    base_intervals: dict[str, tuple[float, float]]  # 95 %, by profile deviance
    final_intervals: dict[str, tuple[float, float]]
    misfit: Misfit
    candidates: tuple[Candidate, ...]
    generic: Generic  # correction of the calibrated model
    next_runs: tuple[NextRun, ...]  # where two effects cannot be told apart
    error_uncalibrated: float
    error_generic: float
    error_before: float
    error_after: float
    error_after_interval: tuple[float, float]
    noise_ceiling: float
    locked_p: float  # agreement of the locked runs with the final model
    delivered: dict[str, float]  # parameters of the final model fitted to all runs
    errors_by_output: dict[str, dict[str, float]]
    locked: str  # names of the sessions
    used: NDArray[np.bool_]
    uncalibrated: Floats  # (n, k) prediction of the model as given
    untestable: dict[str, str]  # effects that these runs cannot test: what is missing
    plan_hash: str  # of everything fixed before the data was looked at
    set_aside: tuple[str, ...]
    limits: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """The verdict in one sentence with its certainty."""
        # The bootstrap resolves no smaller p than 2/(draws + 1).
        relation = "≤" if self.misfit.p_value <= 2.01 / (DRAWS + 1) else "="
        p = f"p {relation} {self.misfit.p_value:.2g}"
        if self.verdict == "none":
            return f"No effect is missing that these runs can show ({p})."
        if self.verdict == "effect":
            best = self.explaining[0]
            assert best.refit is not None
            sizes = []
            for effect in (*best.beside, best.effect):
                low, high = self.final_intervals[effect.name]
                sizes.append(
                    f"{effect.title}, size {best.refit.parameters[effect.name]:.3g} ({low:.3g} to {high:.3g})"
                )
            other = "other effect" if len(sizes) == 1 else "single effect or other pair"
            said = " and ".join(sizes)
            return f"The residual ({p}) is consistent with {said}, and with no {other} of the catalogue."
        if self.verdict == "ambiguous":
            names = " or ".join(" and ".join(e.title for e in (*c.beside, c.effect)) for c in self.explaining)
            return f"The residual ({p}) is explained by {names}: these runs cannot tell them apart."
        none = "no effect and no pair of effects of the catalogue explains"
        return f"There is a residual ({p}) that {none}{self._nearest}."

    @property
    def _nearest(self) -> str:
        """Which single effect takes most of the residual away, if one was refitted and takes much."""
        refits = [(c.refit.deviance, c.effect.title) for c in self.candidates if c.refit is not None]
        if not refits:
            return ""
        deviance, title = min(refits)
        expected = int(self.used.sum()) * self.base.prediction.shape[1]
        share = (self.base.deviance - deviance) / max(self.base.deviance - expected, 1e-9)
        if share < _NEAR:
            return ""
        return f"; the nearest, {title}, takes {100 * min(share, 1.0):.0f} % of it away and leaves more than noise"


def close(
    model: Model,
    *,
    locked: NDArray[np.bool_] | None = None,
    level: float = LEVEL,
    seed: int = 0,
    progress: bool = True,
) -> Verdict:
    """Close the loop on a model's runs.

    Args:
        model: its parameters' starts are the model "as given" (uncalibrated).
        locked: (n,) runs kept for the test, whole sessions; default `locked.middle_session`.
        level: α of every claim.
        seed: of the bootstrap; the result is deterministic given it.
        progress: show bars.
    """
    data, effects = model.runs, model.effects
    locked = middle_session(data) if locked is None else locked
    group, group_names = groups(data) if divided(data, locked) else (data.session, data.session_names)
    names = ", ".join(group_names[g] for g in np.unique(group[locked]))
    fixed = {
        "level": level,
        "seed": seed,
        "catalogue": [e.name for e in effects],
        "locked": names,
    }
    start = start_values(model)
    coefficients = tuple(p.name for p in model.coefficients)
    uncalibrated = model.predict([start], title="as given" if progress else "")[0]
    model.check(uncalibrated)
    gross, reasons = gross_errors(data, uncalibrated)
    used, test = ~locked & ~gross, locked & ~gross
    guess = model.guess(dict(start), used)
    base = fit(model, guess, coefficients, used, title="fit" if progress else "")
    title = "derivatives" if progress else ""
    along = model.derivatives(base.parameters, [e.name for e in effects], title=title)[1]
    misfit = check_misfit(base, data, used, along, level=level, seed=seed)
    found: list[Candidate] = []
    if misfit.p_value < level:
        found = examine(
            model, base, misfit, effects, along, used, start, level=level, seed=seed, progress=progress
        )
    best = explaining(found)
    if misfit.p_value < level and not best:
        best = explaining(pairs(model, found, used, start, level=level, seed=seed, progress=progress))
    verdict = "none" if misfit.p_value >= level else ("unexplained", "effect", "ambiguous")[min(len(best), 2)]
    final = best[0].refit if best and best[0].refit else base
    title = "intervals" if progress else ""
    base_intervals = profile_intervals(model, base, used, title=title)
    final_intervals = base_intervals if final is base else profile_intervals(model, final, used, title=title)
    generic = correct(data, base.prediction, used)
    ahead: list[NextRun] = []
    if len(best) > 1 and best[0].refit and best[1].refit:
        ahead = next_runs(model, best[0].refit, best[1].refit, seed=seed)
    error = {
        name: errors(data, prediction, test)
        for name, prediction in (
            ("uncalibrated", uncalibrated),
            ("before", base.prediction),
            ("after", final.prediction),
            ("generic", base.prediction + generic.correction),
        )
    }
    ceiling = float(np.sqrt(np.trace(base.noise.run) / len(base.noise.run)))
    return Verdict(
        verdict=verdict,
        effects=tuple(dict.fromkeys(e.name for c in best for e in (*c.beside, c.effect))),
        explaining=tuple(best),
        base=base,
        final=final,
        base_intervals=base_intervals,
        final_intervals=final_intervals,
        misfit=misfit,
        candidates=tuple(found) or _unexamined(misfit, effects),
        error_uncalibrated=error["uncalibrated"][0],
        error_before=error["before"][0],
        error_generic=error["generic"][0],
        generic=generic,
        next_runs=tuple(ahead),
        error_after=error["after"][0],
        error_after_interval=error_interval(data, final.prediction, test, seed),
        noise_ceiling=ceiling,
        errors_by_output={k: v[1] for k, v in error.items()},
        locked_p=locked_p_value(final, data, test, seed=seed + 3),
        delivered=fitted_to_all(model, final, ~gross),
        locked=names,
        used=used,
        uncalibrated=uncalibrated,
        untestable=dict(model.untestable),
        plan_hash=fingerprint(fixed),
        set_aside=(*data.set_aside, *reasons),
        limits=(*data.limits, *limits(data, locked), *_unfinished(model, base, final)),
    )


def _unfinished(model: Model, base: Fit, final: Fit) -> tuple[str, ...]:
    """What keeps a fit from being the best one, in words."""
    found = [f"{name} is at the end of its range: these runs do not determine it" for name in final.at_bounds]
    if not inside(model, base.parameters):
        found.append(
            "without effects the coefficients run to the end of their range, so every effect was refitted from "
            "the model as given, and effects are told apart less surely"
        )
    if not final.arrived:
        found.append("the fit did not arrive at a minimum: its coefficients are not to be trusted")
    return tuple(found)


def _unexamined(misfit: Misfit, effects: tuple[Parameter, ...]) -> tuple[Candidate, ...]:
    scores = misfit.scores
    return tuple(
        Candidate(e, (), float(z), float(s), misfit.critical_z / max(float(n), 1e-300), None, None, 0.0, 0.0,
                  "not needed")
        for e, z, s, n in zip(effects, scores.z, scores.survived, scores.length, strict=True)
    )  # fmt: skip


def verdict_record(result: Verdict, *, table: str) -> dict[str, Any]:
    """verdict.json."""
    final = result.final
    parameters = {
        name: {
            "value": final.parameters[name],
            "interval": list(result.final_intervals[name]),
            "value_all_runs": result.delivered[name],
        }
        for name in final.names
    }
    return {
        "verdict": result.verdict,
        "effects": list(result.effects),
        "sentence": result.sentence,
        "parameters": parameters,
        "error_uncalibrated": result.error_uncalibrated,
        "error_before": result.error_before,
        "error_after": result.error_after,
        "error_generic": result.error_generic,
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
                "size": c.refit.parameters[c.effect.name] if c.refit else None,
                "deviance": c.refit.deviance if c.refit else None,
                "session_gain": [c.gain, c.gain_error],
                "verdict": c.verdict,
            }
            for c in result.candidates
        ],
        "untestable": result.untestable,
        "generic_features": list(result.generic.features),
        "next_runs": [run.record() for run in result.next_runs],
        "locked_test": result.locked,
        "locked_p_value": result.locked_p,
        "fixed_before": result.plan_hash,
        "rows_set_aside": list(result.set_aside),
        "limits": list(result.limits),
        "table": table,
        "provenance": provenance({"table": table}),
    }
