"""Standard normal numbers from a counter: their distribution, their independence, and that they stay the same."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ndtri

from planner.planning.stated_error import normals, quantile

COUNT = 1_000_000
FIRST_TEN = [
    1.5315735121420815, 0.8307008439622914, 0.9946437222888765, 2.429524860220238, -0.0881736779634259,
    -0.8378393662461183, 0.24133260542573357, -0.920739098204766, 0.5163686036266667, -0.46754151569994856,
]  # fmt: skip


def test_the_first_ten_numbers_stay_the_same() -> None:
    assert normals(0, 0, 10) == pytest.approx(FIRST_TEN, rel=1e-14)
    assert (normals(7, 1000, 50) == normals(7, 0, 1050)[1000:]).all()
    with pytest.raises(ValueError, match="read-only"):
        normals(0, 0, 10)[0] = 1.0


@pytest.mark.parametrize("seed", [0, 1, 12345])
def test_they_are_normal_and_not_correlated(seed: int) -> None:
    """Within 4 or 4.5 standard errors: moments, tails, neighbours, and another seed at each lag."""
    drawn, other = normals(seed, 0, COUNT), normals(2, 0, COUNT)
    assert abs(drawn.mean()) < 4 / math.sqrt(COUNT)
    assert abs(drawn.var() - 1) < 4 * math.sqrt(2 / COUNT)
    assert abs((drawn**3).mean()) < 4 * math.sqrt(15 / COUNT)
    for limit in (1.0, 2.0, 3.0, 4.0):
        expected = math.erfc(limit / math.sqrt(2)) / 2
        for share in ((drawn > limit).mean(), (drawn < -limit).mean()):
            assert abs(share - expected) < 4 * math.sqrt(expected / COUNT)
    for lag in (1, 2, 3, 8, 900, 2**16):
        for one, late in ((drawn[:-lag], drawn[lag:]), (drawn[:-lag] ** 2 - 1, (drawn[lag:] ** 2 - 1) / 2)):
            assert abs((one * late).mean()) < 4.5 / math.sqrt(COUNT)
    for lag in range(10):
        assert abs((drawn[: COUNT - lag] * other[lag:]).mean()) < 4.5 / math.sqrt(COUNT)


def test_the_quantile_is_that_of_scipy() -> None:
    """In the middle and in both tails, as far as a hash of 32 bits reaches."""
    u = np.concatenate([np.geomspace(2.0**-33, 0.5, 20001), 1 - np.geomspace(2.0**-33, 0.5, 20001)])
    assert quantile(u) == pytest.approx(ndtri(u), rel=2e-15, abs=1e-16)
