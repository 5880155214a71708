"""The error on a path: both schedules on the corrected robot, what the calibration says of it, and refusals."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import softflagella.path_error
from calibration.report.path_error import PathError
from common.errors import InputError, run_command
from planner.paths.distance import distance_to
from sim.knowledge import CalibrationKnowledge
from sim.model.learnt_range import learnt_range
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.replay import replay
from softflagella.__main__ import main
from softflagella.path_error import DEFAULT_PATHS, path_errors, wanted_paths
from surrogate.interface import LookupTable
from surrogate.robot_table import RobotTable
from surrogate.table_file import load
from surrogate.tabulate import tabulate
from tests.calibration.toy_tables import DRAG, effect, toy_table, verdict_of
from tests.page_text import PageText
from tests.shared import shared

GIVEN = PRESETS["paper-control"]
CORRECTED = replace(GIVEN, C_yr=0.92 * GIVEN.C_yr, tail_length=0.998 * GIVEN.tail_length, effects={DRAG: 1.0})
KNOWN = CalibrationKnowledge(("C_yr",), np.array([[0.01**2]]))
LENGTH = GIVEN.tail_length
ROBOTS = {"given": GIVEN, "corrected": CORRECTED}


@shared
def own_table(name: str) -> RobotTable:
    return tabulate(ROBOTS[name])


@pytest.fixture(autouse=True)
def _own_tables_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other robots have the shipped table."""

    def table(robot: Robot) -> LookupTable:
        return next((own_table(name) for name, known in ROBOTS.items() if known == robot), load())

    monkeypatch.setattr(softflagella.path_error, "tabulate", table)


@shared
def error_of(knowledge: str = "sure") -> PathError:
    """The error on a circle."""
    known = {
        "sure": KNOWN,
        "unsure": replace(KNOWN, covariance=9 * KNOWN.covariance),
        "in a current": replace(KNOWN, current=(2e-5, -1e-5)),
    }
    return path_errors(wanted_paths(["circle:1.2l"], GIVEN), GIVEN, CORRECTED, known[knowledge])[0]


@pytest.mark.slow
def test_the_error_is_that_of_a_replay_in_time_steps() -> None:
    error = error_of()
    carried = error.carried_out["as_given"]
    track = replay(carried.schedule)
    places = CORRECTED.tail_length * track[["x_over_l", "y_over_l"]].to_numpy()
    distance = distance_to(error.polyline, places)
    weight = np.gradient(track["time_bar"].to_numpy())
    rms = math.sqrt((weight * distance**2).sum() / weight.sum())
    assert carried.rms == pytest.approx(rms, abs=0.01 * LENGTH)
    assert carried.largest == pytest.approx(distance.max(), abs=0.02 * LENGTH)
    end = np.hypot(*(places[-1] - error.polyline[-1]))
    assert carried.end == pytest.approx(end, abs=0.02 * LENGTH)
    np.testing.assert_allclose(carried.track[-1], places[-1], atol=0.02 * LENGTH)


def test_the_corrected_robot_s_plan_leads_along_the_path_and_the_other_does_not() -> None:
    error = error_of()
    as_given, corrected = error.carried_out["as_given"], error.carried_out["corrected"]
    assert corrected.rms < 0.03 * LENGTH
    assert as_given.rms > 5 * corrected.rms
    assert as_given.end > 5 * corrected.end
    for each in (as_given, corrected):
        assert each.rms < each.largest < each.within
    assert as_given.end_interval[0] < as_given.end < as_given.end_interval[1]
    assert not error.refusals
    record = error.record()
    assert record["refused"] == []
    for name, carried in error.carried_out.items():
        entry = record[name]
        assert entry["rms_cm"] == pytest.approx(100 * carried.rms)
        for key in ("rms", "largest", "end", "within", "end_interval"):
            lengths = np.array(entry[f"{key}_over_l"]) * 100 * LENGTH
            np.testing.assert_allclose(entry[f"{key}_cm"], lengths, rtol=1e-12)
        assert entry["dwells"] == len(carried.schedule.dwells)
    assert "planned with the robot as given" in error.sentence
    assert "cm rms" in error.sentence


