"""The schedule: the guaranteed error as a property of random paths; errors do not grow with length."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from planner.paths.distance import distance_to
from planner.paths.path import Path2D, circle
from planner.paths.tractrix import Drift, reference
from planner.planning.line_of_sight import hysteresis
from planner.planning.plan import plan
from planner.planning.schedule import follow
from planner.planning.stated_error import guaranteed, look_ahead
from planner.vehicle.rollout import poses_at_flips, trace
from sim.mechanics import planar
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from tests.planner.vehicles import plain_guidance, vehicle


def random_smooth_path(seed: int, length: float, sharpest: float) -> Path2D:
    """Draw a path of given length with curvature within ±sharpest, varying over lengths of about one."""
    rng = np.random.default_rng(seed)
    s = np.arange(0, length, 0.02)
    waves = rng.normal(size=(6, 1)) * np.sin(rng.uniform(0.3, 2.0, (6, 1)) * s + rng.uniform(0, 6.3, (6, 1)))
    curvature = sharpest * np.tanh(waves.sum(0) / 2)
    heading = np.cumsum(curvature) * 0.02
    return Path2D.of(np.cumsum(0.02 * np.stack([np.cos(heading), np.sin(heading)], 1), 0), closed=False)


@pytest.mark.parametrize(
    "seed", [*range(12), *(pytest.param(seed, marks=pytest.mark.rest) for seed in range(12, 40))]
)
def test_the_bound_holds_on_random_paths(seed: int) -> None:
    """Predicted track within the guaranteed error, for paths of many lengths and curvatures."""
    rng = np.random.default_rng(1000 + seed)
    car = vehicle(lag=rng.uniform(0, 1))
    path = random_smooth_path(seed, rng.uniform(5, 40), rng.uniform(0.05, 0.9))
    ref = reference(path, car.pivot_distance, 0.01)
    curvature = float(np.abs(ref.curvature).max())
    if curvature * car.pivot_radius > 0.9:
        pytest.skip("this path is tighter than the robot can turn")
    dwell = rng.uniform(0.3, 2.0)
    ahead = look_ahead(car, curvature)
    switches = follow(ref, car, plain_guidance(car, dwell, ahead))
    track = trace(car, switches, 0.0, samples=12)
    error = distance_to(ref.p, track[:-12])
    assert error.max() <= guaranteed(car, car.pivot_distance, car.yaw_rate * dwell, ahead)
    assert switches.dwells.min() >= dwell * (1 - 1e-9)


def test_error_does_not_grow_with_length() -> None:
    car = vehicle()
    worst = []
    for length in (10.0, 80.0):
        ref = reference(Path2D.of([[0, 0], [length, 0]]), car.pivot_distance, 0.01)
        switches = follow(ref, car, plain_guidance(car, 1.0, look_ahead(car, 0.0)))
        worst.append(np.abs(trace(car, switches, 0.0)[:, 1]).max())
    assert worst[1] < 1.2 * worst[0]


@pytest.mark.parametrize("bias", [0.0, 0.2])
def test_the_schedule_predicts_what_the_vehicle_does(bias: float) -> None:
    """Poses found switch by switch in plain numbers, against the chain of pose changes, current included."""
    car = replace(vehicle(bias=bias), current=np.array([0.001, -0.0005]))
    ref = reference(circle(2.0), car.pivot_distance + 0.3, 0.02, Drift(0.0, (0.05, -0.03)))
    switches = follow(ref, car, plain_guidance(car, 0.4, look_ahead(car, 0.3)), 0.3)
    pose = switches.poses[0]
    before = None
    for i, dwell in enumerate(switches.dwells[:40]):
        pose = planar.compose(pose, car.motion(switches.first_direction * (-1) ** i, before, dwell))
        pose = pose + np.append(car.current * dwell, 0.0)
        assert switches.poses[i + 1] == pytest.approx(pose, abs=1e-9)
        before = dwell
    assert poses_at_flips(car, switches) == pytest.approx(switches.poses, abs=1e-8)
    assert trace(car, switches, 0.0)[::8] == pytest.approx(switches.poses[:, :2], abs=1e-8)


SIDEWAYS = replace(
    PRESETS["paper-control"], tails=3, tail_length=0.08097, head_radius=0.016, head_length=0.06,
    C_t=3.7343, C_r=1.5529, C_yr=3.7597,
).with_motor(2.2)  # fmt: skip


@pytest.mark.parametrize(
    "path",
    [
        Path2D.of([[0, 0], [0.7, 0.1]]),
        Path2D.of([[0, 0], [3, 0], [3, 2], [0, 2]], closed=True),  # begins at a corner
        circle(1.5),
    ],
    ids=["line", "corner", "circle"],
)
@pytest.mark.parametrize("robot", [SIDEWAYS, PRESETS["paper-control"]], ids=["sideways", "control"])
def test_the_first_dwell_is_no_worse_than_those_after_it(robot: Robot, path: Path2D) -> None:
    """From rest the tails are straight, and the first dwell moves the robot further than the others do."""
    distance = plan(path, robot, dwell=1.5).errors.distance
    first, later = distance[:9].max(), distance[9:-8].max()
    assert first <= 1.12 * later


def test_the_hysteresis_is_half_the_swing_and_grows_with_the_bend() -> None:
    """h = β/2 (1 + R′ |κ|), and β where the robot can only turn: it then swings to one side of the path."""
    car = vehicle()
    for curvature, part in ((0.0, 0.5), (0.5, 0.5 * (1 + 0.5 * car.pivot_radius)), (-9.0, 1.0)):
        ref: Any = SimpleNamespace(curvature=np.array([curvature]))
        assert hysteresis(ref, car, 0.08) == pytest.approx([0.08 * part])
