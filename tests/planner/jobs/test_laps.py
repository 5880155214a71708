"""Schedules that repeat: laps, and a place that is held on the smallest orbit, until the robot is told to stop."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from common.arrays import Floats
from common.errors import InputError
from planner.files.headers import schedule_header
from planner.goal import last_dwells
from planner.goal.last_dwells import looped
from planner.jobs.hold import Orbit, hold
from planner.jobs.plan import make_plan
from planner.paths.obstacles import Circle, FreeSpace
from planner.paths.path import Path2D, circle
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest
from planner.vehicle.tracked_point import tracked_vehicle
from planner.vehicle.vehicle import Switches, Vehicle, roll_out
from sim.mechanics import planar
from sim.mechanics.planar import POSE
from sim.motion.replay import replay
from tests.planner.plans import CONTROL, tracked
from tests.planner.vehicles import FINE
from tests.shared import shared
from tracking.guidance import TrackerGuidance
from tracking.pipe import answers
from tracking.swim import swim
from tracking.tracker import Command, Tracker

pytestmark = pytest.mark.slow

FEW = PlanRequest(dwell=2.03)  # no flip is at the time of a picture
PLACE = (2.0, 1.0)


@shared
def laps() -> Plan:
    return make_plan(circle(1.2), tracked(), replace(FEW, loop=True))


@shared
def held() -> Plan[Orbit]:
    return hold(PLACE, tracked(), dwell=FEW.dwell, seconds=1800.0)


@dataclass
class UntilTold:
    """A tracker that is told at a time that this lap is the last one."""

    tracker: Tracker
    at: float
    told: bool = field(default=False)

    def __post_init__(self) -> None:
        self.plan, self.start = self.tracker.plan, self.tracker.start

    def update(self, now: float, pose: POSE | None = None, seen_at: float | None = None) -> Command:
        command = self.tracker.update(now, pose, seen_at)
        if now >= self.at and not self.told:
            self.told = True
            return self.tracker.finish_lap()
        return command


ANGLE = np.linspace(0, 2 * np.pi, 400, endpoint=False)
EIGHT = Path2D(np.stack([2 * np.sin(ANGLE), 1.2 * np.sin(2 * ANGLE)], 1), True)


@pytest.mark.parametrize(
    "path", [circle(1.2), pytest.param(EIGHT, marks=pytest.mark.rest)], ids=["circle", "eight"]
)
def test_laps_close(path: Path2D) -> None:
    once = make_plan(path, tracked(), FEW)
    plan = looped(once) if path is EIGHT else laps()
    count = len(plan.dwells)
    assert count % 2 == 0
    assert plan.dwells.min() >= plan.minimum_dwell * (1 - 1e-6)
    assert plan.duration == pytest.approx(once.duration, rel=0.02)
    assert plan.predicted_max < 1.3 * once.predicted_max
    assert plan.lap is not None
    closes, turned, drift, drift_turn = plan.lap
    assert max(closes, turned) < 1e-4
    assert plan.lap.to_dict() == {
        "closes_over_l": closes, "closes_rad": turned, "drift_over_l": drift, "drift_rad": drift_turn,
    }  # fmt: skip
    assert "repeat it: a lap ends where it began" in repr(plan)
    header = schedule_header(plan, plan.identity)
    assert "After the last entry go on with the first." in header
    assert "\n#define SCHEDULE_REPEATS 1\n" in header
    many = Switches(plan.first_direction, np.tile(plan.dwells, 6), plan.poses[:1])
    after = roll_out(tracked().vehicle, many).flips[count::count]
    turn = 0.0 if path is EIGHT else 2 * np.pi
    assert np.diff(after, axis=0) == pytest.approx(np.tile([0, 0, turn], (5, 1)), abs=1e-4)
    assert after[0] == pytest.approx(plan.poses[-1], abs=1e-9)
    with pytest.raises(InputError, match="carried out once"):
        replace(plan, lap=None).schedule(laps=2)
    assert len(plan.schedule(laps=3).dwells) == 3 * count


def test_laps_of_short_dwells_close_exactly() -> None:
    """Each lap begins after the same dwell; short ones leave the robot moving."""
    lap = make_plan(circle(1.2), tracked(), PlanRequest(dwell=0.3, loop=True)).lap
    assert lap is not None
    assert max(lap.closes, lap.closes_turn) < 1e-7


def test_a_path_that_no_schedule_repeats_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(last_dwells, "_closed", lambda *_: None)
    with pytest.raises(InputError, match="no schedule of this path repeats"):
        looped(laps())


def test_a_lap_drifts_as_stated() -> None:
    """Some robots that the uncertainty allows: one in 20 may drift further."""
    assert laps().lap is not None
    rng, vehicle, beyond = np.random.default_rng(0), laps().tracked.vehicle, 0
    count = len(laps().dwells)
    for _ in range(40):
        twice = Switches(laps().first_direction, np.tile(laps().dwells, 2), laps().poses[:1])
        poses = roll_out(vehicle.drawn(rng), twice).flips
        x, y, _ = poses[-1] - poses[count]
        beyond += np.hypot(x, y) > laps().lap.drift
    assert beyond <= 6


@pytest.mark.rest
def test_the_simulator_swims_lap_after_lap() -> None:
    assert laps().lap is not None
    track = replay(laps().schedule(laps=2))
    assert float(track["time_bar"].iloc[-1]) == pytest.approx(2 * laps().duration)
    poses = track[["x_over_l", "y_over_l", "heading_rad"]].to_numpy(float)
    one = poses[int(np.abs(track["time_bar"].to_numpy(float) - laps().duration).argmin())]
    x, y, turned = poses[-1] - one - [0, 0, 2 * np.pi]
    assert np.hypot(x, y) < 1.5 * laps().lap.drift + 0.005
    assert abs(turned) < 1.5 * laps().lap.drift_turn + 0.005


@pytest.mark.parametrize("current", [pytest.param(0.0, marks=pytest.mark.rest), 0.001])
def test_a_tracked_robot_goes_around_until_it_is_told(current: float) -> None:
    lap = laps()
    car = lap.tracked.vehicle
    car = replace(car, twist=car.twist * np.array([1.02, 1.0, 1.02]), current=np.array([current, 0.0]))
    tracker = UntilTold(Tracker(lap), 2.4 * lap.duration)
    result = swim(tracker, car, FINE, longest=8)
    assert result.finished
    assert 2.8 < result.times[-1] / lap.duration < 3.2
    assert result.distance.max() < 0.15
    settled = result.times > lap.duration
    assert result.distance[settled].max() < 2 * lap.predicted_max + 0.03
    assert tracker.tracker._law.state.step < TrackerGuidance(lap)._lap


def test_a_robot_that_was_moved_comes_back_in_any_lap() -> None:
    lap = laps()
    start = (0.5, -2.0, 2.0)
    tracker = UntilTold(Tracker(lap, start=start), 1.5 * lap.duration)
    result = swim(tracker, lap.tracked.vehicle, FINE, start=start, longest=8)
    assert result.finished
    assert result.distance[result.times > lap.duration].max() < 2 * lap.predicted_max


def test_the_pipe_is_told_that_this_lap_is_the_last_one() -> None:
    lap = laps()
    scale = lap.robot.time_scale
    tracker, times = Tracker(lap), np.cumsum(np.tile(lap.dwells, 2)) * scale
    lines = [*(f"{time:.6f}" for time in times[: len(lap.dwells) // 2]), "finish"]
    told = list(answers(tracker, lines, lap.robot))
    assert len(told) == len(lines)
    while not tracker.update(tracker.command.flip_at).finished:
        assert tracker.command.flip_at < 1.2 * lap.duration


def orbit_of_a_pair(vehicle: Vehicle, positive: float, negative: float, offset: float) -> float:
    """Compute the largest distance of a point of the axis from the centre of its orbit by a pair of dwells."""
    share = np.linspace(0, 1, 9)
    first = vehicle.motion(1, np.full(9, negative), positive * share)
    second = planar.compose(first[-1:], vehicle.motion(-1, np.full(9, positive), negative * share))
    x, y, turned = second[-1].tolist()
    if abs(math.sin(turned / 2)) < 1e-6:
        return math.inf
    c, s = 1 - math.cos(turned), math.sin(turned)
    centre = np.linalg.solve(np.array([[c, s], [-s, c]]), np.array([x, y]))
    points = planar.compose(np.concatenate([first, second]), np.array([offset, 0.0, 0.0]))[:, :2]
    return float(np.hypot(*(points - centre).T).max())


@pytest.mark.parametrize("point", ["head_centre", "pivot", "head_tip"])
def test_no_pair_of_dwells_stays_nearer_than_one_direction(point: str) -> None:
    tracked = tracked_vehicle(CONTROL, None, point, None)  # type: ignore[arg-type]
    smallest = math.hypot(tracked.vehicle.pivot_radius, tracked.rod)
    dwells: Floats = np.geomspace(0.2, 80.0, 24)
    sizes = [orbit_of_a_pair(tracked.vehicle, a, b, tracked.offset) for a in dwells for b in dwells]
    assert min(sizes) > smallest * (1 - 1e-6)
    assert min(sizes) < smallest * 1.02


def test_the_orbit_is_little_wider_than_the_smallest_one() -> None:
    plan, place = held(), held().job
    assert place.smallest == pytest.approx(tracked().vehicle.turn_radius)
    assert place.smallest < place.radius < 1.05 * place.smallest
    away = np.hypot(*(plan.track - PLACE).T)
    assert np.abs(away - place.radius).max() <= plan.predicted_max + 1e-3
    assert place.laps == math.ceil(1800 / float(plan.seconds.sum()))


@pytest.mark.parametrize(("current", "wrong"), [pytest.param(0.0, 1.05, marks=pytest.mark.rest), (0.001, 0.97)])
def test_a_tracked_robot_stays(current: float, wrong: float) -> None:
    """A coefficient is 3 or 5 % off; the current would carry the robot 0.4 l away in three laps."""
    plan, place = held(), held().job
    car = tracked().vehicle
    car = replace(car, twist=car.twist * np.array([wrong, 1.0, 1.0]), current=np.array([current, 0.0]))
    result = swim(UntilTold(Tracker(plan), 2.5 * plan.duration), car, FINE, longest=8)
    settled = result.times > plan.duration
    away = np.hypot(*(result.poses[settled, :2] - PLACE).T)
    assert result.finished
    assert away.max() < place.within(plan) + 0.08
    assert away.min() > place.radius - 0.15


@pytest.mark.parametrize("x", [3.2, pytest.param(5.5, marks=pytest.mark.rest)])
def test_there_must_be_room(x: float) -> None:
    space = FreeSpace((Circle(x, 1.0, 0.2),))
    if x > 5:
        assert hold(PLACE, tracked(), dwell=FEW.dwell, keep_out=space.regions).job.laps is None
        return
    with pytest.raises(InputError, match="no room to hold"):
        hold(PLACE, tracked(), dwell=FEW.dwell, keep_out=space.regions)
