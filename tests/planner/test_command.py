"""The command refuses in one line and writes nothing; regions and units of goals."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from sim.io.errors import run_command
from sim.model.presets import PRESETS

CONTROL = PRESETS["paper-control"]


BOX = [[-2, -4], [9, -4], [9, 4], [-2, 4]]


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("p.csv", "x,y\n", "no rows"),
        ("p.csv", "a,b\n1,2\n", "give x and y"),
        ("p.csv", "x,y\n1,two\n3,4\n", "no number"),
        ("p.csv", "x,y\n1,1\n1,1\n", "same"),
        ("p.svg", "<svg", "not SVG"),
        ("p.svg", "<svg xmlns='http://www.w3.org/2000/svg'/>", "draw one"),
        ("p.svg", "<svg><path d='M 0 0 L 1 1 M 2 2 L 3 3'/></svg>", "path1/1, path1/2"),
    ],
)
def test_the_command_refuses_and_writes_nothing(
    name: str, text: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from planner.__main__ import main

    (tmp_path / name).write_text(text)
    words = ["plan", str(tmp_path / name), "--robot", "paper-control", "--out", str(tmp_path / "out")]
    assert run_command(main, words) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_the_command_says_that_there_is_no_way(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from planner.__main__ import main

    words = ["goal", "--robot", "paper-control", "--goal", "5", "0", "0", "--keep-out", "circle:5,0,1"]
    assert run_command(main, [*words, "--out", str(tmp_path / "out")]) == 3
    error = capsys.readouterr().err
    assert error.startswith("error: there is no way: at the goal")
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("region", "expected"),
    [
        ("boxx:0,0,1,1", "is it box:0,0,1,1? regions are circle:X,Y,RADIUS, box:"),
        ("ring:0,1", "regions are circle:X"),
    ],
)
@pytest.mark.parametrize("command", [["goal", "--goal", "5", "0", "0", "--keep-out"], ["cover", "--width", "4cm"]])
def test_a_misspelt_region_is_told_the_nearest_one(
    command: list[str], region: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It used to be told the shapes of paths."""
    from planner.__main__ import main

    words = [*command, region, "--robot", "paper-control", "--out", str(tmp_path / "out")]
    assert run_command(main, words) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert f"{region}: no such file or region; {expected}" in error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("command", "what"),
    [
        (["goal", "--goal", "300", "200", "0"], "way across start and goal"),
        (["tour", "0,0", "300,0", "300,200"], "way across the places"),
        (["cover", "box:0,0,300,200", "--width", "4cm"], "way across the region"),
    ],
)
def test_lengths_of_a_job_whose_unit_nobody_stated_are_asked_about(
    command: list[str], what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Places in mm used to be planned as tail lengths: 40 m."""
    from planner.__main__ import main

    words = [*command, "--robot", "paper-control", "--out", str(tmp_path / "out")]
    assert run_command(main, words) == 2
    (error,) = capsys.readouterr().err.splitlines()
    for part in (f"the {what} is 39.7 m (361 l) long, 33 m by 22 m (300 by 200 l)", "--unit l if this is meant",
                 "if you gave l and mean mm, it is 3.28 l: --unit mm"):  # fmt: skip
        assert part in error
    assert not (tmp_path / "out").exists()


def test_a_goal_whose_unit_is_stated_is_not_asked_about(tmp_path: Path) -> None:
    from planner.__main__ import main

    words = ["goal", "--goal", "300", "200", "0", "--unit", "mm", "--robot", "paper-control"]
    assert run_command(main, [*words, "--out", str(tmp_path / "out")]) == 0


def test_files_and_units(tmp_path: Path) -> None:
    from planner.__main__ import main

    tail = 100 * CONTROL.tail_length
    (tmp_path / "outline.csv").write_text("".join(f"{x * tail},{y * tail}\n" for x, y in BOX))
    words = ["goal", "--robot", "paper-control", "--unit", "cm", "--goal", str(3 * tail), str(tail), "-90"]
    words += ["--walls", str(tmp_path / "outline.csv"), "--keep-out", f"circle:0,{3 * tail},{tail}"]
    assert run_command(main, [*words, "--out", str(tmp_path / "out")]) == 0
    content = json.loads((tmp_path / "out" / "goal.json").read_text())
    assert content["goal"] == pytest.approx([3, 1, -math.pi / 2])
    assert np.array(content["walls"]) == pytest.approx(np.array(BOX))
    assert content["keep_out"][0]["circle"] == pytest.approx([0, 3, 1])
    assert content["margin_over_l"] > 0
    assert {"plan.json", "schedule.h", "goal.svg"} <= {path.name for path in (tmp_path / "out").iterdir()}
