"""Wilcoxon's test against that of SciPy, whose module takes longer to load than a small table to calibrate."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.stats import rankdata, wilcoxon

from calibration.statistics.signed_ranks import signed_rank_p


@pytest.mark.parametrize("count", [2, 7, 50, 51, 200])
def test_p_values_are_those_of_scipy(count: int) -> None:
    drawn = np.random.default_rng(count).normal(0.2, 1.0, count)
    expected = wilcoxon(drawn, alternative="greater").pvalue
    assert signed_rank_p(drawn) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_ties_share_their_mean_rank(seed: int) -> None:
    drawn = np.random.default_rng(seed).choice([-3, -2, -1, 1, 2, 3], 8).astype(float)
    ranks = rankdata(np.abs(drawn))
    sums = [ranks @ np.array(signs) for signs in product((0, 1), repeat=8)]
    assert signed_rank_p(drawn) == np.mean(np.array(sums) >= ranks @ (drawn > 0))
