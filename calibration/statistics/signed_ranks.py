"""Wilcoxon's signed-rank test: do differences lie above zero?"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ndtr

from common.arrays import Floats

_MOST_EXACT = 50


def signed_rank_p(differences: Floats) -> float:
    """Compute the p-value of differences (n,), none of them zero: so high ranks have those above zero by chance.

    It is exact for up to 50, also with ties; for more it is that of the normal distribution.
    Source: Wilcoxon (1945).
    """
    sizes, ordered = np.abs(differences), np.sort(np.abs(differences))
    twice = np.searchsorted(ordered, sizes) + np.searchsorted(ordered, sizes, "right") + 1  # mean ranks
    above = int(twice[differences > 0].sum())
    if len(twice) > _MOST_EXACT:
        return float(ndtr((twice.sum() / 2 - above) / math.sqrt((twice**2).sum() / 4)))
    ways = np.ones(1)  # in which signs give a sum, by the sum
    for rank in twice.tolist():
        ways = np.pad(ways, (0, rank)) + np.pad(ways, (rank, 0))
    return float(ways[above:].sum() / ways.sum())
