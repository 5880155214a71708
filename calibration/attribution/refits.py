"""Which effects explain the residual: candidates, their refits, and the judgement on these.

Every effect that the runs can test is a candidate. If its score exceeds the critical |z|
(`calibration.statistics.residual_tests`), with a sign that its bounds allow, the effect is fitted together with
the coefficients. It is kept if

- the fit converged,
- the residual that it leaves passes the general tests and the scores of all other effects (at half of the level,
  so that a true effect is not lost too often),
- its interval excludes the null, and
- it predicts left-out sessions better, by more than the uncertainty of that gain.

Scores hold near the fit only. If a coefficient ran to an end of its range because an effect is missing, scores say
nothing. Then every effect is fitted, starting from the model as given.

Kept effects cannot be told apart if their deviances differ by less than one parameter can gain by chance (6.63).
If no single effect is kept, a second one is looked for beside each of the best few.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np
from tqdm import tqdm

from calibration.statistics.budget import clock, skipped
from calibration.statistics.fit import Fit, UnsolvedError, fit
from calibration.statistics.gls import Noise, solve_normal
from calibration.statistics.residual_tests import TESTABLE, Directions, Misfit, directions, examine_residual
from calibration.statistics.statistical_model import Experiment, ForwardModel, Parameter, Parameters, start_values
from calibration.statistics.study import Study, groups, leave_one_group_out
from common.arrays import Floats, Integers

IMITABLE = 0.05  # imitability index above which a claim needs a reservation
SURE = 0.01  # p-value of the transfer test below which it is
INDISTINGUISHABLE = 6.63  # χ² with one degree of freedom, 99 %
UNSEEN = 1e9  # smallest detectable size of an effect that changes nothing
FIRST = 3  # number of single effects to which a second one is added
_CURVED = 0.3  # share of the best score's z² below which an effect is not refitted if it leaves too much
_DRAWS = 400  # of the bootstrap, for the residual that an effect leaves


class Judgement(StrEnum):
    """Whether an effect is kept; if not, why, in the words of the report."""

    KEPT = "kept"
    NOT_NEEDED = "not needed"
    NO_CHANGE = "it changes nothing in these runs"
    ABSORBED = "the coefficients absorb it: not testable with these runs"
    NOISE = "score within the noise"
    WRONG_SIGN = "its score has a sign that the effect cannot have"
    LEAVES_MUCH = "leaves far more than noise, by its score"
    NO_TIME = "no time was left for its fit"
    NOT_SOLVED = "with it the model of some runs is not solved directly"
    NOT_CONVERGED = "its fit did not converge"
    LEAVES_RESIDUAL = "leaves a residual"
    INCLUDES_NULL = "its interval includes the null"
    NOT_PREDICTIVE = "does not predict left-out sessions better"
    COSTS_MORE = "costs more than it gains beside a single effect"


@dataclass(frozen=True)
class Candidate:
    """What was found about one effect; what only a refit tells is left at its default if there was none."""

    effect: Parameter  # as a parameter
    claimed: tuple[Parameter, ...]  # all effects of its refit: those that were in the model before, and this one
    z: float  # score, in standard deviations of the noise
    survived: float  # share of its signal that the fit cannot absorb
    detectable: float  # size that is found half of the time: critical |z| / signal per unit
    detectable_exact: float  # the same if every nuisance parameter were exact
    judgement: Judgement
    refit: Fit | None = None  # the model with this effect
    refit_misfit: Misfit | None = None  # tests of the residual that the refit leaves
    gain: float = 0.0  # predictive gain summed over left-out sessions, in log likelihood
    gain_error: float = 0.0  # standard error of `gain`
    imitable: float = 0.0  # imitability index of the claim (`calibration.attribution.claim_checks`), if it is kept
    transfer: float = 1.0  # p-value that it carries over to other runs, if it is kept
    left_out: float = math.nan  # as a form: its error on left-out runs over that of the model without it

    @property
    def kept(self) -> bool:
        return self.judgement is Judgement.KEPT

    @property
    def no_fit(self) -> bool:
        """Whether there is no fit of it from which anything could be concluded."""
        return self.judgement in (Judgement.NOT_SOLVED, Judgement.NOT_CONVERGED)

    @property
    def reason(self) -> str:
        """Why it was kept or not, in words."""
        if self.judgement is Judgement.LEAVES_RESIDUAL and self.refit_misfit:
            return f"{self.judgement} (p ≤ {self.refit_misfit.p_value:.1g})"
        return str(self.judgement)

    @property
    def uncertain(self) -> bool:
        """Whether the claim may be something outside the catalogue that looks like it.

        A pair is always uncertain: it is chosen among about 200 pairs, whose shapes lie densely. An effect that
        explains the runs only beside a wrong nuisance parameter counts as a pair.
        """
        is_pair = len(self.claimed) > 1 or bool(self.refit and self.refit.wrong_numbers)
        return is_pair or self.imitable > IMITABLE or self.transfer < SURE

    @property
    def title(self) -> str:
        """Titles of all effects of its refit."""
        return " and ".join(e.title for e in self.claimed)

    @property
    def words(self) -> str:
        """Titles and names of all effects of its refit."""
        return " and ".join(e.words for e in self.claimed)


@dataclass(frozen=True)
class Rival:
    """A fitted model that explains or describes the runs as well as others do."""

    title: str  # in words
    fit: Fit
    model: Experiment  # that was fitted
    law: Mapping[str, Any] = field(default_factory=dict)  # what makes this model of one without the law


def unexamined(
    misfit: Misfit, effects: Sequence[Parameter], threshold: float, beside: tuple[Parameter, ...] = ()
) -> list[Candidate]:
    """Describe every effect by its score alone; a claim needs a |z| above `threshold`."""
    scores = misfit.scores
    return [
        Candidate(
            effect=effect,
            claimed=(*beside, effect),
            z=float(scores.z[j]),
            survived=float(scores.survived[j]),
            detectable=threshold / max(float(scores.length[j]), 1e-300),
            detectable_exact=threshold / max(float(misfit.exact_length[j]), 1e-300),
            judgement=Judgement.NOT_NEEDED,
        )
        for j, effect in enumerate(effects)
    ]


def explaining(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the kept effects that the runs cannot tell from the best one, best first."""
    kept = sorted((c for c in candidates if c.kept and c.refit), key=penalised_deviance)
    return [c for c in kept if penalised_deviance(c) - penalised_deviance(kept[0]) < INDISTINGUISHABLE]


