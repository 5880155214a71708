"""Orders of visits: exact ones are those of brute force, searched ones are near, and the bound is below both."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import pytest

from planner.jobs import shortest_order as module
from planner.jobs.shortest_order import EXACT, shortest_order
from sim.io.errors import InputError

OPTIONS = 3


def random_costs(seed: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Make the costs of visits in the plane, with something for each option; start and end cost a little, too."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(0, 10, (count, 2))
    apart = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
    costs = apart[:, None, :, None] + rng.uniform(0, 3, (count, OPTIONS, count, OPTIONS))
    return costs, rng.uniform(0, 2, (count, OPTIONS)), rng.uniform(0, 2, (count, OPTIONS))


def cost_of(visits: list[int], options: list[int], costs: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    total = start[visits[0], options[0]] + end[visits[-1], options[-1]]
    for (i, c), (j, d) in zip(
        zip(visits, options, strict=True), list(zip(visits, options, strict=True))[1:], strict=False
    ):
        total += costs[i, c, j, d]
    return float(total)


@pytest.mark.parametrize("seed", range(5))
def test_few_visits_are_ordered_as_by_brute_force(seed: int) -> None:
    costs, start, end = random_costs(seed, 4)
    order = shortest_order(costs, start, end)
    least = min(
        cost_of(list(visits), list(options), costs, start, end)
        for visits in permutations(range(4))
        for options in product(range(OPTIONS), repeat=4)
    )
    assert order.cost == pytest.approx(least, rel=1e-12)
    assert cost_of(order.visits, order.options, costs, start, end) == pytest.approx(order.cost)
    assert order.gap == 0


@pytest.mark.parametrize("seed", range(4))
def test_the_search_is_near_the_exact_order_and_the_bound_below(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    costs, start, end = random_costs(seed, 9)
    exact = shortest_order(costs, start, end)
    monkeypatch.setattr(module, "EXACT", 0)
    searched = shortest_order(costs, start, end)
    assert exact.cost <= searched.cost * (1 + 1e-12)
    assert searched.cost < 1.1 * exact.cost
    assert searched.bound <= exact.cost * (1 + 1e-9)
    assert cost_of(searched.visits, searched.options, costs, start, end) == pytest.approx(searched.cost)
    assert sorted(searched.visits) == list(range(9))


def test_many_visits_have_a_small_gap() -> None:
    order = shortest_order(*random_costs(0, EXACT + 8))
    assert sorted(order.visits) == list(range(EXACT + 8))
    assert 0 <= order.gap < 0.4


def test_what_cannot_be_ordered_is_refused() -> None:
    costs, start, end = random_costs(0, 4)
    costs[:, :, 2] = np.inf
    start[2] = np.inf
    with pytest.raises(InputError, match="no way"):
        shortest_order(costs, start, end)
    with pytest.raises(InputError, match="at most 80"):
        shortest_order(np.zeros((81, 1, 81, 1)), np.zeros((81, 1)), np.zeros((81, 1)))
