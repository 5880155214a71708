"""Tours: all places in the quickest order, also in the simulator and among obstacles."""

from __future__ import annotations

from itertools import pairwise, permutations
from typing import Any

import numpy as np
import pytest

from common.errors import InputError
from planner.jobs import shortest_order as module
from planner.jobs.shortest_order import EXACT, shortest_order
from planner.jobs.tour import tour
from planner.jobs.travel import Travel
from planner.paths.distance import distance_to
from planner.paths.obstacles import Circle, FreeSpace
from planner.planning.solve import Trial
from planner.progress import ORDERING
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from planner.vehicle.zigzag import dwells_for
from sim.motion.replay import replay
from tests.planner.plans import CONTROL, tracked

pytestmark = pytest.mark.slow

PLACES = [(0.0, 0.0), (4.0, 0.0), (2.0, 1.0), (3.0, 3.0), (-1.0, 2.0)]
QUICK: dict[str, Any] = {"objective": "time"}
OPTIONS = 3


def random_costs(seed: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Make the costs of visits in the plane, with something for each option; start and end cost a little, too."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(0, 10, (count, 2))
    apart = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
    costs = apart[:, None, :, None] + rng.uniform(0, 3, (count, OPTIONS, count, OPTIONS))
    return costs, rng.uniform(0, 2, (count, OPTIONS)), rng.uniform(0, 2, (count, OPTIONS))


def cost_of(visits: list[int], costs: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    """Compute the cost of an order with the best options, one visit after another."""
    total = start[visits[0]]
    for i, j in pairwise(visits):
        total = (total[:, None] + costs[i, :, j]).min(0)
    return float((total + end[visits[-1]]).min())


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
    assert cost_of(searched.visits, costs, start, end) == pytest.approx(searched.cost)
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


def legs(tracked: TrackedVehicle, places: np.ndarray) -> np.ndarray:
    """Compute the times (n, 72, n, 72) between places, with 72 directions of motion at each."""
    dwell = dwells_for(tracked.vehicle, "time", None)[0]
    travel = Travel.of(Trial.of(tracked, dwell), FreeSpace(), 0.0)
    course = 2 * np.pi * np.arange(72) / 72
    axis = np.stack([np.cos(course), np.sin(course)], 1)
    poses = np.concatenate([[np.c_[place - tracked.rod * axis, course] for place in places]]).reshape(-1, 3)
    times = travel.times(np.repeat(poses, len(poses), 0), np.tile(poses, (len(poses), 1)))
    return times.reshape(len(places), 72, len(places), 72)


def fixed_order(order: tuple[int, ...], times: np.ndarray) -> float:
    """Compute the time of an order of places, one leg after another."""
    total = np.zeros(72)
    for here, there in pairwise(order):
        total = (total[:, None] + times[here, :, there]).min(0)
    return float(total.min())


@pytest.mark.parametrize("size", [1.0, 0.4])  # of the places' distances; the smaller ones are those of a turn
@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("any_start", [False, True])
def test_no_other_order_of_the_places_takes_less_time(size: float, back: bool, any_start: bool) -> None:
    places = size * np.array([(0, 0), (4, 0), (2, 1), (3, 3), (-1, 2)])
    best = tour(places.tolist(), tracked(), **QUICK, back=back, any_start=any_start)
    assert best.job.exact
    assert 0.7 * best.job.estimate < best.duration < 1.1 * best.job.estimate  # longer dwells may be faster
    assert best.job.order[0] == (best.job.order[-1] if back else best.job.order[0] if any_start else 0)
    assert sorted(set(best.job.order)) == [0, 1, 2, 3, 4]
    times = legs(tracked(), places)
    for order in permutations(range(5)):
        if any_start or order[0] == 0:
            assert best.job.estimate <= fixed_order((*order, *order[: int(back)]), times) * 1.001


def test_every_place_is_on_the_declared_path() -> None:
    result = tour(PLACES, tracked(), dwell=0.8)
    assert distance_to(result.reference, np.array(PLACES)).max() < 0.005
    assert result.job.distance.max() <= result.predicted_max + 0.005
    assert (np.diff(result.job.reached) > 0).all()


def test_the_error_of_the_tour_itself_decides_its_dwell() -> None:
    """A longer one than the objective begins with: its flips, which are fewer, add up to less."""
    fixed, best = (tour(PLACES, tracked(), dwell=dwell) for dwell in (0.81, None))
    assert best.minimum_dwell > 1.2 * fixed.minimum_dwell
    assert best.stated_error < fixed.stated_error


@pytest.mark.parametrize("size", [1.0, 0.4])
def test_a_quick_tour_begins_on_its_first_place(size: float) -> None:
    result = tour([(size * x, size * y) for x, y in PLACES], tracked(), **QUICK)
    assert result.job.distance[0] < 0.03
    assert result.straight.largest > 0.08  # where a dwell of the zigzag begins


def test_the_point_that_is_asked_for_passes() -> None:
    by_pivot = tracked_vehicle(CONTROL, None, "pivot", None)
    result = tour(PLACES[:3], by_pivot, **QUICK)
    assert distance_to(result.declared.reference.q, np.array(PLACES[:3])).max() < 0.005


def test_among_obstacles_it_keeps_clear() -> None:
    space = FreeSpace((Circle(1.0, 0.6, 0.3),))
    result = tour(PLACES[:3], tracked(), objective="flips", keep_out=space.regions)
    kept = result.kept_clear
    assert kept is not None
    assert kept.margin >= result.stated_error
    assert kept.clearance > 0
    assert not result.job.exact
    assert distance_to(result.reference, np.array(PLACES[:3])).max() < 0.05


def test_the_simulator_visits_all_places() -> None:
    result = tour(PLACES[:3], tracked(), **QUICK)
    track = replay(result.schedule())
    points = track[["x_over_l", "y_over_l"]].to_numpy(float)
    assert distance_to(points, np.array(PLACES[:3])).max() < result.stated_error + 0.05


def test_the_search_for_an_order_among_obstacles_tells_how_far_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planner.jobs.travel._BLOCK_BESIDE", 200)
    told: list[Any] = []
    tour(PLACES[:3], tracked(), **QUICK, keep_out=[Circle(2.0, 30.0, 0.5)], progress=told.append)
    shares = [share.done for share in told if share.stage == ORDERING]
    assert len(shares) > 5
    assert shares == sorted(shares)
