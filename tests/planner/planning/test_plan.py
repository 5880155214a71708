"""Plans: the paper's cases, objectives, dwells and tolerance, refusals, currents, and no simulation."""

from __future__ import annotations

import math
import re
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, get_type_hints

import numpy as np
import pytest
from matplotlib.text import Annotation

from common.errors import InputError, InputWarning
from planner.files.headers import schedule_header
from planner.goal.trip import to_goal
from planner.guidance import line_of_sight
from planner.jobs.plan import plan
from planner.options import PathOptions
from planner.paths.distance import distance_to
from planner.paths.path import Path2D, circle, polygon
from planner.paths.units import in_lab
from planner.planning import solve
from planner.planning.conditions import BlockedError
from planner.planning.request import PlanRequest
from planner.progress import ERRORS
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.tracked_point import tracked_vehicle
from planner.vehicle.vehicle import roll_out
from planner.vehicle.zigzag import dwells_for, longer_dwells, longest_dwell
from sim.knowledge import COEFFICIENTS, CalibrationKnowledge
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from softflagella.path_error import carry_out
from surrogate.table_file import load
from tests.oracles.unseen_robots import lab_robot
from tests.planner.plans import CONTROL, planned, tracked

pytestmark = pytest.mark.slow

LONG = replace(CONTROL, tails=3, tail_length=0.129, C_t=1.56, C_r=1.97, C_yr=1.08)


@pytest.mark.parametrize(
    ("path", "robot", "most"),
    [("circle:1.5l", "paper-control", 0.012), ("square:3l", "paper-control", 0.020),
     ("triangle:4l", "paper-triangle", 0.044)],
)  # fmt: skip
def test_paper_cases_are_planned_within_their_bound(path: str, robot: str, most: float) -> None:
    result = planned(path, robot)
    assert result.predicted_rms < 1.3 * result.straight.rms
    assert result.errors.drawn_rms < most
    assert result.errors.guaranteed is not None
    assert result.predicted_max <= min(result.errors.guaranteed, result.stated_error)
    assert result.errors.closure is not None
    assert result.errors.closure < 0.05
    assert result.dwells.min() >= result.minimum_dwell * (1 - 1e-9)


