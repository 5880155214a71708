"""Robots of a fleet keep apart: predicted, with random errors, in the simulator, and under trackers."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planner.jobs.fleet import NoTimingError, Priorities, fleet
from planner.jobs.fleet_plan import FleetPlan
from planner.jobs.plan import make_plan
from planner.jobs.separation import Places, Scheduled, TimedMotion, distances, instants, too_near
from planner.paths.obstacles import Circle, Footprint, FreeSpace
from planner.paths.path import Path2D
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest
from planner.tracking.swim import swim
from planner.tracking.tracker import Tracker
from planner.vehicle.tracked_point import tracked_vehicle
from planner.vehicle.vehicle import Switches, roll_out
from sim.io.errors import InputError
from sim.motion.replay import replay
from tests.planner.plans import CONTROL, LINE, planned
from tests.planner.vehicles import FINE
from tests.shared import shared

pytestmark = pytest.mark.slow

BODY = Footprint(np.array([0.02, -0.13]), 0.02)
TAIL = CONTROL.tail_length
APART = 0.3 * TAIL
FAR = [((20.0 + 4 * k, 20.0), (21.0 + 4 * k, 20.0)) for k in range(4)]
Motion = tuple[str, int]  # a place, and an hour at it


def straight(*points: tuple[float, float], **options: Any) -> Plan:
    return planned(points, **{"objective": "flips", **options})


def crossing(**options: Any) -> list[Plan]:
    """Return plans of two robots that would meet, each with a way of 3 l."""
    return [straight((0, 0), (3, 0), **options), straight((1.0, -1.9), (1.0, 2.2), **options)]


def keep_apart(plans: list[Plan], **options: Any) -> FleetPlan:
    return fleet(plans, options.pop("apart", APART) / TAIL, names="abcdef"[: len(plans)], **options)


@shared
def two() -> FleetPlan:
    return keep_apart(crossing())


def least_between(fleet_plan: FleetPlan, poses: list[Any], times: np.ndarray) -> float:
    """Compute the least distance [m] of two bodies from their poses in l at times in s."""
    places = [
        Places(each.motion.body, pose * [TAIL, TAIL, 1.0], np.zeros(len(times)))
        for each, pose in zip(fleet_plan.scheduled, poses, strict=True)
    ]
    return float(distances(*places).min())


def test_robots_that_would_meet_keep_apart() -> None:
    pair = two()
    plans = crossing()
    together = [Scheduled(each.motion, 0.0) for each in keep_apart(plans, apart=1e-6).scheduled]
    times = instants(together)
    assert distances(*(each.places(times) for each in together)).min() < APART
    assert pair.sure_m >= APART
    assert pair.nearest.distance_m > pair.sure_m
    assert pair.circles == (0, 0)
    assert min(pair.begin_s) == 0 < max(pair.begin_s)
    assert pair.plans[0].to_dict()["id"] == plans[0].to_dict()["id"]


def test_the_later_robot_does_not_wait_longer_than_it_must() -> None:
    first, second = (two().scheduled[k] for k in two().order)
    for earlier in (0.93, 0.6):
        sooner = Scheduled(second.motion, earlier * second.begin)
        times = instants([first, sooner])
        one, other = first.places(times), sooner.places(times)
        assert (distances(one, other) - one.error - other.error).min() < APART


@pytest.mark.rest
def test_a_robot_that_must_leave_its_start_circles_on_its_way() -> None:
    passing = straight((-1.0, -3.0), (-1.0, 3.5))  # over the start of the last one
    across = straight((3.2, -2.8), (3.2, 3.5))
    waiting = straight((0, 0), (6, 0))
    result = keep_apart([passing, across, waiting])
    assert result.order == (0, 1, 2)
    assert result.circles == (0, 0, 1)
    assert result.sure_m >= APART
    assert result.plans[2].duration > waiting.duration + 100


def test_other_orders_of_priority_are_tried() -> None:
    ends_on_the_way = straight((0, 2.5), (0, 0))  # its end blocks the other one, which must pass before
    passes = straight((-2.5, -0.5), (3.5, -0.5))
    result = keep_apart([ends_on_the_way, passes])
    assert result.order == (1, 0)
    assert result.begin_s[0] > 0
    assert result.sure_m >= APART


def test_of_five_robots_three_that_end_on_the_way_of_the_fourth_give_way() -> None:
    ends_on_the_way = [straight((2 * k, 1.5), (2 * k, 0.1)) for k in range(3)]
    passes, far = straight((-2, 0), (7, 0)), straight(*FAR[0])
    result = keep_apart([*ends_on_the_way, passes, far])
    assert result.begin_s[3:] == (0, 0)
    assert min(result.begin_s[:3]) > 0
    assert result.sure_m >= APART


def test_robots_far_away_change_nothing() -> None:
    far = keep_apart([*crossing(), *(straight(*way) for way in FAR)])
    assert far.begin_s == (*two().begin_s, 0, 0, 0, 0)


@pytest.mark.rest
def test_waiting_circles_keep_clear_of_walls() -> None:
    passing, across = straight((-1.0, -3.0), (-1.0, 3.5)), straight((3.2, -2.8), (3.2, 3.5))
    tracked = tracked_vehicle(CONTROL, None, "head_centre", None)
    rock = FreeSpace((Circle(1.0, 1.3, 0.3),))
    waiting = make_plan(Path2D.of(LINE), tracked, PlanRequest(space=rock))
    result = keep_apart([passing, across, waiting])
    kept = result.plans[2].kept_clear
    assert kept is not None
    assert result.circles[2] >= 1
    assert min(kept.clearance, kept.margin) >= result.plans[2].stated_error


@pytest.mark.parametrize(
    ("paths", "expected"),
    [
        ([((0, 0), (3, 0)), ((0, 0.6), (3, 0.6))], "a and b start [0-9]"),
        ([((0, 0), (3, 0)), ((0, 3), (3.5, 0.3))], "a and b end"),
        ([((-3, 0), (2.5, 0)), ((3.6, 0), (-1, 0))], "b ends on the way of a"),
        pytest.param(
            [((0, 0), (5, 0)), ((5.5, 0.1), (-1.5, 0.1))], "whichever of them waits", marks=pytest.mark.rest
        ),
        pytest.param(
            [FAR[0], ((-3, 0), (3, 0)), *FAR[1:], ((4, 0), (-1, 0))],
            "^b and f cannot keep 3.3 cm apart, whichever",
            marks=pytest.mark.rest,
        ),
    ],
    ids=["starts", "ends", "on the way", "waits", "far ones"],
)
def test_it_says_which_two_cannot_keep_apart(paths: list[Any], expected: str) -> None:
    with pytest.raises(NoTimingError, match=expected) as refusal:
        keep_apart([straight(*points) for points in paths])
    assert len(str(refusal.value).splitlines()) == 1


def test_bad_distances_and_single_robots_are_refused() -> None:
    for apart in (float("nan"), -0.1, float("inf")):
        with pytest.raises(InputError, match="distance"):
            keep_apart(crossing(), apart=apart)
    with pytest.raises(InputError, match="2 to 12"):
        keep_apart(crossing()[:1])


def test_ninety_five_per_cent_of_random_robots_keep_within_the_error_in_place() -> None:
    motion = two().scheduled[1].motion
    made = motion.plan
    times = np.concatenate([[0.0], np.cumsum(made.seconds)])
    rng, held = np.random.default_rng(0), []
    error, expected = motion.error(times), motion.body.centres(motion.poses(times))
    for _ in range(100):
        robot = made.tracked.vehicle.drawn(rng)
        poses = roll_out(robot, Switches(made.first_direction, made.dwells, made.poses)).flips
        ends = motion.body.centres(poses * [TAIL, TAIL, 1.0])
        off = np.hypot(*np.moveaxis(ends - expected, -1, 0)).max(1)
        held.append((off <= error + 1e-12).all())
    assert 0.9 <= np.mean(held) <= 1.0


def test_they_keep_apart_in_the_simulator() -> None:
    pair = two()
    tracks = [replay(each.schedule()) for each in pair.plans]
    times = np.arange(0.0, pair.duration_s, 0.5)
    poses = [
        np.stack([np.interp(times - begin, track["time_s"], track[name])
                  for name in ("x_over_l", "y_over_l", "heading_rad")], 1)
        for begin, track in zip(pair.begin_s, tracks, strict=True)
    ]  # fmt: skip
    assert least_between(pair, poses, times) >= pair.sure_m


@pytest.mark.rest
def test_robots_under_trackers_keep_apart() -> None:
    result = keep_apart(crossing(camera=FINE, objective="error"), feedback=True)
    rng = np.random.default_rng(3)
    for _ in range(3):
        tracks = []
        for each in result.scheduled:
            made = each.motion.plan
            robot = replace(made.tracked.vehicle.drawn(rng, 0.7), current=np.array([2e-5, -2e-5]))
            tracks.append(swim(Tracker(made, noise=(0.005, 0.005)), robot, replace(FINE, seed=rng)))
        scale = CONTROL.time_scale
        times = np.arange(0.0, result.duration_s, 1.0)
        poses = [
            np.stack([np.interp(times - begin, scale * track.times, column) for column in track.poses.T], 1)
            for begin, track in zip(result.begin_s, tracks, strict=True)
        ]
        assert least_between(result, poses, times) >= result.apart_m
        assert all(track.finished for track in tracks)


def random_places(rng: np.random.Generator, count: int) -> Places:
    poses = np.stack([*rng.uniform(-0.4, 0.4, (2, count)), rng.uniform(-4, 4, count)], 1)
    return Places(BODY, poses, rng.uniform(0, 0.02, count))


def test_distances_of_lines_are_those_of_their_points() -> None:
    rng = np.random.default_rng(0)
    first, second = random_places(rng, 200), random_places(rng, 200)
    along = Footprint(np.linspace(-0.13, 0.02, 401), 0.02)
    points, others = along.centres(first.poses), along.centres(second.poses)
    sampled = np.array(
        [math.sqrt(((a[:, None] - b) ** 2).sum(-1).min()) for a, b in zip(points, others, strict=True)]
    )
    between = distances(first, second) + 2 * BODY.radius
    assert between == pytest.approx(sampled, abs=0.001)
    assert (between == 0).sum() > 3
    assert (between <= sampled + 1e-12).all()


def test_the_table_of_pairs_agrees_with_the_distances() -> None:
    rng = np.random.default_rng(1)
    first, second = random_places(rng, 250), random_places(rng, 40)
    table = too_near(first, second, 0.05)
    for j in range(40):
        one = Places(BODY, np.repeat(second.poses[j : j + 1], 250, 0), np.full(250, second.error[j]))
        near = distances(first, one) - first.error - one.error < 0.05
        assert (table[:, j] == near).all()
    assert 0.1 < table.mean() < 0.9


def test_the_body_covers_head_and_tails() -> None:
    body, discs = TimedMotion(crossing()[0], False).body, Footprint.of(CONTROL, 0.0)
    assert body.places == pytest.approx(TAIL * discs.places[[-1, 0]])
    assert body.radius == pytest.approx(TAIL * discs.radius)


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


@pytest.mark.parametrize("stubborn", [0, 4, 9])
def test_a_robot_that_cannot_wait_goes_before_all(stubborn: int) -> None:
    found = Hours("a" * 10, {stubborn: [0]}).search().resolve()
    assert found is not None
    assert found.motions[stubborn] == ("a", 0)
    assert len(set(found.motions)) == 10
    assert found.order[0] == stubborn


def test_two_that_can_never_keep_apart_end_the_search() -> None:
    search = Hours("a" * 8 + "bb", {8: [3], 9: [3]}).search()
    assert search.resolve() is None
    assert search.impossible == (9, 8)


def test_it_ends_after_as_many_timings_as_allowed() -> None:
    search = Hours("a" * 6, {k: [0, 1, 2, 3, 4] for k in range(6)}).search(most=50)
    assert search.resolve() is None
    assert search.impossible is None
    assert search.tried == 50
