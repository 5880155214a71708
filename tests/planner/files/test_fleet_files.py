"""The command for a fleet: its TOML file, what it writes, and what it refuses in one line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from planner.files.fleet_files import distance_apart, read_fleet
from planner.files.plan_json import load_plan
from sim.io.errors import InputError, run_command
from sim.model.presets import PRESETS

TWO = """
apart = "3cm"
robot = "paper-control"
objective = "flips"
[[member]]
name = "right"
path = "right.csv"
[[member]]
goal = [11, 24, 90]
start = [11, -21, 90]
unit = "cm"
delay_s = 10
"""


def write_files(folder: Path, text: str = TWO) -> Path:
    (folder / "right.csv").write_text("x_cm,y_cm\n0,0\n33,0\n")
    (folder / "fleet.toml").write_text(text)
    return folder / "fleet.toml"


def command(path: Path, out: Path, *words: str) -> int:
    from planner.__main__ import main

    return run_command(main, ["fleet", str(path), "--out", str(out), *words])


def test_the_command_plans_for_all_robots(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = write_files(tmp_path), tmp_path / "out"
    assert command(path, out) == 0
    assert "least distance" in capsys.readouterr().out
    content = json.loads((out / "fleet.json").read_text())
    assert [robot["name"] for robot in content["robots"]] == ["right", "robot-2"]
    assert content["sure_distance_m"] >= content["apart_m"] == pytest.approx(0.03)
    assert content["robots"][1]["begin_s"] >= 10
    for robot in content["robots"]:
        assert load_plan(out / robot["name"] / "plan.json")["id"] == robot["plan_id"]
        assert {"plan.csv", "schedule.h", "tracker.h", "plan.svg"} < {
            file.name for file in (out / robot["name"]).iterdir()
        }
    assert "<svg" in (out / "fleet.svg").read_text()
    renamed = write_files(tmp_path, TWO.replace('"right"', '"left"'))
    assert command(renamed, out) == 0
    assert sorted(file.name for file in out.iterdir()) == ["fleet.json", "fleet.svg", "left", "robot-2"]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (TWO, "apart = 1\n", "no robots"),
        ('apart = "3cm"', "", "how far apart"),
        ('apart = "3cm"', 'apart = "3 apples"', "distance apart: 3 apples; write a length"),
        ('apart = "3cm"', 'apart = "30cm"', "right and robot-2 start"),
        ('"right"', '"../right"', "names a folder"),
        ('"right"', '"robot-2"', "two robots are named robot-2"),
        ("delay_s = 10", "delay_s = -1", "start delay"),
        ("delay_s = 10", 'delay_s = "soon"', "delay_s"),
        ('path = "right.csv"', "", "one of path, goal, places, region"),
        ('path = "right.csv"', 'path = "right.csv"\ngoal = [1, 1, 1]', "one of path, goal, places, region"),
        ('path = "right.csv"', 'path = "wrong.csv"', "wrong.csv"),
        ('path = "right.csv"', 'path = "right.csv"\nspeed = 3', "--speed"),
        ('robot = "paper-control"', 'robot = "no-such"', "no robot 'no-such'"),
        ('robot = "paper-control"', "", "give robot, and one of"),
        ('apart = "3cm"', 'apart = "3cm"\nfeedback = 1', "write true or false"),
    ],
)
def test_it_refuses_in_one_line_and_writes_nothing(
    old: str, new: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert old in TWO
    path = write_files(tmp_path, TWO.replace(old, new, 1))
    assert command(path, tmp_path / "out") == 2
    error = capsys.readouterr().err
    assert expected in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_options_for_all_robots_and_places(tmp_path: Path) -> None:
    path = write_files(tmp_path, 'unit = "cm"\n[[member]]\nrobot = "paper-control"\nplaces = [[0, 0], [-30, 5]]\n'
                                 'return = true\nkeep_out = ["circle:1,2,3", "circle:4,5,6"]\n')  # fmt: skip
    (robot,) = read_fleet(path).robots
    assert robot.command == "tour"
    assert robot.words == (
        "--robot", "paper-control", "--unit", "cm", "--return", "--keep-out", "circle:1,2,3", "--keep-out",
        "circle:4,5,6", "--", "0,0", "-30,5",
    )  # fmt: skip


def test_the_old_name_of_the_array_is_read(tmp_path: Path) -> None:
    new, old = 'path = "right.csv"\n', TWO.replace('robot = "paper-control"\n', "", 1)
    old = old.replace("[[member]]", '[[robot]]\nrobot = "paper-control"')
    assert new in old
    assert read_fleet(write_files(tmp_path, old)) == read_fleet(write_files(tmp_path, TWO))


def test_distances_have_units() -> None:
    control, other = PRESETS["paper-control"], PRESETS["paper-measured"]
    assert distance_apart("10 cm", None, [control, other]) == pytest.approx(0.1)
    assert distance_apart(10, "cm", [control, other]) == pytest.approx(0.1)
    assert distance_apart("0.5l", None, [control, control]) == pytest.approx(0.5 * control.tail_length)
    with pytest.raises(InputError, match=r"distance apart: 0\.5 has no unit"):
        distance_apart(0.5, None, [control, control])
    with pytest.raises(InputError, match="different tail lengths"):
        distance_apart(0.5, "l", [control, replace(other, tail_length=0.1)])
    with pytest.raises(InputError, match="above 0"):
        distance_apart("0cm", None, [control])
