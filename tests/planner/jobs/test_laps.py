"""A schedule that repeats closes; robots and simulator swim it lap after lap, in Python and in C, until told."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from planner.files.saved_plan import restore_plan
from planner.files.tracker_header import rounded
from planner.jobs.laps import looped
from planner.paths.path import Path2D, circle
from planner.planning.plan import make_plan
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.tracking.guidance import TrackerGuidance
from planner.tracking.pipe import answers
from planner.tracking.swim import swim
from planner.tracking.tracker import POSE, Command, Tracker
from planner.vehicle.rollout import Switches, poses_at_flips
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from sim.io.errors import InputError, run_command
from sim.model.presets import PRESETS
from sim.motion.replay import replay
from tests.planner.compiled import CompiledTracker
from tests.planner.vehicles import FINE, drawn_vehicle

CONTROL = PRESETS["paper-control"]
FEW = PlanRequest(dwell=2.03)  # no flip is at the time of a picture
ANGLE = np.linspace(0, 2 * np.pi, 400, endpoint=False)
EIGHT = Path2D(np.stack([2 * np.sin(ANGLE), 1.2 * np.sin(2 * ANGLE)], 1), True)


@pytest.fixture(scope="module")
def tracked() -> TrackedVehicle:
    return tracked_vehicle(CONTROL, None, "head_centre", None)


@pytest.fixture(scope="module")
def laps(tracked: TrackedVehicle) -> Plan:
    return looped(make_plan(circle(1.2), tracked, FEW))


@dataclass
class UntilTold:
    """A tracker that is told at a time that this lap is the last one."""

    tracker: Tracker
    at: float
    told: bool = field(default=False)

    def update(self, now: float, pose: POSE | None = None, seen_at: float | None = None) -> Command:
        command = self.tracker.update(now, pose, seen_at)
        if now >= self.at and not self.told:
            self.told = True
            return self.tracker.finish_lap()
        return command


@pytest.mark.parametrize("path", [circle(1.2), EIGHT], ids=["circle", "eight"])
def test_laps_close(path: Path2D, tracked: TrackedVehicle) -> None:
    once = make_plan(path, tracked, FEW)
    plan = looped(once)
    count = len(plan.dwells)
    assert count % 2 == 0
    assert plan.dwells.min() >= plan.minimum_dwell * (1 - 1e-6)
    assert plan.duration == pytest.approx(once.duration, rel=0.02)
    assert plan.predicted_max < 1.3 * once.predicted_max
    assert plan.lap is not None
    assert max(plan.lap.closes, plan.lap.closes_turn) < 1e-4
    many = Switches(plan.first_direction, np.tile(plan.dwells, 6), plan.poses[:1])
    after = poses_at_flips(tracked.vehicle, many)[count::count]
    turn = 0.0 if path is EIGHT else 2 * np.pi
    assert np.diff(after, axis=0) == pytest.approx(np.tile([0, 0, turn], (5, 1)), abs=1e-4)
    assert after[0] == pytest.approx(plan.poses[-1], abs=1e-9)


def test_a_lap_drifts_as_stated(laps: Plan) -> None:
    """Some robots that the uncertainty allows: one in 20 may drift further."""
    assert laps.lap is not None
    rng, vehicle, beyond = np.random.default_rng(0), laps.tracked.vehicle, 0
    count = len(laps.dwells)
    for _ in range(40):
        twice = Switches(laps.first_direction, np.tile(laps.dwells, 2), laps.poses[:1])
        poses = poses_at_flips(drawn_vehicle(vehicle, rng), twice)
        x, y, _ = poses[-1] - poses[count]
        beyond += np.hypot(x, y) > laps.lap.drift
    assert beyond <= 6


@pytest.mark.rest
def test_the_simulator_swims_lap_after_lap(laps: Plan) -> None:
    assert laps.lap is not None
    track = replay([laps.schedule(laps=2)])[0]
    assert float(track["time_bar"].iloc[-1]) == pytest.approx(2 * laps.duration)
    poses = track[["x_over_l", "y_over_l", "heading_rad"]].to_numpy(float)
    one = poses[int(np.abs(track["time_bar"].to_numpy(float) - laps.duration).argmin())]
    x, y, turned = poses[-1] - one - [0, 0, 2 * np.pi]
    assert np.hypot(x, y) < 1.5 * laps.lap.drift + 0.005
    assert abs(turned) < 1.5 * laps.lap.drift_turn + 0.005


@pytest.mark.parametrize("current", [0.0, 0.001])
def test_a_tracked_robot_goes_around_until_it_is_told(laps: Plan, tracked: TrackedVehicle, current: float) -> None:
    car = replace(
        tracked.vehicle,
        twist=tracked.vehicle.twist * np.array([1.02, 1.0, 1.02]),
        current=np.array([current, 0.0]),
    )
    tracker = UntilTold(Tracker(laps), 3.4 * laps.duration)
    result = swim(tracker, laps, car, FINE, longest=8)
    assert result.finished
    assert 3.8 < result.times[-1] / laps.duration < 4.2
    assert result.distance.max() < 0.15
    settled = result.times > laps.duration
    assert result.distance[settled].max() < 2 * laps.predicted_max + 0.03
    assert tracker.tracker._law.place < TrackerGuidance(laps)._lap


def test_a_robot_that_was_moved_comes_back_in_any_lap(laps: Plan) -> None:
    start = (0.5, -2.0, 2.0)
    tracker = UntilTold(Tracker(laps, start=start), 2.5 * laps.duration)
    result = swim(tracker, laps, laps.tracked.vehicle, FINE, start=start, longest=8)
    assert result.finished
    assert result.distance[result.times > laps.duration].max() < 2 * laps.predicted_max


def test_in_c_it_goes_around_as_well(laps: Plan, tmp_path: Path) -> None:
    plan = rounded(laps)
    one, other = Tracker(plan), CompiledTracker(plan, tmp_path)
    other.restart(None)
    told, command = False, one.command
    for _ in range(4 * len(plan.dwells)):
        now = command.flip_at
        if now > 2.4 * plan.duration and not told:
            told = True
            command, answer = one.finish_lap(), other.finish_lap()
        else:
            command, answer = one.update(now), other.update(now)
        assert answer.direction == command.direction
        assert answer.flip_at == pytest.approx(command.flip_at, abs=1e-4)
        assert answer.finished == command.finished
        if command.finished:
            break
    assert 2.9 < command.flip_at / plan.duration < 3.1


def test_the_command_plans_laps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from planner.__main__ import main

    words = [
        "--unit",
        "l",
        "--robot",
        "paper-control",
        "--objective",
        "flips",
        "--loop",
        "--out",
        str(tmp_path / "out"),
    ]
    (tmp_path / "open.csv").write_text("x,y\n0,0\n3,0\n3,2\n")
    assert run_command(main, ["plan", str(tmp_path / "open.csv"), *words]) == 2
    error = capsys.readouterr().err
    assert "a path that repeats is closed" in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()
    assert run_command(main, ["plan", "circle:1.5l", *words]) == 0
    assert "repeat it: a lap ends where it began" in capsys.readouterr().out
    content = json.loads((tmp_path / "out" / "plan.json").read_text())
    assert set(content["lap"]) == {"closes_over_l", "closes_rad", "drift_over_l", "drift_rad"}
    header = (tmp_path / "out" / "schedule.h").read_text()
    assert "#define SCHEDULE_REPEATS 1" in header
    assert "After the last entry go on with the first" in header
    restored = restore_plan(tmp_path / "out")
    assert restored.lap is not None
    assert restored.lap.to_dict() == content["lap"]
    assert Tracker(restored).command.flip_at == pytest.approx(content["dwell_bar"][0], rel=0.2)


def test_a_schedule_that_is_carried_out_once_has_one_lap(laps: Plan) -> None:
    with pytest.raises(InputError, match="carried out once"):
        replace(laps, lap=None).schedule(laps=2)
    assert len(laps.schedule(laps=3).dwells) == 3 * len(laps.dwells)


def test_the_pipe_is_told_that_this_lap_is_the_last_one(laps: Plan) -> None:
    scale = laps.robot.time_scale
    tracker, times = Tracker(laps), np.cumsum(np.tile(laps.dwells, 2)) * scale
    lines = [*(f"{time:.6f}" for time in times[: len(laps.dwells) // 2]), "finish"]
    told = list(answers(tracker, lines, laps.robot))
    assert len(told) == len(lines)
    while not tracker.update(tracker.command.flip_at).finished:
        assert tracker.command.flip_at < 1.2 * laps.duration
