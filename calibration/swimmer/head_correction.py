"""A correction of the head's load, for a swimmer whose runs no effect explains.

`sim.model.correction` says what is corrected: coefficients and two effects (knobs). Each has the same few terms
in N, l/R and the motor's rate. With J_i the derivatives of run i in the knobs, the residual is

    y_i − f_i ≈ J_i g(x_i),   g = W φ(x_i),

which is linear in the weights W. Terms are added one at a time, as long as left-out sessions are predicted better.
Weights have Gaussian priors (`_SIGMA`), so knobs that the runs do not show stay at rest. Then the weights are
corrected a few times with the simulator itself. Source: ridge regression, forward selection by cross-validation.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from calibration.statistics.fit import Fit
from calibration.statistics.gls import Gls, Noise, solved
from calibration.statistics.residual_regression import select_forward
from calibration.statistics.study import Split, errors, groups, leave_one_group_out
from calibration.swimmer.swimmer import SwimmerModel
from sim.arrays import Flags, Floats
from sim.io.errors import InputError
from sim.model.correction import Correction, inputs_of, monomials

Powers = tuple[tuple[int, ...], ...]

_SIGMA = {"C_t": 0.5, "C_r": 0.5, "C_yr": 0.5, "surface_couple": 0.5, "anisotropic_head_drag": 0.3}
_CONSTANT = (0, 0, 0)
_MOST = 7  # terms
_GAIN = 0.02  # share of the left-out error that a term must save
_CORRECTIONS = 4  # of the weights, with the simulator
_SETTLED = 1e-3  # share of the remaining error


@dataclass(frozen=True)
class HeadCorrection:
    """A learnt correction, how sure it is, and what it predicts."""

    prediction: Floats  # (n, k) of the runs, learnt without the held-out ones
    terms: tuple[str, ...]  # that it depends on, in words
    correction: Correction  # learnt from all runs
    covariance: Floats  # (q t, q t) of the weights, knob by knob
    slopes: Floats  # (n, k, q) of the runs' outputs in the knobs
    inputs: Floats  # (n, 3)
    beyond: float  # what is left on runs that were not learnt from, beyond noise; relative rms

    def knob_covariance(self, values: dict[str, float]) -> Floats:
        """Compute the covariance (q, q) of the knobs at a robot: of the weights, and of what is left.

        Args:
            values: groups of the robot.
        """
        x = np.array(inputs_of(values))
        knobs = tuple(self.correction.weights)
        phi = np.kron(np.eye(len(knobs)), self.correction.terms(x[None]))  # (q, q t)
        J = self.slopes[int(np.argmin((((self.inputs - x) / np.array(self.correction.scale)) ** 2).sum(1)))]
        prior = np.diag([_SIGMA[name] ** -2 for name in knobs])
        remainder = np.zeros_like(prior)
        if self.beyond > 0:
            remainder = np.linalg.inv(J.T @ J / self.beyond**2 + prior)
        return np.asarray(phi @ self.covariance @ phi.T + remainder)


@dataclass(frozen=True)
class _Problem:
    """The calibrated model, and derivatives and inputs of all runs; in the noise of runs, without sessions."""

    model: SwimmerModel
    base: Fit
    knobs: tuple[str, ...]
    slopes: Floats  # (n, k, q) of the outputs in the knobs
    inputs: Floats  # (n, 3)
    centre: Floats  # (3,)
    scale: Floats

    def regression(self, powers: Powers, rows: Flags, *, priors: bool = True) -> Gls:
        """Regress the runs in `rows` on the weights, (n, k, q t)."""
        phi = monomials((self.inputs - self.centre) / self.scale, powers)
        columns = np.einsum("nkq,nt->nkqt", self.slopes, phi).reshape(*self.slopes.shape[:2], -1)
        precision = np.repeat([_SIGMA[name] ** -2 for name in self.knobs], len(powers)) * priors
        runs = self.model.runs
        return Gls(columns[rows], precision, runs.session[rows], runs.scale[rows])

    def normal(self, linear: Gls, prediction: Floats, rows: Flags, weights: Floats | None = None) -> Floats:
        """Multiply the columns and the residual of a prediction (n, k) with these weights; default: 0."""
        return linear.products((self.model.runs.y - prediction)[rows], self.base.noise.run, weights).at(0.0)

    def correction(self, powers: Powers, weights: Floats, rows: Flags) -> Correction:
        """Make the correction with these weights, whose range is that of the runs in `rows`; without errors."""
        table = weights.reshape(len(self.knobs), len(powers)).tolist()
        ends = (self.inputs[rows].min(0), self.inputs[rows].max(0))
        centre, scale, low, high = (tuple(v.tolist()) for v in (self.centre, self.scale, *ends))
        named = {k: tuple(row) for k, row in zip(self.knobs, table, strict=True)}
        return Correction(centre, scale, low, high, powers, named, 0.0, 0.0)

    def learn(
        self, powers: Powers, weights: Floats, prediction: Floats, rows: Flags
    ) -> tuple[Floats, Floats, Floats]:
        """Correct the weights a few times with the simulator.

        Args:
            weights, prediction: to begin with.
            rows: (n,) runs to learn from.

        Returns:
            The weights, the prediction with them, and their covariance.
        """
        linear, every = self.regression(powers, rows), np.ones(len(self.inputs), bool)
        normal = self.normal(linear, prediction, rows, weights)
        covariance = solved(normal)[1]
        for _ in range(_CORRECTIONS):
            change, before = solved(normal)[0], normal[-1, -1]
            for share in (1.0, 0.5, 0.25):
                tried = weights + share * change
                robot = replace(self.model.robot, correction=self.correction(powers, tried, every))
                try:
                    predicted = replace(self.model, robot=robot).predict([self.base.parameters])[0]
                except InputError:  # no motion with these weights
                    continue
                there = self.normal(linear, predicted, rows, tried)
                if there[-1, -1] < before:
                    weights, prediction, normal = tried, predicted, there
                    break
            if before - normal[-1, -1] < _SETTLED * before:
                break
        return weights, prediction, covariance


def learn_head_correction(model: SwimmerModel, base: Fit, split: Split) -> HeadCorrection | None:
    """Learn a correction of `base`, if there is one that predicts left-out sessions better.

    The terms are chosen from the runs that are fitted. The error is that on the held-out runs. In the end the
    correction is learnt from both.
    """
    here = {p.name for p in (*model.coefficients, *model.effects)}
    knobs = tuple(name for name in _SIGMA if name in here)
    robots, place = model.robots(base.parameters)
    inputs = np.array([inputs_of(robot.group_values()) for robot in robots])[place]
    used = split.fitted
    spread = inputs[used].std(0)
    problem = _Problem(
        model=model,
        base=base,
        knobs=knobs,
        slopes=model.derivatives(base.parameters, knobs)[1],
        inputs=inputs,
        centre=inputs[used].mean(0),
        scale=np.where(spread > 1e-6, spread, 1.0),
    )
    powers = _choose_terms(problem, used)
    if not powers:
        return None
    none = np.zeros(len(knobs) * len(powers))
    weights, prediction, _ = problem.learn(powers, none, base.prediction, used)
    last, fitted, covariance = problem.learn(powers, weights, prediction, split.kept)
    error, without = (errors(model.runs, p, split.test)[0] for p in (prediction, base.prediction))
    noise = float(np.trace(base.noise.run) / len(base.noise.run))
    correction = problem.correction(powers, last, split.kept)
    white = Noise(base.noise.run, 0.0).whitener(model.runs.session[split.kept], model.runs.scale[split.kept])
    left = white((model.runs.y - fitted)[split.kept])
    return HeadCorrection(
        prediction=prediction,
        terms=tuple(_name_term(term) for term in powers),
        correction=replace(correction, error=error, error_without=without),
        covariance=covariance * max(1.0, float((left**2).mean())),
        slopes=problem.slopes,
        inputs=inputs,
        beyond=math.sqrt(max(error**2 - noise, 0.0)),
    )


def _choose_terms(problem: _Problem, used: Flags) -> Powers:
    """Choose the powers of the terms, the constant first; none if they do not predict better."""
    levels = [len(np.unique(column[used].round(6))) for column in problem.inputs.T]
    possible = tuple(
        p for p in itertools.product(range(4), repeat=3)
        if (sum(p) <= 2 or max(p) == sum(p)) and all(q < m for q, m in zip(p, levels, strict=True))
    )  # fmt: skip
    start: Powers = ()
    pairs = leave_one_group_out(groups(problem.model.runs)[0], used)

    def normal(rows: Flags, *, priors: bool) -> Floats:
        linear = problem.regression(possible, rows, priors=priors)
        return problem.normal(linear, problem.base.prediction, rows)

    normals = [(normal(learn, priors=True), normal(out, priors=False)) for learn, out in pairs]

    def left_out_error(powers: Powers) -> float:
        """Compute the sum of squares on groups that the weights have not seen; without terms, of the residual."""
        terms = [possible.index(p) for p in powers]
        places = [len(possible) * knob + term for knob in range(len(problem.knobs)) for term in terms]
        chosen, total = np.ix_([*places, -1], [*places, -1]), 0.0
        for learnt, left_out in normals:
            combination = np.append(-solved(learnt[chosen])[0], 1.0)
            total += float(combination @ left_out[chosen] @ combination)
        return total

    return select_forward(
        start,
        lambda chosen: [tuple(dict.fromkeys((_CONSTANT, *chosen, p))) for p in possible if p not in chosen],
        left_out_error,
        most=_MOST,
        gain=_GAIN,
    )


def _name_term(term: tuple[int, ...]) -> str:
    symbols = ("N", "ln l/R", "ln ω")
    parts = [s if p == 1 else f"({s})^{p}" for s, p in zip(symbols, term, strict=True) if p]
    return " × ".join(parts) or "constant"
