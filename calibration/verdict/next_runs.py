"""Which runs to make next, so that effects can be told apart.

Effects A, B, … may explain the runs equally well and predict different outputs at other inputs. If A is true, new
runs add

    λ_AB = dᵀ (Σ + J Cov Jᵀ)⁻¹ d,   d = f_A − f_B

to the difference of χ² between B and A. Σ is the covariance of the new runs, which are one session
(`calibration.statistics.statistical_model`). J and Cov are the derivatives of B and the covariance of its fit,
because B can be fitted again (T-optimal design, linearised). There is a λ for every two rivals, both ways; for
single runs the smallest counts. How often the runs decide is found by drawing them at random. Source: Atkinson
and Fedorov (1975).

A batch is chosen one run after the other. With equal odds the wrong one of two is chosen with the probability
Φ(−√λ/2); the run is taken that makes the sum of these over all pairs least. `calibration.verdict.sequential_test`
judges the runs once they are made: an explanation is given up where the best one is `STOP` times as likely.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtr

from calibration.statistics.fit import Fit
from calibration.statistics.gls import Noise
from calibration.statistics.statistical_model import Experiment
from sim.arrays import Floats

STOP = 25.0  # ratio of likelihoods at which an explanation is given up, 1/α of the sequence of batches
GIVEN_UP = 2 * math.log(STOP)  # the same as a difference of deviances
BATCH = 8  # runs
SELDOM = 0.5  # share of cases in which runs must decide to be worth making
_DRAWS = 4000
_DECIDES = 3.84  # difference of χ² at which one of the two is chosen
_WANTED = 0.9  # share of draws that should decide
_MOST_REPEATS = 16
_MOST_RIVALS = 4


@dataclass(frozen=True)
class Rival:
    """A fitted model that explains or describes the runs as well as others do."""

    title: str  # in words
    fit: Fit
    model: Experiment  # that was fitted
    law: Mapping[str, Any] = field(default_factory=dict)  # what makes this model of one without the law


@dataclass(frozen=True)
class NextRun:
    """An experiment, and how well it tells the rivals apart, for the two that it tells apart least."""

    settings: dict[str, Any]  # column -> value
    repeats: int  # of the setting
    separation: float  # λ of all repeats
    decides: float  # share of draws in which the true one is chosen

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
    decides: float  # share of draws in which the true one of these two is chosen
    stop: float  # difference of deviances on the new runs at which to stop

    @property
    def worth_making(self) -> bool:
        return self.decides >= SELDOM

    def record(self) -> dict[str, Any]:
        return {
            "runs": list(self.settings),
            "separation": round(self.separation, 2),
            "decides": round(self.decides, 3),
            "worth_making": self.worth_making,
            "stop_at_deviance": round(self.stop, 2),
        }


class Pair(NamedTuple):
    """A true rival and a wrong one that is fitted again."""

    difference: Floats  # of their predictions, (m, k)
    J: Floats  # (m, k, p) derivatives of the wrong one
    covariance: Floats  # (p, p) of its fit


def next_runs(rivals: Sequence[Rival], *, count: int = 3, seed: int = 0) -> tuple[tuple[NextRun, ...], Batch]:
    """Find the best experiments to tell rivals apart, best first, and the best batch of `BATCH` runs.

    Args:
        rivals: two fitted models or more, the best first; of many, the first four are told apart.
    """
    told_apart = rivals[:_MOST_RIVALS]
    fits = [rival.fit for rival in told_apart]
    possible = [rival.model.possible() for rival in told_apart]
    settings = possible[0][1]  # those of all of them
    sides = [model.derivatives(fit.parameters, fit.names) for (model, _), fit in zip(possible, fits, strict=True)]
    pairs = [
        Pair(true[0] - wrong[0], wrong[1], again.covariance)
        for (_, true), (again, wrong) in itertools.permutations(zip(fits, sides, strict=True), 2)
    ]
    noise = Noise(np.mean([f.noise.run for f in fits], 0), np.mean([np.asarray(f.noise.share) for f in fits], 0))
    alone = np.array([_together(pairs, noise, [place]).min() for place in range(len(settings))])
    runs = []
    rng = np.random.default_rng(seed)
    for place in np.argsort(-alone)[:count].tolist():
        for repeats in (1, 2, 4, 8, _MOST_REPEATS):
            strength = float(_together(pairs, noise, [place] * repeats).min())
            decides = _decides(strength, rng)
            if decides >= _WANTED:
                break
        runs.append(NextRun(settings[place], repeats, strength, decides))
    chosen, strength = _greedy(pairs, noise)
    batch = tuple(settings[place] for place in chosen)
    return tuple(runs), Batch(batch, strength, _decides(strength, rng), GIVEN_UP)


def _decides(strength: float, rng: np.random.Generator) -> float:
    """Estimate the share of draws in which the true one is chosen; χ² of the wrong one over it is λ + 2 √λ z."""
    draws = strength + 2 * np.sqrt(strength) * rng.normal(size=_DRAWS)
    return float((draws > _DECIDES).mean())


def _greedy(pairs: Sequence[Pair], noise: Noise) -> tuple[list[int], float]:
    """Choose `BATCH` runs, one after the other; return their places and the smallest λ of them together."""
    chosen: list[int] = []
    strengths = np.zeros(len(pairs))
    for _ in range(BATCH):
        tried = [_together(pairs, noise, [*chosen, place]) for place in range(len(pairs[0].difference))]
        wrong = [float(ndtr(-np.sqrt(strength) / 2).sum()) for strength in tried]
        place = int(np.argmin(wrong))
        strengths = tried[place]
        chosen.append(place)
    return sorted(chosen), float(strengths.min())


def _together(pairs: Sequence[Pair], noise: Noise, places: list[int]) -> Floats:
    """Compute λ of several runs made together, for every pair."""
    spread = noise.covariance(np.zeros(len(places), dtype=np.int64))  # one session
    strengths = []
    for pair in pairs:
        slopes = pair.J[places].reshape(-1, pair.J.shape[-1])
        d = pair.difference[places].ravel()
        strengths.append(float(d @ np.linalg.solve(spread + slopes @ pair.covariance @ slopes.T, d)))
    return np.array(strengths)
