"""Routes keep their distance and their radius, and are short."""

from __future__ import annotations

import numpy as np
import pytest

from planner.goal.dubins import words
from planner.goal.lattice import RouteLimits
from planner.goal.route import COURSES, NoWayError, route
from planner.paths.obstacles import Circle, Footprint, FreeSpace, Polygon
from planner.paths.tractrix import STILL
from sim.arrays import Floats
from sim.model.presets import PRESETS

CONTROL = PRESETS["paper-control"]
RADIUS = 0.37


BODY = Footprint(np.linspace(-0.3, 1.0, 8), 0.2)


def stop(*pose: float) -> Floats:
    return np.array([pose])


def box(left: float, low: float, right: float, high: float) -> Polygon:
    return Polygon.of([[left, low], [right, low], [right, high], [left, high]])


@pytest.mark.parametrize("seed", range(4))
def test_a_route_keeps_its_distance_and_its_radius(seed: int) -> None:
    rng = np.random.default_rng(seed)
    circles = tuple(Circle(x, y, 0.5) for x, y in rng.uniform([1.5, -2], [4.5, 2], (3, 2)))
    limits = RouteLimits(RADIUS, BODY, FreeSpace(circles), STILL)
    found = route([stop(0, 0, 0), stop(6.5, 0, 1.0)], limits, 0.1, {}, CONTROL)
    track = found.poses(0.01)
    assert limits.clearance(track).min() >= 0.1 - 1e-3
    assert track[-1] == pytest.approx([6.5, 0, 1.0 + 2 * np.pi * round((track[-1, 2] - 1) / 2 / np.pi)], abs=1e-6)
    steps = np.hypot(*np.diff(track[:, :2], axis=0).T)
    assert np.abs(np.diff(track[:, 2]) / steps).max() < 1.01 / RADIUS


def test_a_route_through_places_is_as_short_as_with_the_best_courses() -> None:
    limits = RouteLimits(RADIUS, BODY, FreeSpace(), STILL)
    course = 2 * np.pi * np.arange(COURSES) / COURSES
    places = [(2.0, 1.0), (1.0, 3.0)]
    free = [np.stack([0 * course + x, 0 * course + y, course], 1) for x, y in places]
    ends = stop(0, 0, 0), stop(-1, 1, -2)
    found = route([ends[0], *free, ends[1]], limits, 0.0, {}, CONTROL)
    fine = 2 * np.pi * np.arange(720) / 720
    (one, other) = (np.stack([0 * fine + x, 0 * fine + y, fine], 1) for x, y in places)
    first = words(ends[0], one, RADIUS).sum(-1).min(-1)
    middle = words(one[:, None], other[None], RADIUS).sum(-1).min(-1)
    last = words(other, ends[1], RADIUS).sum(-1).min(-1)
    assert found.length <= (first[:, None] + middle + last).min() + 1e-3
    for place in places:
        assert np.hypot(*(found.poses(0.005)[:, :2] - place).T).min() < 0.005


def test_a_wall_without_a_gap_leaves_no_way() -> None:
    for gap, passes in ((1.4, True), (0.3, False)):
        room = FreeSpace((box(2, -3, 2.5, -gap / 2), box(2, gap / 2, 2.5, 3)), box(-2, -3, 7, 3))
        limits = RouteLimits(RADIUS, BODY, room, STILL)
        ends = [stop(0, 0, 0), stop(5, 0, 0)]
        if passes:
            assert route(ends, limits, 0.05, {}, CONTROL).length == pytest.approx(5.0, rel=0.05)
        else:
            leaves = r"there is no way to the goal that leaves 5\.5 mm \(0\.05 l\) .* 4\.07 cm \(0\.37 l\)"
            with pytest.raises(NoWayError, match=leaves):
                route(ends, limits, 0.05, {}, CONTROL)


def test_a_goal_inside_a_region_is_refused_with_the_distance() -> None:
    limits = RouteLimits(RADIUS, BODY, FreeSpace((Circle(5, 0, 1),)), STILL)
    pivot = r"at the goal, .* \(55\.00, 0\.00\) cm = \(.*\) l, "
    with pytest.raises(
        NoWayError, match=pivot + r".* cm \(.* l\) inside what it must keep out of; it needs 1\.1 cm \(0\.1 l\)"
    ):
        route([stop(0, 0, 0), stop(5, 0, 0)], limits, 0.1, {}, CONTROL)
