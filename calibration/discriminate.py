"""Which runs to make next, so that two effects can be told apart.

Two effects A and B may explain the runs equally well and predict different outputs at other inputs. If A is true,
a run at x that is made m times adds

    λ(x) = dᵀ (S/m + J Cov Jᵀ)⁻¹ d,   d = f_A(x) − f_B(x)

to the difference of χ² between B and A. S is the covariance of a run. J and Cov are the derivatives of B and the
covariance of its fit, because B can be fitted again (T-optimal design, linearised). The same is computed with A
and B exchanged; the smaller value counts. How often the runs decide is found by drawing them at random. Source:
Atkinson and Fedorov (1975).

A batch is chosen one run after the other, each the one that raises λ of the whole batch most. The likelihood ratio
of two predictions that were made before the runs is an e-value: under the wrong one it exceeds `STOP` with a
probability of at most 1/STOP, however often one looks (Ville 1939). So stop when the deviances of the two
predictions, summed over all new runs, differ by 2 ln STOP. The predictions have fitted parameters, so this holds
nearly, not exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.fit import Fit
from calibration.model import Model
from sim.arrays import Floats

STOP = 25.0  # 1/α of the sequence of batches
BATCH = 8  # runs
_DRAWS = 4000
_DECIDES = 3.84  # difference of χ² at which one of the two is chosen
_WANTED = 0.9  # share of draws that should decide
_MOST_REPEATS = 16


@dataclass(frozen=True)
class NextRun:
    """An experiment, and how well it tells the two rivals apart."""

    settings: dict[str, Any]
    repeats: int
    separation: float  # λ of all repeats
    decides: float  # share of draws in which the true one is chosen

    def record(self) -> dict[str, Any]:
        return {
            **self.settings,
            "repeats": self.repeats,
            "separation": round(self.separation, 2),
            "decides": round(self.decides, 3),
        }


@dataclass(frozen=True)
class Batch:
    """Runs to make next, all together, to tell two rivals apart."""

    settings: tuple[dict[str, Any], ...]  # of each run; the same settings may come more than once
    separation: float  # λ of the batch
    decides: float  # share of draws in which the true one is chosen
    stop: float  # difference of deviances on the new runs at which to stop

    def record(self) -> dict[str, Any]:
        return {
            "runs": list(self.settings),
            "separation": round(self.separation, 2),
            "decides": round(self.decides, 3),
            "stop_at_deviance": round(self.stop, 2),
        }


def next_runs(
    model: Model, first: Fit, second: Fit, *, count: int = 3, seed: int = 0
) -> tuple[list[NextRun], Batch]:
    """The best experiments to tell two fits apart, best first, and the best batch of `BATCH` runs."""
    possible, settings = model.possible()
    sides = [possible.derivatives(fit.parameters, fit.names) for fit in (first, second)]
    noise = (first.noise.run + second.noise.run) / 2
    difference = sides[0][0] - sides[1][0]
    rivals = list(zip((first, second), sides, strict=True))
    separation = np.min([_separation(difference, J, fit, noise, 1) for fit, (_, J) in rivals], 0)
    found = []
    rng = np.random.default_rng(seed)
    for place in np.argsort(-separation)[:count]:
        for repeats in (1, 2, 4, 8, _MOST_REPEATS):
            strength = min(
                float(_separation(difference[place : place + 1], J[place : place + 1], fit, noise, repeats)[0])
                for fit, (_, J) in rivals
            )
            decides = _decides(strength, rng)
            if decides >= _WANTED:
                break
        found.append(NextRun(settings[place], repeats, strength, decides))
    chosen, strength = _greedy(difference, [(J, fit.covariance) for fit, (_, J) in rivals], noise)
    batch = tuple(settings[place] for place in chosen)
    return found, Batch(batch, strength, _decides(strength, rng), 2 * math.log(STOP))


def _decides(strength: float, rng: np.random.Generator) -> float:
    """Share of draws in which the true one is chosen; χ² of the wrong one over it is λ + 2 √λ z."""
    draws = strength + 2 * np.sqrt(strength) * rng.normal(size=_DRAWS)
    return float((draws > _DECIDES).mean())


def _greedy(difference: Floats, rivals: list[tuple[Floats, Floats]], noise: Floats) -> tuple[list[int], float]:
    """Places of `BATCH` runs, and λ of them together.

    Args:
        difference: of the predictions, (m, k).
        rivals: derivatives (m, k, p) and covariance (p, p) of each fit.
    """
    chosen: list[int] = []
    best = 0.0
    for _ in range(BATCH):
        strengths = [
            min(_together(difference, J, V, noise, [*chosen, place]) for J, V in rivals)
            for place in range(len(difference))
        ]
        chosen.append(int(np.argmax(strengths)))
        best = max(strengths)
    return sorted(chosen), best


def _together(difference: Floats, J: Floats, covariance: Floats, noise: Floats, places: list[int]) -> float:
    """λ of several runs made together."""
    slopes = J[places].reshape(-1, J.shape[-1])
    spread = np.kron(np.eye(len(places)), noise) + slopes @ covariance @ slopes.T
    d = difference[places].ravel()
    return float(d @ np.linalg.solve(spread, d))


def _separation(difference: Floats, J: Floats, fit: Fit, noise: Floats, repeats: int) -> Floats:
    spread = noise / repeats + np.einsum("nap,pq,nbq->nab", J, fit.covariance, J)
    return np.asarray(np.einsum("na,na->n", difference, np.linalg.solve(spread, difference[..., None])[..., 0]))
