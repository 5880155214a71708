"""Paths of drawings are those of `read_path`, by name; and so are the refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from planner.paths.svg_drawing import read_svg
from sim.io.errors import InputError
from tests.planner.page.page_core import EXACT, answer, answers, check_near, without_digits
from tests.planner.paths.svg_cases import ALIKE, REFUSED

BODIES = [
    "<polyline points='0,0 3,0 3,-4'/>", "<polygon points='0,0 3,0 3,-4'/>", "<path d='M 0 0 h 3 v -4 Z'/>",
    "<path d='M 1 1 L 4 1 l 0 -4'/>", "<line x1='1' y1='1' x2='4' y2='-3'/>", "<circle cx='2' cy='1' r='3'/>",
    "<rect x='1' y='1' width='3' height='2'/>", "<rect x='1' width='9' height='6' rx='2'/>",
    "<ellipse rx='3' ry='1'/>",
    "<path d='M 0 0 A 3 1 0 0 1 6 0'/>", "<path d='M 0 0 C 1 2 3 2 4 0'/>", "<path d='M0,0c1-2 3-2 4 0s3 2 4 0'/>",
    "<path d='M0 0Q1 2 3 0T6 0t3 1'/>", "<path d='m1 1 2 3 4-1z'/>",
    "<path d='M0 0a2 3 30 1 0 4 1A1 1 0 0110 10'/>",
    "<g transform='translate(10,0) rotate(90)'><path d='M 0 0 L 2 0' transform='scale(3)'/></g>",
    "<path d='M0 0H5V2h-1v3' transform='matrix(1 .5 -.3 2 7 8)'/>", "<circle r='2' transform='scale(2,-1)'/>",
    "<rect width='4' height='2' transform='rotate(30)'/>",
    "<path d='M0 0C1 2 3 2 4 0' transform='skewX(20) skewY(-10deg) translate(3)'/>",
    "<ellipse rx='3' ry='1' transform='rotate(30 1 2)'/>",
    "<path d='M0 0A3 1 20 0 0 5 5' transform='rotate(40)'/>",
    "<defs><path id='p' d='M0 0L1 2 3 1'/></defs><use href='#p' x='3' y='1' transform='scale(2)'/>",
    "<g style='display:none'><path d='M0 0L9 9'/></g><path d='M0 0L1 1'/>", "<path d='M0 0L1e1,2.5e-1.5.5'/>",
    "<!-- c --><path d='M0 0L&#49; 1'/><text>no path</text><title>t</title>",
]  # fmt: skip
ROOTS = ["", "width='5cm' height='5cm' viewBox='0 0 100 100'", "width='70mm' height='30mm' viewBox='1 2 100 100'",
         "viewBox='0 0 10 10' width='200' height='100' preserveAspectRatio='xMaxYMin slice'"]  # fmt: skip
SEVERAL = (
    "<defs><clipPath id='c'><path d='M 0 0 L 9 9'/></clipPath></defs>"
    "<path id='outline' d='M 0 0 L 1 0 M 5 5 L 5 7'/><rect width='2' height='2'/><text>no path</text>"
)
BAD = [
    "<svg", "", "<svg/>", "<svg><path d='M 0 0'/></svg>", "<svg><path d='nonsense'/></svg>", "no xml",
    "<svg><path d='M 0 0 L 0 0'/></svg>", "<svg><text>hi</text></svg>", "<svg><g></svg>", "<svg></svg><svg/>",
    "<svg><path d='M0 0L1 1' transform='matrix(1 2)'/></svg>",
    "<svg><path d='M0 0L1 1' transform='rotate(a)'/></svg>",
    "<svg xmlns:xlink='http://www.w3.org/1999/xlink'><g id='a'><use xlink:href='#a'/></g></svg>",
    f"<svg><path d='M{'1 ' * 50_001}'/></svg>", f"<svg>{'<g>' * 120}{'</g>' * 120}</svg>",
]  # fmt: skip


def check_drawing(text: str, folder: Path, shape: str | None = None) -> None:
    file = folder / "a.svg"
    file.write_text(text)
    wanted, unit = read_svg(file, None, shape)
    found = answer("svg_drawing.js", "readSvg", text, str(file), None, shape)
    assert not isinstance(found, InputError), found
    assert found["unit"] == unit
    assert found["path"]["closed"] == wanted.closed
    points = np.array(found["path"]["points"])
    assert points.shape == wanted.points.shape
    assert np.abs(points - wanted.points).max() < EXACT


@pytest.mark.parametrize("body", BODIES)
def test_drawings(body: str, tmp_path: Path) -> None:
    check_drawing(f"<svg xmlns='http://www.w3.org/2000/svg'>{body}</svg>", tmp_path)


@pytest.mark.parametrize("root", ROOTS)
def test_views_and_units(root: str, tmp_path: Path) -> None:
    for body in (BODIES[5], BODIES[11], "<circle cx='5' r='3cm'/>"):
        check_drawing(f"<svg xmlns='http://www.w3.org/2000/svg' {root}>{body}</svg>", tmp_path)


def test_names_of_several_paths(tmp_path: Path) -> None:
    text = f"<svg xmlns='http://www.w3.org/2000/svg'>{SEVERAL}</svg>"
    names = ["outline/1", "outline/2", "rect1"]
    assert answer("svg_drawing.js", "pathNames", text, "a.svg") == names
    for name in names:
        check_drawing(text, tmp_path, name)


@pytest.mark.parametrize("text", [*BAD, f"<svg>{SEVERAL}</svg>"], ids=range(len(BAD) + 1))
@pytest.mark.parametrize("shape", [None, "circle9"])
def test_bad_drawings_are_refused_in_the_same_words(text: str, shape: str | None, tmp_path: Path) -> None:
    file = tmp_path / "a.svg"
    file.write_text(text)
    found = answer("svg_drawing.js", "readSvg", text, str(file), None, shape)
    with pytest.raises(InputError) as wanted:
        read_svg(file, None, shape)
    assert isinstance(found, InputError)
    words = str(wanted.value) if str(file) in str(wanted.value) else f"{file}: {wanted.value}"
    assert without_digits(found) == without_digits(words)


def test_what_moves_scales_or_hides_is_read_as_by_the_command(tmp_path: Path) -> None:
    texts = [text for pair in ALIKE for text in pair]
    file = tmp_path / "a.svg"
    for text, found in zip(
        texts, answers([("svg_drawing.js", "readSvg", text, str(file)) for text in texts]), strict=True
    ):
        file.write_text(text)
        wanted, unit = read_svg(file, None, None)
        assert not isinstance(found, InputError), (text, found)
        assert (found["unit"], found["path"]["closed"]) == (unit, wanted.closed), text
        check_near(found["path"]["points"], wanted.points)


def test_what_is_not_read_is_refused_as_by_the_command(tmp_path: Path) -> None:
    file = tmp_path / "a.svg"
    refusals = answers([("svg_drawing.js", "readSvg", text, str(file)) for text, _ in REFUSED])
    for (text, _), found in zip(REFUSED, refusals, strict=True):
        file.write_text(text)
        with pytest.raises(InputError) as wanted:
            read_svg(file, None, None)
        words = str(wanted.value)
        assert str(found) == (words if words.startswith(str(file)) else f"{file}: {words}"), text
