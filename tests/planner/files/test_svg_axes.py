"""Axes that write themselves as SVG: scales are equal, ticks are where they say, and any words are valid XML."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from planner.files.svg_axes import SvgAxes

SVG = "{http://www.w3.org/2000/svg}"


def places(text: str) -> list[np.ndarray]:
    """Return the points of every path in px."""
    found = []
    for path in ElementTree.fromstring(text.encode()).iter(f"{SVG}path"):
        pairs = [word.split(",") for word in path.attrib["d"].split()[1:] if "," in word]
        found.append(np.array(pairs, dtype=float))
    return found


@pytest.mark.parametrize("size", [(3.0, 1.0), (1.0, 400.0), (0.002, 0.002), (5.0, 0.0)])
def test_scales_are_equal_and_ticks_are_in_place(size: tuple[float, float]) -> None:
    axes = SvgAxes()
    corners = np.array([7.0, -2.0]) + np.array([[0.0, 0.0], [size[0], 0.0], size, [0.0, size[1]]])
    axes.fill(*corners.T, color="#aabbcc")
    text = axes.text("p1")
    drawn = places(text)[0]
    scale = np.ptp(drawn, axis=0).max() / max(size)
    x, y = (drawn - drawn[0]).T
    assert x == pytest.approx(scale * (corners - corners[0])[:, 0], abs=0.02)
    assert y == pytest.approx(-scale * (corners - corners[0])[:, 1], abs=0.02)
    words = [word for word in ElementTree.fromstring(text.encode()).iter(f"{SVG}text") if word.text]
    below = [word for word in words if word.attrib["text-anchor"] == "middle"]
    assert 2 <= len(below) <= 7
    for word in below:
        number = float((word.text or "").replace("−", "-"))
        assert float(word.attrib["x"]) == pytest.approx(drawn[0, 0] + scale * (number - 7.0), abs=0.6)


def test_any_words_can_be_written() -> None:
    axes = SvgAxes()
    axes.plot(1.0, 2.0, "o", color="#000000", label='a < b & "c"')
    axes.set_title("first\n<second>")
    axes.set_xlabel("x")
    axes.set_ylabel("y")
    texts = [word.text for word in ElementTree.fromstring(axes.text("p&1").encode()).iter(f"{SVG}text")]
    assert {"first", "<second>", 'a < b & "c"', "x", "y"} <= set(texts)


def test_other_aspects_are_refused() -> None:
    with pytest.raises(ValueError, match="equal"):
        SvgAxes().set_aspect("auto")
