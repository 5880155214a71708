"""One law, fitted in the simulator from its linear model, and judged.

All its numbers are fitted together with the coefficients and the nuisance parameters. A fit that leaves more than
noise starts a second time, from the model as given. A law is kept if

- the fit converged within the ranges of its numbers, and its BIC is smaller than that of the model without a law,
- the interval of at least one of its numbers excludes the null, and that of its lever, if it has one, excludes 0,
  and
- it predicts left-out sessions better, by more than the uncertainty of that gain.

A lever is a part of the place, as the component of a force is. So laws are told apart if their gains in BIC differ
both with the price of a lever and without it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calibration.attribution.refits import session_gain
from calibration.laws.curves import Curve, error_bars, factors
from calibration.laws.group_factors import group_factors
from calibration.laws.law_model import LEVER, SIZE, LawModel
from calibration.laws.places import Place
from calibration.laws.readings import (
    EXPONENTS,
    INPUTS,
    in_words,
    logarithms,
    motion_patterns,
    noted_in_words,
    parameter_of,
)
from calibration.laws.search import Ranked
from calibration.statistics.fit import Fit, fit
from calibration.statistics.held_out import error_interval, errors
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.study import Study
from calibration.swimmer.swimmer import SwimmerModel
from sim.arrays import Flags, Floats
from sim.io.errors import InputError

NO_SESSIONS = "does not predict left-out sessions better"
NOT_CONVERGED = "its fit did not converge"
AT_THE_END = "a number is at the end of its range"
UNDETERMINED = (NOT_CONVERGED, AT_THE_END)  # reasons for which the runs exclude the numbers, not the place
NO_LEVER = "its lever is not told from none: a side force at the disc"  # unless that one fits worse
_LARGEST_AT_START = 50.0  # size of a term
_RPM = 30 / math.pi
_DRAWS = 400  # of the bootstrap, for the residual that a law leaves
_POINTS = 60  # of a curve
_LARGEST = 20.0  # logarithm of a factor: what the runs do not determine may be of any size


@dataclass(frozen=True)
class Law:
    """A place with its exponents, fitted to the runs."""

    place: Place
    ranked: Ranked  # the linear model of the place
    model: LawModel
    fit: Fit
    gain: float  # BIC of the model without a law less that with it
    gain_at_lever: float  # the same without the price of its lever, if it has one
    session_gain: tuple[float, float]  # in log likelihood over left-out sessions, and its standard error
    p_value: float  # of the residual that it leaves
    error: float  # relative rms on the held-out runs
    error_interval: tuple[float, float]  # 95 %
    reason: str  # why it is not kept; empty if it is
    gain_with_curve: float = -math.inf  # gain with free factors along the best input, linearised
    curves: tuple[Curve, ...] = ()  # along each input; of the best law, and of the best with a curve
    elsewhere: tuple[Law, ...] = ()  # of a side force at the disc: the same with a lever that is not told from 0

    @property
    def numbers(self) -> int:
        """How many of its numbers were fitted, without the lever, of which a search has a few."""
        return sum(p.name in self.fit.names and p.name != LEVER for p in self.model.effects)

    @property
    def words(self) -> str:
        """The law in words, with 95 % intervals."""
        chosen = [i for i, name in enumerate(EXPONENTS) if name in self.fit.names]
        at = [self.fit.names.index(EXPONENTS[i]) for i in chosen]
        said = in_words(
            [INPUTS[i] for i in chosen],
            np.array([self.fit.parameters[EXPONENTS[i]] for i in chosen]),
            self.fit.covariance[np.ix_(at, at)],
            [self.fit.interval(EXPONENTS[i]) for i in chosen],
            motion_patterns(logarithms(self.model.runs), self.model.runs.outputs, self.fit.prediction),
        )
        noted = [name for name in self.model.noted if parameter_of(name) in self.fit.names]
        values = [self.fit.parameters[parameter_of(name)] for name in noted]
        also = noted_in_words(noted, values, [self.fit.interval(parameter_of(name)) for name in noted])
        return ", ".join(filter(None, (self.place.words, self.where, said, also)))

    @property
    def where(self) -> str:
        """Where on the axis a side force acts, in words; empty for what has no lever."""
        if self.elsewhere:
            return f"at the disc or up to {' and '.join(law.farthest for law in self.elsewhere)} it"
        if LEVER not in self.fit.names:
            return ""
        lever = self.fit.parameters[LEVER]
        away, side = (-1, "behind") if lever < 0 else (1, "ahead of")
        low, high = sorted(away * end for end in self.fit.interval(LEVER))
        return f"{abs(lever):.2f} {self.place.lever_unit} ({low:.2f} to {high:.2f}) {side} the disc"

    def behind(self, best: Law) -> float:
        """Compute how far its gain is behind that of the best law, with the price of levers or without."""
        return min(best.gain - self.gain, best.gain_at_lever - self.gain_at_lever)

    @property
    def farthest(self) -> str:
        """How far from the disc a side force may act, by the interval of its lever."""
        unit = self.place.lever_unit
        low, high = np.clip(self.fit.interval(LEVER), *self.place.lever_bounds)
        return f"{-low:.2f} l behind" if unit == "l" else f"{high:.2f} {unit} ahead of"

    def to_dict(self) -> dict[str, Any]:
        """Return the law as laws.json has it; `size` is at the geometric mean of the runs."""
        effect, size, _ = self.model.effect(self.fit.parameters)
        runs = self.model.runs
        numbers = {
            p.name.removeprefix("law_"): {
                "value": self.fit.parameters[p.name],
                "interval": list(self.fit.interval(p.name)),
            }
            for p in self.model.effects
            if p.name in self.fit.names
        }
        return {
            "place": self.place.name,
            "acts": ", ".join(filter(None, (self.place.words, self.where))),
            "words": self.words,
            "effect": {"name": effect.name, "size": size},
            **numbers,
            "runs": {
                "N": [float(runs.tails.min()), float(runs.tails.max())],
                "l_cm": [100 * float(runs.length.min()), 100 * float(runs.length.max())],
                "omega_rpm": [_RPM * float(np.abs(runs.omega).min()), _RPM * float(np.abs(runs.omega).max())],
            },
            "gain": self.gain,
            "session_gain": list(self.session_gain),
            "p_value": self.p_value,
            "error": self.error,
            "error_interval": list(self.error_interval),
            "reason": self.reason,
            "curves": [curve.to_dict() for curve in self.curves],
        }


@dataclass(frozen=True)
class Dependence:
    """The load of a law along one input, over that at the mean of the runs, the other inputs at their means."""

    symbol: str  # of INPUTS
    inputs: Floats  # (m,) along the curve: rad/s, m, or a number of tails
    factor: Floats  # (m,) of the law
    low: Floats  # (m,) 95 % band of the law
    high: Floats
    groups: Floats  # (g,) inputs at which there are runs
    by_runs: Floats  # (g,) the factor that these runs ask for, everything else fitted anew
    errors: Floats  # (2, g) one standard error of it, below and above
    curve: Curve | None  # what the runs ask for where they contradict the power law


def dependences(law: Law, used: Flags) -> list[Dependence]:
    """Compute how a law depends on each input that differs between the runs in `used` (n,)."""
    results = []
    for asked in group_factors(law.model, law.fit, used, draws=0, fewest=1):
        at = law.fit.names.index(EXPONENTS[INPUTS.index(asked.symbol)])
        curve = next((one for one in law.curves if one.symbol == asked.symbol and one.rejected), None)
        groups = curve.groups if curve else asked.levelled()
        x = np.linspace(asked.x[0], asked.x[-1], _POINTS)
        half = law.fit.half_width(at) * np.abs(x)
        factor, low, high = np.exp(np.clip(asked.exponent * x + np.outer((0, -1, 1), half), -_LARGEST, _LARGEST))
        law_itself = (asked.symbol, np.exp(x + asked.centre), factor, low, high)
        results.append(Dependence(*law_itself, groups.inputs, factors(groups), error_bars(groups), curve))
    return results


def fitted_law(
    study: Study, model: SwimmerModel, base: Fit, ranked: Ranked, *, chosen_alone: bool = False
) -> Law | None:
    """Fit a law from its linear model, and judge it; None where its motion cannot be simulated.

    Args:
        base: coefficients and nuisance parameters, without a law.
        chosen_alone: whether only the exponents of the linear model are fitted.
    """
    data = model.runs
    size = float(np.clip(ranked.size, -_LARGEST_AT_START, _LARGEST_AT_START))
    with_law = LawModel.of(model, ranked.place, size, noted=ranked.noted)
    names = tuple(p.name for p in with_law.effects if not chosen_alone or p.name in (SIZE, LEVER, *ranked.chosen))
    refit = _best_fit(study, with_law, base, names, {**ranked.start, SIZE: size})
    if refit is None:
        return None
    gain = base.deviance - refit.deviance - len(names) * math.log(study.values)
    predictive = session_gain(study, base, refit)
    reason = ""
    if not refit.converged:
        reason = NOT_CONVERGED
    elif any(refit.parameters[p.name] in p.bounds for p in with_law.effects if p.name in names):
        reason = AT_THE_END
    elif gain <= 0:
        reason = "its BIC is not smaller than that without a law"
    elif all(_includes(refit.interval(name), 0.0) for name in names if name != LEVER):
        reason = "the intervals of all its numbers include the null"
    elif LEVER in names and _includes(refit.interval(LEVER), 0.0):
        reason = NO_LEVER
    else:
        reason = _of_sessions(predictive)
    again = replace(study, model=with_law, seed=study.seed + 1)
    none = Directions.plain(np.empty((*data.y.shape, 0)))
    return Law(
        place=ranked.place,
        ranked=ranked,
        model=with_law,
        fit=refit,
        gain=gain,
        gain_at_lever=gain + (math.log(study.values) if LEVER in names else 0.0),
        session_gain=predictive,
        p_value=examine_residual(again, refit, none, draws=_DRAWS).general_p,
        error=errors(data, refit.prediction, study.split.test)[0],
        error_interval=error_interval(data, refit.prediction, study.split.test, study.seed),
        reason=reason,
    )


def _of_sessions(gain: tuple[float, float]) -> str:
    """Say whether a law fails to predict left-out sessions better."""
    return NO_SESSIONS if gain[0] <= gain[1] else ""


def with_a_lever(law: Law) -> Law:
    """Return a law whose interval of the lever includes 0, after the same force at the disc has fitted worse."""
    return replace(law, reason=_of_sessions(law.session_gain))


def _includes(interval: tuple[float, float], value: float) -> bool:
    return interval[0] <= value <= interval[1]


def _best_fit(
    study: Study, model: LawModel, base: Fit, names: tuple[str, ...], linear: dict[str, float]
) -> Fit | None:
    """Fit a law from its linear model; if more than noise is left, from the model as given, too.

    Args:
        names: its numbers that are fitted.
        linear: size and exponents of the linear model.

    Returns:
        The better fit, or None where the motion cannot be simulated.
    """
    kept = {SIZE: linear[SIZE] / 2, LEVER: linear[LEVER]}
    flat = {name: kept.get(name, 0.0) for name in names}
    target = study.noise_at_most(len(base.names) + len(names))
    best: Fit | None = None
    for start in (
        {**base.parameters, **{name: linear[name] for name in names}},
        {**base.parameters, **{p.name: p.start for p in model.coefficients}, **flat},
    ):
        try:
            refit = fit(model, start, (*base.names, *names), study.split.fitted, target=target, title="")
        except InputError:
            continue
        if best is None or refit.deviance < best.deviance:
            best = refit
        if best.converged and best.deviance < target:
            break
    return best
