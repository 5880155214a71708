"""λ of an effect in a swim is that of dense algebra with replays."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from common.arrays import Floats
from sim.knowledge import COEFFICIENTS, NUMBERS
from sim.mechanics import planar
from sim.motion.run import Resolution
from tests.oracles.drawn_swims import LabSwim, drawn_swim
from tests.oracles.swim_scores import SwimScores, with_influence
from tests.oracles.swims import CameraNoise, make_track, swum
from tests.planner.plans import CONTROL, planned
from tests.shared import shared

FITTED = 2 / 3  # of a swim
CAMERA = CameraNoise(every=2.0, white=(8e-5, 0.002), slow=(6e-5, 0.004), memory=7.0)  # small for a short swim
KICK = (2e-5, 4e-4)
ODD = {"left_right_bias": 3e-3, "natural_curvature": 0.02}  # coefficients do not do the same


@shared
def lab() -> LabSwim:
    plan = planned("circle:1.2l", objective="flips")
    return LabSwim(CONTROL, CONTROL, plan.drawn, plan, {"camera": CAMERA, "kick": KICK})


def flat(poses: Floats) -> Floats:
    """Changes of poses (n, 3, …), x first, then y, then the headings."""
    return np.moveaxis(poses, 1, 0).reshape(3 * len(poses), *poses.shape[2:])


def test_strength_is_that_of_replays() -> None:
    """By dense algebra, with differences of replays for all derivatives, and kicks as a track has them."""
    plan, resolution = lab().plan, Resolution.fitting(CONTROL.omega_bar)
    swim = swum(CONTROL, plan, resolution)
    time = np.arange(0, FITTED * swim.flips[-1], CAMERA.every)
    poses = swim.at(time)
    slow = np.exp(-np.abs(time[:, None] - time) / CAMERA.memory)
    noise = [w**2 * np.eye(len(time)) + s**2 * slow for w, s in zip(CAMERA.white, CAMERA.slow, strict=True)]
    covariance = np.zeros((3 * len(time), 3 * len(time)))
    for axis, each in enumerate((noise[0], noise[0], noise[1])):
        part = slice(axis * len(time), (axis + 1) * len(time))
        covariance[part, part] = each
    dwell = np.searchsorted(swim.flips[1:-1], time, side="right")
    for flip in range(len(swim.flips) - 2):
        for axis, size in enumerate((KICK[0], KICK[0], KICK[1])):
            kicks = np.zeros((len(swim.flips) - 2, 3))
            kicks[flip, axis] = 1e-4 * size
            column = 1e4 * flat(planar.compose(swim.carried(kicks)[dwell], poses) - poses)
            covariance += np.outer(column, column)
    for name in NUMBERS:
        by = 0.5 * CONTROL.sigma(name).of(CONTROL.number(name))
        other = replace(CONTROL, **{name: CONTROL.number(name) + by})  # type: ignore[arg-type]
        column = flat(swum(other, plan, resolution).at(time) - poses) / 0.5
        covariance += np.outer(column, column)
    scale = 0.01 * flat(poses * [1.0, 1.0, 0.0])
    covariance += np.outer(scale, scale)
    columns = [flat(planar.compose(poses, 1e-6 * np.eye(3)[axis]) - poses) / 1e-6 for axis in range(3)]
    columns += [flat(planar.compose(1e-6 * np.eye(3)[axis], poses) - poses) / 1e-6 for axis in range(3)]
    columns += [flat(np.outer(time, np.eye(3)[axis])) for axis in range(2)]
    for name in COEFFICIENTS:
        other = replace(CONTROL, **{name: getattr(CONTROL, name) * 1.01})
        columns.append(flat(swum(other, plan, resolution).at(time) - poses) / 0.01)
    root = np.linalg.cholesky(covariance)
    free = np.linalg.qr(np.linalg.solve(root, np.stack(columns, 1)))[0]
    scores = SwimScores(lab())
    for name, size in ODD.items():
        other = with_influence(CONTROL, name, size)
        change = np.linalg.solve(root, flat(swum(other, plan, resolution).at(time) - poses))
        expected = np.linalg.norm(change - free @ (free.T @ change))
        assert scores.strength(name, size) == pytest.approx(expected, rel=0.1)
        assert expected < 0.6 * np.linalg.norm(change)


def test_what_is_fitted_anyway_leaves_nothing() -> None:
    """Of other coefficients; of a number, at most how far it is off in its standard deviation."""
    scores = SwimScores(lab())
    assert scores.strength("left_right_bias", 0.01) > 5
    for name in COEFFICIENTS:
        assert scores.strength(name, 1.01 * getattr(CONTROL, name)) < 0.2
    for name in NUMBERS[:2]:
        by = 0.5 * CONTROL.sigma(name).of(CONTROL.number(name))
        assert scores.strength(name, CONTROL.number(name) + by) < 0.55


def test_effects_are_sized_or_left_out() -> None:
    scores = SwimScores(lab())
    found = scores.sized("left_right_bias", -1, 8.0)
    assert found is not None
    assert found.effects["left_right_bias"] < 0
    assert scores.strength("left_right_bias", found.effects["left_right_bias"]) == pytest.approx(8.0, rel=0.08)
    assert scores.sized("one_tail_missing", 1, 8.0) is None  # coefficients do the same
    assert scores.sized("end_over_end_drag", -1, 8.0) is None  # none is negative


def test_drawn_swims_can_be_seen_and_differ() -> None:
    swim, other = drawn_swim(0), drawn_swim(1)
    assert swim.given != other.given
    assert swim.plan.seconds.mean() > 2 * swim.disturbed["camera"].every
    for name in COEFFICIENTS:
        assert 0 < abs(getattr(swim.truth, name) / getattr(swim.given, name) - 1) < 0.2
    for name in NUMBERS:
        value = swim.given.number(name)
        assert abs(swim.truth.number(name) - value) <= 2 * swim.given.sigma(name).of(value) * (1 + 1e-9)
    assert 8 <= swim.path.length / swim.given.tail_length <= 16
    track = make_track(swim.truth, swim.plan, seed=0, **swim.disturbed)
    assert math.isfinite(track.to_numpy().sum())
