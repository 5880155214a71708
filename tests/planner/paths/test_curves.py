"""Curves: smoothing, rounded corners, the tractrix, distances, and the nearest path that can be followed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import InputError
from planner.jobs.plan import plan
from planner.paths.distance import distance_to, nearest, two_sided
from planner.paths.nearest_path import nearest_path
from planner.paths.path import Path2D, circle, polygon, resample, smoothed
from planner.paths.tractrix import STILL, Drift, Reference, closest, reference
from planner.planning.declare import fillet, largest_fillet
from tests.planner.plans import CONTROL


def test_smoothing_takes_camera_noise_out_and_says_what_it_moves() -> None:
    rng = np.random.default_rng(0)
    clean = circle(2.0)
    noisy = Path2D.of(clean.points + 0.02 * rng.normal(size=clean.points.shape), closed=True)
    found, moved = smoothed(noisy, 0.5)
    assert np.abs(np.hypot(*found.points.T) - 2.0).max() < 0.03
    assert 0.01 < moved < 0.15
    assert plan(found, CONTROL).declared.missed < 0.05
    with pytest.raises(InputError, match="smoothing over"):
        smoothed(noisy, -1.0)


def test_an_open_path_keeps_its_ends() -> None:
    found, _ = smoothed(Path2D.of([[0, 0], [2, 0], [2, 3]]), 0.4)
    assert found.points[[0, -1]] == pytest.approx(np.array([[0.0, 0.0], [2.0, 3.0]]))


def test_the_last_bit_of_a_length_does_not_choose_the_number_of_points() -> None:
    for length in (12.0, np.nextafter(12.0, 0.0), np.nextafter(12.0, 20.0)):
        assert len(resample(np.array([[0.0, 0.0], [length, 0.0]]), 0.02)) == 601


def test_fillet_keeps_edges_and_radius() -> None:
    square = polygon(4, 3.0)
    assert largest_fillet(square) == pytest.approx(1.5)
    rounded = fillet(square, 0.5)
    assert rounded.length == pytest.approx(12 - 8 * 0.5 + math.pi, rel=1e-3)
    assert distance_to(square.polyline(), rounded.points).max() == pytest.approx(
        0.5 * (1 - math.sqrt(0.5)), rel=1e-2
    )


def test_tractrix_of_a_circle() -> None:
    """The pivot settles on a circle of radius √(ρ² − a²)."""
    ref = reference(circle(2.0), 0.87, 0.005)
    assert np.linalg.norm(ref.q, axis=1) == pytest.approx(np.full(len(ref.q), math.sqrt(4 - 0.87**2)), rel=1e-3)
    assert ref.curvature[5:-5] == pytest.approx(1 / math.sqrt(4 - 0.87**2), rel=0.05)


def test_tractrix_of_a_kink_decays_exponentially() -> None:
    """Behind a kink of angle α: tan(δ/2) = tan(α/2) exp(−s/a)."""
    path = Path2D.of([[0, 0], [1, 0], [1, 3]])
    ref = reference(path, 0.5, 0.01)
    after = ref.p[:, 1] > 1e-9
    s = ref.p[after, 1]
    expected = math.pi / 2 - 2 * np.arctan(np.exp(-s / 0.5))
    assert ref.heading[after] == pytest.approx(expected, abs=0.01)


def all_with_all(polyline: np.ndarray, points: np.ndarray) -> np.ndarray:
    start, along = polyline[:-1], np.diff(polyline, axis=0)
    away = points[:, None] - start
    share = np.clip((away * along).sum(-1) / np.maximum((along**2).sum(-1), 1e-300), 0, 1)
    return np.asarray(np.hypot(*np.moveaxis(away - share[..., None] * along, -1, 0)).min(1))


@given(st.integers(0, 10_000), st.integers(2, 60), st.floats(0.01, 30.0))
@settings(max_examples=150, deadline=None)
def test_distances_are_exact(seed: int, count: int, spread: float) -> None:
    """Any polyline: short and long steps, crossings, hairpins, points near and far."""
    rng = np.random.default_rng(seed)
    polyline = np.cumsum(rng.normal(size=(count, 2)) * 10 ** rng.uniform(-2, 1, (count, 1)), 0)
    if seed % 3 == 0:
        polyline = np.concatenate([polyline, polyline[::-1]])
    points = polyline[rng.integers(count, size=30)] + spread * rng.normal(size=(30, 2))
    assert distance_to(polyline, points) == pytest.approx(all_with_all(polyline, points), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("away", "count"), [(1e4, 40), (1e5, 40), (1e7, 40), (1.0, 20_000)])
def test_points_far_away_and_more_points_than_a_block_holds(away: float, count: int) -> None:
    """Where distances are so large that TIE is less than their last bit."""
    rng = np.random.default_rng(3)
    line = away * np.array([1.0, 0.7]) + np.cumsum(rng.normal(size=(10, 2)), axis=0)
    points = away * rng.normal(size=(count, 2))
    found, segment, share = nearest(line, points)
    assert found == pytest.approx(all_with_all(line, points), rel=1e-9, abs=1e-9)
    foot = line[segment] + share[:, None] * (line[segment + 1] - line[segment])
    assert np.hypot(*(foot - points).T) == pytest.approx(found, rel=1e-9, abs=1e-9)


def test_a_missed_corner_is_seen_from_the_other_side() -> None:
    square = np.array([[0, 0], [2, 0], [2, 2], [0, 2], [0, 0]], dtype=float)
    angle = np.linspace(0, 2 * np.pi, 400)
    inscribed = 1 + np.stack([np.cos(angle), np.sin(angle)], 1)
    off, missed = two_sided(inscribed, square)
    assert off == pytest.approx(1 - np.sqrt(0.5), rel=1e-2)
    assert missed == pytest.approx(np.sqrt(2) - 1, rel=1e-2)


def test_of_equally_near_segments_the_first_counts() -> None:
    """Outside a corner both sides are equally near; the sides of a hairpin are, too."""
    angle = np.linspace(0, 2 * np.pi, 13)
    ring = np.stack([np.cos(angle), np.sin(angle)], 1)
    _, segment, share = nearest(ring, 2 * ring[1:-1])
    assert segment.tolist() == list(range(11))
    assert share == pytest.approx(np.ones(11))
    hairpin = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    assert nearest(hairpin, np.array([[0.3, 1.0], [1.5, -0.2]]))[1].tolist() == [0, 1]


A, RADIUS = 0.87, 0.37
ZIGZAG = Path2D.of([[0, 0], [3, 0], [3, 3], [6, 3], [4.5, 0.0], [8, 0]])


def off(path: Path2D, raw: Path2D) -> float:
    return float(np.sqrt(np.mean(distance_to(raw.polyline(), reference(path, A, 0.01).p) ** 2)))


def sharpest(path: Path2D, drift: Drift = STILL) -> float:
    return float(np.abs(reference(path, A, 0.02, drift).curvature).max()) * RADIUS


@pytest.mark.parametrize("raw", [polygon(4, 3.0), polygon(3, 4.0), ZIGZAG], ids=["square", "triangle", "zigzag"])
def test_it_is_nearer_than_rounded_corners_or_has_a_smaller_largest_distance(raw: Path2D) -> None:
    one, other = (nearest_path(raw, A, RADIUS / 0.85, minimax=minimax) for minimax in (False, True))
    assert max(sharpest(one), sharpest(other)) < 1.0
    radii = np.linspace(0.05, 1.4, 28)
    followed = next(r for r in radii.tolist() if sharpest(fillet(raw, r)) < 0.95)
    assert off(one, raw) < 0.7 * off(fillet(raw, followed), raw)
    assert max(two_sided(other.polyline(), raw.polyline())) < 0.95 * max(two_sided(one.polyline(), raw.polyline()))
    assert off(one, raw) < off(other, raw) < 2 * off(one, raw)


@pytest.mark.parametrize("rod", [0.0, 1e-4, 0.005, 0.02, 0.1])
def test_a_pivot_near_its_point_turns_as_the_arc_does_not_as_its_chords(rod: float) -> None:
    apart = closest(rod, 0.02)
    for found in (nearest_path(polygon(4, 9.0), rod, 1.2, apart=apart), fillet(polygon(4, 9.0), 1.2, apart)):
        assert reference(found, rod, 0.02).sharpness.max() == pytest.approx(1 / 1.2, rel=0.15)


@pytest.mark.parametrize("rod", [0.0, 1e-4, 0.01, 0.9])
def test_a_drift_leans_any_rod_by_the_same_angle(rod: float) -> None:
    straight = reference(Path2D.of([[0, 0], [9, 0]]), rod, 0.02, Drift(0.1))
    assert straight.heading == pytest.approx(-math.atan(0.1), abs=1e-3)


def test_a_path_that_can_be_followed_is_left_as_it_is() -> None:
    found = nearest_path(circle(2.0), A, RADIUS)
    assert max(two_sided(found.polyline(), circle(2.0).polyline())) < 2e-3


def test_more_room_gives_a_nearer_path() -> None:
    tight, wide = (off(nearest_path(polygon(4, 3.0), A, r), polygon(4, 3.0)) for r in (RADIUS, 0.6 * RADIUS))
    assert wide < 0.7 * tight


def test_turned_and_mirrored_paths_give_turned_and_mirrored_results() -> None:
    c, s = math.cos(0.7), math.sin(0.7)
    turn = np.array([[c, -s], [s, c]]) @ np.diag([1.0, -1.0])
    one = nearest_path(ZIGZAG, A, RADIUS).points @ turn.T
    other = nearest_path(Path2D.of(ZIGZAG.points @ turn.T), A, RADIUS).points
    assert other == pytest.approx(one, abs=1e-5)


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


def test_parts_of_a_reference_are_joined_to_the_same_one() -> None:
    """A closed one begins elsewhere, and goes on for a lap and a half; whole turns go on, too."""
    ring = reference(circle(2.0), 0.9, 0.02)
    cut = Reference.joined(ring.part(0, 100), replace(ring.part(100), heading=ring.heading[100:] - 4 * math.pi))
    assert cut.heading == pytest.approx(ring.heading)
    assert cut.arc == pytest.approx(ring.arc)
    later = ring.begun_at(100)
    assert later.closed
    assert later.q[[0, -1]] == pytest.approx(np.array([ring.q[100], ring.q[100]]))
    assert later.turn == ring.turn == pytest.approx(2 * math.pi)
    longer = ring.laps(2, ring.arc[-1] / 2)
    assert longer.arc[-1] == pytest.approx(2.5 * ring.arc[-1], abs=0.03)
    assert np.abs(np.diff(longer.heading)).max() < 0.05
    assert longer.heading[-1] - ring.heading[0] == pytest.approx(5 * math.pi, abs=0.05)


def test_a_track_of_the_pivot_leads_to_the_path_whose_tractrix_it_is() -> None:
    bend = reference(Path2D.of([[0, 0], [2, 0], [3, 1]]), 0.9, 0.02)
    again = Reference.of_pivot(
        np.column_stack([bend.q, bend.heading]), 0.9, Drift(), bend.heading[0] + 2 * math.pi
    )
    assert again.p == pytest.approx(bend.p)
    assert again.heading == pytest.approx(bend.heading + 2 * math.pi)
    assert again.first_turn == bend.first_turn == 1
