"""Which runs to make next, so that effects can be told apart, and which effect the runs then speak for.

Effects A, B, … may explain the runs equally well and predict different outputs at other inputs. If A is true, new
runs add

    λ_AB = dᵀ (Σ + J Cov Jᵀ)⁻¹ d,   d = f_A − f_B

to the difference of χ² between B and A. Σ is the covariance of the new runs, which are one session
(`calibration.statistics.statistical_model`). J and Cov are the derivatives of B and the covariance of its fit,
because B can be fitted again (T-optimal design, linearised). There is a λ for every two rivals, both ways; for
single runs the smallest counts. How often the runs decide is found by drawing them at random. Source: Atkinson
and Fedorov (1975).

A swim or a trace is many rows, and has own numbers, such as its start, that are fitted to it alone. They are in J
as well; in Cov they have a wide prior, or that of their tolerance. A trace that is made again has own ones again.

A batch is chosen one run after the other; of swims it is the best one, of traces the best one and its repeats.
With equal odds the wrong one of two is chosen with the probability Φ(−√λ/2); the run is taken that makes the sum
of these over all pairs least.

Each explanation was fitted before the new runs were made, and gives them a density: Gaussian about its prediction,
with covariance Σ + J Cov Jᵀ, J Cov Jᵀ the error of its own fit. The ratio of two densities, of all new runs
together, is an e-value. If one of the two is true, the ratio of the other to it exceeds `STOP` with a probability
of at most 1/STOP, however often one looks (Ville 1939). So an explanation is given up if it is behind the best one
by more than 2 ln STOP. Source: Grünwald, de Heide and Koolen (2024).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from scipy.linalg import block_diag
from scipy.special import ndtr

from calibration.attribution.hypothesis import Hypothesis
from calibration.linear.gls import Noise
from calibration.statistics.forward import derivatives
from calibration.statistics.statistical_model import Experiment, ForwardModel, apply_step, parameter, start_values
from calibration.table.runs import Runs, lines_of_excluded
from common.arrays import Flags, Floats
from common.errors import InputError
from common.reading import expecting, read_json

WithLaw = Callable[[Any, Mapping[str, Any]], ForwardModel]
STOP = 25.0  # ratio of likelihoods at which an explanation is given up, 1/α of the sequence of batches
GIVEN_UP = 2 * math.log(STOP)  # the same as a difference of deviances
BATCH = 8  # runs
SELDOM = 0.5  # share of cases in which runs must decide to be worth making
_DRAWS = 4000
_PROPOSED, _PROPOSED_WHOLE = 3, 15  # single settings; swims or traces
_WANTED = 0.9  # share of draws that should decide
_ENOUGH = 17.0  # λ at which they do
_REPEATS, _REPEATS_OF_TRACES = (1, 2, 4, 8, 16), (1, 2, 4)
_MOST_RIVALS = 4
_WIDE = 1e3  # standard deviation of a number of new runs' own without a tolerance, in typical sizes or logarithms
_PASSES = 3  # of a fit of these numbers


@dataclass(frozen=True)
class NextRun:
    """An experiment, and how well it tells the rivals apart, for the two that it tells apart least."""

    settings: dict[str, Any]  # column -> value
    repeats: int  # of the setting
    separation: float  # λ of all repeats
    decides: float  # share of draws in which the wrong one is given up

    @property
    def worth_making(self) -> bool:
        return self.decides >= SELDOM

    def record(self) -> dict[str, Any]:
        return {
            **self.settings,
            "repeats": self.repeats,
            "separation": round(self.separation, 2),
            "decides": round(self.decides, 3),
            "worth_making": self.worth_making,
        }


@dataclass(frozen=True)
class Batch:
    """Runs to make next, all together, to tell rivals apart."""

    settings: tuple[dict[str, Any], ...]  # of each run; the same settings may come more than once
    separation: float  # λ of the batch, for the two rivals that it tells apart least
    decides: float  # share of draws in which the wrong one of these two is given up

    @property
    def worth_making(self) -> bool:
        return self.decides >= SELDOM

    def record(self) -> dict[str, Any]:
        return {
            "runs": list(self.settings),
            "separation": round(self.separation, 2),
            "decides": round(self.decides, 3),
            "worth_making": self.worth_making,
            "stop_at_deviance": round(GIVEN_UP, 2),
        }


class Pair(NamedTuple):
    """A true rival and a wrong one that is fitted again."""

    difference: Floats  # of their predictions, (m, k)
    J: Floats  # (m, k, p) derivatives of the wrong one
    covariance: Floats  # (p, p) of its fit, see `_with_own`
    own: int = 0  # of the p, how many are the new runs' own; they come last


def next_runs(rivals: Sequence[Hypothesis], *, seed: int = 0) -> tuple[tuple[NextRun, ...], Batch]:
    """Find the best experiments to tell (the first four) rivals apart, best first, and the best `BATCH` runs.

    Of experiments of several rows, swims or traces, more are listed, the cheapest first of those that decide in
    `_WANTED` of cases, and the batch is the first one. Swims are not repeated.

    Raises:
        InputError: a run cannot be simulated; of swims none can.
    """
    told_apart = rivals[:_MOST_RIVALS]
    fits = [rival.fitted for rival in told_apart]
    distinct = {id(rival.model): cast(Experiment, rival.model) for rival in told_apart}
    possible = {key: model.possible() for key, model in distinct.items()}
    first, settings = next(iter(possible.values()))  # settings are those of all of them
    sides = []
    for rival, fit in zip(told_apart, fits, strict=True):
        model, before = possible[id(rival.model)][0], Explanation.of(rival)
        names, covariance = _with_own(model, before)
        at = {**start_values(model), **fit.parameters}
        sides.append((*derivatives(model, at, names), covariance, len(names) - len(before.parameters)))
    pairs = [Pair(true[0] - wrong[0], *wrong[1:]) for true, wrong in itertools.permutations(sides, 2)]
    solved = np.array([np.isfinite(prediction).all(1) & np.isfinite(J).all((1, 2)) for prediction, J, *_ in sides])
    experiments = [np.flatnonzero(first.runs.condition == place) for place in range(len(settings))]
    kept = [place for place, of in enumerate(experiments) if solved[:, of].all()]
    if not kept:
        raise InputError("no run that is possible can be simulated")
    settings, rows = [settings[place] for place in kept], [experiments[place].tolist() for place in kept]
    whole = max(map(len, rows)) > 1
    ratio = np.mean([np.asarray(f.noise.session_ratio) for f in fits], 0)
    noise = Noise(np.mean([f.noise.run_covariance for f in fits], 0), ratio)
    along = first.runs.along
    alone = np.array([_together(pairs, noise, along, of).min() for of in rows])
    runs = []
    counts = _REPEATS if not whole else (1,) if first.runs.trace is None else _REPEATS_OF_TRACES
    measured = told_apart[0].model.runs
    apart = len(measured.session_names) == len(measured.trace_names)
    rng = np.random.default_rng(seed)
    order = np.argsort(-np.minimum(alone, _ENOUGH if whole else math.inf), kind="stable")
    for place in order[: _PROPOSED_WHOLE if whole else _PROPOSED].tolist():
        for repeats in counts:
            if whole:
                strengths = _together(pairs, noise, along, rows[place], repeats, apart=apart)
            else:
                strengths = _together(pairs, noise, along, rows[place] * repeats)
            strength = float(strengths.min())
            decides = _decides(strength, rng)
            if decides >= _WANTED:
                break
        runs.append(NextRun(settings[place], repeats, strength, decides))
    if whole:
        return tuple(runs), Batch((runs[0].settings,) * runs[0].repeats, runs[0].separation, runs[0].decides)
    chosen, strength = _greedy(pairs, noise, along)
    batch = tuple(settings[place] for place in chosen)
    return tuple(runs), Batch(batch, strength, _decides(strength, rng))


def _decides(strength: float, rng: np.random.Generator) -> float:
    """Estimate the share of draws in which the wrong one is given up; its χ² over the true one's is λ + 2 √λ z."""
    draws = strength + 2 * np.sqrt(strength) * rng.normal(size=_DRAWS)
    return float((draws > GIVEN_UP).mean())