def penalised_deviance(candidate: Candidate) -> float:
    """Return the deviance of a refit plus what second numbers cost, because each may gain as much by chance."""
    assert candidate.refit is not None
    seconds = sum(e.second is not None for e in candidate.claimed)
    return candidate.refit.deviance + INDISTINGUISHABLE * seconds


def examine(
    study: Study,
    base: Fit,
    misfit: Misfit,
    directions: Directions,
    *,
    threshold: float | None = None,
    beside: tuple[Parameter, ...] = (),
    after_first: Callable[[int, float], None] | None = None,
) -> list[Candidate]:
    """Refit and judge every effect that is not in the model yet, best score first.

    Args:
        base: the fit without them.
        misfit: of its residual.
        directions: of the effects there.
        threshold: |z| that a refit needs; the critical one of `misfit` if not given.
        beside: effects that `base` has already.
        after_first: is told, after the first refit, how many there are, and the processor time of this one.
    """
    needed = misfit.critical_z if threshold is None else threshold
    effects = [e for e in study.effects if e not in beside]
    local = coefficients_within_range(study.model, base.parameters)
    scored = unexamined(misfit, effects, needed, beside)
    most = study.noise_at_most(len(base.names))
    reasons = [_reason(c, base, misfit, j, needed, most) if local else None for j, c in enumerate(scored)]
    examined = []
    title = " ".join(("effects", *(f"beside {e.title}" for e in beside)))
    order = np.argsort(-np.abs(misfit.scores.z)).tolist()
    for j in tqdm(order, desc=title, unit="effect", delay=1.0, disable=not study.progress or None):
        effect, candidate = effects[j], scored[j]
        if reason := reasons[j]:
            examined.append(replace(candidate, judgement=reason))
            continue
        guess = _guess(base, misfit, candidate, j) if local else effect.start
        if skipped(f"a second effect beside {beside[0].title}" if beside else effect.title):
            examined.append(replace(candidate, judgement=Judgement.NO_TIME))
            continue
        size = {effect.name: min(max(guess, effect.bounds[0]), effect.bounds[1])}
        if effect.second is not None:
            size[effect.second.name] = float(misfit.second[j]) if local else effect.second.start
        start = {**(base.parameters if local else start_values(study.model)), **size}
        names = (*base.names, *size)
        target, began = study.noise_at_most(len(names)), clock()
        try:
            refit = fit(study.model, start, names, study.split.fitted, target=target, title="")
        except UnsolvedError:
            examined.append(replace(candidate, judgement=Judgement.NOT_SOLVED))
            continue
        examined.append(judge(study, candidate, base, refit, directions.without(j)))
        if after_first:
            after_first(reasons.count(None), clock() - began)
            after_first = None
    return examined


