"""Tracks of swims have the kicks, the noise and the camera that they claim."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from common.arrays import Floats
from planner.planning.plan import Plan
from sim.mechanics import planar
from sim.motion.replay import replay
from tests.oracles.swims import CameraNoise, Swum, make_track, swum
from tests.planner.plans import CONTROL, planned

CAMERA = CameraNoise()
EXACT = CameraNoise(white=(0.0, 0.0), slow=(0.0, 0.0))
OTHER = replace(CONTROL, tail_length=0.1, viscosity=1.6, C_t=2.7, effects={"left_right_bias": 0.1})


def plan_of_a_circle() -> Plan:
    return planned("circle:1.2l", objective="flips")


def poses_of(track: pd.DataFrame) -> Floats:
    """Poses (n, 3) in m and rad, the heading without jumps."""
    heading = np.unwrap(np.radians(track["heading_deg"]))
    return np.stack([track["x_cm"] / 100, track["y_cm"] / 100, heading], 1)


def assert_same(poses: Floats, others: Floats, error: float = 1e-9) -> None:
    """Compare poses (n, 3) up to whole turns of all headings."""
    turns = 2 * np.pi * np.round((poses[0, 2] - others[0, 2]) / (2 * np.pi))
    np.testing.assert_allclose(poses, others + np.array([0.0, 0.0, turns]), atol=error)


def test_without_noise_a_track_is_the_replay_of_another_robot() -> None:
    plan = plan_of_a_circle()
    swim, known = swum(OTHER, plan), replay(plan.schedule(OTHER))
    assert_same(swim.at(known["time_s"].to_numpy()), poses_of(known))
    track = make_track(OTHER, plan, seed=0, camera=EXACT)
    time = track["time_s"].to_numpy()
    assert_same(poses_of(track), swim.at(time))
    assert time[-1] == pytest.approx(plan.seconds.sum(), abs=CAMERA.every)
    flips = np.flatnonzero(np.diff(track["direction"]))
    np.testing.assert_allclose(time[flips] + 0.25, plan.flip_times[1:-1] * plan.robot.time_scale, atol=0.2500001)
    assert track["direction"][0] == plan.first_direction


def test_a_kick_carries_the_rest_of_the_path_rigidly() -> None:
    """On a straight line of three dwells: turned by 90° at the first flip, then 1 m ahead at the second."""
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    swim = Swum(np.arange(4.0), line, np.arange(4.0))
    kicks = np.array([[0.0, 0.0, np.pi / 2], [1.0, 0.0, 0.0]])
    ends = planar.compose(swim.carried(kicks), line[1:])
    known = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, np.pi / 2], [1.0, 3.0, np.pi / 2]])
    np.testing.assert_allclose(ends, known, atol=1e-12)


def test_within_a_dwell_kicks_change_nothing() -> None:
    """They have the size that is stated, in the frame of the robot."""
    plan, size = plan_of_a_circle(), np.array([2e-4, 2e-4, 0.01])
    clean = swum(CONTROL, plan)
    track = make_track(CONTROL, plan, seed=3, camera=EXACT, kick=(size[0], size[2]))
    time, poses = track["time_s"].to_numpy(), poses_of(track)
    dwell = np.searchsorted(clean.flips[1:-1], time, side="right")
    moved, known, steps = planar.between(poses[:-1], poses[1:]), clean.at(time), []
    plain = planar.between(known[:-1], known[1:])
    same = np.diff(dwell) == 0
    assert_same(moved[same], plain[same])
    for index in np.flatnonzero(~same):  # one flip, as dwells are longer than the camera's step
        flip = clean.at(clean.flips[dwell[index + 1]][None])[0]
        before, after = planar.between(known[index], flip), planar.between(flip, known[index + 1])
        steps.append(planar.compose(planar.compose(planar.inverse(before), moved[index]), planar.inverse(after)))
    assert len(steps) == len(plan.dwells) - 1
    scatter = np.array(steps) / size
    np.testing.assert_allclose(scatter.std(0), 1.0, atol=4 / math.sqrt(2 * len(steps)))
    np.testing.assert_allclose(scatter.mean(0), 0.0, atol=4 / math.sqrt(len(steps)))


def test_noise_has_the_stated_covariance() -> None:
    """White and exponential, also at unequal times, and independent between x, y and heading."""
    time, count = np.array([0.0, 0.5, 3.0, 30.0]), 20_000
    camera, rng = CameraNoise(white=(2.0, 0.3), slow=(1.0, 0.4), memory=5.0), np.random.default_rng(0)
    draws = np.array([camera.draw(time, rng) for _ in range(count)]).transpose(2, 1, 0).reshape(12, count)
    slow = np.exp(-np.abs(time[:, None] - time) / 5.0)
    place, heading = 4.0 * np.eye(4) + slow, 0.09 * np.eye(4) + 0.16 * slow
    none = np.zeros((4, 4))
    expected = np.block([[place, none, none], [none, place, none], [none, none, heading]])
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(np.cov(draws) / np.outer(size, size), expected / np.outer(size, size), atol=0.05)


def test_the_camera_sees_marker_scale_current_and_clock_as_stated() -> None:
    plan, marker = plan_of_a_circle(), (0.02, -0.01, 0.3)
    track = make_track(
        CONTROL, plan, seed=0, camera=EXACT, marker=marker, scale=1.1, clock=7.0, current=(1e-5, -2e-5),
        later_current=(3e-5, 0.0), rest=(5.0, 3.0),
    )  # fmt: skip
    clean = swum(CONTROL, plan)
    end = clean.flips[-1]
    time = track["time_s"].to_numpy() - 7.0
    assert time[0] == -5.0
    assert end + 2.5 < time[-1] <= end + 3.0
    poses, known = poses_of(track), clean.at(time)
    early, late = np.minimum(time, end / 2) + 5.0, np.maximum(time - end / 2, 0.0)
    drift = np.stack([1e-5 * early + 3e-5 * late, -2e-5 * early], 1)
    c, s = np.cos(known[:, 2]), np.sin(known[:, 2])
    place = known[:, :2] + drift + np.stack([0.02 * c + 0.01 * s, 0.02 * s - 0.01 * c], 1)
    assert_same(poses, np.column_stack([1.1 * place, known[:, 2] + 0.3]))
    assert set(track["direction"][(time < 0) | (time >= end)]) == {0}
    assert set(track["direction"][(time >= 0) & (time < end)]) == {-1, 1}


def test_pictures_are_lost_frozen_turned_and_wrong_as_stated() -> None:
    plan = plan_of_a_circle()
    clean = make_track(CONTROL, plan, seed=0, camera=EXACT)
    faulty = make_track(
        CONTROL, plan, seed=0, camera=EXACT, lost=((10.0, 20.0),), frozen=((30.0, 33.0),), turned=((50.0, 52.0),)
    )  # fmt: skip
    time = clean["time_s"]
    kept = clean[(time < 10) | (time >= 20)].reset_index(drop=True)
    assert faulty[["time_s", "direction"]].equals(kept[["time_s", "direction"]])
    poses = ["x_cm", "y_cm", "heading_deg"]
    changed = kept["time_s"][(faulty[poses] != kept[poses]).any(axis=1)]
    assert set(changed) == {*np.arange(30, 33, 0.5), *np.arange(50, 52, 0.5)}
    frozen = faulty[(faulty["time_s"] >= 29.5) & (faulty["time_s"] < 33)]
    assert len(frozen[poses].drop_duplicates()) == 1
    turned = (faulty["heading_deg"] - kept["heading_deg"])[changed[changed >= 50].index]
    np.testing.assert_allclose(np.abs(turned), 180.0)
    wrong = make_track(CONTROL, plan, seed=0, camera=EXACT, outliers=0.05)
    away = np.hypot(wrong["x_cm"] - clean["x_cm"], wrong["y_cm"] - clean["y_cm"])
    assert (away > 0.1).mean() == pytest.approx(0.05, abs=4 * math.sqrt(0.05 / len(away)))
    assert away.max() < 10 * math.sqrt(2)


def test_a_seed_tells_the_noise() -> None:
    plan = plan_of_a_circle()
    first, again, other = (make_track(CONTROL, plan, seed=seed) for seed in (1, 1, 2))
    assert first.equals(again)
    difference = poses_of(first) - poses_of(other)
    of_place = math.sqrt(2) * math.hypot(*(part[0] for part in (CAMERA.white, CAMERA.slow)))
    assert difference[:, :2].std() == pytest.approx(of_place, rel=0.2)
