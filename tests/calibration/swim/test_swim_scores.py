"""λ of an effect in a swim is that of dense algebra, and numbers that are fitted anyway leave nothing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from common.arrays import Floats
from sim.knowledge import COEFFICIENTS, NUMBERS
from sim.mechanics import planar
from tests.oracles.drawn_swims import LabSwim, drawn_swim
from tests.oracles.swim_scores import FITTED, SwimScores, moved, sized, with_influence
from tests.oracles.swims import CameraNoise, make_track, swum
from tests.planner.plans import CONTROL, planned
from tests.shared import shared

CAMERA = CameraNoise(every=2.0, white=(8e-5, 0.002), slow=(6e-5, 0.004), memory=7.0)  # small for a short swim
KICK = (2e-5, 4e-4)
BIASED = with_influence(CONTROL, "left_right_bias", 0.01)


@shared
def scores() -> SwimScores:
    plan = planned("circle:1.2l", objective="flips")
    return SwimScores(LabSwim(CONTROL, CONTROL, plan.drawn, plan, {"camera": CAMERA, "kick": KICK}))


def flat(poses: Floats) -> Floats:
    """Changes of poses (n, 3, …), x first, then y, then the headings."""
    return np.moveaxis(poses, 1, 0).reshape(3 * len(poses), *poses.shape[2:])


def test_strength_is_that_of_dense_algebra() -> None:
    """With differences for all derivatives, and kicks as a track has them."""
    of = scores()
    swim = swum(CONTROL, of.plan, of.resolution)
    time, poses = of.time, swim.at(of.time)
    assert time[-1] == pytest.approx(FITTED * swim.flips[-1], abs=CAMERA.every)
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
        column = flat(swum(other, of.plan, of.resolution).at(time) - poses) / 0.5
        covariance += np.outer(column, column)
    scale = 0.01 * flat(poses * [1.0, 1.0, 0.0])
    covariance += np.outer(scale, scale)
    columns = [flat(planar.compose(poses, 1e-6 * np.eye(3)[axis]) - poses) / 1e-6 for axis in range(3)]
    columns += [flat(planar.compose(1e-6 * np.eye(3)[axis], poses) - poses) / 1e-6 for axis in range(3)]
    columns += [flat(np.outer(time, np.eye(3)[axis])) for axis in range(2)]
    for name in COEFFICIENTS:
        other = replace(CONTROL, **{name: getattr(CONTROL, name) * 1.01})
        columns.append(flat(swum(other, of.plan, of.resolution).at(time) - poses) / 0.01)
    root = np.linalg.cholesky(covariance)
    small = with_influence(CONTROL, "left_right_bias", 1e-3)
    change = np.linalg.solve(root, flat(swum(small, of.plan, of.resolution).at(time) - poses))
    free = np.linalg.qr(np.linalg.solve(root, np.stack(columns, 1)))[0]
    expected = np.linalg.norm(change - free @ (free.T @ change))
    assert expected > 0.5
    assert of.strength(small) == pytest.approx(expected, rel=0.02)


def test_what_is_fitted_anyway_leaves_nothing() -> None:
    """Of other coefficients; of a number, at most how far it is off in its standard deviation."""
    of = scores()
    assert of.strength(BIASED) > 5
    for place in range(len(COEFFICIENTS)):
        assert of.strength(moved(CONTROL, 0.01 * np.eye(10)[place])) < 0.2
    for place in range(len(COEFFICIENTS), 10):
        assert of.strength(moved(CONTROL, 0.5 * np.eye(10)[place])) < 0.55


def test_effects_are_sized_or_left_out() -> None:
    of = scores()
    found = sized(CONTROL, "left_right_bias", -1, of, 8.0)
    assert found is not None
    assert found.effects["left_right_bias"] < 0
    assert of.strength(found) == pytest.approx(8.0, rel=0.08)
    assert sized(CONTROL, "one_tail_missing", 1, of, 8.0) is None  # coefficients do the same
    assert sized(CONTROL, "end_over_end_drag", -1, of, 8.0) is None  # none is negative


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
