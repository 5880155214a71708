"""Which effect explains the residual: candidates, refits, and which of them are kept.

Every effect that the runs can test is a candidate. If its score exceeds the critical |z|
(`calibration.statistics.residual_tests`), with a sign that its bounds allow, the effect is fitted together with
the coefficients. It is kept if

    the fit arrives at a minimum,
    the residual that it leaves passes the general tests and the scores of all other effects (at half of the
    level, so that a true effect is not lost too often),
    its interval excludes the null, and
    it predicts left-out sessions better, by more than the uncertainty of that gain.

Scores hold near the fit only. If a coefficient ran to an end of its range because an effect is missing, scores say
nothing. Then every effect is fitted, starting from the model as given.

Kept effects cannot be told apart if their deviances differ by less than one parameter can gain by chance (6.63).
If no single effect is kept, each of the best few is taken into the model, and a second one is looked for in the
same way (`pairs`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from tqdm import tqdm

from calibration.attribution.imitability import DOUBT, absorbable_shares, imitability
from calibration.attribution.transfer_test import SURE, transfer_p
from calibration.attribution.wrong_numbers import free_numbers
from calibration.statistics.fit import Fit, fit
from calibration.statistics.forward_model import Model, Parameter, Parameters
from calibration.statistics.priors import likeliest, prior_rows, pulls
from calibration.statistics.residual_tests import TESTABLE, Misfit, check_misfit
from calibration.statistics.score_directions import Directions, directions
from calibration.statistics.splits import groups
from sim.arrays import Flags, Floats, Integers

_CURVED = 0.3  # share of the best score's z² below which an effect is not refitted if it leaves too much
UNSEEN = 1e9  # smallest detectable size of an effect that changes nothing
_FAR = 6.0  # standard deviations of χ²
_LEAVES_MORE = "leaves far more than noise, by its score"
_DRAWS = 400  # of the bootstrap, for the residual that an effect leaves
FIRST = 3  # number of single effects to which a second one is added
INDISTINGUISHABLE = 6.63  # χ² with one degree of freedom, 99 %


@dataclass(frozen=True)
class Candidate:
    """What was found about one effect."""

    effect: Parameter
    beside: tuple[Parameter, ...]  # effects that were in the model before
    z: float
    survived: float
    detectable: float  # size that is found half of the time: critical |z| / signal per unit
    detectable_exact: float  # the same if every number as given were exact
    refit: Fit | None
    refit_misfit: Misfit | None
    gain: float  # predictive gain summed over left-out sessions, in log likelihood
    gain_error: float
    verdict: str  # why it was kept or not
    imitable: float = (
        0.0  # imitability index of the claim (`calibration.attribution.imitability`), where it is kept
    )
    transfer: float = 1.0  # p-value that it carries over to other runs (`transfer_test`), where it is kept

    @property
    def kept(self) -> bool:
        return self.verdict == "kept"

    @property
    def doubted(self) -> bool:
        """Whether the claim may be something outside the catalogue that looks like it.

        An effect that explains the runs only beside a wrong number counts as a pair, and is always in doubt.
        """
        return self.imitable > DOUBT or self.transfer < SURE or bool(self.refit and self.refit.wrong)

    @property
    def claimed(self) -> tuple[Parameter, ...]:
        """All effects of its refit."""
        return (*self.beside, self.effect)


def examine(
    model: Model,
    base: Fit,
    misfit: Misfit,
    effects: tuple[Parameter, ...],
    along: Directions,
    used: Flags,
    given: Parameters,
    *,
    level: float,
    seed: int,
    beside: tuple[Parameter, ...] = (),
    progress: bool = True,
) -> list[Candidate]:
    """Refit and judge every effect, best score first; refits start at `given` if a coefficient ran away.

    Args:
        base: the fit without them; it has `beside`.
        along: directions of `effects` there.
    """
    found = []
    local = inside(model, base.parameters)
    free = tuple(alike[0].parameter.name for alike in base.wrong)
    order = np.argsort(-np.abs(misfit.scores.z)).tolist()
    title = " ".join(("effects", *(f"beside {e.title}" for e in beside)))
    for j in tqdm(order, desc=title, unit="effect", delay=1.0, disable=not progress):
        effect = effects[j]
        z, survived = float(misfit.scores.z[j]), float(misfit.scores.survived[j])
        detectable, exact = detectable_sizes(misfit, j)
        guess = base.parameters[effect.name] + z / max(float(misfit.scores.length[j]), 1e-300)
        low, high = effect.bounds
        reason = ""
        if not local:
            guess = effect.start
        elif detectable > UNSEEN:
            reason = "it changes nothing in these runs"
        elif survived < TESTABLE:
            reason = "the coefficients absorb it: not testable with these runs"
        elif abs(z) < misfit.critical_z:
            reason = "score within the noise"
        elif not low <= guess <= high and (guess < low) == (effect.start == low):
            reason = "its score has a sign that the effect cannot have"
        if reason:
            found.append(Candidate(effect, beside, z, survived, detectable, exact, None, None, 0.0, 0.0, reason))
            continue
        if local and _hopeless(model, base, misfit, z, used):
            found.append(
                Candidate(effect, beside, z, survived, detectable, exact, None, None, 0.0, 0.0, _LEAVES_MORE)
            )
            continue
        own = {effect.name: min(max(guess, low), high)}
        if effect.second is not None:
            own[effect.second.name] = float(misfit.second[j]) if local else effect.second.start
        refit = fit(
            model,
            {**(base.parameters if local else given), **own},
            (*base.names, *own),
            used,
            free=free,
            title="",
        )
        refit = replace(refit, wrong=base.wrong)
        others = along.without(j)
        one = Candidate(effect, beside, z, survived, detectable, exact, refit, None, 0.0, 0.0, "")
        found.append(_judged(model, one, base, refit, used, others, level, seed))
    return found


def _hopeless(model: Model, base: Fit, misfit: Misfit, z: float, used: Flags) -> bool:
    """Whether an effect takes a small share of the residual and leaves far more than noise, by its score.

    A refit takes z² from the deviance if the model is linear. `_CURVED` allows for its curvature.
    """
    freedom = int(used.sum()) * base.prediction.shape[1] - len(base.names)
    left = base.deviance - z**2 / _CURVED - freedom
    best = float(np.max(np.where(misfit.scores.survived >= TESTABLE, misfit.scores.z**2, 0.0)))
    return z**2 < _CURVED * best and left > _FAR * math.sqrt(2 * freedom)


def detectable_sizes(misfit: Misfit, place: int) -> tuple[float, float]:
    """Size of an effect that is found half of the time; the same if every number as given were exact."""
    lengths = float(misfit.scores.length[place]), float(misfit.exact_length[place])
    return misfit.critical_z / max(lengths[0], 1e-300), misfit.critical_z / max(lengths[1], 1e-300)


def _judged(
    model: Model, one: Candidate, base: Fit, refit: Fit, used: Flags, others: Directions, level: float, seed: int
) -> Candidate:
    """The candidate with a refit, and the reason why that is kept or not.

    Args:
        others: directions of all other effects.
    """
    after = check_misfit(
        refit, model.runs, used, others, level=level, seed=seed + 1, draws=_DRAWS, decide=level / 2
    )
    gain, error = _session_gain(model, base, refit, used)
    ends = interval_at_second(refit, one.effect)
    reason = "kept"
    if not refit.arrived:
        reason = "its fit does not arrive at a minimum"
    elif after.p_value < level / 2:
        reason = f"leaves a residual (p ≤ {after.p_value:.1g})"
    elif ends[0] <= one.effect.start <= ends[1]:
        reason = "its interval includes the null"
    elif gain <= error:
        reason = "does not predict left-out sessions better"
    return replace(one, refit=refit, refit_misfit=after, gain=gain, gain_error=error, verdict=reason)


def interval_at_second(refit: Fit, effect: Parameter) -> tuple[float, float]:
    """95 % interval of an effect, with its second number as it was fitted.

    A weak effect's size and second number cannot be told apart, and the interval over both would hold the null.
    """
    if effect.second is None:
        return refit.interval(effect.name)
    i, j = refit.names.index(effect.name), refit.names.index(effect.second.name)
    V = refit.covariance
    share = 1 - V[i, j] ** 2 / (V[i, i] * V[j, j])
    half = refit.half_width(i) * math.sqrt(max(share, 0.0))
    return refit.parameters[effect.name] - half, refit.parameters[effect.name] + half


def beside_wrong_numbers(
    model: Model, base: Fit, found: list[Candidate], used: Flags, along: Directions, *, level: float, seed: int
) -> list[Candidate]:
    """The best few refits once more, without the priors of numbers that they contradict.

    Args:
        along: directions of `model.effects`.
    """
    reach = []
    names = [e.name for e in model.effects]
    for one in found:
        if one.refit is not None:
            worst = likeliest(pulls(one.refit, model.given))
            if worst is not None:
                reach.append((one.refit.deviance - worst.z**2, one.effect.name, one))
    again = []
    for _, name, one in sorted(reach, key=lambda r: r[:2])[:FIRST]:
        assert one.refit is not None
        refit = free_numbers(model, one.refit, used)
        others = along.without(names.index(name))
        again.append(_judged(model, one, base, refit, used, others, level, seed))
    return again


def pairs(
    model: Model,
    found: list[Candidate],
    used: Flags,
    given: Parameters,
    *,
    level: float,
    seed: int,
    draws: int,
    progress: bool = True,
) -> list[Candidate]:
    """Second effects, added to the best fits with a single one."""
    refitted = [c for c in found if c.refit is not None]
    second: list[Candidate] = []
    for first in sorted(refitted, key=_deviance)[:FIRST]:
        assert first.refit is not None
        title = "second effects" if progress else ""
        others = tuple(e for e in model.effects if e.name != first.effect.name)
        along = directions(model, first.refit.parameters, others, title=title)
        misfit = check_misfit(first.refit, model.runs, used, along, level=level, seed=seed + 2, draws=draws)
        second += examine(
            model,
            first.refit,
            misfit,
            others,
            along,
            used,
            given,
            level=level,
            seed=seed + 2,
            beside=(first.effect,),
            progress=progress,
        )
    unique: dict[frozenset[str], Candidate] = {}
    single = min(ebic(c.refit, 1, model, used) for c in refitted if c.refit) if refitted else np.inf
    for candidate in second:
        names = frozenset(e.name for e in candidate.claimed)
        pays = candidate.refit is not None and ebic(candidate.refit, 2, model, used) < single
        if candidate.kept and pays and names not in unique:
            unique[names] = candidate
    return list(unique.values())


def ebic(refit: Fit, count: int, model: Model, used: Flags) -> float:
    """Deviance of a fit with `count` effects, and what they cost: k ln n + 2 ln (number of such sets).

    Source: Chen and Chen (2008), γ = 1.
    """
    values = int(used.sum()) * refit.prediction.shape[1]
    sets = math.comb(len(model.effects), count)
    return refit.deviance + len(refit.names) * math.log(values) + 2 * math.log(sets)


def with_doubts(model: Model, best: list[Candidate], base: Fit, used: Flags, seed: int) -> list[Candidate]:
    """Claims with their imitability index and whether they carry over; their strength is what they take from the
    deviance of `base`.
    """
    found = []
    for one in best:
        assert one.refit is not None
        strength = math.sqrt(max(base.deviance - one.refit.deviance, 0.0))
        seconds = (e.second.name for e in one.claimed if e.second)
        names = (*(e.name for e in one.claimed), *seconds)
        shares = absorbable_shares(one.refit, model.runs, used, names, seed=seed)
        transfer = transfer_p(one.refit, model.runs, used, seed=seed + 4)
        found.append(replace(one, imitable=imitability(shares, strength), transfer=transfer))
    return found


def inside(model: Model, fitted: Parameters) -> bool:
    """Whether no coefficient ran to an end of its range."""
    return all(1.5 * p.bounds[0] < fitted[p.name] < p.bounds[1] / 1.5 for p in model.coefficients)


def explaining(found: list[Candidate]) -> list[Candidate]:
    """Kept effects that the runs cannot tell from the best one, best first."""
    kept = sorted((c for c in found if c.kept and c.refit), key=_deviance)
    return [c for c in kept if _deviance(c) - _deviance(kept[0]) < INDISTINGUISHABLE]


def _deviance(candidate: Candidate) -> float:
    """Of the refit, and what second numbers cost: each may gain as much by chance."""
    assert candidate.refit is not None
    seconds = sum(e.second is not None for e in candidate.claimed)
    return candidate.refit.deviance + INDISTINGUISHABLE * seconds


def _session_gain(model: Model, base: Fit, refit: Fit, used: Flags) -> tuple[float, float]:
    """Gain in log likelihood summed over left-out sessions, and its standard error (linearised refits).

    With whitened residuals r of the refit and r + d of the base, a session gains ½|d|² + d·r, |d| of it by noise.
    """
    data = model.runs
    gain, variance = 0.0, 0.0
    group = groups(data)[0]
    for one in np.unique(group[used]):
        learn, out = used & (group != one), used & (group == one)
        left = [_left_out(data.y, data.session, fitted, learn, out, refit) for fitted in (base, refit)]
        gain += 0.5 * float(left[0] @ left[0] - left[1] @ left[1])
        variance += float(((left[0] - left[1]) ** 2).sum())
    return gain, float(np.sqrt(variance))


def _left_out(
    y: Floats,
    session: Integers,
    fitted: Fit,
    learn: Flags,
    out: Flags,
    judge: Fit,
) -> Floats:
    """Whitened residuals of a left-out session for a model fitted to the others, in the noise of `judge`."""
    white = judge.noise.whitener(session[learn])
    residual = y - fitted.prediction
    rows, prior = prior_rows(fitted.fitted, fitted.parameters)
    derivative = np.concatenate([white(fitted.jacobian[learn]), rows])
    step = np.linalg.lstsq(derivative, np.concatenate([white(residual[learn]), prior]), rcond=None)[0]
    left = residual[out] - fitted.jacobian[out] @ step
    return np.asarray(judge.noise.whitener(session[out])(left))