def _greedy(pairs: Sequence[Pair], noise: Noise, along: Floats) -> tuple[list[int], float]:
    """Choose `BATCH` runs, one after the other; return their places and the smallest λ of them together."""
    chosen: list[int] = []
    for _ in range(BATCH):
        tried = [_together(pairs, noise, along, [*chosen, place]) for place in range(len(pairs[0].difference))]
        chosen.append(int(np.argmin([ndtr(-np.sqrt(strength) / 2).sum() for strength in tried])))
    return sorted(chosen), float(tried[chosen[-1]].min())


def _together(
    pairs: Sequence[Pair], noise: Noise, along: Floats, places: list[int], repeats: int = 1, *, apart: bool = False
) -> Floats:
    """Compute λ of several rows made together, for every pair; for `along` (m,) see `Runs`.

    Args:
        repeats: how often all rows are made, each time with own numbers.
        apart: each time is a session of its own; by default all are one.
    """
    session = np.repeat(np.arange(repeats) if apart else np.zeros(repeats, dtype=np.int64), len(places))
    white, strengths = noise.whitener(session, along=np.tile(along[places], repeats)), []
    for pair in pairs:
        slopes, shared = pair.J[places], len(pair.covariance) - pair.own
        own = shared + np.flatnonzero(slopes[..., shared:].any((0, 1)))
        table = np.concatenate([pair.difference[places, :, None], slopes[..., :shared]], -1)
        of_each = np.einsum("rs,mkp->rmksp", np.eye(repeats), slopes[..., own])
        of_each = of_each.reshape(repeats * len(places), slopes.shape[1], -1)
        whitened = white(np.concatenate([np.tile(table, (repeats, 1, 1)), of_each], -1))
        known = pair.covariance[:shared, :shared], *[pair.covariance[np.ix_(own, own)]] * repeats
        root = _root(block_diag(*known))
        strengths.append(_fit_again(whitened[:, 0], whitened[:, 1:], root).left)
    return np.array(strengths)


