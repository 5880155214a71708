"""How easily something outside the catalogue passes for an effect, or for a pair, with this design of runs.

What is outside is not known. It is drawn: the signal of an effect times exp(g), with g a smooth random function of
the runs' inputs (Gaussian process, correlation length one standard deviation, standard deviation 0.5). So it
acts on the same outputs, and depends on N, l and ω in another way. The nuisance parameters and the coefficients
absorb what they can. Of the rest, the claim absorbs a share a (the absorbable share). A departure that passes
for a claim of strength Λ (standard deviations) leaves Λ √(1/a − 1). Less than `SEEN` is not noticed.

The *imitability index* of a claim is the share of draws that it would not notice. Above `DOUBT` the verdict says
"or something outside the catalogue that looks like it". The absorbable shares depend on the design alone, not on
what was measured.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibration.statistics.fit import Fit
from calibration.statistics.forward_model import Runs
from calibration.statistics.priors import prior_rows
from calibration.statistics.study import Study
from sim.arrays import Flags, Floats

DOUBT = 0.05
SEEN = 6.0  # standard deviations of a remainder that the tests notice nearly always
_DRAWS = 200
_SPREAD = 0.5  # of ln of a signal


def absorbable_shares(study: Study, fitted: Fit, names: Sequence[str]) -> Floats:
    """Draw signals from outside, made from each of the effects `names` of a fit in turn, and return their a."""
    runs, used = study.runs, study.used
    white = fitted.noise.whitener(runs.session[used])
    rows = prior_rows(fitted.fitted, fitted.parameters)[0]
    J = np.concatenate([white(fitted.jacobian[used]), rows])
    claimed = [fitted.names.index(name) for name in names]
    others = [i for i in range(J.shape[1]) if i not in claimed]
    without, with_claim = (np.linalg.qr(_scaled(J[:, columns]))[0] for columns in (others, [*others, *claimed]))
    factors = deformations(runs, used, _DRAWS, study.seed)
    signals = np.concatenate([fitted.jacobian[used][..., [p]] * factors[:, None] for p in claimed], -1)
    signals = np.concatenate([white(signals), np.zeros((len(rows), signals.shape[-1]))])
    before = signals - without @ (without.T @ signals)
    after = signals - with_claim @ (with_claim.T @ signals)
    return np.asarray(1 - (after**2).sum(0) / np.maximum((before**2).sum(0), 1e-300))


def imitability(shares: Floats, strength: float) -> float:
    """Return the share of draws that a claim of this strength (standard deviations) would not notice."""
    remainder = strength * np.sqrt(np.maximum(1 / np.maximum(shares, 1e-9) - 1, 0.0))
    return float((remainder < SEEN).mean())


def deformations(runs: Runs, used: Flags, count: int, seed: int) -> Floats:
    """Draw exp(g) at the runs in `used`, (n, count)."""
    spread = runs.inputs[used].std(0)
    inputs = runs.inputs[used] / np.where(spread > 0, spread, 1.0)
    kinds, place = np.unique(inputs.round(9), axis=0, return_inverse=True)
    distance = ((kinds[:, None] - kinds[None]) ** 2).sum(-1)
    values, vectors = np.linalg.eigh(np.exp(-distance / 2))
    drawn = np.random.default_rng(seed).normal(size=(len(kinds), count))
    g = vectors @ (np.sqrt(np.maximum(values, 0.0))[:, None] * drawn)
    return np.asarray(np.exp(_SPREAD * g)[place.reshape(-1)])


def _scaled(J: Floats) -> Floats:
    return J / np.maximum(np.linalg.norm(J, axis=0), 1e-300)
