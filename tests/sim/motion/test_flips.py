"""Robots after flips: courses do not depend on the group, agree with single robots, and end when they should."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sim.lanes import ALONE, GROUP, HALF_GROUP
from sim.model.groups import Groups
from sim.motion import flips as module
from sim.motion import grouping, orbit_groups
from sim.motion.flips import Course, Flip, follow_flips
from sim.motion.phased_orbits import orbits_with_phases
from sim.motion.response import mirrored, responses
from sim.solve.assembly import numbers, unpacked
from sim.solve.transient import lag_at, transient
from tests.sim.motion.test_orbit_groups import robots
from tests.sim.robots import control

TIMES, MARKS = np.linspace(0.3, 1.0, 5), np.array([0.4, 0.7])
TOLERANCE = 1e-3
EDGES = 6


def flips_of(groups: Groups, until: float = 1.0) -> list[Flip]:
    """Return flips of robots from the mirror images of their steady shapes."""
    rows = numbers(groups)
    flips = []
    for row, orbit in zip(rows, orbits_with_phases(rows, groups.N, [EDGES])[0], strict=True):
        assert orbit is not None
        flips.append(Flip(row, mirrored(orbit.x), orbit.u, orbit.twist, until))
    return flips


def with_speed(flip: Flip, omega: float) -> Flip:
    """Return the flip of the same robot with another speed of its motor."""
    return flip._replace(row=np.array([omega, *flip.row[1:]]))


def same_bits(a: Course | None, b: Course | None) -> bool:
    assert a is not None
    assert b is not None
    return all(np.array_equal(p, q, equal_nan=True) for p, q in zip(a, b, strict=True))


def followed(flips: list[Flip]) -> list[Course | None]:
    return follow_flips(flips, TIMES, TOLERANCE, MARKS)


@pytest.mark.parametrize("tails", [2, 3])
def test_a_course_does_not_depend_on_the_group(tails: int) -> None:
    """Eleven robots: three take lanes of robots that have come to their ends."""
    flips = flips_of(robots(tails, 11))
    together = followed(flips)
    for flip, course in zip(flips, together, strict=True):
        assert same_bits(course, followed([flip])[0])
    apart = [*followed(flips[:4]), *followed(flips[4:])]
    backwards = followed(flips[::-1])[::-1]
    assert all(map(same_bits, together, apart))
    assert all(map(same_bits, together, backwards))


@pytest.mark.parametrize("width", [ALONE, HALF_GROUP, GROUP])
def test_the_width_of_groups_does_not_matter(width: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    groups = robots(3, 6)
    wanted = responses(groups)
    for place in (module, orbit_groups, grouping):
        monkeypatch.setattr(place, "group_width", lambda: width)
    found = responses(groups)
    for name in ("lag", "memory", "rest", "spread", "net_speed"):
        assert np.array_equal(getattr(wanted, name), getattr(found, name)), name


def test_responses_of_many_robots_are_simulated_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    groups = robots(3, 5)
    wanted = responses(groups, history=False)
    monkeypatch.setattr(grouping, "AT_ONCE", 2)
    found = responses(groups, history=False)
    assert np.array_equal(wanted.lag, found.lag)
    assert np.array_equal(wanted.net_speed, found.net_speed, equal_nan=True)


@pytest.mark.parametrize("tails", [2, 3, 5])
def test_courses_agree_with_those_of_single_robots(tails: int) -> None:
    for flip, course in zip(flips := flips_of(robots(tails, 9)), followed(flips), strict=True):
        assert course is not None
        x = flip.x.copy()
        alone = transient(unpacked(flip.row[None])[0], x, flip.u.copy(), flip.twist, 1.0, MARKS, TOLERANCE)
        assert alone.solved
        assert course.lag == pytest.approx(lag_at(alone, TIMES), abs=1e-10)
        assert course.shapes == pytest.approx(alone.shapes, abs=1e-10)
        assert course.end == pytest.approx(x, abs=1e-10)


def test_a_robot_that_cannot_be_followed_leaves_the_others_alone() -> None:
    flips = flips_of(robots(3, 10))
    wanted = followed(flips)
    broken: list[Any] = list(flips)
    broken[2] = with_speed(flips[2], np.nan)
    broken[7] = None
    broken[9] = with_speed(flips[9], 1e12)
    found = followed(broken)
    assert [i for i, course in enumerate(found) if course is None] == [2, 7, 9]
    assert all(same_bits(wanted[i], found[i]) for i in (0, 1, 3, 4, 5, 6, 8))


def test_robots_wait_for_lanes_of_robots_without_numbers() -> None:
    flips = flips_of(robots(3, 2))
    found = followed([with_speed(flips[0], np.nan)] * 2 * len(GROUP) + flips)
    assert all(course is None for course in found[:-2])
    assert all(map(same_bits, found[-2:], followed(flips)))


def test_every_robot_is_followed_until_its_own_end() -> None:
    flips = flips_of(robots(3, 5))
    ends = [0.4, 0.55, 0.7, 0.9, 1.0]
    courses = followed([flip._replace(until=end) for flip, end in zip(flips, ends, strict=True)])
    for course, whole, end in zip(courses, followed(flips), ends, strict=True):
        assert course is not None
        assert whole is not None
        assert (np.isfinite(course.lag).all((1, 2)) == (end >= TIMES)).all()
        assert course.lag[end >= TIMES] == pytest.approx(whole.lag[end >= TIMES], abs=2e-3)
        assert (np.isfinite(course.shapes).all((1, 2, 3)) == (end >= MARKS)).all()
        if end in MARKS:
            assert np.array_equal(course.end, course.shapes[end == MARKS][0])


def test_robots_with_non_local_effects_are_followed_beside_the_others() -> None:
    mixed = control(3, omega_bar=np.array([12.0, 14.0, 16.0]), tail_interaction=np.array([0.0, 1.0, 0.0]))
    flips = flips_of(mixed)
    together = followed(flips)
    for flip, course in zip(flips, together, strict=True):
        assert same_bits(course, followed([flip])[0])
    assert together[1] is not None
    early = followed([flips[1]._replace(until=0.7)])[0]
    assert early is not None
    assert (np.isfinite(early.lag).all((1, 2)) == (TIMES <= 0.7)).all()
    assert np.array_equal(early.end, early.shapes[1])
    plain = followed(flips_of(control(omega_bar=14.0)))[0]
    assert plain is not None
    assert np.abs(together[1].lag - plain.lag).max() > 1e-3
