"""Laws that describe a residual: the best places, each fitted in the simulator, and those that are not told apart.

**One law** is fitted from its linear model. All its numbers are fitted together with the coefficients and the
nuisance parameters. A fit that leaves more than noise starts a second time, from the model as given. A law is kept
if

- the fit converged within the ranges of its numbers, and its BIC is smaller than that of the model without a law,
- the interval of at least one of its numbers excludes the null, and that of its lever, if it has one, excludes 0,
  and
- it predicts left-out sessions better, by more than the uncertainty of that gain.

A lever is a part of the place, as the component of a force is. So laws are told apart if their gains in BIC differ
both with the price of a lever and without it.

**Which.** The places that `calibration.laws.search` ranks first are fitted with all exponents. If the best of them
leaves more than noise, all others follow.

Beside a claim that something outside the catalogue could imitate, only the places that rank first are fitted, each
with the exponents of its linear model alone: a claim has one number, or two. A law fits as well as the claim if it
leaves no more than noise and its deviance is not larger by what one parameter can gain by chance.

Kept laws cannot be told apart if their BIC differ by less than one parameter can gain by chance (6.63). The place
that is true need not be among the places of the search: a law describes the runs, and is no claim about their
cause. Laws are claimed only if tables without a law, searched in the same way, hardly ever gain as much
(`calibration.laws.search`). Intervals do not count the choice among the places.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, cast

import numpy as np
from tqdm import tqdm

from calibration.attribution.refits import INDISTINGUISHABLE, Rival, session_gain
from calibration.laws.law_model import LEVER, SIZE, LawModel
from calibration.laws.places import Place, in_common, places
from calibration.laws.readings import (
    EXPONENTS,
    INPUTS,
    in_words,
    logarithms,
    motion_patterns,
    noted_in_words,
    parameter_of,
)
from calibration.laws.search import DRAWS, Ranked, search, search_p_value
from calibration.statistics.budget import skipped
from calibration.statistics.fit import Fit, fit
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.study import LEVEL, Study, error_interval, errors
from calibration.swimmer.swimmer import SwimmerModel
from calibration.words.render import say_laws
from common.arrays import Floats
from common.errors import InputError

_LARGEST_AT_START = 50.0  # size of a term
_RPM = 30 / math.pi
_DRAWS = 400  # of the bootstrap, for the residual that a law leaves


class Rejection(StrEnum):
    """Why a law is not kept, in the words of the report."""

    NOT_CONVERGED = "its fit did not converge"
    AT_THE_END = "a number is at the end of its range"
    NO_GAIN = "its BIC is not smaller than that without a law"
    INCLUDES_NULL = "the intervals of all its numbers include the null"
    NO_LEVER = "its lever is not told from none: a side force at the disc"  # unless that one fits worse
    NOT_PREDICTIVE = "does not predict left-out sessions better"


# The runs exclude the numbers, not the place.
UNDETERMINED = (Rejection.NOT_CONVERGED, Rejection.AT_THE_END)


@dataclass(frozen=True)
class FittedLaw:
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
    reason: Rejection | None  # why it is not kept; None if it is
    elsewhere: tuple[FittedLaw, ...] = ()  # of a side force at the disc: those with a lever not told from 0

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

    def behind(self, best: FittedLaw) -> float:
        """Compute how far its gain is behind that of the best law, with the price of levers or without."""
        return min(best.gain - self.gain, best.gain_at_lever - self.gain_at_lever)

    @property
    def farthest(self) -> str:
        """How far from the disc a side force may act, by the interval of its lever."""
        unit = self.place.lever_unit
        low, high = np.clip(self.fit.interval(LEVER), *self.place.lever_bounds)
        return f"{-low:.2f} l behind" if unit == "l" else f"{high:.2f} {unit} ahead of"

    def to_dict(self) -> dict[str, Any]:
        """Return the law as verdict.json has it; `size` is at the geometric mean of the runs."""
        effect, size, _ = self.model.law(self.fit.parameters)
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
            "reason": self.reason or "",
        }


def fitted_law(study: Study, base: Fit, ranked: Ranked, *, chosen_alone: bool) -> FittedLaw | None:
    """Fit a law from its linear model, and judge it; None where its motion cannot be simulated.

    With `chosen_alone` only the exponents of the linear model are fitted.
    """
    data = study.model.runs
    size = float(np.clip(ranked.size, -_LARGEST_AT_START, _LARGEST_AT_START))
    with_law = LawModel.of(cast(SwimmerModel, study.model), ranked.place, size, noted=ranked.noted)
    names = tuple(
        p.name for p in with_law.effects if not chosen_alone or p.name in (SIZE, LEVER, *ranked.exponents)
    )
    refit = _best_fit(study, with_law, base, names, {**ranked.start, SIZE: size})
    if refit is None:
        return None
    gain = base.deviance - refit.deviance - len(names) * math.log(study.values)
    predictive = session_gain(study, base, refit)
    null_in = {name for name in names if refit.interval(name)[0] <= 0 <= refit.interval(name)[1]}
    if not refit.converged:
        reason: Rejection | None = Rejection.NOT_CONVERGED
    elif any(refit.parameters[p.name] in p.bounds for p in with_law.effects if p.name in names):
        reason = Rejection.AT_THE_END
    elif gain <= 0:
        reason = Rejection.NO_GAIN
    elif null_in >= {*names} - {LEVER}:
        reason = Rejection.INCLUDES_NULL
    elif LEVER in null_in:
        reason = Rejection.NO_LEVER
    else:
        reason = _of_sessions(predictive)
    again = replace(study, model=with_law, seed=study.seed + 1)
    none = Directions.plain(np.empty((*data.y.shape, 0)))
    return FittedLaw(
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


def _of_sessions(gain: tuple[float, float]) -> Rejection | None:
    """Say whether a law fails to predict left-out sessions better."""
    return Rejection.NOT_PREDICTIVE if gain[0] <= gain[1] else None


def _best_fit(
    study: Study, model: LawModel, base: Fit, names: tuple[str, ...], linear: dict[str, float]
) -> Fit | None:
    """Fit `names` of a law from its linear model, and, if more than noise is left, from the model as given.

    It is None where the motion cannot be simulated.
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


