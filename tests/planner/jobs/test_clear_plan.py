"""Plans for paths keep clear of obstacles, on the declared path by the stated error, and in the simulator."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.files.plan_json import load_plan
from planner.jobs.clear_plan import plan_clear
from planner.jobs.hindered import Hindered
from planner.paths.obstacles import Circle, Footprint, FreeSpace, Polygon
from planner.paths.path import Path2D, circle
from planner.planning.declared_path import TIGHTEST
from planner.planning.plan import make_plan
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.tracking.swim import swim
from planner.tracking.tracker import Tracker
from sim.io.errors import InputError, run_command
from sim.motion.replay import replay
from tests.planner.plans import CONTROL, LINE, QUICK, ROCK, around, tracked
from tests.planner.vehicles import FINE

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


def check_clear(result: Plan, space: FreeSpace) -> None:
    """Check the margin on the declared path, from the headings of its reference, and the turns."""
    kept, reference = result.kept_clear, result.declared.reference
    assert kept is not None
    axis = np.stack([np.cos(reference.heading), np.sin(reference.heading)], 1)
    assert reference.p == pytest.approx(reference.q + result.tracked.rod * axis, abs=1e-9)
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
    assert plan_clear(Path2D.of(line), tracked(), QUICK, FreeSpace()).kept_clear is None
    with pytest.raises(InputError, match="radius above 0"):
        sf.plan(line, "paper-control", keep_out=[sf.Circle(0, 0, math.nan)])


@pytest.mark.rest
def test_a_closed_path_that_is_blocked_at_its_start_begins_elsewhere() -> None:
    space = FreeSpace.of([Circle(2.5, 0, 0.4)])
    result = plan_clear(circle(2.5), tracked(), QUICK, space)
    check_clear(result, space)
    assert result.start[0] < -1.5
    assert result.errors.closure is not None
    assert result.errors.closure < 0.2


def test_the_simulator_stays_clear() -> None:
    track = replay([around().schedule()])[0]
    poses = np.stack([track[name].to_numpy(float) for name in ("x_over_l", "y_over_l", "heading_rad")], 1)
    assert Footprint.of(CONTROL, 0.0).clearance(poses, ROCK).min() > 0


@pytest.mark.rest
def test_a_tracked_robot_with_wrong_coefficients_stays_clear() -> None:
    result = plan_clear(Path2D.of(LINE), tracked(), PlanRequest(), ROCK)
    assert result.kept_clear is not None
    twist = tracked().vehicle.twist * np.array([1.02, 1.0, 1.02])
    distances = swim(Tracker(result), result, replace(tracked().vehicle, twist=twist), FINE).distance
    assert distances.max() < result.kept_clear.margin


def test_with_feedback_the_margin_is_smaller() -> None:
    watched = around(2.5, feedback=True)
    assert watched.kept_clear is not None
    assert watched.feedback_error <= watched.kept_clear.margin < watched.stated_error


@pytest.mark.rest
@pytest.mark.parametrize("seed", range(8))
def test_random_obstacles(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 5, 200)
    path = Path2D.of(np.stack([1.6 * angle, rng.uniform(0.3, 1) * np.sin(1.5 * angle)], 1))
    rocks = [Circle(*(path.points[i] + rng.normal(0, 0.3, 2)).tolist(), rng.uniform(0.2, 0.6)) for i in (70, 130)]
    space = FreeSpace.of(rocks)
    check_clear(plan_clear(path, tracked(), QUICK, space), space)


def test_regions_are_in_the_unit_that_is_given(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from planner.__main__ import main

    cm = 100 * CONTROL.tail_length
    (tmp_path / "line.csv").write_text(f"x_cm,y_cm\n0,0\n{5 * cm},0\n")
    words = ["plan", str(tmp_path / "line.csv"), "--robot", "paper-control", "--out", str(tmp_path / "out")]
    words += ["--unit", "cm", "--objective", "flips", "--keep-out", f"circle:{2.5 * cm},0.1,0.3l"]
    assert run_command(main, words) == 0
    said = capsys.readouterr().out
    assert said.count("the way around leaves it at") == 1
    content = load_plan(tmp_path / "out" / "plan.json")
    kept = content["kept_clear"]
    assert kept["keep_out"][0]["circle"] == pytest.approx([2.5, 0.1 / cm, 0.3])
    assert len(kept["detours"]) == 1
    assert kept["margin_over_l"] > 0
    assert content["id"].startswith("p")