class FittedAgain(NamedTuple):
    """What p numbers that were known with a covariance C become with new runs."""

    left: float  # rᵀ (1 + J C Jᵀ)⁻¹ r
    log_determinant: float  # of 1 + J C Jᵀ
    scores: Floats  # (p,) by how much they change, in the axes of `_root`


def _fit_again(residual: Floats, slopes: Floats, root: Floats, scores: Floats | float = 0.0) -> FittedAgain:
    """Fit numbers to white rows again: with C as rows, which needs no large matrix.

    Args:
        residual: (n,) at some scores.
        slopes: J, (n, p).
        root: of C, (p, p).
        scores: (p,) by which the numbers are off already, in the axes of the root.
    """
    count = len(root)
    orthogonal, upper = np.linalg.qr(np.concatenate([slopes @ root, np.eye(count)]))
    target = np.concatenate([residual, np.zeros(count) - scores])
    explained = orthogonal.T @ target
    left = target - orthogonal @ explained
    return FittedAgain(
        float(left @ left),
        2 * float(np.log(np.abs(np.diag(upper))).sum()),
        np.asarray(np.linalg.solve(upper, explained)),
    )


def _root(covariance: Floats) -> Floats:
    """Compute F, F Fᵀ = C, (p, p), whatever the units of its rows."""
    sigma = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    sizes, axes = np.linalg.eigh(covariance / np.outer(sigma, sigma))
    return np.asarray(sigma[:, None] * axes * np.sqrt(np.maximum(sizes, 0.0)))


def _with_own(model: ForwardModel, before: Explanation) -> tuple[list[str], Floats]:
    """List what new runs fit again, and its covariance: that of an explanation, and wide of their own numbers.

    Their own are those of these runs, and of specimens that are new.
    """
    every = [p for p in (*model.coefficients, *model.nuisances) if p.of_these_runs or p.of_group]
    own = [p for p in every if p.name not in before.parameters]
    widths = [p.sigma or _WIDE * (1.0 if p.logarithmic else abs(p.typical)) for p in own]
    names = [*before.parameters, *(p.name for p in own)]
    return names, block_diag(before.covariance, np.diag(np.square(widths)))


