"""Plans that keep clear of obstacles."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from common.errors import InputError
from planner.jobs.detours import Hindered
from planner.jobs.plan import make_plan
from planner.paths.obstacles import Circle, Footprint, FreeSpace, Polygon
from planner.paths.path import Path2D, circle, runs_of
from planner.planning.declare import TIGHTEST
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest
from sim.motion.replay import replay
from tests.planner.plans import CONTROL, LINE, QUICK, ROCK, around, tracked
from tests.planner.vehicles import FINE
from tracking.swim import swim
from tracking.tracker import Tracker

pytestmark = pytest.mark.slow

BODY = Footprint(np.linspace(-0.5, 1.0, 6), 0.15)
SPACE = FreeSpace((Circle(1.0, 0.3, 0.4), Polygon.of([[-1, -1], [0, -1], [0, -0.4], [-1, -0.4]])))
POSES = np.array([[-3.0, 0.0, 0.0], [0.1, 0.0, 0.2], [0.4, -0.2, -0.5], [4.0, 0.0, 0.1]])


def test_a_hindrance_is_what_the_discs_lack_and_its_derivatives_are_those_of_differences() -> None:
    hindered = Hindered(BODY, SPACE, 0.1, POSES[[0, -1], 2])
    residual, slopes = hindered(POSES)
    assert residual.max(1) == pytest.approx(np.maximum(0.1 - BODY.clearance(POSES, SPACE), 0.0), abs=1e-12)
    assert (residual[[0, -1]] == 0).all()
    for i, step in enumerate(1e-5 * np.eye(3)):
        difference = (hindered(POSES + step)[0] - hindered(POSES - step)[0]) / 2e-5
        assert slopes[..., i] == pytest.approx(difference, abs=1e-4)


def test_blocked_stretches_that_are_near_are_one() -> None:
    flags = np.array([0, 1, 1, 0, 1, 0, 0, 0, 1], dtype=bool)
    assert runs_of(flags, np.arange(9.0), 2.5) == [(1, 4), (8, 8)]


def check_clear(result: Plan, space: FreeSpace) -> None:
    """Check the margin on the declared path, from the headings of its reference, and the turns."""
    kept, reference = result.kept_clear, result.declared.reference
    assert kept is not None
    axis = np.stack([np.cos(reference.heading), np.sin(reference.heading)], 1)
    assert reference.p == pytest.approx(reference.q + result.tracked.rod * axis, abs=1e-9)
    assert (np.diff(reference.q, axis=0) * axis[1:]).sum(1).min() > 0  # the pivot moves forward only
    poses = np.concatenate([reference.p, reference.heading[:, None]], 1)
    assert result.stated_error <= kept.margin <= Footprint.of(result.robot, 0.0).clearance(poses, space).min()
    assert kept.clearance > 0
    assert result.declared.curvature * result.tracked.vehicle.pivot_radius <= TIGHTEST


def test_a_way_around_leaves_the_path_and_joins_it_again() -> None:
    result = around()
    check_clear(result, ROCK)
    assert result.kept_clear is not None
    (detour,) = result.kept_clear.detours
    assert detour.leaves[0] < 2.5 < detour.joins[0]
    assert detour.leaves[1] == pytest.approx(0, abs=0.05)
    assert detour.joins[1] == pytest.approx(0, abs=0.05)
    assert detour.length > detour.replaced
    assert detour.farthest < 1.5
    beside = np.abs(result.reference[(result.reference[:, 0] < detour.leaves[0] - 0.1), 1])
    assert beside.max() < 0.05
    assert result.reference[:, 1].min() < -0.3  # on the side on which the way is shorter
    assert "the way around leaves it at" in repr(result)


def test_a_path_that_is_clear_stays() -> None:
    import softflagella as sf

    walls = [[-3, -3], [6, -3], [6, 4], [-3, 4]]
    line = [[0, 0], [3, 0]]
    result = sf.plan(line, "paper-control", objective="flips", keep_out=[sf.Circle(2, 3, 0.5)], walls=walls)
    assert (result.dwells == make_plan(Path2D.of(line), tracked(), QUICK).dwells).all()
    assert result.kept_clear is not None
    assert result.kept_clear.detours == ()
    assert result.kept_clear.free_space.walls is not None
    assert make_plan(Path2D.of(line), tracked(), QUICK).kept_clear is None
    with pytest.raises(InputError, match="radius above 0"):
        sf.plan(line, "paper-control", keep_out=[sf.Circle(0, 0, math.nan)])


@pytest.mark.rest
def test_a_closed_path_that_is_blocked_at_its_start_begins_elsewhere() -> None:
    space = FreeSpace((Circle(2.5, 0, 0.4),))
    result = make_plan(circle(2.5), tracked(), replace(QUICK, space=space))
    check_clear(result, space)
    assert result.start[0] < -1.5
    assert result.errors.closure is not None
    assert result.errors.closure < 0.2


def test_the_simulator_stays_clear() -> None:
    track = replay(around().schedule())
    poses = np.stack([track[name].to_numpy(float) for name in ("x_over_l", "y_over_l", "heading_rad")], 1)
    assert Footprint.of(CONTROL, 0.0).clearance(poses, ROCK).min() > 0


@pytest.mark.rest
def test_a_tracked_robot_with_wrong_coefficients_stays_clear() -> None:
    result = make_plan(Path2D.of(LINE), tracked(), PlanRequest(space=ROCK))
    assert result.kept_clear is not None
    twist = tracked().vehicle.twist * np.array([1.02, 1.0, 1.02])
    distances = swim(Tracker(result), replace(tracked().vehicle, twist=twist), FINE).distance
    assert distances.max() < result.kept_clear.margin


def test_with_feedback_the_margin_is_smaller() -> None:
    straight = Path2D.of(((0.0, 0.0), (14.0, 0.0)))  # long enough for the error without a camera to grow
    watched = make_plan(straight, tracked(), PlanRequest(dwell=2.5, space=ROCK, feedback=True))
    assert watched.kept_clear is not None
    assert watched.feedback_error <= watched.kept_clear.margin < watched.stated_error


@pytest.mark.parametrize(
    "seed", [pytest.param(s, marks=pytest.mark.rest if s < 3 else pytest.mark.rates) for s in range(8)]
)
def test_random_obstacles(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 5, 200)
    path = Path2D.of(np.stack([1.6 * angle, rng.uniform(0.3, 1) * np.sin(1.5 * angle)], 1))
    rocks = [Circle(*(path.points[i] + rng.normal(0, 0.3, 2)).tolist(), rng.uniform(0.2, 0.6)) for i in (70, 130)]
    space = FreeSpace(tuple(rocks))
    check_clear(make_plan(path, tracked(), replace(QUICK, space=space)), space)
