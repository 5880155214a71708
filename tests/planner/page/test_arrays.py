"""Operations on columns round as NumPy's do."""

from __future__ import annotations

import math

import numpy as np

from tests.planner.page.page_core import answers, check_near

RNG = np.random.default_rng(0)
COLUMNS = [RNG.normal(size=count) for count in (1, 5, 8, 100, 129, 1000, 4711)]


def test_sums_are_equal_to_the_last_bit() -> None:
    found = answers([("arrays.js", "sum", column) for column in COLUMNS])
    assert found == [float(column.sum()) for column in COLUMNS]
    found = answers([("arrays.js", "runningSum", column) for column in COLUMNS])
    assert found == [[0.0, *np.cumsum(column).tolist()] for column in COLUMNS]


def test_equal_steps_and_interpolation_are_equal_to_the_last_bit() -> None:
    knots, values, at = np.sort(RNG.normal(size=50)), RNG.normal(size=50), 1.5 * RNG.normal(size=200)
    at[:5] = knots[[0, 3, 9, 48, 49]]
    spaced, between = answers(
        [("arrays.js", "linspace", 0.1, 7.3, 1234), ("arrays.js", "interp", at, knots, values)]
    )
    assert spaced == np.linspace(0.1, 7.3, 1234).tolist()
    assert between == np.interp(at, knots, values).tolist()


def test_angles_medians_remainders_and_means() -> None:
    angles = np.cumsum(RNG.normal(size=300)) * 2
    wrapped = (angles + math.pi) % (2 * math.pi) - math.pi
    jumps = np.array([0.0, math.pi, 0.0, -math.pi, 3 * math.pi])
    values = [5.0, -5.0, 3.0, -3.0, 1.5, 4.5, 9.42, -9.42]
    calls = [("arrays.js", "unwrap", wrapped), ("arrays.js", "unwrap", jumps)]
    calls += [("arrays.js", "median", column) for column in COLUMNS]
    calls += [("arrays.js", "mod", value, 3.0) for value in values]
    calls += [("arrays.js", "remainder", value, 3.0) for value in values]
    first, second, *rest = answers(calls)
    assert first == np.unwrap(wrapped).tolist()
    assert second == np.unwrap(jumps).tolist()
    wanted = [float(np.median(column)) for column in COLUMNS]
    assert rest == [*wanted, *(value % 3.0 for value in values), *(math.remainder(v, 3.0) for v in values)]


def test_sums_with_a_kernel() -> None:
    kernel = RNG.normal(size=7)
    found = answers([("arrays.js", "convolved", COLUMNS[3], kernel)])[0]
    check_near(found, np.convolve(COLUMNS[3], kernel, mode="valid"), 1e-13)


def test_hypotenuses_to_the_last_bit() -> None:
    pairs = np.random.default_rng(5).lognormal(sigma=3.0, size=(2000, 2)) * [1.0, -1.0]
    pairs[:4] = [[0.0, 0.0], [3.0, 4.0], [1e-9, 1.0], [0.0, -2.5]]
    found = answers([("arrays.js", "hypot", *pair) for pair in pairs.tolist()])
    assert found == [math.hypot(*pair) for pair in pairs.tolist()]
