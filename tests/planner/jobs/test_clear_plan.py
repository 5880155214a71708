"""Plans for paths keep clear of obstacles, on the declared path by the stated error, and in the simulator."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.files.plan_json import load_plan
from planner.jobs.clear_plan import plan_clear
from planner.paths.obstacles import Circle, Footprint, FreeSpace, Polygon
from planner.paths.path import Path2D, circle, polygon
from planner.planning.declared_path import TIGHTEST
from planner.planning.plan import make_plan
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.tracking.swim import swim
from planner.tracking.tracker import Tracker
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from sim.io.errors import InputError, run_command
from sim.model.presets import PRESETS
from sim.motion.replay import replay
from tests.planner.vehicles import FINE

CONTROL = PRESETS["paper-control"]
LINE = Path2D.of([[0, 0], [8, 0]])
QUICK = PlanRequest(objective="flips")


@pytest.fixture(scope="module")
def tracked() -> TrackedVehicle:
    return tracked_vehicle(CONTROL, None, "head_centre", None)


def declared_clearance(result: Plan, space: FreeSpace) -> float:
    """Compute the least clearance of the body on the declared path, from the headings of its reference."""
    reference, rod = result.declared.reference, result.tracked.rod
    axis = np.stack([np.cos(reference.heading), np.sin(reference.heading)], 1)
    assert reference.p == pytest.approx(reference.q + rod * axis, abs=1e-9)
    body = Footprint.of(result.robot, 0.0)
    return float(body.clearance(np.concatenate([reference.p, reference.heading[:, None]], 1), space).min())


def check_clear(result: Plan, space: FreeSpace, tracked: TrackedVehicle) -> None:
    kept = result.kept_clear
    assert kept is not None
    assert result.stated_error <= kept.margin
    assert declared_clearance(result, space) >= kept.margin
    assert kept.clearance > 0
    assert result.declared.curvature * tracked.vehicle.pivot_radius <= TIGHTEST


def test_a_way_around_leaves_the_path_and_joins_it_again(tracked: TrackedVehicle) -> None:
    space = FreeSpace.of([Circle(4, 0.2, 0.5)])
    result = plan_clear(LINE, tracked, QUICK, space)
    check_clear(result, space, tracked)
    assert result.kept_clear is not None
    (detour,) = result.kept_clear.detours
    assert detour.leaves[0] < 4 < detour.joins[0]
    assert detour.leaves[1] == pytest.approx(0, abs=0.05)
    assert detour.joins[1] == pytest.approx(0, abs=0.05)
    assert detour.length > detour.replaced
    assert detour.farthest < 1.5
    beside = np.abs(result.reference[(result.reference[:, 0] < detour.leaves[0] - 0.1), 1])
    assert beside.max() < 0.05
    assert result.reference[:, 1].min() < -0.3  # on the side on which the way is shorter


def test_a_path_that_is_clear_stays(tracked: TrackedVehicle) -> None:
    space = FreeSpace.of([Circle(4, 3, 0.5)], [[-3, -3], [11, -3], [11, 4], [-3, 4]])
    result, plain = plan_clear(LINE, tracked, QUICK, space), make_plan(LINE, tracked, QUICK)
    assert (result.dwells == plain.dwells).all()
    assert result.kept_clear is not None
    assert result.kept_clear.detours == ()
    assert plan_clear(LINE, tracked, QUICK, FreeSpace()).kept_clear is None


@pytest.mark.rest
def test_a_closed_path_that_is_blocked_at_its_start_begins_elsewhere(tracked: TrackedVehicle) -> None:
    space = FreeSpace.of([Circle(2.5, 0, 0.4)])
    result = plan_clear(circle(2.5), tracked, QUICK, space)
    check_clear(result, space, tracked)
    assert result.start[0] < -1.5
    assert result.errors.closure is not None
    assert result.errors.closure < 0.2


def test_the_simulator_stays_clear_and_within_the_stated_error(tracked: TrackedVehicle) -> None:
    space = FreeSpace.of([Polygon.of([[1.4, -0.2], [1.8, -0.2], [1.8, 0.2], [1.4, 0.2]])])
    result = plan_clear(polygon(4, 3.5), tracked, QUICK, space)
    track = replay([result.schedule()])[0]
    poses = np.stack([track[name].to_numpy(float) for name in ("x_over_l", "y_over_l", "heading_rad")], 1)
    assert Footprint.of(CONTROL, 0.0).clearance(poses, space).min() > 0


@pytest.mark.rest
def test_a_tracked_robot_with_wrong_coefficients_stays_clear(tracked: TrackedVehicle) -> None:
    result = plan_clear(LINE, tracked, PlanRequest(), FreeSpace.of([Circle(4, 0.2, 0.5)]))
    assert result.kept_clear is not None
    twist = tracked.vehicle.twist * np.array([1.02, 1.0, 1.02])
    distances = swim(Tracker(result), result, replace(tracked.vehicle, twist=twist), FINE).distance
    assert distances.max() < result.kept_clear.margin


def test_with_feedback_the_margin_is_smaller(tracked: TrackedVehicle) -> None:
    space = FreeSpace.of([Circle(4, 0.2, 0.5)])
    alone, watched = (plan_clear(LINE, tracked, QUICK, space, feedback=feedback) for feedback in (False, True))
    assert alone.kept_clear is not None
    assert watched.kept_clear is not None
    assert watched.feedback_error <= watched.kept_clear.margin < alone.kept_clear.margin


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.rest) for seed in range(1, 8))])
def test_random_obstacles(seed: int, tracked: TrackedVehicle) -> None:
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 5, 200)
    path = Path2D.of(np.stack([1.6 * angle, rng.uniform(0.3, 1) * np.sin(1.5 * angle)], 1))
    rocks = [Circle(*(path.points[i] + rng.normal(0, 0.3, 2)).tolist(), rng.uniform(0.2, 0.6)) for i in (70, 130)]
    space = FreeSpace.of(rocks)
    check_clear(plan_clear(path, tracked, QUICK, space), space, tracked)


def test_no_way_around_is_one_line_and_exit_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from planner.__main__ import main

    (tmp_path / "line.csv").write_text("x,y\n0,0\n6,0\n")
    words = ["plan", str(tmp_path / "line.csv"), "--robot", "paper-control", "--out", str(tmp_path / "out")]
    words += ["--objective", "flips", "--unit", "l"]
    for options, expected in (
        (["--keep-out", "circle:0,0.2,0.4"], "the path begins at"),
        (["--keep-out", "box:3,-2,3.5,2", "--walls", "box:-2,-1.5,8,1.5"], "there is no way around that leaves"),
        (["--keep-out", "ring:0,1"], "no such file"),
    ):
        assert run_command(main, [*words, *options]) == 2
        error = capsys.readouterr().err
        assert expected in error
        assert len(error.splitlines()) == 1
        assert not (tmp_path / "out").exists()


def test_regions_are_in_the_unit_that_is_given(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from planner.__main__ import main

    cm = 100 * CONTROL.tail_length
    (tmp_path / "line.csv").write_text(f"x_cm,y_cm\n0,0\n{6 * cm},0\n")
    words = ["plan", str(tmp_path / "line.csv"), "--robot", "paper-control", "--out", str(tmp_path / "out")]
    words += ["--unit", "cm", "--objective", "flips", "--keep-out", f"circle:{3 * cm},0.1,0.4l"]
    assert run_command(main, words) == 0
    said = capsys.readouterr().out
    assert said.count("the way around leaves it at") == 1
    kept = load_plan(tmp_path / "out" / "plan.json")["kept_clear"]
    assert kept["keep_out"][0]["circle"] == pytest.approx([3, 0.1 / cm, 0.4])
    assert len(kept["detours"]) == 1
    assert kept["margin_over_l"] > 0
    assert json.loads((tmp_path / "out" / "plan.json").read_text())["id"].startswith("p")


def test_python_takes_regions_and_walls() -> None:
    import softflagella as sf

    walls = [[-2, -2], [8, -2], [8, 2], [-2, 2]]
    rock = sf.Circle(3, 0.1, 0.3)
    result = sf.plan([[0, 0], [6, 0]], "paper-control", objective="flips", keep_out=[rock], walls=walls)
    assert result.kept_clear is not None
    assert "the way around leaves it at" in repr(result)
    assert result.kept_clear.free_space.walls is not None
    with pytest.raises(InputError, match="radius above 0"):
        sf.plan(LINE, "paper-control", keep_out=[sf.Circle(0, 0, math.nan)])
