"""The commands `track` and `replan`: a saved plan is as good as one in memory; bad words end in one line."""

from __future__ import annotations

import io
import math
from pathlib import Path

import pytest

from planner.__main__ import main
from planner.files.goal_files import write_goal_plan
from planner.files.plan_files import FILES, write_plan
from planner.files.plan_json import load_plan
from planner.goal.to_goal import to_goal
from planner.paths.path import circle
from planner.planning.plan import plan
from planner.tracking.tracker import Tracker
from sim.io.errors import run_command
from sim.model.presets import PRESETS

ROBOT = PRESETS["paper-control"]
POSE = (0.3, -2.5, 1.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("plan")
    write_plan(plan(circle(2.0), ROBOT), place)
    return place


def told(
    words: list[str], lines: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> list[str]:
    """Run the command on lines; return its answers."""
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(lines.encode("latin-1")), "utf-8"))
    capsys.readouterr()
    assert run_command(main, ["track", *words]) == 0
    return capsys.readouterr().out.splitlines()


def test_a_saved_plan_gives_the_orders_of_the_plan_in_memory(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scale, cm = ROBOT.time_scale, 100 * ROBOT.tail_length
    tracker = Tracker(plan(circle(2.0), ROBOT), start=POSE)
    pose = f"{POSE[0]} {POSE[1]} {POSE[2]}"
    start = [str(cm * POSE[0]), str(cm * POSE[1]), str(math.degrees(POSE[2]))]
    in_l = [f"{x}l" for x in POSE[:2]]
    commands = [tracker.command, tracker.update(1.0 / scale), tracker.update(2.0 / scale, (0.31, -2.49, 1.01))]
    expected = [[command.direction, command.flip_at * scale] for command in commands]
    later = "1\n2 0.31 -2.49 1.01\n"
    for words, lines in (
        ([str(folder / "plan.json")], f"0 {pose}\n{later}"),
        ([str(folder), "--start", *start, "--unit", "cm"], f"0\n{later}"),
        (
            ["circle:2l", "--robot", "paper-control", "--start", *in_l, start[2]],
            f"0\n{later}",
        ),
    ):
        answers = [[float(word) for word in line.split()[:2]] for line in told(words, lines, monkeypatch, capsys)]
        assert answers == [pytest.approx(order, abs=1e-4) for order in expected]


def test_a_goal_trip_is_tracked_from_its_goal_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_goal_plan(to_goal((0, 0, 0), (3, 1, 1), ROBOT), tmp_path)
    lines = "0\n1 0 0.1 0.1\n1.5 \xb0\n"  # the last one is no UTF-8
    first, second, _ = told([str(tmp_path / "goal.json")], lines, monkeypatch, capsys)
    assert first == "0 1.000000000 nan 0"
    assert second.split()[0] in ("1", "-1")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["{}/plan.json", "--smooth", "0.3"], "--smooth: {}/plan.json is planned already"),
        (["{}", "--robot", "paper-control"], "--robot: {} is planned already"),
        (["{}", "--keep-out", "circle:0,0,1"], "--keep-out: {} is planned already"),
        (["{}", "--closed"], "--closed: {} is planned already"),
        (["{}", "--start", "0", "inf", "0"], "--start: inf; write a length"),
        (["{}", "--noise", "0"], "--noise: 0; write a length above 0"),
        (["circle:2l"], "circle:2l is no saved plan, so --robot is needed"),
        (["{}/tour.json"], "tour.json"),
    ],
)
def test_bad_words_end_in_one_line(
    words: list[str], expected: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "tour.json").write_text("{}")
    assert run_command(main, ["track", *(word.replace("{}", str(folder)) for word in words)]) == 2
    output = capsys.readouterr()
    assert expected.replace("{}", str(folder)) in output.err
    assert len(output.err.splitlines()) == 1
    assert output.out == ""


def test_replan_writes_a_plan_from_where_the_robot_is(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "track.csv").write_text("time_s,x_cm,y_cm,heading_deg\n0,22,0,90\n60,10,25,170\n")
    words = ["replan", str(folder), str(tmp_path / "track.csv"), "--out", str(tmp_path / "rest")]
    assert run_command(main, words) == 0
    said = capsys.readouterr().out
    assert "start: put the head's centre at (10.00, 25.00) cm" in said
    assert "the track has followed" in said
    assert "joins it at" in said
    start = load_plan(tmp_path / "rest" / "plan.json")["start"]
    assert start["x_over_l"] == pytest.approx(0.1 / ROBOT.tail_length)
    assert {path.name for path in (tmp_path / "rest").iterdir()} == set(FILES)


@pytest.mark.parametrize(
    ("plan_words", "track", "expected"),
    [
        ("{}", "time_s,x_cm,y_cm\n0,0,0\n", "no column 'heading_deg'"),
        ("{}", "time_s,x_cm,y_cm,heading_deg\n0,nan,0,0\n", "row 1 of the track"),
        ("{}/none.json", "time_s,x_cm,y_cm,heading_deg\n0,0,0,0\n", "none.json: no such file"),
        ("{}/plan.csv", "time_s,x_cm,y_cm,heading_deg\n0,0,0,0\n", "is not a plan.json"),
        ("{}", None, "track.csv: no such file"),
    ],
)
def test_replan_refuses_in_one_line_and_writes_nothing(
    plan_words: str, track: str | None, expected: str, folder: Path, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    if track is not None:
        (tmp_path / "track.csv").write_text(track)
    words = ["replan", plan_words.replace("{}", str(folder)), str(tmp_path / "track.csv")]
    assert run_command(main, [*words, "--out", str(tmp_path / "rest")]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "rest").exists()
