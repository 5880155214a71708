"""Laws that describe a residual: the best places, each fitted in the simulator, and those that are not told apart.

The places that `calibration.laws.search` ranks first are fitted with all exponents, the coefficients and the
nuisance parameters free. If the best of them leaves more than noise, all others follow. A law is kept if

- the fit converged within the ranges of its numbers, and its BIC is smaller than that of the model without a law,
- the interval of at least one of its numbers excludes the null, and
- it predicts left-out sessions better, by more than the uncertainty of that gain.

Beside a claim that something outside the catalogue could imitate, only the places that rank first are fitted, each
with the exponents of its linear model alone: a claim has one number, or two. A law fits as well as the claim if it
leaves no more than noise and its deviance is not larger by what one parameter can gain by chance.

Kept laws cannot be told apart if their BIC differ by less than one parameter can gain by chance (6.63). The place
that is true need not be among the places of the search: a law describes the runs, and is no claim about their
cause. Laws are claimed only if tables without a law, searched in the same way, hardly ever gain as much
(`calibration.laws.selection`). Intervals do not count the choice among the places; those of
`Laws.simultaneous_interval` do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from tqdm import tqdm

from calibration.attribution.refits import INDISTINGUISHABLE, session_gain
from calibration.laws.law_model import EXPONENTS, SIZE, LawModel
from calibration.laws.places import Place, in_common, places
from calibration.laws.readings import INPUTS, in_words
from calibration.laws.search import Ranked, search
from calibration.laws.selection import Selection, examine_selection
from calibration.statistics.fit import Fit, fit, noise_at_most
from calibration.statistics.held_out import error_interval, errors
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.study import LEVEL, Study
from calibration.swimmer.swimmer import SwimmerModel
from calibration.verdict.experiment import Rival
from sim.arrays import Floats
from sim.io.errors import InputError

_FITTED = 6  # places that are fitted first
_CURVED = 0.3  # share of the best gain below which a place is not among them
_LARGEST_AT_START = 50.0  # size of a term
_NAMED = 2  # laws beside a claim that are named
_SAME = 0.1  # of the noise of a run
_RPM = 30 / math.pi
_DRAWS = 400  # of the bootstrap, for the residual that a law leaves


@dataclass(frozen=True)
class Law:
    """A place with its exponents, fitted to the runs."""

    place: Place
    ranked: Ranked  # the linear model of the place
    model: LawModel
    fit: Fit
    gain: float  # BIC of the model without a law less that with it
    session_gain: tuple[float, float]  # in log likelihood over left-out sessions, and its standard error
    p_value: float  # of the residual that it leaves
    error: float  # relative rms on the held-out runs
    error_interval: tuple[float, float]  # 95 %
    reason: str  # why it is not kept; empty if it is

    @property
    def numbers(self) -> int:
        """How many of its numbers were fitted."""
        return sum(p.name in self.fit.names for p in self.model.effects)

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
        )
        return ", ".join(filter(None, (self.place.words, said)))

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
        }


@dataclass(frozen=True)
class Laws:
    """What describes a residual."""

    base: Fit  # coefficients and nuisance parameters, without a law
    ranked: tuple[Ranked, ...]  # every place, the best first
    fitted: tuple[Law, ...]  # those that were fitted, the largest gain first
    selection: Selection | None = None  # what the choice among the places costs; None: nothing was searched
    level: float = LEVEL  # α of the search, and of the residual that a law leaves; of this, half of it decides

    @property
    def kept(self) -> tuple[Law, ...]:
        """Laws that the runs cannot tell from the best one, best first."""
        kept = _kept(self.fitted)
        return tuple(law for law in kept if kept[0].gain - law.gain < INDISTINGUISHABLE)

    @property
    def complete(self) -> bool:
        """Whether the best law leaves no more than noise, and tables without a law hardly ever gain as much."""
        return bool(self.kept) and self.kept[0].p_value >= self.level / 2 and self.significant

    @property
    def significant(self) -> bool:
        """Whether the p-value of the search is below the level."""
        return self.selection is not None and self.selection.p_value < self.level

    @property
    def _search(self) -> str:
        """The p-value of the search in words."""
        return f"with the choice among all places counted, {self.selection.words}" if self.selection else ""

    @property
    def sentence(self) -> str:
        """What the runs say, without a claim about the cause."""
        if not self.kept:
            return "No law of the places that were searched describes the residual."
        best = self.kept[0]
        if not self.significant:
            return (
                "No law is claimed: noise alone can gain as much in a search over all places "
                f"({self._search}). The nearest is {best.words}."
            )
        if not self.complete:
            return (
                "No law of the places that were searched describes the whole residual. The nearest is "
                f"{best.words}; it leaves more than noise (p = {best.p_value:.2g})."
            )
        if len(self.kept) == 1:
            return (
                f"The residual is described by {best.words}, and less well by all other places that were searched "
                f"({self._search})."
            )
        rivals = "; or ".join(law.words for law in self.kept)
        shared = in_common([law.place for law in self.kept])
        agree = f" All of them {shared}." if shared else ""
        return f"The residual is described by {rivals}: these runs cannot tell them apart ({self._search}).{agree}"

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

    def _as_good_as(self, claim: Fit) -> list[Law]:
        """List them without those that predict what the claim does: they are the claim in other words."""
        limit = claim.deviance + INDISTINGUISHABLE
        good = [law for law in self.kept if law.p_value >= self.level / 2 and law.fit.deviance < limit]
        scatter = np.sqrt(np.diag(claim.noise.run))
        return [law for law in good if np.abs((law.fit.prediction - claim.prediction) / scatter).max() > _SAME]

    def beside(self, claim: Fit) -> str:
        """Say which laws fit as well as a claimed effect, and what they have in common."""
        laws = self._as_good_as(claim)
        if not laws:
            return "No law of the places that were searched describes it as well."
        shared = in_common([law.place for law in laws]) if len(laws) > 1 else ""
        agree = f" All of them {shared}." if shared else ""
        named = "; or by ".join(law.words for law in laws[:_NAMED])
        others = len(laws) - _NAMED
        more = f"; or by laws at {others} other place{'s' if others > 1 else ''}" if others > 0 else ""
        return f"It is described as well by {named}{more}.{agree}"

    def to_dict(self) -> dict[str, Any]:
        """Return the record for laws.json and verdict.json."""
        return {
            "sentence": self.sentence,
            "complete": self.complete,
            **(self.selection.to_dict() if self.selection else {}),
            "places": [self._place_record(one) for one in self.ranked],
            "laws": [self._law_record(law) for law in self.fitted],
            "kept": [law.place.name for law in self.kept],
        }

    def simultaneous_interval(self, law: Law, name: str) -> tuple[float, float]:
        """Compute the 95 % interval of a number of a law that covers those of all places at once."""
        assert self.selection is not None
        place, value = law.fit.names.index(name), law.fit.parameters[name]
        variance = law.fit.covariance[place, place] / law.fit.inflation  # K contains that S is estimated
        half = max(self.selection.widest * math.sqrt(variance), law.fit.half_width(place))
        return value - half, value + half

    def _law_record(self, law: Law) -> dict[str, Any]:
        record = {**law.to_dict(), "ebic_gain": self._ebic_gain(law.gain, law.numbers)}
        for name in (SIZE, *EXPONENTS):
            if self.selection and name in law.fit.names:
                interval = list(self.simultaneous_interval(law, name))
                record[name.removeprefix("law_")]["simultaneous_interval"] = interval
        return record

    def _place_record(self, ranked: Ranked) -> dict[str, Any]:
        name = ranked.place.name
        record = {"place": name, "gain": ranked.gain, "ebic_gain": self._ebic_gain(ranked.gain, ranked.columns)}
        if self.selection:
            record |= {"first": self.selection.first[name], "near_first": self.selection.near[name]}
        return record

    def _ebic_gain(self, gain: float, columns: int) -> float | None:
        return self.selection.ebic_gain(gain, columns) if self.selection else None


def find_laws(study: Study, base: Fit, *, beside_claim: bool = False) -> Laws:
    """Find laws that describe the residual of a fit without effects; for `calibration.verdict.calibrate`, too.

    Args:
        study: of a `SwimmerModel`.
        base: its coefficients and nuisance parameters, fitted to the runs that the study uses.
        beside_claim: whether an effect is claimed for the residual, with which laws are compared.

    Source: Schwarz (1978) for BIC; nested power laws as in dimensional analysis.
    """
    model = study.model
    if not isinstance(model, SwimmerModel):
        raise TypeError("laws are looked for in a SwimmerModel")
    searched = search(model, base, study.split.fitted, places(), title="places" if study.progress else "")
    ranked, selection = searched.ranked, examine_selection(searched, seed=study.seed + 2)
    least = max(_CURVED * ranked[0].gain, 0.0)
    likely = [one for one in ranked[:_FITTED] if one.gain > least]
    laws = _fit_all(study, model, base, likely, chosen_alone=beside_claim)
    kept = _kept(laws)
    if not beside_claim and (not kept or kept[0].p_value < study.level / 2):
        laws += _fit_all(study, model, base, [one for one in ranked if one.gain > 0 and one not in likely])
    return Laws(base, tuple(ranked), tuple(sorted(laws, key=lambda law: -law.gain)), selection, study.level)


def _fit_all(
    study: Study, model: SwimmerModel, base: Fit, likely: Sequence[Ranked], *, chosen_alone: bool = False
) -> list[Law]:
    """Fit and judge places, without those where the motion cannot be simulated.

    Args:
        chosen_alone: whether only the exponents of the linear model are fitted.
    """
    bar = tqdm(likely, desc="laws", unit="law", delay=1.0, disable=not study.progress)
    return [law for one in bar if (law := _fitted(study, model, base, one, chosen_alone))]


def _fitted(study: Study, model: SwimmerModel, base: Fit, ranked: Ranked, chosen_alone: bool) -> Law | None:
    """Fit a law from its linear model, and judge it; None where its motion cannot be simulated."""
    data = model.runs
    size = float(np.clip(ranked.size, -_LARGEST_AT_START, _LARGEST_AT_START))
    with_law = LawModel.of(model, ranked.place, size)
    names = tuple(p.name for p in with_law.effects if not chosen_alone or p.name in (SIZE, *ranked.chosen))
    refit = _best_fit(study, with_law, base, names, {**ranked.start, SIZE: size})
    if refit is None:
        return None
    gain = base.deviance - refit.deviance - len(names) * math.log(study.values)
    predictive = session_gain(study, base, refit)
    reason = ""
    if not refit.converged:
        reason = "its fit did not converge"
    elif any(refit.parameters[p.name] in p.bounds for p in with_law.effects if p.name in names):
        reason = "a number is at the end of its range"
    elif gain <= 0:
        reason = "its BIC is not smaller than that without a law"
    elif all(low <= 0.0 <= high for low, high in map(refit.interval, names)):
        reason = "the intervals of all its numbers include the null"
    elif predictive[0] <= predictive[1]:
        reason = "does not predict left-out sessions better"
    again = replace(study, model=with_law, seed=study.seed + 1)
    none = Directions.plain(np.empty((*data.y.shape, 0)))
    return Law(
        place=ranked.place,
        ranked=ranked,
        model=with_law,
        fit=refit,
        gain=gain,
        session_gain=predictive,
        p_value=examine_residual(again, refit, none, draws=_DRAWS).general_p,
        error=errors(data, refit.prediction, study.split.test)[0],
        error_interval=error_interval(data, refit.prediction, study.split.test, study.seed),
        reason=reason,
    )


def _rival(law: Law) -> Rival:
    return Rival(law.words, law.fit, law.model, law.model.record)


def _kept(laws: Sequence[Law]) -> list[Law]:
    """Return the laws that are kept, the largest gain first."""
    return sorted((law for law in laws if not law.reason), key=lambda law: -law.gain)


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
    flat = {name: linear[SIZE] / 2 if name == SIZE else 0.0 for name in names}
    target = noise_at_most(study.values, len(base.names) + len(names))
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