def test_planning_never_calls_the_simulator_and_says_how_far_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plan is made as before; numbers of its progress do not fall."""
    import sim.motion.run
    import sim.motion.steady

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("the planner simulated")

    for module, name in ((sim.motion.steady, "steady"), (sim.motion.steady, "refined_orbits"),
                         (sim.motion.run, "side_by_side")):  # fmt: skip
        monkeypatch.setattr(module, name, refuse)
    shares: list[Any] = []
    again = plan(polygon(4, 3.0), CONTROL, progress=shares.append)
    assert np.array_equal(again.dwells, planned("square:3l").dwells)
    assert shares
    assert shares == sorted(shares)
    assert len({share.done for share in shares if share.stage == ERRORS}) > 5


def test_what_takes_days_is_asked_about_before_it_is_planned(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planner.jobs.plan.solve", lambda *_: 1 / 0)
    monkeypatch.setattr("planner.goal.trip.solve", lambda *_: 1 / 0)
    asked = r"400 m \(3636 l\) takes this robot 2\.0\d days or more; are its units right"
    with pytest.warns(InputWarning, match=asked), pytest.raises(ZeroDivisionError):
        plan([[0.0, 0.0], [40_000.0, 0.0]], CONTROL, unit="cm")
    with pytest.warns(InputWarning, match=asked), pytest.raises(ZeroDivisionError):
        to_goal((0.0, 0.0, 0.0), ("400m", "0m", "0"), CONTROL)


@pytest.mark.parametrize("factor", [1e3, 1e6])
def test_a_robot_whose_tails_hardly_bend_is_refused_before_its_table_is_simulated(
    factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("surrogate.tabulate.tabulate", lambda robot: 1 / 0)
    stiff = replace(CONTROL, youngs_modulus=factor * CONTROL.youngs_modulus)
    with pytest.raises(InputError, match=r"hardly moves forward, .* cm/s: its tails hardly bend .*; check"):
        plan(polygon(4, 3.0), stiff)
    with pytest.raises(ZeroDivisionError):
        plan(polygon(4, 3.0), replace(CONTROL, youngs_modulus=50 * CONTROL.youngs_modulus))


@pytest.mark.parametrize("point", ["head_tip", "pivot"])
def test_other_points_of_the_axis(point: str) -> None:
    """The tip needs a longer rod, the pivot none; each is planned for itself."""
    result = planned("circle:2l", point=point)
    assert result.errors.guaranteed is not None
    assert result.predicted_max <= result.errors.guaranteed
    assert result.tracked.offset != 0


def test_options_are_the_fields_of_a_request() -> None:
    others = {"space", "loop"}  # which have arguments of their own
    wanted = {name: hint for name, hint in get_type_hints(PlanRequest).items() if name not in others}
    options = get_type_hints(PathOptions)
    words = {name: options[name] for name in ("tolerance", "camera")}  # as users write them, too
    assert {name: options.get(name) for name in wanted} == wanted | words


def test_objectives_trade_error_for_time_and_flips() -> None:
    """With few flips, a measured pose does no harm."""
    error, time, flips = planned(), planned(objective="time"), planned("circle:2l", objective="flips")
    assert error.predicted_rms < time.predicted_rms
    assert time.duration < error.duration
    assert len(flips.dwells) <= len(time.dwells) < len(error.dwells)
    line = planned(((0.0, 0.0), (12.0, 0.0)), objective="flips")
    assert line.feedback_error <= line.stated_error


SHAPES = {"square": polygon(4, 3.0), "triangle": polygon(3, 4.0), "circle": circle(1.5),
          "corner": Path2D.of([[0, 0], [8, 0], [8, 3]])}  # fmt: skip
SHORT, FOUR_TAILS = replace(CONTROL, tail_length=0.06), PRESETS["paper-triangle"]


@pytest.mark.parametrize(
    "robot",
    [SHORT, pytest.param(CONTROL, marks=pytest.mark.rest), pytest.param(FOUR_TAILS, marks=pytest.mark.rest)],
    ids=["short", "control", "four tails"],
)
@pytest.mark.parametrize(
    "path", ["small triangle", *(pytest.param(name, marks=pytest.mark.rest) for name in SHAPES)]
)
def test_the_fastest_plan_is_the_fastest_of_a_grid_of_dwells(path: str, robot: Robot) -> None:
    """The fastest dwell of straight motion is up to 4 % slower on squares and triangles."""
    drawn = SHAPES.get(path, polygon(3, 3.0))
    quick = plan(drawn, robot, objective="time")
    longest = longest_dwell(quick.tracked.vehicle, 1.2)
    grid = [plan(drawn, robot, dwell=each) for each in np.geomspace(1.2, longest, 7 if path in SHAPES else 4)]
    assert quick.duration <= 1.01 * min(each.duration for each in grid)
    front = [each for each in grid if each.stated_error < quick.stated_error]
    assert all(each.duration > 0.99 * quick.duration for each in front)


def test_dwells_have_a_shortest_time_and_should_not_be_far_too_long() -> None:
    """Dwells of 100 s turn the robot by 127 degrees, so the path is lost."""
    result = plan(circle(2.0), CONTROL, minimum_seconds=5.0)
    assert result.seconds[:-1].min() >= 5.0 * (1 - 1e-9)
    assert result.warnings == ()
    result = plan(circle(3.0), CONTROL, minimum_seconds=100.0)
    assert result.predicted_max > 0.9
    (warning,) = result.warnings
    for part in ("the predicted track is up to 11.2 cm", "dwells of 1.67 min", "turns by 127 degrees"):
        assert part in warning


LAB = CONTROL.tail_length / CONTROL.time_scale  # m/s of one l per time unit
FAST = CalibrationKnowledge(current=(0.0, 0.5 * LAB))
AGAINST = CalibrationKnowledge(current=(-0.05 * LAB, 0.0))


@pytest.mark.parametrize(
    ("path", "expected", "options"),
    [
        ([], "empty", {}),
        ([[0, 0]], "same|two points", {}),
        ([[0, 0], [0, 0]], "same", {}),
        ([[0, 0], [float("nan"), 1]], "finite", {}),
        ([[0, 0, 0], [1, 1, 1]], r"\(n, 2\)", {}),
        ([["a", "b"]], "no number", {}),
        (polygon(4, 0.1), "too small, the robot's circle has a radius", {}),
        ([[0, 0], [8e4, 0]], "at most 12000 l can be planned; scale it", {}),
        (polygon(4, 3.0), "corner of 90 degrees", {"corner": "error"}),
        (polygon(4, 3.0), "give a number of l²", {"time_weight": -1.0}),
        (polygon(4, 3.0), "give a number of l²", {"time_weight": float("nan")}),
        (polygon(4, 3.0), "needs corner = nearest or minimax", {"corner": "fillet", "time_weight": 0.1}),
        (circle(2.0), "below 0.2 time units", {"minimum_dwell": 0.1}),
        (circle(2.0), "objective", {"objective": "speed"}),
        (circle(3.0), "allow shorter ones: it turns too far", {"minimum_seconds": 400.0}),
        (circle(3.0), "as fast as the robot", {"knowledge": FAST}),
        ([[0, 0], [6, 0]], "as fast as the robot", {"knowledge": AGAINST, "point": "pivot"}),
        (circle(2.0), r"outside the look-up table: motor .* rpm \(omega_bar = 500\)",
         {"robot": CONTROL.with_motor(500.0)}),
        (circle(2.0), r"outside the look-up table: disc offset 1.6 mm \(a_over_R = 0.1\)",
         {"robot": replace(CONTROL, disc_offset=0.0016)}),
        (circle(2.0), "lookup: the vehicle of a plan has its own", {"robot": tracked()}),
        (circle(2.0), "point: the vehicle of a plan has its own",
         {"robot": tracked(), "lookup": None, "point": "pivot"}),
        (circle(2.0), "tail_sag .*surrogate robot", {"robot": replace(CONTROL, effects={"tail_sag": 0.1})}),
    ],
    ids=range(22),
)  # fmt: skip
def test_refusals(path: Any, expected: str, options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=expected) as caught:
        plan(path, **{"robot": CONTROL, "lookup": load(), **options})  # of this table alone
    assert "\n" not in str(caught.value)


def test_a_current_is_steered_against() -> None:
    """Across a line: the robot looks upstream, and its track stays on the line."""
    result = planned(((0.0, 0.0), (6.0, 0.0)), current=(0.0, 0.004 * LAB))
    assert result.predicted_rms < 1.4 * result.straight.rms
    middle = result.poses[len(result.poses) // 2 :, 2].mean()
    assert middle == pytest.approx(-math.asin(0.004 / result.straight.net_speed), abs=0.01)


def test_long_paths_are_planned_with_the_least_stated_error_and_propose_the_robot_s_own_table() -> None:
    """The dwell of the smallest zigzag has a larger stated error, since the errors of more flips add up."""
    result = plan(circle(6.0), LONG)
    quick = plan(circle(6.0), LONG, dwell=dwells_for(result.tracked.vehicle, "error", None)[0])
    assert result.minimum_dwell > quick.minimum_dwell
    assert result.stated_error < 0.8 * quick.stated_error
    assert any("own table" in words for words in quick.warnings)
    own = replace(quick, tracked=quick.tracked._replace(own_table=True))
    assert not any("own table" in words for words in own.warnings)


def test_errors_that_are_not_calibrated_say_so() -> None:
    known = CalibrationKnowledge(COEFFICIENTS, 1e-4 * np.eye(3))
    guessed, found = planned(), plan(circle(2.0), CONTROL, knowledge=known)
    assert "if the coefficients are exact" in guessed.error_line
    assert "another robot" in guessed.error_line
    assert "coefficients" not in found.error_line
    assert guessed.error_line in "\n".join(guessed.lines())
    assert guessed.to_dict()["stated_error_unmeasured_over_l"] == guessed.unmeasured_error
    assert found.to_dict()["stated_error_unmeasured_over_l"] is None
    assert "if its coefficients are exact" in schedule_header(guessed, "p1")
    assert "exact" not in schedule_header(found, "p1")


def test_the_stated_error_of_a_verdict_holds_for_every_robot_that_the_runs_allow() -> None:
    """The alternative is 2 % longer, in units of its own, and turns less quickly."""
    known = CalibrationKnowledge(COEFFICIENTS, 1e-4 * np.eye(3))
    other = replace(CONTROL, tail_length=1.02 * CONTROL.tail_length, C_yr=1.15 * CONTROL.C_yr)
    verdict = SimpleNamespace(corrected=CONTROL, knowledge=known, alternatives=((other, known),))
    alone, joined = plan(circle(2.0), CONTROL, knowledge=known), plan(circle(2.0), verdict)
    np.testing.assert_array_equal(joined.dwells, alone.dwells)
    theirs = tracked_vehicle(other, load(), "head_centre", known)
    far = carry_out(alone, theirs).largest / CONTROL.tail_length
    assert joined.stated_error > far > alone.stated_error
    same = SimpleNamespace(corrected=CONTROL, knowledge=known, alternatives=((CONTROL, known),))
    assert plan(circle(2.0), same).stated_error == pytest.approx(alone.stated_error)
    with pytest.raises(InputError, match="a SimpleNamespace is no robot; give a Robot"):  # verdict of a model
        plan(circle(2.0), SimpleNamespace(corrected={"viscosity": 1.0}))


def test_an_error_larger_than_the_path_is_no_error_of_the_path() -> None:
    square = planned("square:2.2l")
    assert square.unmeasured_error is not None
    assert square.unmeasured_error > 2.2
    for words in (square.error_line, schedule_header(square, "p1")):
        assert re.search("[nN]ot known before calibration", words)
        assert in_lab(square.unmeasured_error, CONTROL) in words


def test_the_smaller_error_is_stated_with_its_condition() -> None:
    result, short = planned(), planned("square:2.2l")
    assert f"with feedback {in_lab(result.feedback_error, CONTROL)}" in result.error_line
    assert short.feedback_error > short.stated_error
    assert "with feedback" not in short.error_line


def test_robots_with_the_coefficients_of_another_stay_within_the_error_of_unmeasured_ones() -> None:
    """The first-order statement, against 40 vehicles of robots whose coefficients are drawn as those of others."""
    result = planned("circle:2l", objective="flips")
    rng, lookup, misses = np.random.default_rng(5), load(), []
    for factor in np.exp(rng.normal(size=(40, 3)) * [0.35, 0.22, 0.48]):
        other = {name: getattr(CONTROL, name) * value for name, value in zip(COEFFICIENTS, factor, strict=True)}
        with suppress(InputError):  # outside the table
            truth = table_vehicle(replace(CONTROL, **other), lookup)
            misses.append(distance_to(result.reference, roll_out(truth, result.switches, 0.0).track).max())
    assert len(misses) > 25
    assert result.unmeasured_error is not None
    assert np.mean(np.array(misses) < result.unmeasured_error) > 0.8
    assert np.median(misses) > 0.2 * result.unmeasured_error > 2 * result.stated_error


class Rungs:
    """Stands for the plans with one dwell each: they are blocked above a dwell, and their errors grow with it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, clear_below: float = 99.0, *, hopeless: bool = False):
        self.tried: list[float] = []
        self._clear_below, self._hopeless = clear_below, hopeless
        monkeypatch.setattr(solve, "at_dwell", self.at)

    def at(self, task: Any, tracked: Any, request: Any, dwell: float, **_: Any) -> Any:
        self.tried.append(dwell)
        if dwell >= self._clear_below:
            refusal = BlockedError(f"blocked at {dwell:.3f}")
            refusal.hopeless = self._hopeless
            raise refusal
        return SimpleNamespace(
            stated_error=0.1 * dwell, predicted_max=0.1 * dwell, minimum_dwell=dwell, robot=CONTROL
        )

    def plan(self, *, longer: bool = True, **options: Any) -> Any:
        task = solve.PathTask(source=lambda _: 1 / 0, try_longer=longer)
        return solve.solve(task, tracked(), PlanRequest(objective="flips", **options))