_FITTED = 6  # places that are fitted first
_LIKELY = 0.3  # share of the best gain below which a place is not among them
_SAME = 0.1  # of the noise of a run


@dataclass(frozen=True)
class Laws:
    """What describes a residual."""

    base: Fit  # coefficients and nuisance parameters, without a law
    ranked: tuple[Ranked, ...]  # every place, the best first
    fitted: tuple[FittedLaw, ...]  # those that were fitted, the largest gain first
    search_p_value: float  # of the largest gain among all places
    level: float = LEVEL  # α of the search, and of the residual that a law leaves; of this, half of it decides

    @property
    def kept(self) -> tuple[FittedLaw, ...]:
        """Laws that the runs cannot tell from the best one, best first.

        Those that would be the best one if they predicted left-out sessions better are among them: they fit the
        runs at least as well. So are those whose numbers these runs do not determine, if they fit nearly as well.
        """
        kept = _kept(self.fitted)
        if not kept:
            return ()
        near = [law for law in kept if law.behind(kept[0]) < INDISTINGUISHABLE]
        unconfirmed = [
            law for law in self.fitted if law.reason is Rejection.NOT_PREDICTIVE and law.gain >= kept[0].gain
        ]
        undetermined = [
            law for law in self.fitted if law.reason in UNDETERMINED and law.behind(kept[0]) < INDISTINGUISHABLE
        ]
        return (*near, *unconfirmed, *undetermined)

    @property
    def complete(self) -> bool:
        """Whether the best law leaves no more than noise, and tables without a law hardly ever gain as much."""
        return bool(self.kept) and self.kept[0].p_value >= self.level / 2 and self.significant

    @property
    def significant(self) -> bool:
        """Whether the p-value of the search is below the level."""
        return self.search_p_value < self.level

    @property
    def sentence(self) -> str:
        """What the runs say, without a claim about the cause."""
        return say_laws(self._facts(None))

    @property
    def prediction(self) -> Floats:
        """(n, k) of the best law, fitted without the held-out runs; without a law, of the calibrated model."""
        return self.kept[0].fit.prediction if self.kept else self.base.prediction

    @property
    def rivals(self) -> tuple[Rival, ...]:
        """Laws that the runs cannot tell apart, best first; none if there are not two."""
        if not self.complete or len(self.kept) < 2:
            return ()
        return tuple(map(_rival, self.kept))

    def as_good_as(self, claim: Fit) -> tuple[Rival, ...]:
        """List the kept laws that leave no more than noise and fit as well as a claimed effect, best first."""
        return tuple(map(_rival, self._as_good_as(claim)))

    def _as_good_as(self, claim: Fit) -> list[FittedLaw]:
        """List them without those that predict what the claim does: they are the claim in other words."""
        limit = claim.deviance + INDISTINGUISHABLE
        good = [law for law in self.kept if law.p_value >= self.level / 2 and law.fit.deviance < limit]
        scatter = np.sqrt(np.diag(claim.noise.run_covariance))
        return [law for law in good if np.abs((law.fit.prediction - claim.prediction) / scatter).max() > _SAME]

    def to_dict(self, claim: Fit | None = None) -> dict[str, Any]:
        """Return the record for verdict.json, with laws that fit as well as an effect that is claimed."""
        facts = self._facts(claim)
        beside = say_laws(facts) if claim else ""
        return {"sentence": say_laws({**facts, "as_good": None}), "beside": beside, **facts}

    def _facts(self, claim: Fit | None) -> dict[str, Any]:
        as_good = self._as_good_as(claim) if claim else []
        return {
            "complete": self.complete,
            "significant": self.significant,
            "search_p_value": self.search_p_value,
            "tables_without_law": DRAWS,
            "places": [{"place": one.place.name, "gain": one.gain} for one in self.ranked],
            "laws": [
                {
                    **law.to_dict(),
                    "leaves_noise": law.p_value >= self.level / 2,
                    "undetermined": law.reason in UNDETERMINED,
                }
                for law in self.fitted
            ],
            "kept": [law.place.name for law in self.kept],
            "in_common": _in_common(self.kept),
            "as_good": [law.place.name for law in as_good] if claim else None,
            "in_common_of_as_good": _in_common(as_good),
        }