def _guess(base: Fit, misfit: Misfit, candidate: Candidate, place: int) -> float:
    """Estimate the size of the effect at a place by its score."""
    return base.parameters[candidate.effect.name] + candidate.z / max(float(misfit.scores.length[place]), 1e-300)


def _reason(
    candidate: Candidate, base: Fit, misfit: Misfit, place: int, needed: float, most: float
) -> Judgement | None:
    """Say why an effect with this score is not worth a refit; `most`: what noise may leave."""
    effect, z, guess = candidate.effect, candidate.z, _guess(base, misfit, candidate, place)
    low, high = effect.bounds
    if candidate.detectable > UNSEEN:
        return Judgement.NO_CHANGE
    if candidate.survived < TESTABLE:
        return Judgement.ABSORBED
    if abs(z) < needed:
        return Judgement.NOISE
    if not low <= guess <= high and (guess < low) == (effect.start == low):
        return Judgement.WRONG_SIGN
    # A refit takes z² from the deviance if the model is linear. `_CURVED` allows for its curvature.
    remainder = base.deviance - z**2 / _CURVED
    best = float(np.max(np.where(misfit.scores.survived >= TESTABLE, misfit.scores.z**2, 0.0)))
    if z**2 < _CURVED * best and remainder > most:
        return Judgement.LEAVES_MUCH
    return None


def coefficients_within_range(model: ForwardModel, fitted: Parameters) -> bool:
    """Tell whether no coefficient ran to an end of its range."""
    return all(1.5 * p.bounds[0] < fitted[p.name] < p.bounds[1] / 1.5 for p in model.coefficients)


