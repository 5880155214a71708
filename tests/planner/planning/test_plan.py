"""Plans: the paper's cases, objectives, tolerance, refusals, currents, and no simulation."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from typing import Any, get_type_hints

import numpy as np
import pytest

from planner.command_line import say
from planner.files.plan_files import controller_header
from planner.paths.distance import distance_to
from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import plan
from planner.planning.planned import _MOVED
from planner.planning.request import PlanRequest, RequestOptions
from planner.vehicle.calibration_table import COEFFICIENTS, CalibrationKnowledge
from planner.vehicle.dwell_choice import dwells_for, longest_dwell
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.rollout import trace
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from surrogate.one_robot.tabulate import tabulate
from surrogate.table.model_file import load
from tests.processes import LIMIT

CONTROL = PRESETS["paper-control"]


def refused(path: Any, expected: str, **options: Any) -> None:
    with pytest.raises(InputError, match=expected) as caught:
        plan(path, options.pop("robot", CONTROL), **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["circle", "square", "triangle"])
def test_paper_cases_are_planned_within_their_bound(name: str) -> None:
    path = {"circle": circle(1.5), "square": polygon(4, 3.0), "triangle": polygon(3, 4.0)}[name]
    robot = PRESETS["paper-triangle"] if name == "triangle" else CONTROL
    result = plan(path, robot)
    assert result.predicted_rms < 1.3 * result.straight.rms
    assert result.errors.drawn_rms < {"circle": 0.012, "square": 0.020, "triangle": 0.044}[name]
    assert result.errors.guaranteed is not None
    assert result.predicted_max <= min(result.errors.guaranteed, result.stated_error)
    assert result.errors.closure is not None
    assert result.errors.closure < 0.05
    assert result.dwells.min() >= result.minimum_dwell * (1 - 1e-9)
    again = plan(path, robot)
    assert np.array_equal(again.dwells, result.dwells)


def test_planning_never_calls_the_simulator(monkeypatch: pytest.MonkeyPatch) -> None:
    import sim.motion.orbits
    import sim.motion.run
    import sim.motion.steady
    import sim.motion.switching

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("the planner simulated")

    for module, name in ((sim.motion.steady, "steady"), (sim.motion.switching, "switch_response"),
                         (sim.motion.orbits, "refined_orbit"), (sim.motion.orbits, "orbits_in_groups"),
                         (sim.motion.run, "advance")):  # fmt: skip
        monkeypatch.setattr(module, name, refuse)
    assert len(plan(polygon(4, 3.0), CONTROL).dwells) > 50


def test_planning_does_not_even_load_the_simulator() -> None:
    simulator = ("sim.solve.newton", "sim.motion.steady", "sim.motion.replay", "sim.motion.run", "sim.solve.orbit")
    code = (
        "import sys; from softflagella import plan, circle; from sim.model.presets import PRESETS;"
        "plan(circle(2.0), PRESETS['paper-control']);"
        f"print([m for m in {simulator} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=LIMIT)
    assert done.stdout.strip() == "[]"


def test_other_points_of_the_axis() -> None:
    """The tip needs a longer rod, the pivot none; each is planned for itself."""
    for point in ("head_tip", "pivot"):
        result = plan(circle(2.5), CONTROL, point=point)  # type: ignore[arg-type]
        assert result.errors.guaranteed is not None
        assert result.predicted_max <= result.errors.guaranteed
        assert result.tracked.offset != 0


def test_old_attributes_of_a_plan_warn_and_work() -> None:
    result = plan(circle(2.0), CONTROL)
    for name, path in _MOVED.items():
        with pytest.warns(DeprecationWarning, match=f"Plan.{name} is deprecated; use Plan.{re.escape(path)}"):
            value = getattr(result, name)
        new: Any = result
        for part in path.removesuffix("()").split("."):
            new = getattr(new, part)
        assert np.array_equal(value, new()) if path.endswith("()") else value == new or value is new
    with pytest.raises(AttributeError, match="'Plan' object has no attribute 'dwell'"):
        result.dwell  # type: ignore[attr-defined]  # noqa: B018


def test_the_options_of_plan_are_the_fields_of_a_request() -> None:
    assert get_type_hints(RequestOptions) == get_type_hints(PlanRequest)


def test_a_tolerance_shortens_the_dwell_and_says_when_it_cannot() -> None:
    free = plan(circle(2.0), CONTROL, objective="flips")
    tight = plan(circle(2.0), CONTROL, objective="flips", tolerance=0.75 * free.stated_error)
    assert tight.minimum_dwell < free.minimum_dwell
    assert tight.stated_error <= 0.75 * free.stated_error
    assert len(tight.dwells) > len(free.dwells)
    with pytest.raises(InputError, match="smallest stated error is"):
        plan(circle(2.0), CONTROL, tolerance=1e-3)


def test_objectives_trade_error_for_time_and_flips() -> None:
    found = {name: plan(circle(2.0), CONTROL, objective=name) for name in ("error", "time", "flips")}  # type: ignore[arg-type]
    assert found["error"].predicted_rms < found["time"].predicted_rms
    assert found["time"].duration < found["error"].duration
    assert len(found["flips"].dwells) <= len(found["time"].dwells) < len(found["error"].dwells)


@pytest.mark.parametrize("tail_length", [0.06, 0.11])
@pytest.mark.parametrize(
    "path", [polygon(4, 3.0), polygon(3, 4.0), circle(1.5), Path2D.of([[0, 0], [8, 0], [8, 3]])],
    ids=["square", "triangle", "circle", "corner"],
)  # fmt: skip
def test_the_fastest_plan_is_the_fastest_of_a_grid_of_dwells(path: Path2D, tail_length: float) -> None:
    """The fastest dwell of straight motion used to be taken: on squares and triangles up to 4 % slower."""
    for robot in (replace(CONTROL, tail_length=tail_length), PRESETS["paper-triangle"]):
        quick = plan(path, robot, objective="time")
        vehicle = quick.tracked.vehicle
        grid = [plan(path, robot, dwell=dwell) for dwell in np.geomspace(1.2, longest_dwell(vehicle, 1.2), 12)]
        assert quick.duration <= 1.01 * min(each.duration for each in grid)
        front = [each for each in grid if each.stated_error < quick.stated_error]
        assert all(each.duration > 0.99 * quick.duration for each in front)


def test_a_shortest_dwell_in_seconds() -> None:
    result = plan(circle(2.0), CONTROL, minimum_seconds=4.0)
    assert result.seconds[:-1].min() >= 4.0 * (1 - 1e-9)


def test_refusals() -> None:
    from dataclasses import replace

    refused([], "empty")
    refused([[0, 0]], "same|two points")
    refused([[0, 0], [0, 0]], "same")
    refused([[0, 0], [float("nan"), 1]], "finite")
    refused([[0, 0, 0], [1, 1, 1]], r"\(n, 2\)")
    refused([["a", "b"]], "no number")
    refused(circle(0.5), "too tight .* scale the path by")
    refused(polygon(4, 0.8), "too tight .* scale the path by")
    refused(polygon(4, 0.1), "too small, the robot's circle has a radius")
    refused([[0, 0], [8e4, 0]], "at most 12000 l can be planned; scale it")
    refused(polygon(4, 3.0), "corner of 90 degrees", corner="error")
    for weight in (-1.0, float("nan")):
        refused(polygon(4, 3.0), "give a number of l²", time_weight=weight)
    refused(polygon(4, 3.0), "needs corner = nearest or minimax", corner="fillet", time_weight=0.1)
    refused(circle(2.0), "below 0.2 time units", minimum_dwell=0.1)
    refused(circle(2.0), "objective", objective="speed")
    refused(
        circle(2.0),
        r"outside the look-up table: motor .* rpm \(omega_bar = 500\)",
        robot=CONTROL.with_motor(500.0),
    )
    refused(
        circle(2.0),
        r"outside the look-up table: disc offset 1.6 mm \(a_over_R = 0.1\)",
        robot=replace(CONTROL, disc_offset=0.0016),
    )
    refused(circle(2.0), "tail_sag .*surrogate robot", robot=replace(CONTROL, effects={"tail_sag": 0.1}))


def test_another_robot_carries_a_plan_out_in_the_same_seconds_and_metres() -> None:
    result = plan(circle(2.0), CONTROL)
    other = replace(CONTROL, viscosity=1.1 * CONTROL.viscosity, tail_length=1.02 * CONTROL.tail_length)
    one, own = result.schedule(other), result.schedule()
    assert one.dwells * one.time_scale == pytest.approx(own.dwells * own.time_scale)
    assert np.array(one.start[:2]) * other.tail_length == pytest.approx(
        np.array(own.start[:2]) * CONTROL.tail_length
    )


def test_a_current_is_steered_against() -> None:
    """Across a line: the robot looks upstream, and its track stays on the line."""
    unit = CONTROL.tail_length / CONTROL.time_scale
    flow = CalibrationKnowledge(current=(0.0, 0.004 * unit))
    result = plan(Path2D.of([[0, 0], [12, 0]]), CONTROL, knowledge=flow)
    assert result.predicted_rms < 1.4 * result.straight.rms
    middle = result.poses[len(result.poses) // 2 :, 2].mean()
    assert middle == pytest.approx(-math.asin(0.004 / result.straight.net_speed), abs=0.01)
    with pytest.raises(InputError, match="as fast as the robot"):
        plan(circle(3.0), CONTROL, knowledge=CalibrationKnowledge(current=(0.0, 0.5 * unit)))


def test_a_dwell_that_is_too_long_is_to_be_shorter() -> None:
    """The advice used to be "allow longer ones"."""
    with pytest.raises(InputError, match="allow shorter ones: it turns too far"):
        plan(circle(3.0), CONTROL, minimum_seconds=400.0)


def test_a_small_circle_is_small_not_noisy() -> None:
    with pytest.raises(InputError) as refusal:
        plan(circle(0.2), CONTROL)
    assert "noisy" not in str(refusal.value)
    assert "small" in str(refusal.value) or "tight" in str(refusal.value)


def test_dwells_that_are_far_too_long_get_a_warning() -> None:
    """Dwells of 100 s turn the robot by 127 degrees; nobody was told that the path is lost."""
    result = plan(circle(3.0), CONTROL, minimum_seconds=100.0)
    assert result.predicted_max > 0.9
    (warning,) = result.warnings
    for part in ("the predicted track is up to 11.2 cm", "dwells of 1.67 min", "turns by 127 degrees"):
        assert part in warning
    assert plan(circle(3.0), CONTROL, minimum_seconds=5.0).warnings == ()


def test_progress_is_called_with_numbers_that_do_not_fall() -> None:
    shares: list[float] = []
    plan(polygon(4, 3.0), CONTROL, progress=shares.append)
    assert shares
    assert shares == sorted(shares)


def test_long_paths_are_planned_with_the_least_stated_error() -> None:
    """The dwell of the smallest zigzag has a larger stated error, since the errors of more flips add up."""
    robot = replace(CONTROL, tails=3, tail_length=0.129, C_t=1.56, C_r=1.97, C_yr=1.08)
    path = circle(6.0)
    result = plan(path, robot)
    quick = plan(path, robot, dwell=dwells_for(result.tracked.vehicle, "error", None)[0])
    assert result.minimum_dwell > quick.minimum_dwell
    assert result.stated_error < 0.8 * quick.stated_error


def test_a_plan_whose_error_is_the_table_s_proposes_the_robot_s_own_table() -> None:
    robot = replace(CONTROL, tails=3, tail_length=0.129, C_t=1.56, C_r=1.97, C_yr=1.08)
    result = plan(circle(6.0), robot, dwell=0.3)
    assert any("own table" in words for words in result.warnings)
    by_own_table = plan(circle(6.0), robot, dwell=0.3, lookup=tabulate(robot))
    assert not any("own table" in words for words in by_own_table.warnings)
    assert by_own_table.stated_error < result.stated_error


def test_with_few_flips_a_measured_pose_does_no_harm() -> None:
    """The error with feedback was above the one without, since the two are drawn."""
    share = np.linspace(0, 1, 100)
    line = plan(np.stack([12 * share, 0 * share], 1), CONTROL, objective="flips")
    assert line.feedback_error <= line.stated_error


def test_errors_that_are_not_calibrated_say_so(capsys: pytest.CaptureFixture[str]) -> None:
    """First-guess coefficients had a stated error of 3 mm, and the robot missed by 10 cm."""
    known = CalibrationKnowledge(COEFFICIENTS, 1e-4 * np.eye(3))
    guessed, found = (plan(circle(2.0), CONTROL, knowledge=each) for each in (None, known))
    assert guessed.error_line.startswith("if the coefficients are exact: predicted error")
    assert "with the coefficients of another robot: stated error" in guessed.error_line
    assert found.error_line.startswith("predicted error")
    assert guessed.error_line.replace("\n", "\n  ") in repr(guessed)
    say(guessed)
    assert guessed.error_line in capsys.readouterr().out
    assert guessed.to_dict()["stated_error_unmeasured_over_l"] == guessed.unmeasured_error
    assert found.to_dict()["stated_error_unmeasured_over_l"] is None
    assert "if its coefficients are exact" in controller_header(guessed, "p1")
    assert "exact" not in controller_header(found, "p1")


def test_robots_with_the_coefficients_of_another_stay_within_the_error_of_unmeasured_ones() -> None:
    """The first-order statement, against 40 vehicles of robots whose coefficients are drawn as those of others."""
    result = plan(circle(2.0), CONTROL, objective="flips")
    rng, lookup, misses = np.random.default_rng(5), load(), []
    for factor in np.exp(rng.normal(size=(40, 3)) * [0.35, 0.22, 0.48]):
        other = {name: getattr(CONTROL, name) * value for name, value in zip(COEFFICIENTS, factor, strict=True)}
        with suppress(InputError):  # outside the table
            truth = table_vehicle(replace(CONTROL, **other), lookup)
            misses.append(distance_to(result.reference, trace(truth, result.switches, 0.0)).max())
    assert len(misses) > 25
    assert result.unmeasured_error is not None
    assert np.mean(np.array(misses) < result.unmeasured_error) > 0.8
    assert np.median(misses) > 0.2 * result.unmeasured_error > 2 * result.stated_error
