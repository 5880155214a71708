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

    words = ["goal", "--robot", "paper-control", "--goal", "5l", "0", "0", "--keep-out", "circle:5l,0,1l"]
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
@pytest.mark.parametrize("command", ["goal --goal 5l 0 0 --keep-out", "cover --width 4cm"])
def test_a_misspelt_region_is_told_the_nearest_one(
    command: str, region: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It used to be told the shapes of paths."""
    from planner.__main__ import main

    words = [*command.split(), region, "--robot", "paper-control", "--out", str(tmp_path / "out")]
    assert run_command(main, words) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert f"{region}: no such file or region; {expected}" in error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("plan square:3", "square:3: its lengths have no unit; write it behind them, 24cm or 3l"),
        ("plan path.csv", "path.csv: its lengths have no unit; write it behind them, 24cm or 3l"),
        ("plan path.svg", "path.svg: its lengths have no unit;"),
        ("plan square:3l --unit cm", "square:3l: --unit cm: it has a size of its own, it is 1.3"),
        ("plan x_mm.csv --unit cm", "x_mm.csv: --unit cm: it has a size of its own"),
        ("plan square:3l --tolerance 5", "--tolerance: 5 has no unit; write 5cm, or 5l in tail"),
        ("plan square:3l --smooth 1", "--smooth: 1 has no unit"),
        ("plan square:3l --keep-out circle:9cm,0,2", "circle:9cm,0,2: 2 has no unit"),
        ("plan square:3l --walls path.csv", "path.csv: its lengths have no unit"),
        ("track square:3l --start 1 0 0", "--start: 1 has no unit"),
        ("track square:3l --noise 1", "--noise: 1 has no unit"),
        ("goal --goal 300 200 0", "--goal: 300 has no unit"),
        ("goal --goal 3l 0 0 --via 2l -1", "--via: -1 has no unit"),
        ("goal --goal 3l 0 east", "--goal: east; write the heading in degrees"),
        ("tour 0,0 300,0", "place 300,0: 300 has no unit"),
        ("tour path.csv", "path.csv: its lengths have no unit"),
        ("cover box:0,0,300,200 --width 4cm", "box:0,0,300,200: 300 has no unit"),
        ("cover box:0,0,3l,2l --width 4", "--width: 4 has no unit"),
        ("hold 2,1", "place 2,1: 2 has no unit"),
        ("page --path square:3", "square:3: its lengths have no unit"),
    ],
)
def test_every_length_has_a_unit(
    words: str, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """Numbers without a unit used to be tail lengths: a square of 24 cm was planned as one of 2.64 m."""
    from planner.__main__ import main

    monkeypatch.chdir(tmp_path)
    Path("path.csv").write_text("x,y\n0,0\n3,0\n3,3\n")
    Path("x_mm.csv").write_text("x_mm,y_mm\n0,0\n300,0\n300,300\n")
    Path("path.svg").write_text("<svg><path d='M 0 0 h 3 v 3'/></svg>")
    out = [] if words.startswith("track") else ["--out", "out"]
    assert run_command(main, [*words.split(), "--robot", "paper-control", *out]) == 2
    *said, error = capsys.readouterr().err.splitlines()
    assert expected in error
    assert not said or out == []  # track prints the plan first
    assert "--unit" in error or "degrees" in error
    assert not Path("out").exists()


@pytest.mark.parametrize(
    "words",
    [
        ["square:24cm", "--tolerance", "5mm"], ["square:24", "--unit", "cm", "--tolerance", "0.5"],
        ["square:240mm", "--tolerance", "0.5cm"], ["square:0.24m", "--unit", "m", "--tolerance", "0.005"],
        ["path.csv", "--unit", "cm", "--tolerance", "0.5"], ["path_cm.csv", "--unit", "cm", "--tolerance", "0.5"],
        ["path_mm.csv", "--tolerance", "0.5cm"],
    ],
)  # fmt: skip
def test_one_square_in_many_words(words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """--tolerance used to be in tail lengths, whatever --unit said; --unit beside a column in it was refused."""
    from planner.__main__ import main

    monkeypatch.chdir(tmp_path)
    for name, size in (("x,y", 24), ("x_cm,y_cm", 24), ("x_mm,y_mm", 240)):
        corners = f"0,0\n{size},0\n{size},{size}\n0,{size}\n"
        Path(f"path{name[1:].split(',')[0]}.csv").write_text(f"{name}\n{corners}")
    asked = [*words, "--robot", "paper-control", "--objective", "flips"]
    assert run_command(main, ["plan", *asked, *["--closed"] * ("csv" in words[0]), "--out", "out"]) == 0
    plan = json.loads(Path("out/plan.json").read_text())
    assert np.ptp(np.array(plan["raw_path"]), axis=0) == pytest.approx(0.24 / CONTROL.tail_length)
    assert plan["stated_error_over_l"] <= 0.005 / CONTROL.tail_length


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