def pairs(study: Study, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Add second effects to the best fits with a single one; of those kept each is worth more than one effect."""
    refitted = sorted((c for c in candidates if c.refit), key=penalised_deviance)
    again = replace(study, seed=study.seed + 2)
    title = "second effects" if study.progress else ""
    second: list[Candidate] = []
    for first in refitted[:FIRST]:
        assert first.refit is not None
        if skipped(f"a second effect beside {first.title}"):
            continue
        others = [e for e in study.effects if e.name != first.effect.name]
        tangents = directions(study.model, first.refit.parameters, others, title=title, quick=True)
        misfit = examine_residual(again, first.refit, tangents)
        second += examine(again, first.refit, misfit, tangents, beside=(first.effect,))
    single = lowest_ebic(study, candidates)
    judged: dict[frozenset[str], Candidate] = {}
    for pair in second:
        if pair.kept and pair.refit is not None and ebic(study, pair.refit, 2) >= single:
            pair = replace(pair, judgement=Judgement.COSTS_MORE)
        known = judged.setdefault(frozenset(e.name for e in pair.claimed), pair)
        if pair.kept and not known.kept:
            judged[frozenset(e.name for e in pair.claimed)] = pair
    return list(judged.values())


def lowest_ebic(study: Study, candidates: Sequence[Candidate]) -> float:
    """Return the lowest EBIC of a single effect that was refitted; infinity if none was."""
    return min((ebic(study, c.refit, 1) for c in candidates if c.refit), default=math.inf)


def ebic(study: Study, refit: Fit, count: int) -> float:
    """Add to the deviance of a fit with `count` effects what they cost: k ln n + 2 ln (number of such sets).

    A nuisance parameter that lost its prior counts once more among the k numbers.

    Source: Chen and Chen (2008), γ = 1.
    """
    sets = max(math.comb(len(study.effects), count), 1)  # a number may stand for an effect
    numbers = len(refit.names) + len(refit.wrong_numbers)
    return refit.deviance + numbers * math.log(study.values) + 2 * math.log(sets)


def judge(study: Study, candidate: Candidate, base: Fit, refit: Fit, others: Directions) -> Candidate:
    """Add to a candidate its refit, and whether it is kept, in view of the directions of all `others`."""
    after = examine_residual(
        replace(study, seed=study.seed + 1), refit, others, draws=_DRAWS, decide=study.level / 2
    )
    gain, error = session_gain(study, base, refit)
    judgement = Judgement.KEPT
    if refit.stopped:
        judgement = Judgement.NO_TIME
    elif not refit.converged:
        judgement = Judgement.NOT_CONVERGED
    elif after.p_value < study.level / 2:
        judgement = Judgement.LEAVES_RESIDUAL
    elif _includes_null(base, refit, candidate.effect):
        judgement = Judgement.INCLUDES_NULL
    elif gain <= error:
        judgement = Judgement.NOT_PREDICTIVE
    return replace(candidate, refit=refit, refit_misfit=after, gain=gain, gain_error=error, judgement=judgement)


def _includes_null(base: Fit, refit: Fit, effect: Parameter) -> bool:
    """Tell whether the 95 % interval of an effect includes its null, by the covariance and by the deviance there.

    Along a bent valley the covariance alone says nothing.
    """
    low, high = interval_at_second(refit, effect)
    alike = base.wrong_numbers == refit.wrong_numbers  # otherwise the base lacks more than the effect
    return low <= effect.start <= high and not (
        alike and base.deviance - refit.deviance > refit.risen(effect.name)
    )


def interval_at_second(refit: Fit, effect: Parameter) -> tuple[float, float]:
    """Compute the 95 % interval of an effect, with its second number as it was fitted.

    A weak effect's size and second number cannot be told apart, and the interval over both would hold the null.
    """
    i = refit.names.index(effect.name)
    if effect.second is None or refit.held[i]:
        return refit.interval(effect.name)
    j = refit.names.index(effect.second.name)
    V = refit.covariance
    share = 1 - V[i, j] ** 2 / (V[i, i] * V[j, j])
    half = refit.half_width(i) * math.sqrt(max(share, 0.0))
    return refit.parameters[effect.name] - half, refit.parameters[effect.name] + half


def session_gain(study: Study, base: Fit, refit: Fit) -> tuple[float, float]:
    """Sum the gain in log likelihood over left-out sessions, with its standard error (linearised refits).

    With whitened residuals r of the refit and r + d of the base, a session gains ½|d|² + d·r, |d| of it by noise.
    """
    before, after = left_out_residuals(study, base, refit)
    return float(before @ before - after @ after) / 2, float(np.linalg.norm(before - after))


def left_out_residuals(study: Study, base: Fit, refit: Fit) -> tuple[Floats, Floats]:
    """Compute `left_out_residual` of the base and of the refit, both in the noise of the refit."""
    return left_out_residual(study, base, refit.noise), left_out_residual(study, refit, refit.noise)


def left_out_residual(study: Study, fitted: Fit, noise: Noise) -> Floats:
    """Whiten the residual of all fitted runs, in the order of `left_out_rows`, each from the other sessions."""
    data, parts = study.model.runs, []
    for learn, out in leave_one_group_out(groups(data)[0], study.split.fitted):
        step = solve_normal(fitted.normal_of_fit(data, learn, noise))[0]
        predicted = (data.y - fitted.prediction)[out] - fitted.tangents[out] @ step
        parts.append(noise.whitener(data.session[out], data.scale[out])(predicted))
    return np.concatenate(parts)


def left_out_rows(study: Study) -> Integers:
    """Return the places of the runs of a left-out residual."""
    left_out = leave_one_group_out(groups(study.model.runs)[0], study.split.fitted)
    return np.concatenate([np.flatnonzero(out) for _, out in left_out])
