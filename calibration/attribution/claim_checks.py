"""Checks of a claim: could something outside the catalogue look like it, and does it carry over to other runs?

What is outside is not known. It is drawn: the signal of an effect times exp(g), with g a smooth random function of
the runs' inputs (Gaussian process, correlation length one standard deviation, along the time of traces two,
standard deviation 0.5). So it acts on the same outputs, and depends on N, l and ω in another way. The nuisance
parameters and the coefficients absorb what they can. Of the rest, the claim absorbs a share a (the absorbable
share). A departure that passes for a claim of strength Λ (standard deviations) leaves Λ √(1/a − 1). Less than
`SEEN` is not noticed. The *imitability index* of a claim, or of a pair, is the share of draws that it would not
notice. The absorbable shares depend on the design alone, not on what was measured.

Something outside the catalogue can look like an effect at some runs. It depends on the settings in another way,
so that the size which fits short tails, say, is wrong for long ones. In the *transfer test* the model with the
claim is fitted again, by one linear step, to the runs at one end of the settings (`Runs.nearer`). Then the other
runs are judged as the held-out ones are. Of several such sets the smallest p-value counts, times their number.

Where the index is above `rules.IMITABLE`, or the p-value of the test below `rules.SURE`, the verdict says "or
something outside the catalogue that looks like it".
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calibration.attribution.hypothesis import Hypothesis
from calibration.attribution.rules import RULES, Trial, doubted
from calibration.linear.gls import schur_complement
from calibration.statistics.fit import Fit
from calibration.statistics.residual_tests import kernel_factor
from calibration.statistics.statistical_model import regression
from calibration.statistics.study import Study, held_out_p_value
from calibration.table.runs import Runs
from common.arrays import Flags, Floats

SEEN = 6.0  # standard deviations of a remainder that the tests notice nearly always
_DRAWS = 200
_SPREAD = 0.5  # of ln of a signal
_ALONG_TRACES = 2.0  # correlation length in time: what imitates an effect along a trace differs from it slowly
_ENOUGH = 2  # values a parameter
_MOST = 0.999  # p-value of the transfer test; 1 means that it was not made


def with_checks(study: Study, claims: Sequence[Hypothesis], base: Fit) -> tuple[Hypothesis, ...]:
    """Add to each claim, of effects or of a wrong number, its imitability index and its transfer test.

    The strength of a claim is what it takes from the deviance of `base`.
    """

    def imitable(claim: Hypothesis) -> float:
        strength = math.sqrt(max(base.deviance - claim.fitted.deviance, 0.0))
        seconds = (e.second.name for e in claim.added if e.second)
        return imitability(
            absorbable_shares(study, claim.fitted, (*(e.name for e in claim.added), *seconds)), strength
        )

    def transfer(claim: Hypothesis) -> float:
        return transfer_p(replace(study, seed=study.seed + 4), claim.fitted)

    trial = Trial(study, base, {"imitable": imitable, "transfer": transfer})
    return tuple(doubted(claim, trial, RULES) for claim in claims)


def absorbable_shares(study: Study, fitted: Fit, names: Sequence[str]) -> Floats:
    """Draw signals from outside, made from each of the effects `names` of a fit in turn, and return their a."""
    runs, used, noise = study.model.runs, study.split.fitted, fitted.noise
    claimed = [fitted.names.index(name) for name in names]
    order = [*(i for i in range(len(fitted.names)) if i not in claimed), *claimed]
    factors = np.ones((len(runs), _DRAWS))
    factors[used] = deformations(runs, used, _DRAWS, study.seed)
    plain = runs.raw(fitted.jacobian)
    deformed = (runs.whitened(plain[..., [p]] * factors[:, None])[used] for p in claimed)
    signals = np.moveaxis(np.concatenate(list(deformed), -1), -1, 0)  # (B, n', k)
    linear = regression(runs, used, fitted.jacobian[..., order], [fitted.fitted[i] for i in order])
    normal = linear.products(signals, noise.run_covariance).at(np.tile(noise.session_ratio, (len(signals), 1)))
    before = schur_complement(normal, len(order) - len(claimed))
    after = schur_complement(before, len(claimed))
    return np.asarray(1 - after[:, -1, -1] / np.maximum(before[:, -1, -1], 1e-300))


def imitability(shares: Floats, strength: float) -> float:
    """Return the share of draws that a claim of this strength (standard deviations) would not notice."""
    remainder = strength * np.sqrt(np.maximum(1 / np.maximum(shares, 1e-9) - 1, 0.0))
    return float((remainder < SEEN).mean())


def deformations(runs: Runs, used: Flags, count: int, seed: int) -> Floats:
    """Draw exp(g) at the runs in `used`, (n', count)."""
    spread = runs.inputs[used].std(0)
    if runs.trace is not None:
        spread[-1] *= _ALONG_TRACES
    factor = kernel_factor(runs.inputs[used] / np.where(spread > 0, spread, 1.0))
    return np.asarray(np.exp(_SPREAD * factor @ np.random.default_rng(seed).normal(size=(factor.shape[1], count))))


def transfer_p(study: Study, fitted: Fit) -> float:
    """Estimate the probability that noise alone puts the other runs as far from a model with the claim.

    It is 1 where runs are too few or too much alike.
    """
    runs, used, p = study.model.runs, study.split.fitted, []
    for nearer in runs.nearer(used):
        others = runs.left_out(used & ~nearer)
        near = used & ~others
        if others.any() and runs.values(near) >= _ENOUGH * len(fitted.names):
            refit = fitted.refitted(runs, near, for_test=True)
            p.append(held_out_p_value(refit, runs, others, seed=study.seed))
    return min(_MOST, len(p) * min(p)) if p else 1.0
