"""The whole loop: split, fit, test, attribute, refit, and open the locked test once.

1. One whole session is locked away before anything is looked at (`locked_session`); rows are never split.
2. Covariance from the repeats and the sessions (`calibration.noise`).
3. Fit of the coefficients to the other sessions (`calibration.fit`).
4. Lack of fit, kernel score and projected scores (`calibration.misfit`).
5. Refit with each effect that passes; keep what explains (`calibration.attribute`).
6. Verdict: "none" (no departure beyond noise), "effect" (one explains it), "ambiguous" (several do and the runs
   cannot tell them apart), "unexplained" (there is a departure, and no effect in the catalogue explains it).
7. Where no single effect explains it, pairs; where several do, the runs that would tell them apart.
8. Errors on the locked session: as given, calibrated, with the effect, with a generic correction of the calibrated
   model (`calibration.generic`), and the noise ceiling.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.attribute import Candidate, directions, examine, explaining, pairs
from calibration.discriminate import NextRun, next_runs
from calibration.fit import Fit, fit
from calibration.generic import Generic, correct
from calibration.misfit import DRAWS, Misfit, check_misfit
from calibration.model import Floats, Model, Parameter, Runs, start_values
from sim.artefact import fingerprint, provenance

LEVEL = 0.05  # α of every claim


@dataclass(frozen=True)
class Verdict:
    """What runs say about a model."""

    verdict: str  # "none", "effect", "ambiguous", "unexplained"
    effects: tuple[str, ...]
    explaining: tuple[Candidate, ...]  # what explains the residual, best first; more than one: not told apart
    base: Fit  # calibrated, without effects
    final: Fit  # the model to go on with
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
    errors_by_output: dict[str, dict[str, float]]
    locked: str
    used: NDArray[np.bool_]
    uncalibrated: Floats  # (n, k) prediction of the model as given
    untestable: dict[str, str]  # effects that these runs cannot test: what is missing
    plan_hash: str  # of everything fixed before the data was looked at
    set_aside: tuple[str, ...]

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
                low, high = best.refit.interval(effect.name)
                sizes.append(
                    f"{effect.title}, size {best.refit.parameters[effect.name]:.3g} ({low:.3g} to {high:.3g})"
                )
            other = "other effect" if len(sizes) == 1 else "single effect or other pair"
            said = " and ".join(sizes)
            return f"The residual ({p}) is consistent with {said}, and with no {other} of the catalogue."
        if self.verdict == "ambiguous":
            names = " or ".join(" and ".join(e.title for e in (*c.beside, c.effect)) for c in self.explaining)
            return f"The residual ({p}) is explained by {names}: these runs cannot tell them apart."
        return f"There is a residual ({p}) that no effect and no pair of effects of the catalogue explains."


def locked_session(data: Runs) -> int:
    """The session kept for the test: the middle one by name, so that it is interpolated to."""
    return len(data.session_names) // 2


def close(model: Model, *, level: float = LEVEL, seed: int = 0, progress: bool = True) -> Verdict:
    """Close the loop on a model's runs.

    Args:
        model: its parameters' starts are the model "as given" (uncalibrated).
        level: α of every claim.
        seed: of the bootstrap; the result is deterministic given it.
        progress: show bars.
    """
    data, effects = model.runs, model.effects
    fixed = {
        "level": level,
        "seed": seed,
        "catalogue": [e.name for e in effects],
        "locked": data.session_names[locked_session(data)],
    }
    used = data.session != locked_session(data)
    start = start_values(model)
    coefficients = tuple(p.name for p in model.coefficients)
    guess = model.guess(dict(start), used)
    uncalibrated = model.predict([start], title="as given" if progress else "")[0]
    base = fit(model, guess, coefficients, used, title="fit" if progress else "")
    along = directions(model, base.parameters, base.prediction, effects, title="effects" if progress else "")
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
    generic = correct(data, base.prediction, used)
    ahead: list[NextRun] = []
    if len(best) > 1 and best[0].refit and best[1].refit:
        ahead = next_runs(model, best[0].refit, best[1].refit, seed=seed)
    errors = {
        name: _errors(data, prediction, ~used)
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
        misfit=misfit,
        candidates=tuple(found) or _unexamined(misfit, effects),
        error_uncalibrated=errors["uncalibrated"][0],
        error_before=errors["before"][0],
        error_generic=errors["generic"][0],
        generic=generic,
        next_runs=tuple(ahead),
        error_after=errors["after"][0],
        error_after_interval=_interval(data, final.prediction, ~used, seed),
        noise_ceiling=ceiling,
        errors_by_output={k: v[1] for k, v in errors.items()},
        locked=data.session_names[locked_session(data)],
        used=used,
        uncalibrated=uncalibrated,
        untestable=dict(model.untestable),
        plan_hash=fingerprint(fixed),
        set_aside=data.set_aside,
    )


def _unexamined(misfit: Misfit, effects: tuple[Parameter, ...]) -> tuple[Candidate, ...]:
    scores = misfit.scores
    return tuple(
        Candidate(e, (), float(z), float(s), misfit.critical_z / max(float(n), 1e-300), None, None, 0.0, 0.0,
                  "not needed")
        for e, z, s, n in zip(effects, scores.z, scores.survived, scores.length, strict=True)
    )  # fmt: skip


def _errors(data: Runs, prediction: Floats, rows: NDArray[np.bool_]) -> tuple[float, dict[str, float]]:
    """Relative rms over runs and outputs (θ in rad), and per output."""
    square = ((data.y - prediction)[rows] ** 2).mean(0)
    each = dict(zip(data.outputs, np.sqrt(square).tolist(), strict=True))
    return float(np.sqrt(square.mean())), each


def _interval(data: Runs, prediction: Floats, rows: NDArray[np.bool_], seed: int) -> tuple[float, float]:
    """95 % interval of the relative rms by resampling conditions."""
    square = ((data.y - prediction)[rows] ** 2).mean(1)
    condition = data.condition[rows]
    kinds = np.unique(condition)
    means = np.array([square[condition == c].mean() for c in kinds])
    rng = np.random.default_rng(seed)
    drawn = np.sqrt(means[rng.integers(0, len(kinds), (2000, len(kinds)))].mean(1))
    return float(np.quantile(drawn, 0.025)), float(np.quantile(drawn, 0.975))


def verdict_record(result: Verdict, *, table: str) -> dict[str, Any]:
    """verdict.json."""
    final = result.final
    parameters = {
        name: {"value": final.parameters[name], "interval": list(final.interval(name))} for name in final.names
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
        "p_lack_of_fit": result.misfit.general_p,
        "p_scores": result.misfit.score_p,
        "critical_z": result.misfit.critical_z,
        "candidates": [
            {
                "effect": c.effect.name,
                "z": c.z,
                "survived_share": c.survived,
                "smallest_detectable": c.detectable,
                "size": c.refit.parameters[c.effect.name] if c.refit else None,
                "chi_square": c.refit.chi_square if c.refit else None,
                "session_gain": [c.gain, c.gain_error],
                "verdict": c.verdict,
            }
            for c in result.candidates
        ],
        "untestable": result.untestable,
        "generic_features": list(result.generic.features),
        "next_runs": [run.record() for run in result.next_runs],
        "locked_test": result.locked,
        "fixed_before": result.plan_hash,
        "rows_set_aside": list(result.set_aside),
        "table": table,
        "provenance": provenance({"table": table}),
    }
