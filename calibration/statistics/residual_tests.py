"""Is the residual more than noise? General tests and projected scores, by one parametric bootstrap.

With W = Σ^−½ and Q = orth(W ∂f/∂C), the part that the coefficients can absorb is projected out:

    r = (I − QQᵀ) W (y − f),   d_j = (I − QQᵀ) W ∂f/∂ε_j,   z_j = d̂_jᵀ r.

Five statistics:

    lack     χ² of the condition means: lack of fit against pure error;
    kernel   rᵀ K r: smooth structure over the runs' inputs;
    shape    max |z| over directions in which one output follows an input, a square or a product of two;
    pull     max |x/√(σ² − V)| over nuisance parameters, x the change in the fit and V its variance;
    score    max |z_j| over the catalogue. The scatter of the sessions is estimated with effect j in the model,
             because otherwise a shift of all runs would look like scatter. An effect with a second number has
             one score at each of several values of it, and the largest counts.

Nuisance parameters have priors of covariance P, so Σ is Σ + J P Jᵀ in all of
them.

Their null distribution comes from data drawn with the fitted noise (repeats and sessions) and with nuisance
parameters drawn from their priors. Each draw goes through the same steps: S and ρ are estimated, and the
coefficients are refitted (linearised). A run of weight w keeps its weight and is drawn with S/w. So the p-values
take into account the fit, the estimated noise, and correlated candidates. Several statistics are judged together
by the smallest of their p-values. Its null distribution comes from the same draws (Westfall and Young 1993).

An effect with a second number (a time, say) has no such number at its null: the prediction does not depend on it
there. So it cannot be estimated without the effect, and a score must be taken at each of several values. The test
takes the largest, and its bootstrap takes the largest, too (Davies 1987, a nuisance parameter that is present only
under the alternative).

Source: score tests after projection, Rao (1948); kernel score, e.g. Liu, Lin, Ghosh (2007).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from calibration.linear.gls import (
    Groups,
    NormalEquations,
    Regression,
    inverse_root,
    schur_complement,
    solve_normal,
    square_root,
)
from calibration.linear.memory import Memory
from calibration.statistics.budget import skipped
from calibration.statistics.fit import LEARNT, Fit
from calibration.statistics.forward import derivatives
from calibration.statistics.statistical_model import ForwardModel, Parameter, Parameters, prior_offsets, regression
from calibration.statistics.study import Study
from calibration.table.runs import Runs, features
from common.arrays import Flags, Floats, Integers

GENERAL = ("lack", "kernel", "shape", "pull")
_PASSES = 3  # iterations for the scatter of the sessions
_PASSES_OF_A_SCORE = 2
_AT_ONCE, _OF_TRACES_AT_ONCE = 50, 200  # draws
_FEWEST_DRAWS = 100  # where no time is left
_MOST_PLACES, _LANDMARKS = 1000, 200  # distinct inputs between which a kernel is computed, and those of more
_SEEN = 3e-3  # share of the largest eigenvalue of the kernel between these that counts
_ROUNDING = 1e-12  # of the kernel between all inputs
_VALUES = 2_000_000  # of the draws that are made at once


@dataclass(frozen=True)
class Directions:
    """∂f/∂ε of e effects in m columns; an effect with a second number has several."""

    table: Floats  # (n, k, m)
    owner: Integers  # (m,) place of each column's effect, 0 to e − 1, in order
    second: Floats  # (m,) value of the second number; NaN where there is none

    @classmethod
    def plain(cls, table: Floats) -> Directions:
        """Make one column for each effect."""
        count = table.shape[-1]
        return cls(table, np.arange(count), np.full(count, np.nan))

    def without(self, place: int) -> Directions:
        """Leave one effect out."""
        kept = self.owner != place
        owner = self.owner[kept]
        return Directions(self.table[..., kept], owner - (owner > place), self.second[kept])


def directions(
    model: ForwardModel,
    parameters: Parameters,
    effects: Sequence[Parameter],
    *,
    title: str = "",
    quick: bool = False,
) -> Directions:
    """Compute the directions of effects that are at their null in `parameters`, (n, k, m).

    With `quick` a direction is zero, which no test notices, where it cannot be computed quickly.
    """
    at_null = derivatives(model, parameters, effects, title=title, quick=quick)[1]
    columns, owner, second = [], [], []
    for place, effect in enumerate(effects):
        values: dict[float, Floats] = {}
        if effect.second is None:
            values[np.nan] = at_null[..., place]
        else:
            name = effect.second.name
            for value in effect.second.grid:
                if value == parameters[name]:
                    values[value] = at_null[..., place]
                else:
                    at = {**parameters, name: value}
                    values[value] = derivatives(model, at, [effect], quick=quick)[1][..., 0]
        columns += list(values.values())
        owner += [place] * len(values)
        second += list(values)
    table = np.stack(columns, -1) if columns else at_null
    table = np.where(np.isfinite(table).all((0, 1)), table, 0.0)
    return Directions(table, np.array(owner, dtype=np.int64), np.array(second, dtype=float))


@dataclass(frozen=True)
class Scores:
    """Statistics of residuals; ... for batches of them."""

    general: Floats  # (..., 4) GENERAL
    z: Floats  # (..., e) projected score of each effect
    survived: Floats  # (..., e) |d_j| / |W ∂f/∂ε_j|
    length: Floats  # (..., e) |d_j|: signal per unit of the effect, in standard deviations
    shapes: Floats  # (..., k, f) z of each output along each feature
    session_ratio: Floats  # (..., k) ρ


@dataclass(frozen=True)
class Misfit:
    """Observed statistics and their p-values."""

    scores: Scores  # statistics of the residual
    p: dict[str, float]  # of each statistic
    general_p: float  # of the general tests together
    p_value: float  # any departure: general tests and scores together
    critical_z: float  # quantile of max |z_j| at the level
    features: tuple[str, ...]  # names of the features of the inputs
    exact_length: Floats  # (e,) `Scores.length` if the nuisance parameters were exact
    second: Floats  # (e,) value of each effect's second number at its largest score; NaN where there is none

    def without(self, place: int) -> Misfit:
        """Leave one effect out."""
        scores = {name: np.delete(getattr(self.scores, name), place) for name in ("z", "survived", "length")}
        exact, second = (np.delete(each, place) for each in (self.exact_length, self.second))
        return replace(self, scores=replace(self.scores, **scores), exact_length=exact, second=second)


class _Tester:
    """The columns of the fitted runs, which stay the same, and the statistics of any residual.

    Rows are multiplied by the roots of the weights of their runs.
    """

    def __init__(self, data: Runs, used: Flags, fitted: Fit, D: Floats):
        self.absorbed = _Absorbed(data, used, fitted)
        kept = self.absorbed.kept
        numbers = [fitted.fitted[place] for place in kept]
        self.p, self.least_surviving = len(kept), data.least_surviving
        self.pulled = np.array([p.sigma is not None and not p.grid for p in numbers], dtype=bool)
        columns = np.concatenate([fitted.tangents[..., kept], D], -1)
        self.design = self.absorbed.regression(columns, numbers, data.repeats(used))
        self.J, scale = self.design.columns[..., : self.p], self.design.scale
        inputs = data.inputs[used]
        spread = inputs.std(0)
        inputs = (data.inputs - inputs.mean(0)) / np.where(spread > 0, spread, 1.0)
        self.smooth = data.white_features(kernel_factor(inputs))[used] * scale[:, None]  # (n', r)
        self.names, self.F = features(data, used)
        self.F = self.absorbed.project(data.white_features(self.F)[used]) * scale[:, None]
        self.conditions = Groups.of(data.condition[used])
        self.condition_sizes = self.conditions.add(scale[self.conditions.order, None] ** 2)  # (c, 1)
        self.F_means = self.design.average(self.F)  # (s, f)
        self.FJ = np.einsum("nf,nkp->fkp", self.F, self.J, optimize=True)
        self.FJ_means = np.einsum("sf,skp->sfkp", self.F_means, self.design.means[..., : self.p])

    def scores(self, residual: Floats) -> Scores:
        """Compute the statistics of residuals (B, n, k) from the parameters as given, after a linear refit.

        Each residual is judged in its own noise.
        """
        run_covariance = self.design.noise(residual)
        residual = np.moveaxis(self.absorbed.project(np.moveaxis(residual, 0, -1)), -1, 0)
        products, root = self.design.products(residual, run_covariance), inverse_root(run_covariance)  # (B, k, k)
        base = products.take(np.array([[*range(self.p), -1]]))
        projected = projected_scores(products, self.p)
        session_ratios = base.session_ratio(passes=_PASSES)
        session_ratio, (step, covariance) = (
            session_ratios[:, 0],
            (part[:, 0] for part in solve_normal(base.at(session_ratios))),
        )
        white = residual * self.design.scale[:, None] - np.einsum("nkp,bp->bnk", self.J, step, optimize=True)
        white = self.design.shrink(white @ np.swapaxes(root, -1, -2), session_ratio)
        sums = self.conditions.add((white * self.design.scale[:, None])[:, self.conditions.order])
        lack = (sums**2 / self.condition_sizes).sum((-1, -2))
        kernel = ((self.smooth.T @ white) ** 2).sum((-1, -2))
        shapes = self._shapes(covariance, white, root, session_ratio)
        largest = np.abs(shapes).max((-1, -2)) if shapes.size else np.zeros(len(session_ratio))
        pull = self._largest_pull(step, covariance)
        return Scores(np.stack([lack, kernel, largest, pull], -1), *projected, shapes, session_ratio)

    def _largest_pull(self, step: Floats, covariance: Floats) -> Floats:
        """Compute the largest pull of a nuisance parameter, (B,); of those of which the runs say something."""
        known = self.pulled
        prior = 1 / self.design.precision[known]
        removed = prior - np.diagonal(covariance, axis1=-2, axis2=-1)[:, known]
        pulls = np.abs(step[:, known]) / np.sqrt(np.maximum(removed, LEARNT * prior))
        return np.asarray(np.where(removed > LEARNT * prior, pulls, 0.0).max(-1, initial=0.0))

    def _shapes(self, covariance: Floats, white: Floats, root: Floats, session_ratio: Floats) -> Floats:
        """Compute z of every output along every feature, (B, k, f), of residuals that are white in Σ."""
        count, k = len(white), white.shape[-1]
        score = np.einsum("nf,bnk,bka->baf", self.F, self.design.shrink(white, session_ratio), root, optimize=True)
        less = 1 / (1 + session_ratio[:, None, :] * self.design.sizes[:, None]) - 1  # Σ⁻¹ of the sessions' means
        of_means = np.einsum("bik,bsi,bia->bska", root, less, root, optimize=True)
        absorbed = np.einsum("bik,bia,fkp->bafp", root, root, self.FJ, optimize=True)
        absorbed += np.einsum("bska,sfkp->bafp", of_means, self.FJ_means, optimize=True)
        square = (root**2).sum(1)[:, :, None] * (self.F**2).sum(0)
        square += np.einsum("bsaa,sf->baf", of_means, self.F_means**2, optimize=True)
        projected = square - np.einsum("bafp,bpq,bafq->baf", absorbed, covariance, absorbed, optimize=True)
        seen = projected > self.least_surviving**2 * square
        z = np.where(seen, score / np.sqrt(np.where(seen, projected, 1.0)), 0.0)
        return np.asarray(z).reshape(count, k, -1)


class _Nulls:
    """The statistics of draws; along traces each draw is judged in the memory that its own repeats show."""

    def __init__(self, tester: _Tester, data: Runs, used: Flags, fitted: Fit, D: Floats):
        self.tester, self.data, self.used, self.fitted, self.D = tester, data, used, fitted, D
        self.others: dict[int, tuple[Memory, _Tester]] = {}  # by their places in `NoiseOfTraces.as_likely`

    def statistics(self, drawn: Floats, testable: Flags, rng: np.random.Generator) -> Floats:
        """Compute the general statistics, and the largest score, of draws (B, n', k), (B, 5)."""
        noise, memory = self.data.noise_of_traces, self.data.memory
        if noise is None or memory is None or not self.data.noise_known:
            return _row(self.tester.scores(drawn), testable)
        count, _, k = drawn.shape
        white = rng.normal(size=(len(self.data), count, k)) @ square_root(noise.run_covariance).T
        white[self.used] = np.moveaxis(drawn, 0, 1)
        plain = memory.colour(white)
        places, run_covariance = noise.estimated(plain)
        # As if S were that of the fit: its own is in the residual.
        scale = np.linalg.solve(inverse_root(noise.run_covariance), inverse_root(run_covariance))
        result = np.empty((count, len(GENERAL) + 1))
        for place in np.unique(places).tolist():
            some = places == place
            other, tester = self._at(place, memory)
            residual = np.moveaxis(other.whiten(plain[:, some]), 0, 1)[:, self.used]
            result[some] = _row(tester.scores(residual @ np.swapaxes(scale[some], -1, -2)), testable)
        return result

    def _at(self, place: int, memory: Memory) -> tuple[Memory, _Tester]:
        """Return another memory, and a tester with all columns white in it."""
        if place not in self.others:
            assert self.data.noise_of_traces is not None
            share, tau = self.data.noise_of_traces.as_likely[place]
            other = replace(memory, share=share, tau=tau)
            J, D = (other.whiten(memory.colour(columns)) for columns in (self.fitted.jacobian, self.D))
            data, fitted = replace(self.data, memory=other), replace(self.fitted, jacobian=J)
            self.others[place] = other, _Tester(data, self.used, fitted, D)
        return self.others[place]


def _row(scores: Scores, testable: Flags) -> Floats:
    return np.column_stack([scores.general, _largest(scores.z, testable)])


class _Absorbed:
    """The numbers that each trace has of its own, without priors: they are taken from all columns, trace by trace.

    So many traces cost no more than the small solves of each. It is exact for one output: what is left of Σ is
    I + ρ (P a)(P a)ᵀ with P the projection and a what a shift of the session is. Of several outputs, which S
    connects, none is taken away.
    """

    def __init__(self, data: Runs, used: Flags, fitted: Fit):
        single = data.trace is not None and data.y.shape[1] == 1
        own = [
            place
            for place, p in enumerate(fitted.fitted)
            if single and p.of_group and p.of_group[1] in data.trace_names and p.sigma is None
        ]
        self.data, self.used = data, used
        self.kept = [place for place in range(len(fitted.fitted)) if place not in own]
        self.bases: list[tuple[Integers, Floats]] = []  # rows of a trace among those used, an orthonormal basis
        for trace in np.unique(data.trace[used]) if own and data.trace is not None else ():
            assert data.trace is not None
            rows = np.flatnonzero(data.trace[used] == trace)
            columns = fitted.tangents[used][rows, 0][:, own]
            columns = columns[:, np.abs(columns).max(0) > 0]
            self.bases.append((rows, np.linalg.qr(columns)[0]))

    def project(self, table: Floats) -> Floats:
        """Take from a table (n', …) what numbers of traces can change."""
        table = table.copy() if self.bases else table
        for rows, basis in self.bases:
            part = table[rows]
            table[rows] = part - np.tensordot(basis, np.tensordot(basis.T, part, 1), 1)
        return table

    def regression(
        self, columns: Floats, numbers: Sequence[Parameter], repeated: Integers | Floats | None
    ) -> Regression:
        """Regress the runs on columns (n, k, m), the first those of `numbers`."""
        linear = regression(self.data, self.used, columns, numbers, repeated)
        if not self.bases:
            return linear
        return linear.seen(self.project(columns[self.used]), self.project(self.data.along[self.used]))


def kernel_factor(inputs: Floats) -> Floats:
    """Return a factor (n, r) of the kernel exp(−|x − x′|²/2) of inputs (n, q).

    Of many distinct inputs it is an approximation by some of them (Nyström 1930).
    """
    return _kernel_factor(inputs.tobytes(), inputs.shape)


@lru_cache(maxsize=2)  # all tests of a calibration are of the same runs
def _kernel_factor(numbers: bytes, shape: tuple[int, int]) -> Floats:
    inputs = np.frombuffer(numbers).reshape(shape)
    kinds, place = np.unique(inputs.round(9), axis=0, return_inverse=True)
    several = len(kinds) > _MOST_PLACES
    landmarks = kinds[np.linspace(0, len(kinds) - 1, _LANDMARKS).astype(int)] if several else kinds
    values, vectors = np.linalg.eigh(_kernel(landmarks, landmarks))
    seen = values > (_SEEN if several else _ROUNDING) * values[-1]
    vectors, lengths = vectors[:, seen], np.sqrt(values[seen])
    rows = _kernel(kinds, landmarks) @ (vectors / lengths) if several else vectors * lengths
    factor = np.asarray(rows[place.reshape(-1)])
    factor.setflags(write=False)  # it is shared
    return factor


def _kernel(one: Floats, other: Floats) -> Floats:
    distance = (one**2).sum(1)[:, None] + (other**2).sum(1) - 2 * one @ other.T
    return np.asarray(np.exp(-np.maximum(distance, 0.0) / 2))


def projected_scores(products: NormalEquations, p: int) -> tuple[Floats, Floats, Floats]:
    """Score each column after the first `p`, and before the last, without the part that the first `p` can absorb.

    Each column has the scatter of sessions that remains with it in the fit.

    Returns:
        z of the last column along it, the share of it that survives the projection, and the length of the rest.
    """
    e = products.within.shape[-1] - p - 1
    columns = np.array([[*range(p), p + j, p + e] for j in range(e)], dtype=np.int64).reshape(e, p + 2)
    part = products.take(columns)
    normal = part.at(part.session_ratio(passes=_PASSES_OF_A_SCORE))  # (..., e, p + 2, p + 2)
    left = schur_complement(normal, p)
    length = np.sqrt(np.maximum(left[..., 0, 0], 1e-300))
    survived = length / np.sqrt(np.maximum(normal[..., p, p], 1e-300))
    return np.where(survived > 1e-6, left[..., 0, 1] / length, 0.0), survived, length


def examine_residual(
    study: Study, fitted: Fit, directions: Directions, *, draws: int | None = None, decide: float | None = None
) -> Misfit:
    """Test the residual of a fit.

    Args:
        study: its level is α of the critical |z|.
        fitted: model fitted to the runs that the study uses.
        directions: of e candidates, at their null; e may be 0. Of an effect with a second number, the value with
            the largest score counts, in the bootstrap, too.
        draws: of the bootstrap, if not as many as the study says.
        decide: stop drawing as soon as it is clear whether the p-value is below this.
    """
    data, used = study.model.runs, study.split.fitted
    tester = _Tester(data, used, fitted, directions.table)
    residual = (data.y - fitted.prediction)[used]
    shift = fitted.jacobian[used] @ prior_offsets(fitted.fitted, fitted.parameters)
    observed = tester.scores(residual[None] + shift)
    free = tester.design.precision == 0
    numbers = np.array(tester.absorbed.kept, dtype=int)[free]
    columns = np.concatenate([fitted.tangents[..., numbers], directions.table], -1)
    exact = tester.absorbed.regression(columns, (), tester.design.repeated).products(
        tester.absorbed.project(residual)
    )
    testable = observed.survived[0] >= data.least_surviving
    rng = np.random.default_rng(study.seed)
    run_covariance = tester.design.noise(residual)
    statistics = np.append(observed.general[0], _largest(observed.z, testable))
    nulls = _Nulls(tester, data, used, fitted, directions.table)
    batches: list[Floats] = []
    while (drawn := sum(map(len, batches))) < (draws or study.draws):
        count = min(
            _AT_ONCE if data.trace is None else _OF_TRACES_AT_ONCE,
            max(1, _VALUES // residual.size),
            (draws or study.draws) - drawn,
        )
        tables = tester.design.draw(rng, run_covariance, np.tile(observed.session_ratio[0], (count, 1)))
        batches.append(nulls.statistics(tables, testable, rng))
        if drawn + count >= _FEWEST_DRAWS and skipped("more draws of some tests"):
            break
        if decide is not None and _decided(np.concatenate(batches), statistics, decide):
            break
    null_table = np.concatenate(batches)
    scores = Scores(*(getattr(observed, name)[0] for name in Scores.__dataclass_fields__))
    best = _best(scores.z, testable, directions)
    general_p = _p_value(null_table[:, :-1], statistics[:-1])
    return Misfit(
        scores=replace(scores, z=scores.z[best], survived=scores.survived[best], length=scores.length[best]),
        p={name: _p_value(null_table[:, [i]], statistics[[i]]) for i, name in enumerate((*GENERAL, "score"))},
        general_p=general_p,
        p_value=_p_value(null_table, statistics) if testable.any() else general_p,
        critical_z=float(np.quantile(null_table[:, -1], 1 - study.level)),
        features=tester.names,
        exact_length=projected_scores(exact, int(free.sum()))[2][best],
        second=directions.second[best],
    )


def _best(z: Floats, testable: Flags, directions: Directions) -> Integers:
    """Choose the column of each effect with the largest |z|, among those that are testable if any is, (e,)."""
    size = np.abs(z) + np.where(testable, 1e6, 0.0)
    columns = [np.flatnonzero(directions.owner == owner) for owner in np.unique(directions.owner)]
    return np.array([candidates[np.argmax(size[candidates])] for candidates in columns], dtype=np.int64)


def _decided(null: Floats, observed: Floats, level: float) -> bool:
    """Tell whether so many draws tell a p-value from `level` (Besag and Clifford 1991)."""
    p = _p_value(null, observed)
    far = p < level / 4
    return far or (p > 8 * level and len(null) * p > 10)


def _largest(z: Floats, testable: Flags) -> Floats:
    return np.abs(z[:, testable]).max(1) if testable.any() else np.zeros(len(z))


def _p_value(null: Floats, observed: Floats) -> float:
    """Tell how often the least p-value of the statistics (D, q) is as small as that of `observed` (q,)."""
    table = np.vstack([observed, null])
    below = np.stack([np.searchsorted(np.sort(column), column) for column in table.T], 1)
    p = 1 - below / len(table)
    least = p.min(1)
    return float(np.count_nonzero(least <= least[0]) / len(table))
