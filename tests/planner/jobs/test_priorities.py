"""Priorities are found by conflict: here motions are hours at places, and robots must not share both."""

from __future__ import annotations

import math
from itertools import combinations

import pytest

from planner.jobs.priorities import Priorities

Motion = tuple[str, int]  # a place, and an hour at it


def meet(first: Motion, second: Motion) -> float:
    return first[1] if first == second else math.inf


class Hours:
    """A robot that gives way comes at the first of its hours that is left at its place."""

    def __init__(self, places: str, hours: dict[int, list[int]]):
        self.places, self.hours, self.timed = places, hours, list[int]()

    def at(self, k: int, others: tuple[Motion, ...]) -> Motion | None:
        self.timed.append(k)
        allowed = self.hours.get(k, list(range(10)))
        return next((each for hour in allowed if (each := (self.places[k], hour)) not in others), None)

    def search(self, most: int = 1000) -> Priorities[Motion]:
        alone = tuple((place, self.hours.get(k, [0])[0]) for k, place in enumerate(self.places))
        return Priorities(alone, self.at, meet, most)


def test_ten_robots_at_one_place_come_one_after_another() -> None:
    found = Hours("a" * 10, {}).search().resolve()
    assert found is not None
    assert [hour for _, hour in found.motions] == list(range(10))
    assert found.order == tuple(range(10))


@pytest.mark.parametrize("stubborn", range(10))
def test_a_robot_that_cannot_wait_goes_before_all(stubborn: int) -> None:
    found = Hours("a" * 10, {stubborn: [0]}).search().resolve()
    assert found is not None
    assert found.motions[stubborn] == ("a", 0)
    assert len(set(found.motions)) == 10
    assert found.order[0] == stubborn


def test_robots_that_meet_nobody_are_not_timed() -> None:
    robots = Hours("abcdaefgha", {})
    found = robots.search().resolve()
    assert found is not None
    assert set(robots.timed) <= {4, 9}
    assert all(meet(*pair) == math.inf for pair in combinations(found.motions, 2))


def test_two_that_can_never_keep_apart_end_the_search() -> None:
    search = Hours("a" * 8 + "bb", {8: [3], 9: [3]}).search()
    assert search.resolve() is None
    assert search.impossible == (9, 8)


def test_it_ends_after_as_many_timings_as_allowed() -> None:
    search = Hours("a" * 6, {k: [0, 1, 2, 3, 4] for k in range(6)}).search(most=50)
    assert search.resolve() is None
    assert search.impossible is None
    assert search.tried == 50
