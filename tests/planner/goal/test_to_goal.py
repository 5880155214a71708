"""From a pose to a pose: it ends at the goal, in nearly the least time, around obstacles; routes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from common.arrays import Floats
from common.errors import InputError
from planner.goal.route import COURSES, Lattice, NoWayError, RouteLimits, route
from planner.paths.dubins import TURNS, DubinsPaths, segment_lengths, shortest_paths
from planner.paths.obstacles import Circle, Footprint, FreeSpace, Polygon
from planner.paths.tractrix import STILL
from planner.planning.plan import Plan
from planner.vehicle.vehicle import Switches, roll_out
from sim.knowledge import CalibrationKnowledge
from sim.mechanics import planar
from sim.model.presets import PRESETS
from sim.motion.replay import replay
from softflagella import to_goal
from tests.oracles.quickest import brute_force
from tests.planner.plans import BIASED, CONTROL, hindered_trip, own_table, trip

pytestmark = pytest.mark.slow

BOX = [[-2, -4], [9, -4], [9, 4], [-2, 4]]
REST = pytest.mark.rest


def check_end(goal_plan: Plan) -> None:
    """Check that the schedule, carried out anew from the start that was asked for, ends at the goal."""
    plan, goal = goal_plan, goal_plan.job.goal
    switches = Switches(plan.first_direction, plan.dwells, np.array([plan.start]))
    end = roll_out(plan.tracked.vehicle, switches).flips[-1]
    assert end[:2] == pytest.approx(goal[:2], abs=1e-3)
    assert math.cos(end[2] - goal[2]) > 1 - 1e-6
    assert max(goal_plan.job.end_error) < 1e-3
    assert plan.dwells.min() >= plan.minimum_dwell * (1 - 1e-9)


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=REST) for seed in (0, 2, 3, 4, 5))])
def test_the_motion_begins_and_ends_as_asked(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, goal = (rng.uniform([-2, -2, -3], [2, 2, 3]).tolist() for _ in range(2))
    goal_plan = to_goal(start, goal, CONTROL, objective=("time", "error")[seed % 2])
    assert goal_plan.start == pytest.approx(tuple(start))
    check_end(goal_plan)
    if seed == 1:  # whose track is followed closely: the last dwells keep to it, too
        assert goal_plan.predicted_max < 2 * goal_plan.straight.largest


@pytest.mark.rest
@pytest.mark.parametrize("seed", [2, 6])
def test_time_is_within_5_percent_of_brute_force(seed: int) -> None:
    x, y, heading = np.random.default_rng(seed).uniform([-4, -4, -np.pi], [4, 4, np.pi]).tolist()
    goal = (x, y, heading)
    goal_plan = to_goal((0, 0, 0), goal, CONTROL)
    assert goal_plan.duration < 1.05 * brute_force(goal_plan.tracked.vehicle, goal)


def test_moved_and_mirrored_tasks_give_moved_and_mirrored_plans() -> None:
    """One task is moved and mirrored: about the x axis, then by a frame. The guaranteed bound is for paths."""
    one, frame = trip(), np.array([3.0, -1.0, 0.7])
    check_end(one)
    assert one.errors.guaranteed is None
    goal = planar.compose(frame, np.array(one.job.goal) * [1, -1, -1])
    other = to_goal(frame.tolist(), goal.tolist(), CONTROL, objective="flips")
    assert other.dwells == pytest.approx(one.dwells, rel=1e-4)
    assert other.first_direction == -one.first_direction


def test_a_robot_that_turns_unequally_in_a_current_arrives() -> None:
    drifting = CalibrationKnowledge(current=(2e-5, -1e-5))
    task = {"lookup": own_table(), "knowledge": drifting, "objective": "flips"}
    goal_plan = to_goal((0, 0, 0.3), (1.2, 0.5, -0.6), BIASED, **task)  # type: ignore[arg-type]
    assert np.abs(goal_plan.tracked.vehicle.current).max() > 0
    check_end(goal_plan)


def test_a_shortest_dwell_in_seconds_holds_to_the_end() -> None:
    goal_plan = to_goal((0, 0, 0), (0.8, 0.2, 0.3), CONTROL, objective="error", minimum_seconds=7.0)
    assert goal_plan.seconds.min() >= 7.0 * (1 - 1e-9)
    check_end(goal_plan)


def test_it_passes_places_and_the_margin_around_obstacles_is_the_stated_error() -> None:
    goal_plan = hindered_trip()
    check_end(goal_plan)
    for place in goal_plan.job.via:
        assert np.hypot(*(goal_plan.declared.reference.q - place).T).min() < 0.02
    assert goal_plan.stated_error <= goal_plan.kept_clear.margin
    assert goal_plan.kept_clear.clearance > 0
    assert goal_plan.job.length > 1.02 * 3


@pytest.mark.rest
def test_a_narrow_gap_is_passed_with_shorter_dwells() -> None:
    """With four tails: with two, the phase of the disc makes the stated error wider than the gap."""
    robot = PRESETS["paper-triangle"]
    gate = [Polygon.of([[2, low], [2.5, low], [2.5, high], [2, high]]) for low, high in ((-4, -0.3), (0.3, 4))]
    goal_plan = to_goal((0, 0, 0), (6, 0, 0), robot, keep_out=gate, walls=BOX)
    wide = to_goal((0, 0, 0), (6, 0, 0), robot, walls=BOX)
    assert goal_plan.stated_error < 0.6 * wide.stated_error
    assert len(goal_plan.dwells) > len(wide.dwells)


@pytest.mark.rest
def test_a_replay_in_the_simulator_stays_out() -> None:
    """Behind three circles between start and goal."""
    rng = np.random.default_rng(3)
    start, goal = (0, *rng.uniform(-1, 1, 2).tolist()), (6.5, rng.uniform(-1, 1), rng.uniform(-3, 3))
    circles = [Circle(*rng.uniform([1.8, -1.5, 0.3], [4.2, 1.5, 0.8]).tolist()) for _ in range(3)]
    goal_plan = to_goal(start, goal, CONTROL, keep_out=circles, walls=BOX)
    poses = replay(goal_plan.schedule())[["x_over_l", "y_over_l", "heading_rad"]].to_numpy(float)
    assert goal_plan.kept_clear is not None
    assert Footprint.of(CONTROL, 0.0).clearance(poses, goal_plan.kept_clear.free_space).min() > 0
    x, y, turned = poses[-1] - goal_plan.job.goal
    assert np.hypot(x, y) < goal_plan.stated_error
    assert abs(math.remainder(turned, math.tau)) < 0.1


@pytest.mark.parametrize(
    ("start", "goal", "options", "expected"),
    [
        ((0, 0, 0), (5, 0, 0), {"keep_out": [Circle(0.2, 0, 0.5)]}, r"at the start, .* what it must keep out of"),
        ((0, 0, 0), (5, 0), {}, "goal: give x, y and heading"),
        ((0, math.nan, 0), (5, 0, 0), {}, "as finite numbers"),
        ((1, 1, 0.5), (1, 1, 0.5), {}, "start and goal are the same"),
        (
            (0, 0, 0),
            (0.5, 0, 0),
            {"tolerance": 0.001, "minimum_dwell": 3.0},
            r"tolerance 0.11 mm \(0.001 l\) cannot be kept",
        ),
        ((0, 0, 0), (4, 1, 90), {}, r"goal: a heading of 90 is more than one turn; .* math\.radians\(90\)"),
        ((0, 0, -30), (4, 1, 0), {}, "start: a heading of -30"),
    ],
    ids=["start", "heading", "number", "same", "tolerance", "degrees", "start in degrees"],
)
def test_refusals(start: Any, goal: Any, options: dict[str, Any], expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        to_goal(start, goal, CONTROL, **options)


RADIUS = 0.37
BODY = Footprint(np.linspace(-0.3, 1.0, 8), 0.2)


def poses(rng: np.random.Generator, count: int) -> Floats:
    return rng.uniform([-2, -2, -4], [2, 2, 4], (count, 3))


@pytest.mark.parametrize("word", range(6))
def test_every_word_ends_at_its_goal(word: int) -> None:
    rng = np.random.default_rng(word)
    start, goal = poses(rng, 400), poses(rng, 400)
    pieces = segment_lengths(start, goal, RADIUS)[:, word]
    exists = np.isfinite(pieces.sum(-1))
    assert exists.sum() > 40
    tracks = DubinsPaths(start[exists], np.repeat(TURNS[word][None], exists.sum(), 0), pieces[exists], RADIUS)
    missed = tracks.ends - goal[exists]
    missed[:, 2] = (missed[:, 2] + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(missed).max() < 1e-9


def test_no_random_track_is_shorter() -> None:
    """Random tracks of arcs and straight lines: the best word reaches their ends at least as soon."""
    rng = np.random.default_rng(7)
    start = poses(rng, 3000)
    end, length = start, np.zeros(3000)
    for _ in range(4):
        turn, piece = rng.integers(-1, 2, (3000, 1)), rng.uniform(0, 1, (3000, 1))
        track = DubinsPaths(end, np.repeat(turn, 3, 1), np.concatenate([piece, 0 * piece, 0 * piece], 1), RADIUS)
        end, length = track.ends, length + piece[:, 0]
    assert (shortest_paths(start, end, RADIUS).length <= length + 1e-9).all()


def stop(*pose: float) -> Floats:
    return np.array([pose])


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.rest) for seed in range(1, 4))])
def test_a_route_keeps_its_distance_and_its_radius(seed: int) -> None:
    rng = np.random.default_rng(seed)
    circles = tuple(Circle(x, y, 0.5) for x, y in rng.uniform([1.5, -2], [4.5, 2], (3, 2)))
    limits = RouteLimits(RADIUS, BODY, FreeSpace(circles), STILL)
    found = route([stop(0, 0, 0), stop(6.5, 0, 1.0)], limits, 0.1, {}, CONTROL)
    track = found.chain(0.01)
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
    first = segment_lengths(ends[0], one, RADIUS).sum(-1).min(-1)
    middle = segment_lengths(one[:, None], other[None], RADIUS).sum(-1).min(-1)
    last = segment_lengths(other, ends[1], RADIUS).sum(-1).min(-1)
    assert found.total <= (first[:, None] + middle + last).min() + 1e-3
    for place in places:
        assert np.hypot(*(found.chain(0.005)[:, :2] - place).T).min() < 0.005


@pytest.mark.parametrize("gap", [1.4, 0.3])
def test_a_wall_without_a_gap_leaves_no_way(gap: float) -> None:
    room = [[-1, -2], [4.5, -2], [4.5, 2], [-1, 2]]
    walls = [[[1.5, low], [2, low], [2, high], [1.5, high]] for low, high in ((-2, -gap / 2), (gap / 2, 2))]
    limits = RouteLimits(RADIUS, BODY, FreeSpace(tuple(map(Polygon.of, walls)), Polygon.of(room)), STILL)
    ends = [stop(0, 0, 0), stop(3, 0, 0)]
    if gap > 1:
        assert route(ends, limits, 0.05, {}, CONTROL).total == pytest.approx(3.0, rel=0.05)
        return
    leaves = r"there is no way to the goal that leaves 5\.5 mm \(0\.05 l\) .* 4\.07 cm \(0\.37 l\)"
    with pytest.raises(NoWayError, match=leaves):
        route(ends, limits, 0.05, {}, CONTROL)


def test_a_goal_inside_a_region_is_refused_with_the_distance() -> None:
    limits = RouteLimits(RADIUS, BODY, FreeSpace((Circle(5, 0, 1),)), STILL)
    with pytest.raises(NoWayError, match=r"at the goal, .*55\.00, 0\.00.* inside .*; it needs 1\.1 cm"):
        route([stop(0, 0, 0), stop(5, 0, 0)], limits, 0.1, {}, CONTROL)


def test_a_lattice_needs_four_bytes_a_joint_and_finds_the_ways_of_a_plain_search() -> None:
    """Memory is counted in arrays; the plain search joins the poses one after another."""
    rng = np.random.default_rng(3)
    circles = [Circle(float(x), float(y), 0.4) for x, y in rng.uniform([1, -3], [9, 3], (12, 2))]
    space = FreeSpace(
        (*circles, Polygon.of([[4, -6], [5, -6], [5, -4]])), Polygon.of([[-3, -8], [13, -8], [13, 8], [-3, 8]])
    )
    limits = RouteLimits(1.0, Footprint(np.array([-0.3, 0.0, 0.3]), 0.15), space, STILL)
    lattice = Lattice(limits, *np.array([[0.0, -4.0], [10.0, 4.0]]), 0.6, 16)
    room = next(part for part in vars(lattice).values() if getattr(part, "dtype", None) == np.float32)
    others = sum(
        part.nbytes for part in vars(lattice).values() if isinstance(part, np.ndarray) and part is not room
    )
    assert room.nbytes == 4 * room.size
    assert others < room.nbytes

    distance = lattice.map.table
    x, y = (lattice.map._low[i] + lattice.map.step * np.arange(distance.shape[i]) for i in (0, 1))
    points = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    assert np.array_equal(distance, space.distance(points).reshape(distance.shape))

    start, goals, margin = np.array([[0.5, 0.1, 0.2]]), np.array([[9.4, 0.3, 0.1], [5.1, 3.1, 2.0]]), 0.1
    costs, ways = lattice.ways(start, np.zeros(1), goals, margin)
    assert np.isfinite(costs).all()
    for cost, way, goal in zip(costs.tolist(), ways, goals, strict=True):
        assert np.array_equal(way[[0, -1]], [start[0], goal])
        tracks = shortest_paths(way[:-1], way[1:], 1.0)
        assert cost == pytest.approx(tracks.total, abs=1e-4 * len(way))  # lengths are counted in grains
        assert limits.free(tracks, margin, lattice.map).all()
    # A track is free where each of its places is, however many are looked at first.
    poses = np.column_stack([rng.uniform([0, -4], [10, 4], (400, 2)), rng.uniform(0, 6, 400)])
    tracks = shortest_paths(poses[:200], poses[200:], 1.0)
    free, step = limits.free(tracks, margin, step=0.02), 0.05
    for one, is_free in enumerate(free.tolist()):
        places = tracks.take(np.array([one])).chain(step)
        clear = limits.clearance(places).min()
        assert clear >= margin - 0.1 * step if is_free else clear < margin + step