@dataclass(frozen=True)
class Explanation:
    """A fitted model that explains a table, as verdict.json keeps it."""

    title: str  # in words
    parameters: dict[str, float]  # all that are fitted and that new runs have
    covariance: Floats  # (p, p) of them
    noise: Noise  # of runs and sessions
    outputs: tuple[str, ...]  # (k,) that were fitted
    law: Mapping[str, Any] = field(default_factory=dict)  # of a rival that is a law, see `with_law`
    memory: tuple[float, float] | None = None  # s and τ of the noise along traces, see `Memory`

    @staticmethod
    def of(rival: Hypothesis) -> Explanation:
        """Keep of a rival what a decision needs."""
        fitted = rival.fitted
        kept = [place for place, p in enumerate(fitted.fitted) if not p.of_these_runs]
        parameters = {fitted.names[place]: fitted.parameters[fitted.names[place]] for place in kept}
        covariance, runs = fitted.covariance[np.ix_(kept, kept)], rival.model.runs
        memory = None if runs.memory is None else (runs.memory.share, runs.memory.tau)
        return Explanation(
            rival.title, parameters, covariance, fitted.noise, tuple(runs.outputs), rival.law, memory
        )

    def record(self) -> dict[str, Any]:
        """Write it for verdict.json."""
        return {
            "title": self.title,
            "parameters": self.parameters,
            "covariance": self.covariance.tolist(),
            "noise_of_a_run": self.noise.run_covariance.tolist(),
            "share_of_sessions": np.broadcast_to(self.noise.session_ratio, len(self.outputs)).tolist(),
            "outputs": list(self.outputs),
            **({"law": dict(self.law)} if self.law else {}),
            **({"memory": list(self.memory)} if self.memory else {}),
        }

    @staticmethod
    def read(record: dict[str, Any]) -> Explanation:
        """Read it from verdict.json.

        Raises:
            ValueError, TypeError, KeyError, AttributeError, OverflowError: it is none.
        """
        parameters = {str(name): float(value) for name, value in record["parameters"].items()}
        covariance, run = (np.array(record[name], dtype=float) for name in ("covariance", "noise_of_a_run"))
        outputs, share = tuple(map(str, record["outputs"])), np.array(record["share_of_sessions"], dtype=float)
        numbers = np.concatenate([covariance.ravel(), run.ravel(), share.ravel(), list(parameters.values())])
        if covariance.shape != (len(parameters),) * 2 or run.shape != (len(outputs),) * 2:
            raise ValueError
        if share.shape not in ((), (len(outputs),)):  # one of all outputs, as before
            raise ValueError
        if not np.isfinite(numbers).all():
            raise ValueError
        law, memory = dict(record.get("law", {})), None
        if "memory" in record:
            slow, tau = map(float, record["memory"])
            if not (0 <= slow <= 1 and 0 < tau < math.inf):
                raise ValueError
            memory = slow, tau
        return Explanation(str(record["title"]), parameters, covariance, Noise(run, share), outputs, law, memory)


@dataclass(frozen=True)
class Standing:
    """How far an explanation is behind the best one on the new runs."""

    title: str  # of the explanation
    behind: float  # 2 ln of the ratio of the densities

    @property
    def given_up(self) -> bool:
        return self.behind > GIVEN_UP


def refuse_nothing_to_decide(explanations: Sequence[Any] | None) -> None:
    """Refuse a verdict that has nothing to decide."""
    if not explanations:
        raise InputError("this verdict has no two explanations between which new runs could decide")


def read_explanations(path: str | Path) -> tuple[list[Explanation], set[str]]:
    """Read the explanations that the runs of a verdict.json could not tell apart, and the sessions of these runs.

    Raises:
        InputError: no such file, or its verdict has nothing to decide.
    """
    with expecting("a verdict.json of this version", path, "calibrate the table again"):
        record = read_json(path)
        refuse_nothing_to_decide(record.get("explanations"))
        explanations = [Explanation.read(explanation) for explanation in record["explanations"]]
        sessions = set(map(str, record["sessions"]))
    return explanations, sessions


