"""Paths from tables, drawings and shapes in words; regions from them; units."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from common.errors import InputError
from planner.options import read_regions
from planner.paths.obstacles import Circle, FreeSpace, Polygon
from planner.paths.path import SHAPES, Path2D, polygon
from planner.paths.path_files import Drawing, read_path
from planner.paths.svg_drawing import METRES_PER_PIXEL
from planner.paths.units import (
    check_size,
    heading_in_degrees,
    in_lab,
    place_in_lab,
    read_time,
)
from planner.planning.declare import CORNER, kinks
from sim.model.presets import PRESETS
from tests.planner.paths import svg_cases
from tests.planner.plans import CONTROL


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


def test_a_skewed_circle_is_the_image_of_the_circle(tmp_path: Path) -> None:
    for body in ("<circle cx='2' r='3' {}/>", "<path {} d='M5 0A3 3 0 0 1 2 3A3 3 0 1 1 5 0'/>"):
        skewed = drawn_path(tmp_path, body.format("transform='translate(4 -2) skewX(40) scale(1 -2)'"))
        x, y = (skewed.points * [1, -1] - [4, -2]).T
        radius = np.hypot(x - math.tan(math.radians(40)) * y - 2, y / 2)
        assert radius == pytest.approx(np.full(len(radius), 3.0))


def test_a_bezier_curve_is_followed(tmp_path: Path) -> None:
    """Points of the curve by de Casteljau's definition."""
    points = drawn_path(tmp_path, "<path d='M 0 0 C 1 -2 3 -2 4 0'/>").points
    t = np.linspace(0, 1, 2001)[:, None]
    corners = np.array([[0, 0], [1, 2], [3, 2], [4, 0]], float)
    curve = sum(math.comb(3, k) * t**k * (1 - t) ** (3 - k) * corners[k] for k in range(4))
    away = np.linalg.norm(points[:, None] - curve[None], axis=-1).min(1)
    assert away.max() < 2e-3


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
    with pytest.raises(InputError, match=r"outline/1, outline/2, rect1.*--shape"):
        drawn(tmp_path, body)
    assert drawn(tmp_path, body, shape="outline/2").path.length == pytest.approx(2)
    assert drawn(tmp_path, body, shape="rect1").path.length == pytest.approx(8)
    with pytest.raises(InputError, match=r"no shape 'circle1'; there are 3 paths \(outline/1"):
        drawn(tmp_path, body, shape="circle1")


def test_of_many_paths_the_longest_are_named(tmp_path: Path) -> None:
    lines = "".join(f"<line id='n{k}' x2='{1 + (k * 7) % 300}'/>" for k in range(300))
    with pytest.raises(InputError) as refusal:
        drawn(tmp_path, lines)
    longest = ", ".join(sorted((f"n{k}" for k in range(300)), key=lambda name: -(int(name[1:]) * 7 % 300))[:10])
    assert f"a.svg has 300 paths (the longest: {longest}); choose one with --shape" in str(refusal.value)


@pytest.mark.parametrize("text", [*svg_cases.BROKEN, "\xff\xfe\x00"])
def test_what_is_no_drawing_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.svg").write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match="not SVG"):
        read_path(tmp_path / "a.svg")


