"""Paths from files: tables of several kinds; SVG with transforms, curves, units and several shapes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from planner.paths.fillets import CORNER, kinks
from planner.paths.path import Path2D
from planner.paths.path_files import Drawing, read_path
from planner.paths.svg_drawing import METRES_PER_PIXEL
from sim.io.errors import InputError


def drawn(folder: Path, body: str, *, root: str = "", shape: str | None = None) -> Drawing:
    file = folder / "a.svg"
    file.write_text(f"<svg xmlns='http://www.w3.org/2000/svg' {root}>{body}</svg>")
    return read_path(file, shape=shape)


def drawn_path(folder: Path, body: str) -> Path2D:
    return drawn(folder, body).path


def test_lines_and_basic_shapes(tmp_path: Path) -> None:
    assert drawn_path(tmp_path, "<polyline points='0,0 3,0 3,-4'/>").length == pytest.approx(7)
    triangle = drawn_path(tmp_path, "<polygon points='0,0 3,0 3,-4'/>")
    assert triangle.closed
    assert triangle.length == pytest.approx(12)
    assert drawn_path(tmp_path, "<path d='M 0 0 h 3 v -4 Z'/>").points.tolist() == [[0, 0], [3, 0], [3, 4]]
    assert drawn_path(tmp_path, "<path d='M 1 1 L 4 1 l 0 -4'/>").points.tolist() == [[1, -1], [4, -1], [4, 3]]
    assert drawn_path(tmp_path, "<line x1='1' y1='1' x2='4' y2='-3'/>").length == pytest.approx(5)
    box = drawn_path(tmp_path, "<rect x='1' y='1' width='3' height='2'/>")
    assert box.closed
    assert box.length == pytest.approx(10)


def test_circles_and_ellipses_are_smooth(tmp_path: Path) -> None:
    ring = drawn_path(tmp_path, "<circle cx='2' cy='1' r='3'/>")
    assert ring.closed
    assert np.linalg.norm(ring.points - [2, -1], axis=1) == pytest.approx(np.full(len(ring.points), 3.0))
    assert ring.length == pytest.approx(6 * math.pi, rel=1e-4)
    for body in (
        "<ellipse rx='3' ry='1'/>",
        "<path d='M 0 0 A 3 1 0 0 1 6 0'/>",
        "<path d='M 0 0 C 1 2 3 2 4 0'/>",
    ):
        assert np.abs(kinks(drawn_path(tmp_path, body))).max() < CORNER, body


def test_a_bezier_curve_is_followed(tmp_path: Path) -> None:
    """Points of the curve by de Casteljau's definition."""
    points = drawn_path(tmp_path, "<path d='M 0 0 C 1 -2 3 -2 4 0'/>").points
    t = np.linspace(0, 1, 2001)[:, None]
    corners = np.array([[0, 0], [1, 2], [3, 2], [4, 0]], float)
    curve = sum(math.comb(3, k) * t**k * (1 - t) ** (3 - k) * corners[k] for k in range(4))
    away = np.linalg.norm(points[:, None] - curve[None], axis=-1).min(1)
    assert away.max() < 2e-3


def test_transforms_of_shapes_and_groups_apply(tmp_path: Path) -> None:
    body = "<g transform='translate(10,0) rotate(90)'><path d='M 0 0 L 2 0' transform='scale(3)'/></g>"
    assert drawn_path(tmp_path, body).points == pytest.approx(np.array([[10, 0], [10, -6]]), abs=1e-9)


def test_turned_and_mirrored_shapes_are_where_they_are_drawn(tmp_path: Path) -> None:
    box = drawn_path(tmp_path, "<rect width='4' height='2' transform='rotate(90)'/>")
    assert box.points == pytest.approx(np.array([[0, 0], [0, -4], [-2, -4], [-2, 0]]), abs=1e-9)
    ring = drawn_path(tmp_path, "<circle r='2' cy='5' transform='scale(1,-1)'/>")
    assert np.linalg.norm(ring.points - [0, 5], axis=1) == pytest.approx(np.full(len(ring.points), 2.0))


def test_view_box_and_physical_units(tmp_path: Path) -> None:
    """A hundred units drawn on 5 cm: each is half a millimetre."""
    found = drawn(tmp_path, "<path d='M 0 0 L 100 0'/>", root="width='5cm' height='5cm' viewBox='0 0 100 100'")
    assert found.unit == METRES_PER_PIXEL
    assert found.path.length * found.unit == pytest.approx(0.05)
    assert drawn(tmp_path, "<path d='M 0 0 L 100 0'/>").unit is None
    assert drawn(
        tmp_path, "<circle r='3cm'/>", root="width='10cm' height='10cm'"
    ).path.length * METRES_PER_PIXEL == (pytest.approx(2 * math.pi * 0.03, rel=1e-4))


