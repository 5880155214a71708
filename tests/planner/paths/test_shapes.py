"""Shapes in words, for the command and for Python."""

from __future__ import annotations

from pathlib import Path

import pytest

from planner.__main__ import main
from planner.paths.path import polygon
from planner.paths.path_files import read_path
from planner.paths.shapes import SHAPES
from sim.io.errors import InputError, run_command


def test_regular_polygons_have_names() -> None:
    assert read_path("polygon:6:2l").path.points == pytest.approx(polygon(6, 2.0).points)
    assert read_path("square:3l").path.points == pytest.approx(polygon(4, 3.0).points)
    assert read_path("polygon:3:1.5l").path.points == pytest.approx(read_path("triangle:1.5l").path.points)
    assert read_path("circle:2l").path.length == pytest.approx(4 * 3.14159265, rel=1e-4)


@pytest.mark.parametrize("words", ["hexagon:3", "circle", "square", "rectangle:2:3", "HEXAGON:3"])
def test_an_unknown_shape_is_told_which_there_are(words: str) -> None:
    with pytest.raises(InputError) as caught:
        read_path(words)
    assert str(caught.value) == f"{words}: no such file or shape; shapes are {SHAPES}"


@pytest.mark.parametrize(
    ("words", "near"),
    [("squre:3l", "square:3l"), ("cirlce:2l", "circle:2l"), ("Circle:2l", "circle:2l"),
     ("poligon:6:2l", "polygon:6:2l"), ("traingle", "triangle:SIDE")],
)  # fmt: skip
def test_a_misspelt_shape_is_told_the_nearest_one(words: str, near: str) -> None:
    with pytest.raises(InputError) as caught:
        read_path(words)
    assert str(caught.value) == f"{words}: no such file or shape; is it {near}? shapes are {SHAPES}"


@pytest.mark.parametrize(
    "words", ["circle:", "circle:two", "circle:2:3", "polygon:6", "polygon:2:3l", "polygon:5.5:3l",
              "polygon:1e9:3l", "polygon:nan:3l", "polygon:6cm:3l", "circle:2km",
              "square:0l", "square:inf", "triangle:-1", "polygon:6:nan"],
)  # fmt: skip
def test_sizes_that_make_no_sense(words: str) -> None:
    with pytest.raises(InputError, match=r"polygon:6:2l|above 0"):
        read_path(words)


def test_a_file_without_an_ending_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("circle").write_text("x,y\n0,0\n1,2\n")
    assert read_path("circle").path.points.tolist() == [[0, 0], [1, 2]]
    with pytest.raises(InputError, match=r"no such file; check|No such file|no such file"):
        read_path("missing.csv")


def test_the_command_takes_a_polygon(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["plan", "polygon:6:2l", "--robot", "paper-control", "--out", str(tmp_path / "plan")]
    assert run_command(main, words) == 0
    assert "132 cm (12 l) long" in capsys.readouterr().out
