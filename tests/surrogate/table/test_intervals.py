"""Intervals: they cover as they say, in every part and group."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sim.arrays import Flags, Floats
from surrogate.table.intervals import PARTS, Intervals
from tests.surrogate.small import rows, table


def sampled(count: int, random: np.random.Generator, size: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    """Draw features with values from 0 to 1, a fifth of them with one tail, and errors of that size."""
    features = random.uniform(size=(count, 8))
    features[:, -1] = features[:, -1] < 0.2
    return features, size(features) * random.standard_normal(count)


def covered(size: Callable[[Floats], Floats]) -> tuple[Intervals, Floats, Flags]:
    """Learn intervals from such errors; return fresh features, and which of their errors are inside."""
    random = np.random.default_rng(2)
    (x, error), (more, other), (test, last) = (sampled(n, random, size) for n in (3000, 3000, 20000))
    found = Intervals.learned(x, {"v": error}, more, {"v": other})
    return found, test, np.abs(last) <= found.half_widths("v", test, 1.0)


def test_intervals_cover_as_they_say() -> None:
    """Errors whose size depends on an input: 90 % are covered, on the loud side and on the quiet side."""
    _, test, inside = covered(lambda x: np.exp(3 * x[:, 0]))
    assert inside.mean() == pytest.approx(0.9, abs=0.02)
    for side in (test[:, 0] < 0.3, test[:, 0] > 0.7):
        assert 0.86 < inside[side].mean() < 0.94


def test_intervals_cover_in_each_part() -> None:
    """Errors that are large in one octant and for one tail only, which the local width cannot follow."""
    found, test, inside = covered(lambda x: 1 + 8 * (x[:, [0, 3, 5]] > 0.5).all(1) + 20 * (x[:, -1] > 0.5))
    part = found.part(test)
    assert sorted(set(part.tolist())) == list(range(9))
    for k in range(9):
        assert 0.85 < inside[part == k].mean() < 0.95


@pytest.mark.parametrize(("with_couples", "groups"), [(0.5, 2), (0.01, 1)])
def test_intervals_cover_with_and_without_couples(with_couples: float, groups: int) -> None:
    """Errors that are five times as large with couples; with too few of these robots nothing is told apart."""
    random = np.random.default_rng(3)
    (x, error), (more, other), (test, last) = (
        sampled(n, random, lambda x: 1 + x[:, 0]) for n in (3000, 3000, 20000)
    )
    couples, tested = (random.uniform(size=size) < with_couples for size in (3000, 20000))
    found = Intervals.learned(x, {"v": error}, more, {"v": other * (1 + 4 * couples)}, couples)
    inside = np.abs(last * (1 + 4 * tested)) <= found.half_widths("v", test, 1.0, tested)
    assert len(found.factor["v"]) == groups * PARTS
    assert inside[~tested].mean() == pytest.approx(0.9, abs=0.02)
    assert (0.88 < inside[tested].mean() < 0.92) == (groups == 2)


def test_a_query_gives_intervals_around_its_answer() -> None:
    robots = rows(256, 13, wide=False).robots
    found = table().query(robots, intervals=True, flag=True)
    for name in ("omega_yr_bar", "v_z", "theta_deg"):
        assert (found[f"{name}_low"] < found[name]).all()
        assert (found[f"{name}_high"] > found[name]).all()
    assert found["outside"].mean() < 0.2