@pytest.mark.parametrize("longer", [True, False])
def test_where_the_path_is_blocked_longer_and_shorter_dwells_are_tried(
    longer: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Longer ones first, if the task allows them; the first that is clear is taken."""
    dwells = dwells_for(tracked().vehicle, "flips", None)
    rungs = Rungs(monkeypatch, clear_below=dwells[0])
    assert rungs.plan(longer=longer).minimum_dwell == rungs.tried[-1] < dwells[0]
    others = longer_dwells(tracked().vehicle, dwells[0])[:4] if longer else []
    assert rungs.tried[:-1] == [dwells[0], *others]


def test_the_first_refusal_is_told_and_a_hopeless_one_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    first = dwells_for(tracked().vehicle, "flips", None)[0]
    for hopeless, count in ((False, 5), (True, 1)):
        rungs = Rungs(monkeypatch, 0.0, hopeless=hopeless)
        with pytest.raises(BlockedError, match=f"blocked at {first:.3f}"):
            rungs.plan(longer=False)
        assert len(rungs.tried) == count
    with pytest.raises(BlockedError):
        Rungs(monkeypatch, 0.0).plan(dwell=1.0)


def test_the_longest_dwell_that_keeps_a_tolerance_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    dwells = dwells_for(tracked().vehicle, "flips", None)
    best = Rungs(monkeypatch).plan(tolerance=0.1)
    assert best.minimum_dwell == max(dwell for dwell in dwells if 0.1 * dwell <= 0.1)
    with pytest.raises(InputError, match=r"tolerance 0.11 mm .* cannot be kept"):
        Rungs(monkeypatch).plan(tolerance=0.001)


@pytest.mark.parametrize("objective", ["error", "time", "flips"])
@pytest.mark.parametrize("path", ["circle:0.9l", "circle:0.95l", "circle:1.05l", "polygon:6:1l", "square:1.6l"])
def test_a_lap_near_the_own_turn_circle_is_swum_whole(path: str, objective: str) -> None:
    """It has few flips or none, and ends where it begins."""
    result = planned(path, objective=objective)
    length = np.hypot(*np.diff(result.reference, axis=0).T).sum()
    assert 0.8 * length / result.tracked.vehicle.speed < result.duration < 1.2 * length / result.straight.net_speed
    middle = result.drawn.points.mean(0)
    angle = np.unwrap(np.arctan2(*(roll_out(result.tracked.vehicle, result.switches).track - middle).T[::-1]))
    assert angle[-1] - angle[0] == pytest.approx(2 * math.pi, rel=0.1)


def test_a_circle_smaller_than_the_rod_is_followed_ahead() -> None:
    """The rod would drag its pivot backwards along it, so the nearest path is declared."""
    rear = lab_robot(np.random.default_rng(56005))
    vehicle = table_vehicle(rear, load())
    assert vehicle.pivot_distance > 0.95 * vehicle.turn_radius
    result = plan(circle(0.94 * vehicle.turn_radius), rear, objective="flips")
    assert result.declared.reference.sharpness.max() < 1 / vehicle.pivot_radius
    assert result.stated_error < 0.3


def test_a_lap_with_too_few_flips_to_be_corrected_is_refused() -> None:
    with pytest.raises(InputError, match="flips too seldom"):
        plan(circle(tracked().vehicle.turn_radius), CONTROL, objective="flips", loop=True)


def test_a_schedule_too_short_for_its_path_is_an_error_of_the_planner(monkeypatch: pytest.MonkeyPatch) -> None:
    follow = line_of_sight.follow_dwells

    def stopped(*arguments: Any) -> Any:
        return follow(*arguments)._replace(ended=True, done=1)

    monkeypatch.setattr(line_of_sight, "follow_dwells", stopped)
    with pytest.raises(RuntimeError, match="error of the planner"):
        plan(circle(2.0), CONTROL, objective="flips")


@pytest.mark.parametrize("way", [1, -1], ids=["counter-clockwise", "clockwise"])
def test_a_picture_shows_the_heading_at_the_start_and_which_way_the_path_goes(way: int) -> None:
    points = polygon(4, side=2.0).points[::way]
    result = plan(Path2D.of(points, closed=True), CONTROL)
    start, *along = [text for text in result.plot().texts if isinstance(text, Annotation)]
    (tip, foot), cm = (np.array(end) for end in (start.xy, start.xyann)), 100 * CONTROL.tail_length
    x, y, heading = result.start
    assert foot == pytest.approx([cm * x, cm * y])
    assert math.atan2(*(tip - foot)[::-1]) == pytest.approx(math.remainder(heading, 2 * math.pi))
    assert len(along) == 3
    for arrow in along:
        (to_x, to_y), (x, y) = arrow.xy, arrow.xyann
        assert math.copysign(1, x * to_y - y * to_x) == way  # about the middle of the square