def find_laws(study: Study, base: Fit, *, beside_claim: bool = False) -> Laws:
    """Find laws that describe the residual of a fit without effects; for `calibration.verdict.calibrate`, too.

    Args:
        study: of a `SwimmerModel`.
        base: its coefficients and nuisance parameters, fitted to the runs that the study uses.
        beside_claim: whether an effect is claimed for the residual, with which laws are compared.

    Source: Schwarz (1978) for BIC; nested power laws as in dimensional analysis.
    """
    model = cast(SwimmerModel, study.model)
    base = fit(model, base.parameters, base.names, study.split.fitted, in_sigma=True, title="")
    both = len(np.unique(np.sign(model.runs.omega[study.split.fitted]))) == 2
    candidates = places(both_directions=both)
    searched = search(model, base, study.split.fitted, candidates, title="places" if study.progress else "")
    ranked, p_value = searched.ranked, search_p_value(searched, seed=study.seed + 2)
    least = max(_LIKELY * ranked[0].gain, 0.0)
    likely = [one for one in ranked[:_FITTED] if one.gain > least]
    laws = _fit_all(study, base, likely, chosen_alone=beside_claim)
    kept = _kept(laws)
    if not beside_claim and (not kept or kept[0].p_value < study.level / 2):
        laws += _fit_all(
            study, base, [one for one in ranked if one.gain > 0 and one not in likely], chosen_alone=False
        )
    laws = _with_levers(study, base, laws, ranked, chosen_alone=beside_claim)
    return Laws(base, tuple(ranked), tuple(sorted(laws, key=lambda law: -law.gain)), p_value, study.level)


def _fit_all(study: Study, base: Fit, likely: Sequence[Ranked], *, chosen_alone: bool) -> list[FittedLaw]:
    """Fit and judge places, without those where the motion cannot be simulated; see `fitted_law`."""
    bar = tqdm(likely, desc="laws", unit="law", delay=1.0, disable=not study.progress or None)
    tried = (one for one in bar if not skipped("some laws"))
    return [law for one in tried if (law := fitted_law(study, base, one, chosen_alone=chosen_alone))]


def _with_levers(
    study: Study, base: Fit, laws: list[FittedLaw], ranked: Sequence[Ranked], *, chosen_alone: bool
) -> list[FittedLaw]:
    """Compare side forces at the disc with the same ones elsewhere.

    A lever that the interval does not tell from none is told from it if the same force at the disc fits worse. A
    force that is kept at the disc says how far from it it may act.
    """
    fitted = {law.place.name: law for law in laws}
    wanted = {name for law in _kept(laws) for name in law.place.elsewhere}
    wanted |= {law.place.at_disc for law in laws if law.reason is Rejection.NO_LEVER}
    missing = [one for one in ranked if one.place.name in wanted - set(fitted)]
    fitted |= {law.place.name: law for law in _fit_all(study, base, missing, chosen_alone=chosen_alone)}
    for name, law in fitted.items():
        at_disc = fitted.get(law.place.at_disc)
        if law.reason is Rejection.NO_LEVER and at_disc and law.gain_at_lever - at_disc.gain > INDISTINGUISHABLE:
            fitted[name] = replace(law, reason=_of_sessions(law.session_gain))
    return [
        replace(law, elsewhere=tuple(
            fitted[name] for name in law.place.elsewhere
            if name in fitted and fitted[name].reason is Rejection.NO_LEVER
        ))
        if not law.reason else law
        for law in fitted.values()
    ]  # fmt: skip


def _in_common(laws: Sequence[FittedLaw]) -> str:
    """Say what several laws have in common, wherever they may act; empty if nothing."""
    return in_common([one.place for law in laws for one in (law, *law.elsewhere)]) if len(laws) > 1 else ""


def _rival(law: FittedLaw) -> Rival:
    return Rival(law.words, law.fit, law.model, law.model.record)


def _kept(laws: Sequence[FittedLaw]) -> list[FittedLaw]:
    """Return the laws that are kept, the largest gain first."""
    return sorted((law for law in laws if not law.reason), key=lambda law: -law.gain)
