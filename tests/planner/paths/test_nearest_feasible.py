"""The nearest path that can be followed: nearer than rounded corners, and within what the pivot can do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from planner.paths.distance import distance_to, two_sided
from planner.paths.fillets import fillet
from planner.paths.nearest_feasible import nearest_path
from planner.paths.path import Path2D, circle, polygon
from planner.paths.tractrix import STILL, Drift, reference

A, RADIUS = 0.87, 0.37
ZIGZAG = Path2D.of([[0, 0], [3, 0], [3, 3], [6, 3], [4.5, 0.0], [8, 0]])


def off(path: Path2D, raw: Path2D) -> float:
    return float(np.sqrt(np.mean(distance_to(raw.polyline(), reference(path, A, 0.01).p) ** 2)))


def sharpest(path: Path2D, drift: Drift = STILL) -> float:
    return float(np.abs(reference(path, A, 0.02, drift).curvature).max()) * RADIUS


@pytest.mark.parametrize("raw", [polygon(4, 3.0), polygon(3, 4.0), ZIGZAG], ids=["square", "triangle", "zigzag"])
def test_it_can_be_followed_and_is_nearer_than_rounded_corners(raw: Path2D) -> None:
    found = nearest_path(raw, A, RADIUS / 0.85)
    assert sharpest(found) < 1.0
    radii = np.linspace(0.05, 1.4, 28)
    followed = [r for r in radii if sharpest(fillet(raw, float(r))) < 0.95]
    assert off(found, raw) < 0.7 * off(fillet(raw, float(followed[0])), raw)


@pytest.mark.parametrize("raw", [polygon(4, 3.0), polygon(3, 4.0), ZIGZAG], ids=["square", "triangle", "zigzag"])
def test_minimax_has_a_smaller_largest_distance(raw: Path2D) -> None:
    one, other = (nearest_path(raw, A, RADIUS / 0.85, minimax=minimax) for minimax in (False, True))
    assert sharpest(other) < 1.0
    assert max(two_sided(other.polyline(), raw.polyline())) < 0.95 * max(two_sided(one.polyline(), raw.polyline()))
    assert off(one, raw) < off(other, raw) < 2 * off(one, raw)


def test_a_path_that_can_be_followed_is_left_as_it_is() -> None:
    found = nearest_path(circle(2.0), A, RADIUS)
    assert max(two_sided(found.polyline(), circle(2.0).polyline())) < 2e-3


def test_more_room_gives_a_nearer_path() -> None:
    tight, wide = (off(nearest_path(polygon(4, 3.0), A, r), polygon(4, 3.0)) for r in (RADIUS, 0.6 * RADIUS))
    assert wide < 0.7 * tight


@pytest.mark.parametrize("angle", [0.7, 2.9])
def test_turned_and_mirrored_paths_give_turned_and_mirrored_results(angle: float) -> None:
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s], [s, c]]) @ np.diag([1.0, -1.0])
    one = nearest_path(ZIGZAG, A, RADIUS).points @ turn.T
    other = nearest_path(Path2D.of(ZIGZAG.points @ turn.T), A, RADIUS).points
    assert other == pytest.approx(one, abs=1e-5)


def test_closed_paths_close_without_a_kink() -> None:
    found = nearest_path(polygon(4, 3.0), A, RADIUS / 0.85)
    steps = np.diff(np.concatenate([found.points, found.points[:2]]), axis=0)
    turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    assert found.closed
    assert abs(turns[-1]) < 0.05


def test_a_drifting_robot_gets_a_path_that_it_can_follow() -> None:
    drift = Drift(0.3, (0.1, 0.0))
    found = nearest_path(polygon(4, 4.0), A, RADIUS / 0.8, drift=drift)
    assert sharpest(found, drift) < 0.95


@pytest.mark.parametrize(("corners", "side"), [(4, 2.0), (4, 2.5), (3, 2.5), (3, 3.0)])
@pytest.mark.parametrize("room", [0.85, 0.7, 0.55])
def test_a_lap_ends_as_it_begins_however_small(corners: int, side: float, room: float) -> None:
    """Laps whose ends did not meet had a kink there, and were refused as too tight."""
    found = nearest_path(polygon(corners, side), A, RADIUS / room)
    assert sharpest(found) < 1.2 * room


def test_a_closed_path_that_is_begun_elsewhere_gives_the_same_lap() -> None:
    square = polygon(4, 2.0).polyline()
    begun = Path2D.of(np.concatenate([square[1:], square[1:2]]))
    one, other = (nearest_path(raw, A, RADIUS / 0.85) for raw in (polygon(4, 2.0), begun))
    assert max(two_sided(one.polyline(), other.polyline())) < 0.02


def test_a_time_weight_saves_way_and_costs_distance() -> None:
    raw = polygon(4, 3.0)
    found = [nearest_path(raw, A, RADIUS / 0.85, time_weight=weight) for weight in (0.0, 0.03, 0.1, 0.3)]
    ways = [reference(path, A, 0.02).arc[-1] for path in found]
    assert ways == sorted(ways, reverse=True)
    assert ways[-1] < 0.95 * ways[0]
    assert off(found[0], raw) < off(found[2], raw) < off(found[3], raw)
    assert all(sharpest(path) < 1.0 for path in found)
