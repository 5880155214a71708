"""Robots of a fleet keep apart: predicted, with random errors, in the simulator, and under trackers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planner.jobs.clear_plan import plan_clear
from planner.jobs.fleet import Member, NoTimingError, fleet
from planner.jobs.fleet_plan import FleetPlan
from planner.jobs.separation import Places, Scheduled, distances, instants
from planner.paths.obstacles import Circle, FreeSpace
from planner.paths.path import Path2D
from planner.planning.camera import DOCUMENTED, Camera
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.tracking.swim import swim
from planner.tracking.tracker import Tracker
from planner.vehicle.rollout import Switches, poses_at_flips
from planner.vehicle.tracked_point import tracked_vehicle
from planner.vehicle.vehicle import Vehicle
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.motion.replay import replay
from tests.planner.vehicles import FINE

CONTROL = PRESETS["paper-control"]
TAIL = CONTROL.tail_length
APART = 0.3 * TAIL


def straight(*points: tuple[float, float], camera: Camera = DOCUMENTED) -> Plan:
    return plan(np.array(points), CONTROL, camera=camera)


def crossing(camera: Camera = DOCUMENTED) -> list[Plan]:
    """Return plans of two robots that would meet, each with a way of 3 l."""
    return [straight((0, 0), (3, 0), camera=camera), straight((1.0, -1.9), (1.0, 2.2), camera=camera)]


def keep_apart(plans: list[Plan], **options: Any) -> FleetPlan:
    members = [Member.of(name, each) for name, each in zip("abcdef", plans, strict=False)]
    return fleet(members, options.pop("apart", APART), **options)


@pytest.fixture(scope="module")
def two() -> FleetPlan:
    return keep_apart(crossing())


def least_between(fleet_plan: FleetPlan, poses: list[Any], times: np.ndarray) -> float:
    """Compute the least distance [m] of two bodies from their poses in l at times in s."""
    places = [
        Places(each.motion.body, pose * [TAIL, TAIL, 1.0], np.zeros(len(times)))
        for each, pose in zip(fleet_plan.scheduled, poses, strict=True)
    ]
    return float(distances(*places).min())


def test_robots_that_would_meet_keep_apart(two: FleetPlan) -> None:
    plans = crossing()
    together = [Scheduled(each.motion, 0.0) for each in keep_apart(plans, apart=1e-6).scheduled]
    times = instants(together)
    assert distances(*(each.places(times) for each in together)).min() < APART
    assert two.sure_m >= APART
    assert two.nearest.distance_m > two.sure_m
    assert two.circles == (0, 0)
    assert min(two.begin_s) == 0 < max(two.begin_s)
    assert two.plans[0].to_dict()["id"] == plans[0].to_dict()["id"]


def test_the_later_robot_does_not_wait_longer_than_it_must(two: FleetPlan) -> None:
    first, second = (two.scheduled[k] for k in two.order)
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


FAR = [((20 + 4 * k, 20), (21 + 4 * k, 20)) for k in range(4)]


def test_of_five_robots_three_that_end_on_the_way_of_the_fourth_give_way() -> None:
    ends_on_the_way = [straight((2 * k, 1.5), (2 * k, 0.1)) for k in range(3)]
    passes, far = straight((-2, 0), (7, 0)), straight(*FAR[0])
    result = keep_apart([*ends_on_the_way, passes, far])
    assert result.begin_s[3:] == (0, 0)
    assert min(result.begin_s[:3]) > 0
    assert result.sure_m >= APART


def test_robots_far_away_change_nothing(two: FleetPlan) -> None:
    far = keep_apart([*crossing(), *(straight(*way) for way in FAR)])
    assert far.begin_s == (*two.begin_s, 0, 0, 0, 0)


def test_delays_are_kept() -> None:
    plans = crossing()
    members = [Member.of("a", plans[0], 30.0), Member.of("b", plans[1], 45.0)]
    result = fleet(members, APART)
    assert result.begin_s[0] >= 30
    assert result.begin_s[1] >= 45


@pytest.mark.rest
def test_waiting_circles_keep_clear_of_walls() -> None:
    passing, across = straight((-1.0, -3.0), (-1.0, 3.5)), straight((3.2, -2.8), (3.2, 3.5))
    tracked = tracked_vehicle(CONTROL, None, "head_centre", None)
    rock = FreeSpace.of([Circle(1.0, 1.3, 0.3)])
    waiting = plan_clear(Path2D.of([[0, 0], [6, 0]]), tracked, PlanRequest(), rock)
    result = keep_apart([passing, across, waiting])
    kept = result.plans[2].kept_clear
    assert kept is not None
    assert result.circles[2] >= 1
    assert kept.clearance >= result.plans[2].stated_error
    assert kept.margin >= result.plans[2].stated_error


@pytest.mark.parametrize(
    ("paths", "expected"),
    [
        ([((0, 0), (3, 0)), ((0, 0.6), (3, 0.6))], "a and b start [0-9]"),
        ([((0, 0), (3, 0)), ((0, 3), (3.5, 0.3))], "a and b end"),
        ([((-3, 0), (3, 0)), ((4, 0), (-1, 0))], "b ends on the way of a"),
        ([((0, 0), (5, 0)), ((5.5, 0.1), (-1.5, 0.1))], "whichever of them waits"),
        ([FAR[0], ((-3, 0), (3, 0)), *FAR[1:], ((4, 0), (-1, 0))], "^b and f cannot keep 3.3 cm apart, whichever"),
    ],
)
def test_it_says_which_two_cannot_keep_apart(paths: list[Any], expected: str) -> None:
    with pytest.raises(NoTimingError, match=expected) as refusal:
        keep_apart([straight(*points) for points in paths])
    assert len(str(refusal.value).splitlines()) == 1


@pytest.mark.parametrize("apart", [float("nan"), -0.1, float("inf")])
def test_bad_distances_are_refused(apart: float) -> None:
    with pytest.raises(InputError, match="distance"):
        keep_apart(crossing(), apart=apart)


def test_one_robot_is_no_fleet() -> None:
    with pytest.raises(InputError, match="2 to 12"):
        keep_apart(crossing()[:1])


def drawn(vehicle: Vehicle, z: np.ndarray) -> Vehicle:
    """Return a robot that is off by z standard deviations of each mode."""
    twist, lag, current = vehicle.twist.copy(), vehicle.lag.copy(), vehicle.current.copy()
    for mode, size in zip(vehicle.modes, z, strict=True):
        twist = twist + size * mode.twist
        lag = lag if mode.lag is None else lag + size * mode.lag
        current = current + size * mode.current
    return replace(vehicle, twist=twist, lag=lag, current=current)


def test_ninety_five_per_cent_of_random_robots_keep_within_the_error_in_place(two: FleetPlan) -> None:
    motion = two.scheduled[1].motion
    made = motion.plan
    times = np.concatenate([[0.0], np.cumsum(made.seconds)])
    rng, held = np.random.default_rng(0), []
    error, expected = motion.error(times), motion.body.ends(motion.poses(times))
    for _ in range(100):
        robot = drawn(made.tracked.vehicle, rng.normal(size=len(made.tracked.vehicle.modes)))
        poses = poses_at_flips(robot, Switches(made.first_direction, made.dwells, made.poses))
        ends = motion.body.ends(poses * [TAIL, TAIL, 1.0])
        off = np.hypot(*np.moveaxis(ends - expected, -1, 0)).max(1)
        held.append((off <= error + 1e-12).all())
    assert 0.9 <= np.mean(held) <= 1.0


def test_they_keep_apart_in_the_simulator(two: FleetPlan) -> None:
    tracks = replay([each.schedule() for each in two.plans])
    times = np.arange(0.0, two.duration_s, 0.5)
    poses = [
        np.stack([np.interp(times - begin, track["time_s"], track[name])
                  for name in ("x_over_l", "y_over_l", "heading_rad")], 1)
        for begin, track in zip(two.begin_s, tracks, strict=True)
    ]  # fmt: skip
    assert least_between(two, poses, times) >= two.sure_m


@pytest.mark.rest
def test_robots_under_trackers_keep_apart() -> None:
    result = keep_apart(crossing(FINE), feedback=True)
    rng = np.random.default_rng(3)
    for _ in range(3):
        tracks = []
        for each in result.scheduled:
            made = each.motion.plan
            vehicle = made.tracked.vehicle
            robot = drawn(vehicle, 0.7 * rng.normal(size=len(vehicle.modes)))
            robot = replace(robot, current=np.array([2e-5, -2e-5]))
            camera = replace(FINE, seed=rng)
            tracks.append(swim(Tracker(made, noise=(0.005, 0.005)), made, robot, camera))
        scale = CONTROL.time_scale
        times = np.arange(0.0, result.duration_s, 1.0)
        poses = [
            np.stack([np.interp(times - begin, scale * track.times, column) for column in track.poses.T], 1)
            for begin, track in zip(result.begin_s, tracks, strict=True)
        ]
        assert least_between(result, poses, times) >= result.apart_m
        assert all(track.finished for track in tracks)