def new_runs(runs: Runs, before: set[str]) -> Flags:
    """Choose the runs (n,) of sessions that were not there before; refuse a table without such."""
    new = np.array([runs.session_names[s] not in before for s in runs.session])
    if not new.any():
        set_aside = "".join(f"; {line}" for line in lines_of_excluded(runs)[:1])
        raise InputError(
            "all sessions of this table were there before; give the new runs a session of their own "
            f"(column session), a new swim a name of its own (column run, or its file){set_aside}"
        )
    return new


def standings(
    model: ForwardModel, explanations: Sequence[Explanation], new: Flags, with_law: WithLaw | None = None
) -> list[Standing]:
    """Judge explanations by the new runs in `new` (n,), best first; `with_law` makes the model of a law.

    It takes up where `calibration.attribution.attribution.Attribution.verdict` says "ambiguous", and where several
    laws describe what nothing explains.

    Raises:
        InputError: the table has other outputs than were fitted, or lacks what an effect needs.
    """
    data, scores = model.runs, []
    for explanation in explanations:
        subject = with_law(model, explanation.law) if with_law and explanation.law else model
        known = start_values(subject)
        if explanation.outputs != data.outputs:
            raise InputError(
                f"this table has the outputs {', '.join(data.outputs)}; the verdict was made from "
                f"{', '.join(explanation.outputs)}"
            )
        missing = [name for name in explanation.parameters if name not in known]
        if missing:
            raise InputError(
                f"{explanation.title}: these runs cannot test {', '.join(missing)}; keep every column of the "
                "table before"
            )
        names, covariance = _with_own(subject, explanation)
        session = data.session[new]
        whiten = explanation.noise.whitener(session, along=data.along[new])
        root, at = _root(covariance), {**known, **explanation.parameters}
        changed: Floats = np.zeros(len(names))
        for _ in range(_PASSES if len(names) > len(explanation.parameters) else 1):
            prediction, J = derivatives(subject, at, names)
            table = whiten(np.concatenate([(data.y - prediction)[..., None], J], -1)[new])
            again = _fit_again(table[:, 0], table[:, 1:], root, changed)
            changed = changed + again.scores
            at = apply_step([parameter(subject, name) for name in names], at, root @ again.scores)
        scale = explanation.noise.log_determinant(session, data.along[new])
        scores.append(again.left + again.log_determinant + scale)
    best = min(scores)
    standing = [Standing(e.title, score - best) for e, score in zip(explanations, scores, strict=True)]
    return sorted(standing, key=lambda s: s.behind)


@dataclass(frozen=True)
class Decision:
    """What new runs say about several explanations.

    Example:
        >>> from softflagella import decide
        >>> decide("runs.csv", "calibrated/verdict.json", "robot.toml").sentence  # doctest: +SKIP
        'Decided: tank wall. The next step is to calibrate with all runs.'
    """

    standings: tuple[Standing, ...]  # best first
    new_runs: int  # how many there were, or how many swims or traces

    @property
    def decided(self) -> str | None:
        """The explanation that is left; None if there are several."""
        titles = [standing.title for standing in self.standings if not standing.given_up]
        return titles[0] if len(titles) == 1 else None

    @property
    def sentence(self) -> str:
        """What to do now."""
        if self.decided:
            return f"Decided: {self.decided}. The next step is to calibrate with all runs."
        titles = [standing.title for standing in self.standings if not standing.given_up]
        return f"Not decided between {' and '.join(titles)}: make more runs."


def decide(
    model: ForwardModel,
    explanations: Sequence[Explanation],
    before: set[str],
    with_law: WithLaw | None = None,
) -> Decision:
    """Judge explanations by the runs of sessions that were not among those `before`, see `standings`."""
    new = new_runs(model.runs, before)
    return Decision(
        tuple(standings(model, explanations, new, with_law)), len(np.unique(model.runs.made_at_once[new]))
    )
