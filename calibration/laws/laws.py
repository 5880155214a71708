"""Laws that describe a residual: the best places, each fitted in the simulator, and those that are not told apart.

**One law** is fitted from its linear model. All its numbers are fitted together with the coefficients and the
nuisance parameters. A fit that leaves more than noise starts a second time, from the model as given. It is judged
by `LAW_RULES`.

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

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from calibration.attribution.hypothesis import Evidence, Hypothesis, Origin, Reason
from calibration.attribution.left_out import session_gain
from calibration.attribution.rules import INDISTINGUISHABLE, Rule, Stage, Trial, judge, predicts_no_better
from calibration.laws.law_model import LEVER, SIZE, LawModel, law_model
from calibration.laws.places import in_common, places
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
from common.progress import progress_bar

_LARGEST_AT_START = 50.0  # size of a term
_RPM = 30 / math.pi
_DRAWS = 400  # of the bootstrap, for the residual that a law leaves
_FITTED = 6  # places that are fitted first
_LIKELY = 0.3  # share of the best gain below which a place is not among them
_SAME = 0.1  # of the noise of a run

# The runs exclude the numbers, not the place.
UNDETERMINED = (Reason.NOT_CONVERGED, Reason.AT_THE_END)


def _includes_null(law: Hypothesis, name: str) -> bool:
    low, high = law.fitted.interval(name)
    return low <= 0 <= high


_LAW = (Origin.LAW,)
LAW_RULES = (
    Rule(Stage.FIT, _LAW, Reason.NOT_CONVERGED, "its fit did not converge", lambda h, _: not h.fitted.converged),
    Rule(Stage.FIT, _LAW, Reason.AT_THE_END, "a number is at an end of its range",
         lambda h, _: any(h.fitted.parameters[p.name] in p.bounds for p in h.added)),
    Rule(Stage.FIT, _LAW, Reason.NO_GAIN, "its BIC is not below that without a law",
         lambda h, _: (h.evidence.bic_gain or 0.0) <= 0),
    Rule(Stage.FIT, _LAW, Reason.ALL_INCLUDE_NULL,
         "the intervals of all its numbers but the lever include the null",
         lambda h, _: all(_includes_null(h, p.name) for p in h.added if p.name != LEVER)),
    Rule(Stage.FIT, _LAW, Reason.NO_LEVER, "the interval of its lever includes 0",
         lambda h, _: any(_includes_null(h, p.name) for p in h.added if p.name == LEVER)),
    Rule(Stage.FIT, _LAW, Reason.NOT_PREDICTIVE, "the gain over left-out sessions is below its standard error",
         predicts_no_better, "session_gain"),
)  # fmt: skip


def fitted_law(study: Study, base: Fit, ranked: Ranked, *, chosen_alone: bool) -> Hypothesis | None:
    """Fit a law from its linear model, and judge it; None where its motion cannot be simulated.

    With `chosen_alone` only the exponents of the linear model are fitted.
    """
    data = study.model.runs
    size = float(np.clip(ranked.size, -_LARGEST_AT_START, _LARGEST_AT_START))
    with_law = LawModel.of(cast(SwimmerModel, study.model), ranked.place, size, noted=ranked.noted)
    added = tuple(p for p in with_law.effects if not chosen_alone or p.name in (SIZE, LEVER, *ranked.exponents))
    refit = _best_fit(study, with_law, base, tuple(p.name for p in added), {**ranked.start, SIZE: size})
    if refit is None:
        return None
    again = replace(study, model=with_law, seed=study.seed + 1)
    none = Directions.plain(np.empty((*data.y.shape, 0)))
    test = study.split.test
    evidence = Evidence(
        bic_gain=base.deviance - refit.deviance - len(added) * math.log(study.values),
        session_gain=session_gain(study, base, refit),
        remainder=examine_residual(again, refit, none, draws=_DRAWS),
        held_out_error=(
            errors(data, refit.prediction, test)[0], *error_interval(data, refit.prediction, test, study.seed)
        ),
    )  # fmt: skip
    law = Hypothesis(Origin.LAW, added, refit, evidence, law=with_law.record)
    return judge(law, Trial(study, base), LAW_RULES)


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


@dataclass(frozen=True)
class Laws:
    """What describes a residual."""

    base: Fit  # coefficients and nuisance parameters, without a law
    ranked: tuple[Ranked, ...]  # every place, the best first
    fitted: tuple[Hypothesis, ...]  # those that were fitted, the largest gain first
    search_p_value: float  # of the largest gain among all places
    price: float  # of a number, in BIC
    level: float = LEVEL  # α of the search, and of the residual that a law leaves; of this, half of it decides

    @property
    def kept(self) -> tuple[Hypothesis, ...]:
        """Laws that the runs cannot tell from the best one, best first.

        Those that would be the best one if they predicted left-out sessions better are among them: they fit the
        runs at least as well. So are those whose numbers these runs do not determine, if they fit nearly as well.
        """
        kept = [law for law in self.fitted if law.kept]
        if not kept:
            return ()
        near = [law for law in kept if self._behind(law, kept[0]) < INDISTINGUISHABLE]
        unconfirmed = [
            law for law in self.fitted if law.reason is Reason.NOT_PREDICTIVE and gain(law) >= gain(kept[0])
        ]
        undetermined = [
            law for law in self.fitted
            if law.reason in UNDETERMINED and self._behind(law, kept[0]) < INDISTINGUISHABLE
        ]  # fmt: skip
        return (*near, *unconfirmed, *undetermined)

    def _behind(self, law: Hypothesis, best: Hypothesis) -> float:
        """Compute how far its gain is behind that of the best law, with the price of levers or without."""
        at_lever = gain_at_lever(best, self.price) - gain_at_lever(law, self.price)
        return min(gain(best) - gain(law), at_lever)

    @property
    def complete(self) -> bool:
        """Whether the best law leaves no more than noise, and tables without a law hardly ever gain as much."""
        return bool(self.kept) and self._leaves_noise(self.kept[0]) and self.significant

    def _leaves_noise(self, law: Hypothesis) -> bool:
        return p_value(law) >= self.level / 2

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
        return self.kept[0].fitted.prediction if self.kept else self.base.prediction

    @property
    def rivals(self) -> tuple[Hypothesis, ...]:
        """Laws that the runs cannot tell apart, best first; none if there are not two."""
        if not self.complete or len(self.kept) < 2:
            return ()
        return self.kept

    def as_good_as(self, claim: Fit) -> tuple[Hypothesis, ...]:
        """List the kept laws that leave no more than noise and fit as well as a claimed effect, best first."""
        # Those that predict what the claim does are the claim in other words.
        limit = claim.deviance + INDISTINGUISHABLE
        good = [law for law in self.kept if self._leaves_noise(law) and law.fitted.deviance < limit]
        scatter = np.sqrt(np.diag(claim.noise.run_covariance))
        apart = (np.abs((law.fitted.prediction - claim.prediction) / scatter).max() > _SAME for law in good)
        return tuple(itertools.compress(good, apart))

    def to_dict(self, claim: Fit | None = None) -> dict[str, Any]:
        """Return the record for verdict.json, with laws that fit as well as an effect that is claimed."""
        facts = self._facts(claim)
        beside = say_laws(facts) if claim else ""
        return {"sentence": say_laws({**facts, "as_good": None}), "beside": beside, **facts}

    def _facts(self, claim: Fit | None) -> dict[str, Any]:
        as_good = self.as_good_as(claim) if claim else ()
        return {
            "complete": self.complete,
            "significant": self.significant,
            "search_p_value": self.search_p_value,
            "tables_without_law": DRAWS,
            "places": [{"place": one.place.name, "gain": one.gain} for one in self.ranked],
            "laws": [self._record(law) for law in self.fitted],
            "kept": [law_model(law).place.name for law in self.kept],
            "in_common": _in_common(self.kept, self.fitted),
            "as_good": [law_model(law).place.name for law in as_good] if claim else None,
            "in_common_of_as_good": _in_common(as_good, self.fitted),
        }

    def _record(self, law: Hypothesis) -> dict[str, Any]:
        """Write a law as verdict.json has it; `size` is at the geometric mean of the runs."""
        model, fitted, evidence = law_model(law), law.fitted, law.evidence
        effect, size, _ = model.law(fitted.parameters)
        runs, (error, *interval) = model.runs, evidence.held_out_error or (math.nan,)
        numbers = {
            p.name.removeprefix("law_"): {
                "value": fitted.parameters[p.name],
                "interval": list(fitted.interval(p.name)),
            }
            for p in law.added
        }
        return {
            "place": model.place.name,
            "acts": _acts(law, self.fitted),
            "words": law.words,
            "effect": {"name": effect.name, "size": size},
            **numbers,
            "runs": {
                "N": [float(runs.tails.min()), float(runs.tails.max())],
                "l_cm": [100 * float(runs.length.min()), 100 * float(runs.length.max())],
                "omega_rpm": [_RPM * float(np.abs(runs.omega).min()), _RPM * float(np.abs(runs.omega).max())],
            },
            "gain": evidence.bic_gain,
            "session_gain": list(evidence.session_gain or ()),
            "p_value": p_value(law),
            "error": error,
            "error_interval": interval,
            "reason": "" if law.kept else law.reason,
            "leaves_noise": self._leaves_noise(law),
            "undetermined": law.reason in UNDETERMINED,
        }


def elsewhere(law: Hypothesis, laws: Iterable[Hypothesis]) -> list[Hypothesis]:
    """List the same side force with a lever not told from 0, of one that is kept at the disc."""
    names = law_model(law).place.elsewhere if law.kept else ()
    by_place = {law_model(other).place.name: other for other in laws}
    others = [by_place[name] for name in names if name in by_place]
    return [other for other in others if other.reason is Reason.NO_LEVER]


def _said(law: Hypothesis, laws: Iterable[Hypothesis]) -> str:
    """Say a law, with 95 % intervals."""
    model, fitted = law_model(law), law.fitted
    chosen = [i for i, name in enumerate(EXPONENTS) if name in fitted.names]
    at = [fitted.names.index(EXPONENTS[i]) for i in chosen]
    said = in_words(
        [INPUTS[i] for i in chosen],
        np.array([fitted.parameters[EXPONENTS[i]] for i in chosen]),
        fitted.covariance[np.ix_(at, at)],
        [fitted.interval(EXPONENTS[i]) for i in chosen],
        motion_patterns(logarithms(model.runs), model.runs.outputs, fitted.prediction),
    )
    noted = [name for name in model.noted if parameter_of(name) in fitted.names]
    values = [fitted.parameters[parameter_of(name)] for name in noted]
    also = noted_in_words(noted, values, [fitted.interval(parameter_of(name)) for name in noted])
    return ", ".join(filter(None, (_acts(law, laws), said, also)))


def _acts(law: Hypothesis, laws: Iterable[Hypothesis]) -> str:
    """Say what a law is, and where on the axis a side force acts."""
    words, fitted = law_model(law).place.words, law.fitted
    if others := elsewhere(law, laws):
        return f"{words}, at the disc or up to {' and '.join(map(_farthest, others))} it"
    if LEVER not in fitted.names:
        return words
    lever = fitted.parameters[LEVER]
    away, side = (-1, "behind") if lever < 0 else (1, "ahead of")
    low, high = sorted(away * end for end in fitted.interval(LEVER))
    unit = law_model(law).place.lever_unit
    return f"{words}, {abs(lever):.2f} {unit} ({low:.2f} to {high:.2f}) {side} the disc"


def _in_common(some: Sequence[Hypothesis], laws: Sequence[Hypothesis]) -> str:
    """Say what several of the laws have in common, wherever they may act; empty if nothing."""
    everywhere = [law_model(one).place for law in some for one in (law, *elsewhere(law, laws))]
    return in_common(everywhere) if len(some) > 1 else ""


def gain(law: Hypothesis) -> float:
    """Return the BIC of the model without a law less that with it."""
    assert law.evidence.bic_gain is not None
    return law.evidence.bic_gain


def gain_at_lever(law: Hypothesis, price: float) -> float:
    """Return the same without the price of its lever, if it has one."""
    return gain(law) + (price if LEVER in law.fitted.names else 0.0)


def p_value(law: Hypothesis) -> float:
    """Return that of the residual that a law leaves."""
    assert law.evidence.remainder is not None
    return law.evidence.remainder.p_value


def _farthest(law: Hypothesis) -> str:
    """Say how far from the disc a side force may act, by the interval of its lever."""
    place = law_model(law).place
    low, high = np.clip(law.fitted.interval(LEVER), *place.lever_bounds)
    return f"{-low:.2f} l behind" if place.lever_unit == "l" else f"{high:.2f} {place.lever_unit} ahead of"


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
    ranked, p = searched.ranked, search_p_value(searched, seed=study.seed + 2)
    least = max(_LIKELY * ranked[0].gain, 0.0)
    likely = [one for one in ranked[:_FITTED] if one.gain > least]
    laws = _fit_all(study, base, likely, chosen_alone=beside_claim)
    kept = _kept(laws)
    if not beside_claim and (not kept or p_value(kept[0]) < study.level / 2):
        laws += _fit_all(
            study, base, [one for one in ranked if one.gain > 0 and one not in likely], chosen_alone=False
        )
    laws = _with_levers(study, base, laws, ranked, chosen_alone=beside_claim)
    said = (replace(law, said=_said(law, laws)) for law in sorted(laws, key=gain, reverse=True))
    return Laws(base, tuple(ranked), tuple(said), p, math.log(study.values), study.level)


def _fit_all(study: Study, base: Fit, likely: Sequence[Ranked], *, chosen_alone: bool) -> list[Hypothesis]:
    """Fit and judge places, without those where the motion cannot be simulated; see `fitted_law`."""
    laws = []
    with progress_bar("laws", unit="law", total=len(likely), disable=not study.progress) as bar:
        for one in likely:
            if not skipped("some laws") and (law := fitted_law(study, base, one, chosen_alone=chosen_alone)):
                laws.append(law)
            bar.update()
    return laws


def _with_levers(
    study: Study, base: Fit, laws: list[Hypothesis], ranked: Sequence[Ranked], *, chosen_alone: bool
) -> list[Hypothesis]:
    """Compare side forces at the disc with the same ones elsewhere.

    A lever that the interval does not tell from none is told from it if the same force at the disc fits worse. A
    force that is kept at the disc is compared with those elsewhere, which say how far from it it may act.
    """
    fitted = {law_model(law).place.name: law for law in laws}
    wanted = {name for law in _kept(laws) for name in law_model(law).place.elsewhere}
    wanted |= {law_model(law).place.at_disc for law in laws if law.reason is Reason.NO_LEVER}
    missing = [one for one in ranked if one.place.name in wanted - set(fitted)]
    further = _fit_all(study, base, missing, chosen_alone=chosen_alone)
    fitted |= {law_model(law).place.name: law for law in further}
    price, trial = math.log(study.values), Trial(study, base)
    told = [rule for rule in LAW_RULES if rule.reason is not Reason.NO_LEVER]
    for name, law in fitted.items():
        at_disc = fitted.get(law_model(law).place.at_disc)
        worse = at_disc and gain_at_lever(law, price) - gain(at_disc) > INDISTINGUISHABLE
        if law.reason is Reason.NO_LEVER and worse:
            fitted[name] = judge(law, trial, told)
    return list(fitted.values())


def _kept(laws: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return the laws that are kept, the largest gain first."""
    return sorted((law for law in laws if law.kept), key=gain, reverse=True)