@pytest.mark.slow
def test_a_less_certain_calibration_states_wider_errors_and_a_current_carries_the_robot() -> None:
    """Only the corrected plan knows the current."""
    sure, unsure, carried = (error_of(known).carried_out for known in ("sure", "unsure", "in a current"))
    for one, two in zip(sure.values(), unsure.values(), strict=True):
        assert two.rms == pytest.approx(one.rms, rel=0.2)
        assert two.within > one.within
        assert np.ptp(two.end_interval) > 2 * np.ptp(one.end_interval)
    schedule = sure["as_given"].schedule
    seconds = float(schedule.dwells.sum()) * schedule.time_scale
    moved = carried["as_given"].track[-1] - sure["as_given"].track[-1]
    np.testing.assert_allclose(moved, seconds * np.array([2e-5, -1e-5]), rtol=1e-6)
    assert carried["corrected"].rms < 0.03 * LENGTH


def test_what_cannot_be_planned_is_said_and_nothing_else_is_lost() -> None:
    small, good = path_errors(wanted_paths(["circle:0.001l", "circle:1.2l"], GIVEN), GIVEN, CORRECTED, KNOWN)
    assert not small.carried_out
    assert len(small.refusals) == 2
    assert all("too small" in refusal for refusal in small.refusals)
    assert small.record()["as_given"] is small.record()["corrected"] is None
    assert "\n" not in small.sentence
    assert set(good.carried_out) == {"as_given", "corrected"}
    elsewhere = [replace(GIVEN, tail_length=length).group_values() for length in (0.05, 0.06)]
    outside = replace(CORRECTED, learnt_from=learnt_range(elsewhere))
    (error,) = path_errors(wanted_paths(["circle:1.2l"], GIVEN), GIVEN, outside, KNOWN)
    assert not error.carried_out
    assert len(error.refusals) == 1
    assert error.refusals[0].startswith("not planned with the corrected robot: ")


def test_paths_are_read_with_their_sizes_and_what_is_none_is_refused_at_once(tmp_path: Path) -> None:
    assert path_errors([], GIVEN, CORRECTED, KNOWN) == ()
    with pytest.raises(InputError, match="square:3l"):
        wanted_paths(["squre:3l"], GIVEN)
    twice = wanted_paths(["square:3l", "circle:2l", "square:3l"], GIVEN)
    assert [each.words for each in twice] == ["square:3l", "circle:2l"]
    file = tmp_path / "path.csv"
    file.write_text("x_cm,y_cm\n0,0\n22,0\n22,11\n")
    (wanted,) = wanted_paths([str(file)], GIVEN)
    assert wanted.path.length == pytest.approx(0.33 / LENGTH)


@pytest.mark.slow
def test_a_verdict_and_its_report_have_the_error_on_a_path(tmp_path: Path) -> None:
    verdict = verdict_of(effect())
    assert verdict.to_dict()["path"] is None
    small = path_errors(wanted_paths(["circle:0.001l"], GIVEN), GIVEN, CORRECTED, KNOWN)
    paths = replace(verdict, paths=(error_of(), *small)).save(tmp_path)
    record = json.loads(paths[0].read_text())["path"]
    assert set(record) == {"circle:1.2l", "circle:0.001l"}
    assert record["circle:1.2l"]["corrected"]["rms_cm"] < record["circle:1.2l"]["as_given"]["rms_cm"]
    seen = PageText(paths[1]).text
    assert "On a path" in seen
    assert "planned with the corrected robot" in seen
    assert "too small" in seen


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model", "few_candidates")
def test_the_command_states_it_on_the_paths_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    toy_table(3, lengths_cm=(6.0, 9.0)).to_csv(tmp_path / "t.csv", index=False)
    words = ["calibrate", str(tmp_path / "t.csv"), "--robot", "paper-measured", "--out", str(tmp_path / "out")]
    for refused in (["--path", "squre:3l"], ["--path", "circle:2l", "--no-path"]):
        assert run_command(main, [*words, *refused]) == 2
        assert not (tmp_path / "out").exists()
    capsys.readouterr()
    assert run_command(main, [*words, "--path", "circle:1.2l", "--path", "circle:2l"]) == 0
    printed = capsys.readouterr().out
    asked_for = ("circle:1.2l", "circle:2l")
    assert all(f"on the path {path}: planned with the robot as given" in printed for path in asked_for)
    assert tuple(json.loads((tmp_path / "out" / "verdict.json").read_text())["path"]) == asked_for
    assert DEFAULT_PATHS == ("square:3l",)
