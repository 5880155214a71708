"""The command `replay`: files that are no plans, another robot, the tracking error."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from planner.__main__ import main
from planner.files.plan_files import write_plan
from planner.files.tracking_error import tracking_error
from planner.paths.path import circle
from planner.planning.plan import plan
from sim.inputs import save_robot
from sim.io.errors import run_command
from sim.model.presets import PRESETS
from sim.motion.replay import replay


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "not a plan.json"),
        ("{}", "no format"),
        (
            '{"format": 2, "robot": {"groups": {"omega_bar": 10}, "time_scale_s": 1}, "first_direction": 1}',
            "no entry",
        ),
        ("not json", "not a plan.json"),
    ],
)
def test_replay_refuses(text: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = tmp_path / "plan.json"
    plan.write_text(text)
    assert run_command(main, ["replay", str(plan), "--out", str(tmp_path / "t.csv")]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert len(error.splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["plan.json"]


def test_replay_of_a_folder_is_told_the_file_in_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "plan.json").write_text("{}")
    assert run_command(main, ["replay", str(tmp_path), "--out", str(tmp_path / "t.csv")]) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert error.endswith(f"is the folder of a plan; give {tmp_path / 'plan.json'}")


def test_replay_shows_no_bar_without_a_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A replay of 700 dwells used to write 1,400 bars into a log."""
    robot = {"groups": PRESETS["paper-control"].group_values(), "time_scale_s": 2.0, "tail_length_m": 0.11}
    start = {"x_over_l": 0.0, "y_over_l": 0.0, "heading_rad": 0.0}
    content = {"format": 2, "robot": robot, "start": start, "first_direction": 1, "dwell_bar": [0.3, 0.3]}
    (tmp_path / "plan.json").write_text(json.dumps(content))
    monkeypatch.setattr("planner.replay_command.BAR_AFTER", 0.0)
    words = ["replay", str(tmp_path / "plan.json"), "--out", str(tmp_path / "t.csv"), "--no-error"]
    assert run_command(main, words) == 0
    assert "replay:" not in capsys.readouterr().err


def test_another_robot_carries_out_a_plan_and_its_tracking_error_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its track was in its own tail lengths, and `check` took them for those of the plan's robot."""
    result = plan(circle(1.0), PRESETS["paper-control"], objective="flips")
    other = replace(PRESETS["paper-control"], name="other", tail_length=0.9 * PRESETS["paper-control"].tail_length)
    write_plan(result, tmp_path)
    save_robot(other, tmp_path / "other.toml")
    words = [str(tmp_path / "plan.json"), "--out", str(tmp_path / "track.csv"), "--no-error"]
    assert run_command(main, ["replay", *words, "--robot", str(tmp_path / "other.toml")]) == 0
    told = capsys.readouterr().out.splitlines()[-1]
    assert run_command(main, ["check", *words[:1], words[2]]) == 0
    assert capsys.readouterr().out.splitlines() == [told]
    track = replay([result.schedule(other)])[0][["time_s", "x_cm", "y_cm", "heading_deg"]]
    assert tracking_error(result.to_dict(), track).line == told
    assert "ABOVE the stated error" in told
    twin = write_plan(plan(circle(1.0), other, objective="flips"), tmp_path / "twin")[0]
    assert run_command(main, ["check", str(twin), words[2]]) == 2
    assert f"is of plan {result.identity}, not of" in capsys.readouterr().err
