"""Which runs to make next, so that two effects can be told apart.

Two effects A and B may explain the runs equally well and predict different outputs at other inputs. If A is true,
a run at x that is made m times adds

    λ(x) = dᵀ (S/m + J Cov Jᵀ)⁻¹ d,   d = f_A(x) − f_B(x)

to the difference of χ² between B and A. S is the covariance of a run. J and Cov are the derivatives of B and the
covariance of its fit, because B can be fitted again (T-optimal design, linearised). The same is computed with A
and B exchanged; the smaller value counts. How often the runs decide is found by drawing them at random. Source:
Atkinson and Fedorov (1975).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.fit import Fit
from calibration.model import Model
from sim.arrays import Floats

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


def next_runs(model: Model, first: Fit, second: Fit, *, count: int = 3, seed: int = 0) -> list[NextRun]:
    """The best experiments to tell two fits apart, best first."""
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
            # χ² of the wrong one over the right one: λ + 2 √λ z
            draws = strength + 2 * np.sqrt(strength) * rng.normal(size=_DRAWS)
            decides = float((draws > _DECIDES).mean())
            if decides >= _WANTED:
                break
        found.append(NextRun(settings[place], repeats, strength, decides))
    return found


def _separation(difference: Floats, J: Floats, fit: Fit, noise: Floats, repeats: int) -> Floats:
    spread = noise / repeats + np.einsum("nap,pq,nbq->nab", J, fit.covariance, J)
    return np.asarray(np.einsum("na,na->n", difference, np.linalg.solve(spread, difference[..., None])[..., 0]))