def test_several_paths_are_named_and_one_can_be_chosen(tmp_path: Path) -> None:
    body = (
        "<defs><clipPath id='c'><path d='M 0 0 L 9 9'/></clipPath></defs>"
        "<path id='outline' d='M 0 0 L 1 0 M 5 5 L 5 7'/><rect width='2' height='2'/><text>no path</text>"
    )
    with pytest.raises(InputError, match=r"3 paths \(outline/1, outline/2, rect1\); choose one with --shape"):
        drawn(tmp_path, body)
    assert drawn(tmp_path, body, shape="outline/2").path.length == pytest.approx(2)
    assert drawn(tmp_path, body, shape="rect1").path.length == pytest.approx(8)
    with pytest.raises(InputError, match="no shape 'circle1'; there are outline/1"):
        drawn(tmp_path, body, shape="circle1")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<svg", "not SVG"),
        ("", "not SVG"),
        ("<html/>", "not SVG"),
        ("<svg/>", "no path"),
        ("<svg><path d='M 0 0'/></svg>", "no path"),
        ("<svg><path d='M 0 0 L 0 0'/></svg>", "same"),
        ("<svg><text>hi</text></svg>", "no path"),
    ],
)
def test_what_is_no_drawing_is_refused(text: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "a.svg").write_text(text)
    with pytest.raises(InputError, match=expected):
        read_path(tmp_path / "a.svg")
    (tmp_path / "b.svg").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not SVG"):
        read_path(tmp_path / "b.svg")


def test_a_table_has_no_shapes(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text("x,y\n0,0\n1,1\n")
    assert read_path(tmp_path / "p.csv").unit is None
    with pytest.raises(InputError, match="no SVG"):
        read_path(tmp_path / "p.csv", shape="a")


@pytest.mark.parametrize(
    "text",
    ["x,y\n0,0\n3,0\n3,4.5\n", "X;Y\n0;0\n3;0\n3;4,5\n", "0,0\n3,0\n3,4.5\n", "0 0\n3 0\n3 4.5\n",
     "t;x;y\n1;0;0\n2;3;0\n3;3;4.5\n", "y\tx\n0\t0\n0\t3\n4.5\t3\n", "\ufeffx,y\n0,0\n3,0\n3,4.5\n"],
)  # fmt: skip
def test_tables_of_several_kinds_are_the_same_path(text: str, tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text(text, encoding="utf-8")
    assert read_path(tmp_path / "path.csv").path.points.tolist() == [[0, 0], [3, 0], [3, 4.5]]


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("x_mm,y_mm\n0,0\n30,0\n30,45\n", 0.001),
        ("X [cm];Y [cm]\n0;0\n3;0\n3;4,5\n", 0.01),
        ("t_s,x,y\ns,cm,cm\n0,0,0\n1,3,0\n2,3,4.5\n", 0.01),
        ("x_cm,y_mm\n0,0\n3,0\n3,45\n", 0.01),
    ],
)
def test_a_table_says_its_unit(text: str, unit: float, tmp_path: Path) -> None:
    """A path of 7.5 cm, with its corner at (3, 0) cm."""
    (tmp_path / "path.csv").write_text(text)
    path, size = (drawing := read_path(tmp_path / "path.csv")).path, drawing.unit
    assert size == unit
    assert path.points * unit == pytest.approx(np.array([[0, 0], [0.03, 0], [0.03, 0.045]]))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x_mm,y\n1,2\n3,4\n", "both with a unit"),
        ("x_mm,x_cm,y_mm\n1,2,3\n4,5,6\n", "x_mm and x_cm are the same coordinate"),
        ("x_mm,y_s\n1,2\n3,4\n", "has columns x_mm, y_s; give x and y"),
        ("1\n2\n", "give x and y"),
        ("x,y\n1,2\n3,?\n", r"x or y of point 2 \(line 3\) is no number"),
    ],
)
def test_a_table_whose_coordinates_are_not_clear_is_refused(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        read_path(tmp_path / "path.csv")


USES = "".join(f"<g id='g{i + 1}'>" + f"<use href='#g{i}'/>" * 10 + "</g>" for i in range(7))
CURVES = " ".join(f"C {a} {b} {c} {d} {e} {f}" for a, b, c, d, e, f in np.random.default_rng(1).random((2_000, 6)))
OWN_GROUP = "a <use> shows a group that it belongs to"


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (f"<defs><g id='g0'><path d='M 0 0 L 1 1'/></g>{USES}</defs><use href='#g7'/>", "more than 50000 shapes"),
        ("<g id='a'><use href='#a'/></g>", OWN_GROUP),
        (
            "<g id='a'><use href='#b'/></g><g id='b'><use href='#a'/></g>",
            "a <use> shows a group that it belongs to",
        ),
        ("<g>" * 200_000 + "</g>" * 200_000, "more than 100 levels"),
        (f"<path d='M 0 0 {CURVES}'/>", "more than 200000 points"),
        ("<path d='M 0 0" + " L 1 2" * 30_000 + "'/>", "more than 50000 shapes and coordinates"),
    ],
)
def test_a_drawing_that_would_take_minutes_is_rejected(body: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        drawn(tmp_path, body)


def test_uses_within_the_limits_are_drawn(tmp_path: Path) -> None:
    body = "<defs><g id='a'><path d='M 0 0 L 3 4'/></g></defs><use href='#a' transform='scale(2)'/>"
    assert drawn_path(tmp_path, body).length == pytest.approx(10)