def test_a_table_has_no_shapes(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text("x,y\n0,0\n1,1\n")
    assert read_path(tmp_path / "p.csv").unit is None
    with pytest.raises(InputError, match="no shape 'a'; leave --shape out"):
        read_path(tmp_path / "p.csv", shape="a")


ALIKE = [
    "x,y\n0,0\n3,0\n3,4.5\n", "X;Y\n0;0\n3;0\n3;4,5\n", "0,0\n3,0\n3,4.5\n", "0 0\n3 0\n3 4.5\n",
    "t;x;y\n1;0;0\n2;3;0\n3;3;4.5\n", "y\tx\n0\t0\n0\t3\n4.5\t3\n", "\ufeffx,y\n0,0\n3,0\n3,4.5\n",
]  # fmt: skip


@pytest.mark.parametrize("text", ALIKE)
def test_tables_of_several_kinds_are_the_same_path(text: str, tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text(text, encoding="utf-8")
    assert read_path(tmp_path / "path.csv").path.points.tolist() == [[0, 0], [3, 0], [3, 4.5]]


SIZED = {
    "x_mm,y_mm\n0,0\n30,0\n30,45\n": 0.001,
    "X [cm];Y [cm]\n0;0\n3;0\n3;4,5\n": 0.01,
    "t_s,x,y\ns,cm,cm\n0,0,0\n1,3,0\n2,3,4.5\n": 0.01,
    "x_cm,y_mm\n0,0\n3,0\n3,45\n": 0.01,
}


@pytest.mark.parametrize(("text", "unit"), SIZED.items())
def test_a_table_says_its_unit(text: str, unit: float, tmp_path: Path) -> None:
    """A path of 7.5 cm, with its corner at (3, 0) cm."""
    (tmp_path / "path.csv").write_text(text)
    path, size = (drawing := read_path(tmp_path / "path.csv")).path, drawing.unit
    assert size == unit
    assert path.points * unit == pytest.approx(np.array([[0, 0], [0.03, 0], [0.03, 0.045]]))


UNCLEAR = {
    "x_mm,y\n1,2\n3,4\n": "both with a unit",
    "x_mm,x_cm,y_mm\n1,2,3\n4,5,6\n": "x_mm and x_cm are the same coordinate",
    "x_mm,y_s\n1,2\n3,4\n": "has columns x_mm, y_s; give x and y",
    "1\n2\n": "give x and y",
    "x,y\n1,2\n3,?\n": r"x or y of point 2 \(line 3\) is no number",
}


@pytest.mark.parametrize(("text", "words"), UNCLEAR.items())
def test_a_table_whose_coordinates_are_not_clear_is_refused(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        read_path(tmp_path / "path.csv")


@pytest.mark.parametrize(("text", "reference"), svg_cases.ALIKE, ids=range(len(svg_cases.ALIKE)))
def test_drawings_that_show_the_same_are_read_alike(text: str, reference: str, tmp_path: Path) -> None:
    read = []
    for name, content in (("a.svg", text), ("b.svg", reference)):
        (tmp_path / name).write_text(content)
        read.append(read_path(tmp_path / name))
    path, wanted = (drawing.path for drawing in read)
    assert (read[0].unit, path.closed) == (read[1].unit, wanted.closed)
    assert path.points == pytest.approx(wanted.points, rel=1e-8, abs=1e-8 * np.abs(wanted.points).max())


DEEP = (svg_cases.svg("<g>" * 20_000 + "</g>" * 20_000), "more than 100 levels")


@pytest.mark.parametrize(("text", "words"), [*svg_cases.REFUSED, DEEP], ids=range(len(svg_cases.REFUSED) + 1))
def test_what_is_not_read_is_refused_by_name(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "a.svg").write_text(text)
    with pytest.raises(InputError) as refusal:
        read_path(tmp_path / "a.svg")
    assert words in str(refusal.value)


def test_regular_polygons_have_names() -> None:
    assert read_path("polygon:6:2l").path.points == pytest.approx(polygon(6, 2.0).points)
    assert read_path("square:3l").path.points == pytest.approx(polygon(4, 3.0).points)
    assert read_path("polygon:3:1.5l").path.points == pytest.approx(read_path("triangle:1.5l").path.points)
    assert read_path("circle:2l").path.length == pytest.approx(4 * math.pi, rel=1e-4)


@pytest.mark.parametrize(
    ("words", "near"),
    [("hexagon:3", ""), ("circle", ""), ("square", ""), ("rectangle:2:3", ""), ("HEXAGON:3", ""),
     ("squre:3l", "square:3l"), ("cirlce:2l", "circle:2l"), ("Circle:2l", "circle:2l"),
     ("poligon:6:2l", "polygon:6:2l"), ("traingle", "triangle:SIDE")],
)  # fmt: skip
def test_an_unknown_shape_is_told_the_nearest_one_and_which_there_are(words: str, near: str) -> None:
    with pytest.raises(InputError) as caught:
        read_path(words)
    asked = f"is it {near}? " if near else ""
    assert str(caught.value) == f"{words}: no such file or shape; {asked}shapes are {SHAPES}"


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


def test_distances_of_regions() -> None:
    room = FreeSpace((Circle(0, 0, 1),), Polygon.of([[-3, -2], [3, -2], [3, 2], [-3, 2]]))
    found = room.distance(np.array([[0, 0], [2, 0], [0, 1.75], [0, 3.0], [-2.9, 0]]))
    assert found == pytest.approx([-1, 1, 0.25, -1, 0.1])
    assert Circle(1, 2, 3).distance(Circle(1, 2, 3).corners) == pytest.approx(0.0, abs=1e-12)
    notch = Polygon.of([[0, 0], [4, 0], [4, 3], [2, 1], [0, 3]])
    assert notch.distance(np.array([[2.0, 2.0], [2.0, 0.5]])) == pytest.approx([np.sqrt(0.5), -0.5])
    with pytest.raises(InputError, match="not on one line"):
        Polygon.of([[0, 0], [1, 1], [2, 2]])


BAD = {  # outlines, and where they are wrong
    "eight": ([(0, 0), (40, 40), (40, 0), (0, 40)], "(20, 20)"),
    "lopsided eight": ([(0, 0), (40, 40), (40, 0), (0, 30)], "(17.14, 17.14)"),
    "touches an edge": ([(0, 0), (40, 0), (40, 40), (20, 0), (0, 40)], "(20, 0)"),
    "touches a corner": ([(0, 0), (40, 0), (40, 40), (20, 20), (20, 30), (20, 20), (0, 40)], "(20, 20)"),
    "spike": ([(0, 0), (40, 0), (40, 40), (40, 0), (0, 5)], "(40, 40)"),
    "twice": ([(0, 0), (40, 0), (40, 40), (0, 40)] * 2, "(40, 40)"),
}


@pytest.mark.parametrize(("points", "place"), BAD.values(), ids=BAD)
def test_outlines_that_cross_touch_or_repeat_themselves_are_refused(
    points: list[tuple[float, float]], place: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as refusal:
        Polygon.of(points)
    assert f"elf-intersection of an outline at {place} l; draw it so" in str(refusal.value)
    rows = "".join(f"{x},{y}\n" for x, y in points)
    path = " ".join(f"{x} {-y}" for x, y in points)
    for name, text, unit, told in (
        ("a.csv", f"x_mm,y_mm\n{rows}", None, "mm"), ("b.csv", f"x,y\n{rows}", "cm", "cm"),
        ("c.svg", f"<svg width='100cm' viewBox='0 0 100 100'><path d='M {path} z'/></svg>", "mm", "cm"),
    ):  # fmt: skip
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError) as refusal:
            read_regions(str(tmp_path / name), unit, PRESETS["paper-control"])
        assert f"{name}: " in str(refusal.value)
        assert f"at {place} {told}; draw it so" in str(refusal.value)


def test_points_that_follow_each_other_twice_are_one() -> None:
    points = [(0, 0), (4, 0), (4, 0), (4, 4), (0, 4), (0, 4), (0, 0)]
    assert Polygon.of(points).corners.tolist() == [[0, 0], [4, 0], [4, 4], [0, 4]]


def test_lengths_in_messages_are_in_a_laboratory_s_units_first() -> None:
    assert in_lab(0.32, CONTROL) == "3.52 cm (0.32 l)"
    assert place_in_lab(1.0, -0.5, CONTROL) == "(11.00, -5.50) cm = (1.000, -0.500) l"
    assert place_in_lab(-1e-9, 0.0, CONTROL) == "(0.00, 0.00) cm = (0.000, 0.000) l"
    assert in_lab(1200.0, CONTROL) == "132 m (1200 l)"


@pytest.mark.parametrize(
    ("degrees", "words"),
    [(-181.8, "178.2"), (180.0, "180.0"), (-180.0, "180.0"), (-179.97, "180.0"), (181.8, "-178.2"), (0.0, "0.0"),
     (-0.01, "0.0"), (359.99, "0.0"), (725.0, "5.0"), (-90.0, "-90.0")],
)  # fmt: skip
def test_headings_are_above_minus_180_and_up_to_180_degrees(degrees: float, words: str) -> None:
    assert heading_in_degrees(math.radians(degrees)) == f"{words} degrees"


def test_long_paths_pass_if_they_are_not_absurd() -> None:
    check_size(Path2D.of([[0, 0], [10_000, 0]]), CONTROL, 0.9, 1e3)
    with pytest.raises(InputError, match="at most 12000 l can be planned"):
        check_size(Path2D.of([[0, 0], [13_000, 0]]), CONTROL, 0.9, 1e3)


@pytest.mark.parametrize(
    ("words", "seconds"),
    [("12min", 720.0), ("90s", 90.0), ("1h20min", 4800.0), ("1.5 h", 5400.0), ("2min 5s", 125.0)],
)
def test_times_have_their_units(words: str, seconds: float) -> None:
    assert read_time(words, "--for") == pytest.approx(seconds)


@pytest.mark.parametrize("words", ["12", "", "min", "-3min", "0s", "1..2s", "12minutes", "nan s", "3m", "5 min x"])
def test_other_times_are_refused(words: str) -> None:
    with pytest.raises(InputError, match="with its unit"):
        read_time(words, "--for")


def test_a_path_that_ends_where_it_began_looks_closed() -> None:
    ring = polygon(12, side=1.0).points
    assert Path2D.of(ring).looks_closed
    assert not Path2D.of(ring, closed=True).looks_closed
    assert not Path2D.of(ring[:-2]).looks_closed
    assert not Path2D.of([[0, 0], [1, 0], [1, 1]]).looks_closed
