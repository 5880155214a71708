"""Distances from regions and walls."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from planner.files.goal_files import read_region
from planner.paths.obstacles import Circle, FreeSpace, Polygon
from sim.io.errors import InputError
from sim.model.presets import PRESETS


def box(left: float, low: float, right: float, high: float) -> Polygon:
    return Polygon.of([[left, low], [right, low], [right, high], [left, high]])


def test_distances_of_regions() -> None:
    room = FreeSpace((Circle(0, 0, 1),), box(-3, -2, 3, 2))
    found = room.distance(np.array([[0, 0], [2, 0], [0, 1.75], [0, 3.0], [-2.9, 0]]))
    assert found == pytest.approx([-1, 1, 0.25, -1, 0.1])
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
    for space in ({"keep_out": [points]}, {"walls": points}):
        with pytest.raises(InputError) as refusal:
            FreeSpace.of(**space)
        assert f"elf-intersection of an outline at {place} l; draw it so" in str(refusal.value)
    rows = "".join(f"{x},{y}\n" for x, y in points)
    path = " ".join(f"{x} {-y}" for x, y in points)
    for name, text, unit, told in (
        ("a.csv", f"x_mm,y_mm\n{rows}", None, "mm"), ("b.csv", f"x,y\n{rows}", "cm", "cm"),
        ("c.svg", f"<svg width='100cm' viewBox='0 0 100 100'><path d='M {path} z'/></svg>", "mm", "cm"),
    ):  # fmt: skip
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError) as refusal:
            read_region(str(tmp_path / name), unit, PRESETS["paper-control"])
        assert f"{name}: " in str(refusal.value)
        assert f"at {place} {told}; draw it so" in str(refusal.value)


def test_points_that_follow_each_other_twice_are_one() -> None:
    points = [(0, 0), (4, 0), (4, 0), (4, 4), (0, 4), (0, 4), (0, 0)]
    assert Polygon.of(points).corners.tolist() == [[0, 0], [4, 0], [4, 4], [0, 4]]
