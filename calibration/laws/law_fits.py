"""Laws that describe a residual: the best places, each fitted in the simulator, and those that are not told apart.

The places that `calibration.laws.search` ranks first are fitted with all exponents, the coefficients and the
nuisance parameters free (`calibration.laws.law`). If the best of them leaves more than noise, all others follow.

Beside a claim that something outside the catalogue could imitate, only the places that rank first are fitted, each
with the exponents of its linear model alone: a claim has one number, or two. A law fits as well as the claim if it
leaves no more than noise and its deviance is not larger by what one parameter can gain by chance.

Kept laws cannot be told apart if their BIC differ by less than one parameter can gain by chance (6.63). The place
that is true need not be among the places of the search: a law describes the runs, and is no claim about their
cause. Laws are claimed only if tables without a law, searched in the same way, hardly ever gain as much
(`calibration.laws.search`). Intervals do not count the choice among the places; those of
`Laws.simultaneous_interval` do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from tqdm import tqdm

from calibration.attribution.refits import INDISTINGUISHABLE
from calibration.laws.curves import find_curves
from calibration.laws.group_factors import gain_of_a_curve
from calibration.laws.law import NO_LEVER, NO_SESSIONS, UNDETERMINED, Law, fitted_law, with_a_lever
from calibration.laws.law_model import SIZE
from calibration.laws.places import in_common, places
from calibration.laws.readings import EXPONENTS
from calibration.laws.search import Ranked, Selection, examine_selection, search
from calibration.statistics.budget import skipped
from calibration.statistics.fit import Fit
from calibration.statistics.study import LEVEL, Study
from calibration.swimmer.swimmer import SwimmerModel
from calibration.verdict.next_runs import Rival
from calibration.words.render import say_laws
from sim.arrays import Floats

_FITTED = 6  # places that are fitted first
_CURVED = 0.3  # share of the best gain below which a place is not among them
_SAME = 0.1  # of the noise of a run


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
        """Laws that the runs cannot tell from the best one, best first.

        Those that would be the best one if they predicted left-out sessions better are among them: they fit the
        runs at least as well. So are those whose numbers these runs do not determine, if they fit nearly as well.
        """
        kept = _kept(self.fitted)
        if not kept:
            return ()
        near = [law for law in kept if law.behind(kept[0]) < INDISTINGUISHABLE]
        unconfirmed = [law for law in self.fitted if law.reason == NO_SESSIONS and law.gain >= kept[0].gain]
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
        return self.selection is not None and self.selection.p_value < self.level

    @property
    def curved(self) -> Law | None:
        """The law that describes best with a curve in place of a power law, where one is rejected."""
        curved = [law for law in self.fitted if any(curve.rejected for curve in law.curves)]
        return max(curved, key=lambda law: law.gain_with_curve, default=None)

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

    def _as_good_as(self, claim: Fit) -> list[Law]:
        """List them without those that predict what the claim does: they are the claim in other words."""
        limit = claim.deviance + INDISTINGUISHABLE
        good = [law for law in self.kept if law.p_value >= self.level / 2 and law.fit.deviance < limit]
        scatter = np.sqrt(np.diag(claim.noise.run))
        return [law for law in good if np.abs((law.fit.prediction - claim.prediction) / scatter).max() > _SAME]

    def to_dict(self, claim: Fit | None = None) -> dict[str, Any]:
        """Return the record for laws.json and verdict.json.

        Args:
            claim: an effect that is claimed, with which laws are compared.
        """
        facts = self._facts(claim)
        beside = say_laws(facts) if claim else ""
        return {"sentence": say_laws({**facts, "as_good": None}), "beside": beside, **facts}

    def _facts(self, claim: Fit | None) -> dict[str, Any]:
        as_good = self._as_good_as(claim) if claim else []
        return {
            "complete": self.complete,
            "significant": self.significant,
            **(self.selection.to_dict() if self.selection else {}),
            "places": [self._place_record(one) for one in self.ranked],
            "laws": [self._law_record(law) for law in self.fitted],
            "kept": [law.place.name for law in self.kept],
            "curved": self.curved.place.name if self.curved else None,
            "in_common": _in_common(self.kept),
            "as_good": [law.place.name for law in as_good] if claim else None,
            "in_common_of_as_good": _in_common(as_good),
        }

    def simultaneous_interval(self, law: Law, name: str) -> tuple[float, float]:
        """Compute the 95 % interval of a number of a law that covers those of all places at once."""
        assert self.selection is not None
        place, value = law.fit.names.index(name), law.fit.parameters[name]
        variance = law.fit.covariance[place, place] / law.fit.inflation  # K contains that S is estimated
        half = max(self.selection.widest * math.sqrt(variance), law.fit.half_width(place))
        return value - half, value + half

    def _law_record(self, law: Law) -> dict[str, Any]:
        record = {
            **law.to_dict(),
            "ebic_gain": self._ebic_gain(law.gain, law.numbers),
            "first": self.selection.first[law.place.name] if self.selection else None,
            "leaves_noise": law.p_value >= self.level / 2,
            "undetermined": law.reason in UNDETERMINED,
        }
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
    both = len(np.unique(np.sign(model.runs.omega[study.split.fitted]))) == 2
    candidates = places(both_directions=both)
    searched = search(model, base, study.split.fitted, candidates, title="places" if study.progress else "")
    ranked, selection = searched.ranked, examine_selection(searched, seed=study.seed + 2)
    least = max(_CURVED * ranked[0].gain, 0.0)
    likely = [one for one in ranked[:_FITTED] if one.gain > least]
    laws = _fit_all(study, model, base, likely, chosen_alone=beside_claim)
    kept = _kept(laws)
    if not beside_claim and (not kept or kept[0].p_value < study.level / 2):
        laws += _fit_all(study, model, base, [one for one in ranked if one.gain > 0 and one not in likely])
    laws = _with_levers(study, model, base, laws, ranked, chosen_alone=beside_claim)
    if not beside_claim:
        laws = _with_curves(study, laws)
    return Laws(base, tuple(ranked), tuple(sorted(laws, key=lambda law: -law.gain)), selection, study.level)


def _fit_all(
    study: Study, model: SwimmerModel, base: Fit, likely: Sequence[Ranked], *, chosen_alone: bool = False
) -> list[Law]:
    """Fit and judge places, without those where the motion cannot be simulated.

    Args:
        chosen_alone: whether only the exponents of the linear model are fitted.
    """
    bar = tqdm(likely, desc="laws", unit="law", delay=1.0, disable=not study.progress)
    tried = (one for one in bar if not skipped("some laws"))
    return [law for one in tried if (law := fitted_law(study, model, base, one, chosen_alone=chosen_alone))]


def _with_levers(
    study: Study, model: SwimmerModel, base: Fit, laws: list[Law], ranked: Sequence[Ranked], *, chosen_alone: bool
) -> list[Law]:
    """Compare side forces at the disc with the same ones elsewhere.

    A lever that the interval does not tell from none is told from it if the same force at the disc fits worse. A
    force that is kept at the disc says how far from it it may act.
    """
    fitted = {law.place.name: law for law in laws}
    wanted = {name for law in _kept(laws) for name in law.place.elsewhere}
    wanted |= {law.place.at_disc for law in laws if law.reason == NO_LEVER}
    missing = [one for one in ranked if one.place.name in wanted - set(fitted)]
    fitted |= {law.place.name: law for law in _fit_all(study, model, base, missing, chosen_alone=chosen_alone)}
    for name, law in fitted.items():
        at_disc = fitted.get(law.place.at_disc)
        if law.reason == NO_LEVER and at_disc and law.gain_at_lever - at_disc.gain > INDISTINGUISHABLE:
            fitted[name] = with_a_lever(law)
    return [
        replace(law, elsewhere=tuple(
            fitted[name] for name in law.place.elsewhere if name in fitted and fitted[name].reason == NO_LEVER
        ))
        if not law.reason else law
        for law in fitted.values()
    ]  # fmt: skip


def _with_curves(study: Study, laws: Sequence[Law]) -> list[Law]:
    """Find the curves of the best law and, where it leaves more than noise, of the best one with a curve."""
    used = study.split.fitted
    gains = [law.gain + gain_of_a_curve(law.model, law.fit, used) for law in laws]
    laws = [replace(law, gain_with_curve=gain) for law, gain in zip(laws, gains, strict=True)]
    kept = _kept(laws)
    shown = {kept[0].place.name} if kept else set()
    converged = [law for law in laws if law.fit.converged]
    if converged and (not kept or kept[0].p_value < study.level / 2):
        shown.add(max(converged, key=lambda law: law.gain_with_curve).place.name)
    return [
        replace(law, curves=find_curves(replace(study, model=law.model, seed=study.seed + 2), law.fit))
        if law.place.name in shown
        else law
        for law in laws
    ]


def _in_common(laws: Sequence[Law]) -> str:
    """Say what several laws have in common, wherever they may act; empty if nothing."""
    return in_common([one.place for law in laws for one in (law, *law.elsewhere)]) if len(laws) > 1 else ""


def _rival(law: Law) -> Rival:
    return Rival(law.words, law.fit, law.model, law.model.record)


def _kept(laws: Sequence[Law]) -> list[Law]:
    """Return the laws that are kept, the largest gain first."""
    return sorted((law for law in laws if not law.reason), key=lambda law: -law.gain)
