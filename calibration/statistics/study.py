"""A study: a model, its divided runs, and the settings of every test, all fixed beforehand; and the held-out runs.

**Groups.** Sessions, or blocks of conditions if sessions are few, are held out or left out together. Blocks are
drawn from the conditions within a session; repeats stay together. The shift of a single session cannot be
estimated. Its variance is taken to be `gls.UNKNOWN_RATIO`, so a shift of all its runs is no evidence.

**Outliers** are runs that are far from their own repeats, for example because of a misplaced decimal point. If, in
one output, the runs of a condition are more than `FAR` robust standard deviations apart, the run that is farthest
from the model as given is excluded. A missing effect does not cause this: it changes all repeats alike. Where more
than half of a condition would go, none does: its runs scatter more than those of others, and get less weight.

**Held-out runs** tell the error of a model, and whether they agree with it. In the end it is fitted to all runs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import ndtri, stdtrit

from calibration.linear.gls import inverse_root, square_root
from calibration.statistics.fit import Fit
from calibration.statistics.statistical_model import ForwardModel, Parameter, regression
from calibration.table.excluded import Excluded
from calibration.table.runs import Runs
from common.arrays import Flags, Floats, Integers
from common.errors import InputError

LEVEL = 0.04  # α of every claim; below 0.05, because the noise is estimated and false claims must stay below 5 %
DRAWS = 1000  # of the bootstrap
FAR = 12.0  # robust standard deviations between repeats
_BEYOND = 6.0  # standard deviations of a deviance
_POINTED, _GROUP, _SINGLE = 6.0, 8, 0.02  # see `far_readings`
_MAD = 1.4826  # median absolute deviation to standard deviation
_FEWEST = 3  # sessions that are held out as a whole
_BLOCKS = 4  # in all
_HELD_OUT = 1 / 12  # least share of the runs that are held out
_FEWEST_OF_A_QUARTER = 4  # conditions or specimens


@dataclass(frozen=True)
class Split:
    """Which runs are fitted, and which are kept for the test."""

    fitted: Flags  # (n,) runs from which everything is learnt
    test: Flags  # (n,) runs on which errors are stated: whole sessions or blocks
    kept: Flags  # (n,) both, for the final refit: all runs but outliers
    names: str = ""  # of the held-out groups
    outliers: tuple[Excluded, ...] = ()
    caveats: tuple[str, ...] = ()  # what the split weakens


@dataclass(frozen=True)
class Study:
    """What every step of a calibration needs to know, beside the fit that it starts from."""

    model: ForwardModel
    split: Split  # of its runs into fitted and held-out ones
    level: float = LEVEL  # α of every claim
    seed: int = 0  # of the bootstrap
    draws: int = DRAWS  # of the bootstrap
    progress: bool = False  # show progress bars
    variance_ratio: float = 1.0  # variance of any run over that of a run of S, where runs have weights
    settled: frozenset[str] = frozenset()  # effects that are no candidates: in the base, or withdrawn

    @property
    def effects(self) -> tuple[Parameter, ...]:
        """Effects that may be claimed."""
        return tuple(e for e in self.model.effects if e.name not in self.settled)

    @property
    def values(self) -> int:
        """Number of values that are fitted, over runs and outputs."""
        return self.model.runs.values(self.split.fitted)

    def noise_at_most(self, parameters: int) -> float:
        """Compute a deviance that noise alone hardly exceeds: `_BEYOND` standard deviations above its mean.

        The ν repeats contribute ν k exactly, since S is made of them. The other f values have an S that is
        independent of them, and 1/S is inverse Wishart (von Rosen 1988): their mean is f c, c = ν/(ν − k − 1), and

            variance = 2 c ν (ν − 1)/((ν − k)(ν − k − 3)) (f + f²/(k (ν − k − 1))).
        """
        v, k = self.model.runs.noise(self.split.fitted)[1], self.model.runs.y.shape[1]
        if v <= k + 3 or not self.model.runs.noise_known:
            return math.inf
        if math.isinf(v):
            f = self.values - parameters
            return f + _BEYOND * math.sqrt(2 * f)
        f, c = max(self.values - v * k - parameters, 0), v / (v - k - 1)
        variance = 2 * c * v * (v - 1) / ((v - k) * (v - k - 3)) * (f + f**2 / (k * (v - k - 1)))
        return v * k + f * c + _BEYOND * math.sqrt(variance)

    @classmethod
    def fitted_to(cls, model: ForwardModel, used: Flags, **settings: Any) -> Study:
        """Study a model on the runs in `used` (n,); all others are held out."""
        return cls(model, Split(used, ~used, np.ones_like(used)), **settings)


def groups(data: Runs) -> tuple[Integers, tuple[str, ...]]:
    """Number the groups that stay together, (n,), and name them."""
    if data.blocks is not None:
        return data.blocks
    count = len(data.session_names)
    if count >= _FEWEST:
        return data.session, data.session_names
    parts = _BLOCKS // count
    block = np.empty_like(data.session)
    rng = np.random.default_rng(0)
    for session in range(count):
        members = data.session == session
        condition = np.unique(data.together[members], return_inverse=True)[1].reshape(-1)
        block[members] = session * parts + rng.permutation(condition.max() + 1)[condition] % parts
    names = (f"{name}, part {i + 1} of {parts}" for name in data.session_names for i in range(parts))
    return block, tuple(names)


def middle_session(data: Runs) -> Flags:
    """Choose the middle session by name, which needs no extrapolation, or a block if sessions are few; (n,).

    Its neighbours join it until `_HELD_OUT` of the runs are held out, where sessions are short. A session all of
    which would serve to fit its own numbers is none that can be held out.
    """
    group, names = groups(data)
    spent = set(group.tolist()) - set(group[data.left_out(np.ones(len(data), dtype=bool))].tolist())
    every = [place for place in range(len(names)) if place not in spent]
    by_distance = sorted(every, key=lambda place: abs(place - len(names) // 2))
    sizes = np.bincount(group, minlength=len(names))[by_distance]
    count = int(np.searchsorted(np.cumsum(sizes), _HELD_OUT * len(group) - 0.5)) + 1
    return np.isin(group, by_distance[:count])


def split_runs(data: Runs, held_out: Flags | None, outliers: tuple[Flags, tuple[Excluded, ...]]) -> Split:
    """Divide the runs, and say what is weaker if the held-out ones are not whole sessions.

    Args:
        held_out: (n,); the middle session if not given.
        outliers: which they are (n,), and why; neither fitted nor tested.
    """
    held_out = middle_session(data) if held_out is None else held_out
    if held_out.any() and not data.left_out(held_out).any():
        raise InputError(
            f"the {data.row}s that are held out all serve to fit the numbers of their own, so none is left to "
            "compare; hold out others, or more"
        )
    count = len(data.session_names)
    parted = divided(data, held_out)
    group, names = data.parts or (groups(data) if parted else (data.session, data.session_names))
    caveats: tuple[str, ...] = ()
    if count < _FEWEST and parted and data.parts is None:
        caveat = (
            f"{count} session{'s' * (count > 1)} only: the held-out runs are a quarter of the conditions, not a "
            "session of their own, so the error on them does not contain the differences between sessions"
        )
        if count == 1:
            caveat += ", and a shift that is equal in all runs is no evidence for an effect"
        caveats = (caveat,)
    bad, excluded = outliers
    held_out_names = ", ".join(names[g] for g in np.unique(group[held_out]))
    test = data.left_out(held_out) & ~bad
    return Split(~test & ~bad, test, ~bad, held_out_names, excluded, caveats)


def leave_one_group_out(data: Runs, used: Flags) -> Iterator[tuple[Flags, Flags]]:
    """Yield the runs (n,) to learn from and the runs (n,) left out, for every group among those in `used`."""
    group = groups(data)[0]
    for label in np.unique(group[used]):
        yield used & (group != label), used & (group == label)


def divided(data: Runs, held_out: Flags) -> bool:
    """Tell whether some runs of a session are held out and others are not."""
    return bool(set(data.session[held_out]) & set(data.session[~held_out]))


def find_outliers(data: Runs, prediction: Floats) -> tuple[Flags, tuple[Excluded, ...]]:
    """Find the runs (n,) to exclude, and say why; `prediction` (n, k) of the model as given."""
    bad = np.zeros(len(data.y), dtype=bool)
    if data.trace is not None:  # repeats may differ by numbers of their own
        return bad, ()
    residual = data.y - prediction
    y, checked = data.y.copy(), [data.unit_checked.get(name, False) for name in data.outputs]
    for rows in (data.session == session for session in np.unique(data.session)):
        y[rows] -= np.where(checked, np.median(residual[rows], 0), 0.0)  # such a session may differ as a whole
    residual -= np.nanmedian(np.where(data.gaps, np.nan, residual), 0)
    groups = [np.flatnonzero(data.condition == c) for c in np.unique(data.condition)]
    groups = [g for g in groups if len(g) > 1]
    if not groups:
        return bad, ()
    centred = np.concatenate([y[g] - np.median(y[g], 0) for g in groups])
    # The deviation of two repeats from their median is half their difference.
    pairs = np.sqrt(np.mean([(len(g) - 1) / len(g) for g in groups]))
    scatter = _MAD * np.median(np.abs(centred), 0) / pairs
    excluded: list[Excluded] = []
    for all_repeats in groups:
        group, apart = all_repeats, list[Excluded]()
        while len(group) > 1:
            spread = np.ptp(y[group], axis=0) / np.maximum(scatter, 1e-300)
            worst = int(np.argmax(spread))
            if spread[worst] < FAR or scatter[worst] == 0:
                break
            out = group[np.argmax(np.abs(residual[group, worst]))]
            far = f"{data.outputs[worst]} is far from its repeat{{}}"
            distance = f" ({spread[worst]:.0f} standard deviations)"
            apart.append(Excluded(far, data.row_name(int(out)), distance))
            group = group[group != out]
        if 2 * len(apart) <= len(all_repeats):  # else the condition scatters more than others
            bad[np.setdiff1d(all_repeats, group)] = True
            excluded += apart
    return bad, tuple(excluded)


def far_readings(data: Runs, residual: Floats) -> list[str]:
    """Name single readings whose residual (n, k) is far from the rest of their specimen or session.

    They are `_POINTED` robust standard deviations off, somewhat more where a group is small; a group of less than
    `_GROUP` has the scatter of all. A larger share than `_SINGLE` is no single reading but a misfit.
    """
    group, names = (
        (data.session, data.session_names) if data.specimen is None else (data.specimen, data.specimen_names)
    )
    residual, found = np.where(data.gaps, np.nan, residual * data.scale[:, None]), []
    for place, output in enumerate(data.outputs):
        centred, limit = residual[:, place].copy(), np.empty(len(data))
        members = [np.flatnonzero(group == g) for g in range(len(names))]
        for rows in members:
            centred[rows] -= np.nanmedian(centred[rows]) if np.isfinite(centred[rows]).any() else 0.0
        for rows in members:
            rest = np.abs(centred[rows] if len(rows) >= _GROUP else centred)
            limit[rows] = _POINTED * _MAD * np.nanmedian(rest) * (1 + 4 / len(rest))
        far = np.flatnonzero(np.abs(centred) > np.maximum(limit, 1e-12))
        if data.trace is not None:  # of readings one after the other the first
            far = far[np.diff(far, prepend=-2) > 1]
        if len(far) <= max(1, _SINGLE * len(data)) and np.isfinite(centred).sum() >= _GROUP:
            words = "{}: {} is {:.0f} times as far from the model as the rest of {} scatters"
            found += [
                words.format(data.row_name(row), data.title_of(output), _POINTED * abs(centred[row]) / limit[row],
                             names[group[row]])
                for row in far.tolist()
            ]  # fmt: skip
    return found


_DRAWS, _FEWEST_DRAWS, _AT_ONCE = 2000, 200, 50
_VALUES = 10_000_000  # of all draws, where a table is long


def errors(data: Runs, prediction: Floats, rows: Flags) -> tuple[float, dict[str, float]]:
    """Compute the relative rms over runs and outputs (θ in rad), and per output; each run by its weight.

    The residual of a run counts as √w times itself, which noise alone makes as large as S says.
    """
    square = _scaled_square(data, prediction, rows)
    each = dict(zip(data.outputs, np.sqrt(np.nanmean(square, 0)).tolist(), strict=True))
    return float(np.sqrt(np.nanmean(square))), each


def error_interval(data: Runs, prediction: Floats, rows: Flags, seed: int) -> tuple[float, float]:
    """Estimate the 95 % interval of the relative rms by resampling conditions."""
    return _middle(_drawn_errors(data, prediction, rows, seed))


def gain_interval(data: Runs, before: Floats, after: Floats, rows: Flags, seed: int) -> tuple[float, float]:
    """Estimate the 95 % interval of by how much the relative rms falls, paired, by resampling conditions."""
    return _middle(np.subtract(*(_drawn_errors(data, prediction, rows, seed) for prediction in (before, after))))


def _drawn_errors(data: Runs, prediction: Floats, rows: Flags, seed: int) -> Floats:
    """Draw conditions, and compute the relative rms of each draw, (D,)."""
    square, condition = np.nanmean(_scaled_square(data, prediction, rows), 1), data.resampled[rows]
    means = np.array([square[condition == c].mean() for c in np.unique(condition)])
    drawn = np.random.default_rng(seed).integers(0, len(means), (_DRAWS, len(means)))
    return np.asarray(np.sqrt(means[drawn].mean(1)))


def _middle(drawn: Floats) -> tuple[float, float]:
    """Return the ends of the middle 95 %."""
    return float(np.quantile(drawn, 0.025)), float(np.quantile(drawn, 0.975))


def quarter_of_conditions(data: Runs, used: Flags) -> tuple[Flags, str]:
    """Choose a quarter of the specimens, or else of the conditions, among the runs in `used` (n,), and name them.

    Half of a quarter of the conditions are those farthest from the mean of the inputs, the ends of the settings;
    the others are drawn. There are none (n,) where there are fewer than `_FEWEST_OF_A_QUARTER`.
    """
    rng, none = np.random.default_rng(0), np.zeros_like(used)
    if data.specimen is not None and len(kinds := np.unique(data.specimen[used])) >= _FEWEST_OF_A_QUARTER:
        chosen = rng.permutation(kinds)[: len(kinds) // 4]
        return data.left_out(used & np.isin(data.specimen, chosen)), "a quarter of the specimens"
    condition, inputs = data.together, data.inputs
    what = data.stretches
    if data.trace is not None:  # whole traces
        inputs, what = data.partners, "traces"
        condition = np.unique(inputs.round(9), axis=0, return_inverse=True)[1].reshape(-1)
    kinds, first = np.unique(condition[used], return_index=True)
    if len(kinds) < _FEWEST_OF_A_QUARTER:
        return none, ""
    inputs = inputs[used][first]
    spread = inputs.std(0)
    distance = (((inputs - inputs.mean(0)) / np.where(spread > 0, spread, 1.0)) ** 2).sum(1)
    by_distance = kinds[np.argsort(-distance, kind="stable")]
    ends = max(len(kinds) // 8, 1)
    drawn = rng.permutation(by_distance[ends:])[: len(kinds) // 4 - ends]
    return data.left_out(used & np.isin(condition, [*by_distance[:ends], *drawn])), f"a quarter of the {what}"


def _scaled_square(data: Runs, prediction: Floats, rows: Flags) -> Floats:
    """Compute w r² of the runs in `rows`, (n', k); NaN for what was not measured."""
    square = (data.raw(data.y - prediction) * data.scale[:, None]) ** 2
    return np.where(data.gaps, np.nan, square)[rows]


def held_out_p_value(fitted: Fit, data: Runs, rows: Flags, *, seed: int) -> float:
    """Estimate the probability that noise alone puts the held-out runs `rows` (n,) as far from the model.

    The statistic is the sum of squares of the residual, whitened by S. Its null distribution is drawn with the
    noise of runs and sessions, the error of the fitted parameters, and the uncertainty of S.
    """
    root, scale, rng = (
        inverse_root(fitted.noise.run_covariance),
        data.scale[rows, None],
        np.random.default_rng(seed),
    )
    residual = scale * (data.y - fitted.prediction)[rows] @ root.T
    freedom = max(data.noise(~rows)[1], len(root) + 1)
    free = tuple(replace(p, sigma=None) for p in fitted.fitted)
    linear = regression(data, rows, fitted.tangents, free)
    spread = square_root(fitted.covariance)
    as_far = 0
    draws = min(max(_VALUES // residual.size, _FEWEST_DRAWS), _DRAWS)
    for _ in range(draws // _AT_ONCE):
        drawn = linear.draw(
            rng, fitted.noise.run_covariance, np.tile(fitted.noise.session_ratio, (_AT_ONCE, 1)), spread
        )
        white = scale * drawn @ root.T
        if not math.isinf(freedom):
            repeats = rng.normal(size=(_AT_ONCE, int(freedom), len(root)))
            of_repeats = inverse_root(np.swapaxes(repeats, -1, -2) @ repeats / freedom)
            white = white @ np.swapaxes(of_repeats, -1, -2)
        as_far += int(np.count_nonzero((white**2).sum((-1, -2)) >= (residual**2).sum()))
    return (1 + as_far) / (1 + draws)


@dataclass(frozen=True)
class FinalRefit:
    """The model that is handed on: fitted to all runs."""

    parameters: dict[str, float]  # name -> value
    fitted: tuple[Parameter, ...]  # those that were fitted
    covariance: Floats  # (p, p); a 95 % interval is 1.96 standard deviations to each side


def final_refit(fitted: Fit) -> FinalRefit:
    """Hand on a fit to all runs; its intervals, those of Student's t, become those of a normal distribution."""
    wider = stdtrit(fitted.freedom, 0.975) / ndtri(0.975)
    return FinalRefit(fitted.parameters, fitted.fitted, fitted.covariance * np.outer(wider, wider))
