"""Paths of SVG drawings are Python's, what is not read is refused, and a browser reads the same trees."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.paths.svg_drawing import read_svg
from sim.io.errors import InputError
from tests.planner.page.page_core import EXACT, FOLDER, check_near, drawing_tree, opened
from tests.planner.page.view.browser import chromium
from tests.planner.paths.svg_cases import ALIKE, REFUSED

pytestmark = pytest.mark.usefixtures("empty_folder")

BODIES = [
    "<polyline points='0,0 3,0 3,-4'/>", "<polygon points='0,0 3,0 3,-4'/>", "<path d='M 0 0 h 3 v -4 Z'/>",
    "<path d='M 1 1 L 4 1 l 0 -4'/>", "<line x1='1' y1='1' x2='4' y2='-3'/>", "<circle cx='2' cy='1' r='3'/>",
    "<rect x='1' y='1' width='3' height='2'/>", "<rect x='1' width='9' height='6' rx='2'/>",
    "<ellipse rx='3' ry='1'/>", "<path d='M 0 0 A 3 1 0 0 1 6 0'/>", "<path d='M 0 0 C 1 2 3 2 4 0'/>",
    "<path d='M0,0c1-2 3-2 4 0s3 2 4 0'/>", "<path d='M0 0Q1 2 3 0T6 0t3 1'/>", "<path d='m1 1 2 3 4-1z'/>",
    "<path d='M0 0a2 3 30 1 0 4 1A1 1 0 0110 10'/>",
    "<g transform='translate(10,0) rotate(90)'><path d='M 0 0 L 2 0' transform='scale(3)'/></g>",
    "<path d='M0 0H5V2h-1v3' transform='matrix(1 .5 -.3 2 7 8)'/>", "<circle r='2' transform='scale(2,-1)'/>",
    "<rect width='4' height='2' transform='rotate(30)'/>", "<path d='M0 0L1 2' transform='rotate(0.25turn 1 0)'/>",
    "<path d='M0 0C1 2 3 2 4 0' transform='skewX(20) skewY(-10deg) translate(3)'/>",
    "<ellipse rx='3' ry='1' transform='rotate(30 1 2)'/>", "<path d='M0 0L1 2' transform='rotate(3rad)'/>",
    "<path d='M0 0A3 1 20 0 0 5 5' transform='rotate(40)'/>",
    "<path d='M0 0A3 1 20 0 0 5 5A2 2 0 0 1 7 7' transform='skewX(30) scale(1 -3)'/>",
    "<path d='M0 0L1 2' transform='none'/>",
    "<defs><path id='p' d='M0 0L1 2 3 1'/></defs><use href='#p' x='3' y='1' transform='scale(2)'/>",
    "<g style='display:none'><path d='M0 0L9 9'/></g><path d='M0 0L1 1'/>", "<path d='M0 0L1e1,2.5e-1.5.5'/>",
    "<!-- c --><path d='M0 0L&#49; 1'/><text><![CDATA[<]]></text><title>t &amp; &#x41;</title>",
    "<g xmlns:p='v' p:d='1'><p:c p:d='1' e='2'/><path d=\"M0 0L1 1\"\n/></g>",
]  # fmt: skip
ROOTS = ["width='5cm' height='5cm' viewBox='0 0 100 100'", "width='70mm' height='30mm' viewBox='1 2 100 100'",
         "viewBox='0 0 10 10' width='200' height='100' preserveAspectRatio='xMaxYMin slice'"]  # fmt: skip
SEVERAL = (
    "<defs><clipPath id='c'><path d='M 0 0 L 9 9'/></clipPath></defs>"
    "<path id='outline' d='M 0 0 L 1 0 M 5 5 L 5 7'/><rect width='2' height='2'/><text>no path</text>"
)
BAD = [
    "<svg/>", "<svg><path d='M 0 0'/></svg>", "<svg><path d='nonsense'/></svg>", "<svg><text>hi</text></svg>",
    "<svg><path d='M 0 0 L 0 0'/></svg>", "<svg><path d='M0 0L1 1' transform='matrix(1 2)'/></svg>",
    "<svg><path d='M0 0L1 1' transform='rotate(a)'/></svg>",
    "<svg xmlns:xlink='http://www.w3.org/1999/xlink'><g id='a'><use xlink:href='#a'/></g></svg>",
    f"<svg><path d='M{'1 ' * 50_001}'/></svg>", f"<svg>{'<g>' * 120}{'</g>' * 120}</svg>",
]  # fmt: skip
BROKEN = [
    "<svg", "", "no xml", "<svg><g></svg>", "<svg></svg><svg/>", "<svg b='1' b='2'/>", "<svg b=1/>",
    "<svg b='&x;'/>",
]  # fmt: skip


def svg(body: str, root: str = "", before: str = "") -> str:
    return f"{before}<svg xmlns='http://www.w3.org/2000/svg' {root}>{body}</svg>"


TEXTS = [svg(body) for body in BODIES]
TEXTS += [svg(body, root) for root in ROOTS for body in (BODIES[5], BODIES[11], "<circle cx='5' r='3cm'/>")]
TEXTS += [text for pair in ALIKE for text in pair]


def check_drawing(text: str, shape: str | None = None, index: int = 0) -> None:
    Path("a.svg").write_text(text, encoding="utf-8")
    (path, unit), found = read_svg(Path("a.svg"), None, shape), opened("a.svg", text)
    assert not isinstance(found, InputError), (found, text)
    drawn = found["paths"][index]
    assert drawn["closed"] == path.closed
    assert (found["unit"] is None) == (unit is None)
    check_near(drawn["points"], path.points, EXACT * max(1.0, float(np.abs(path.points).max())))
    if unit is not None:
        assert found["unit"] == pytest.approx(100 * unit)


def test_drawings() -> None:
    for text in TEXTS:
        check_drawing(text)
    for index, name in enumerate(("outline/1", "outline/2", "rect1")):
        check_drawing(svg(SEVERAL), name, index)
    assert [path["name"] for path in opened("a.svg", svg(SEVERAL))["paths"]] == ["outline/1", "outline/2", "rect1"]


@pytest.mark.parametrize("text", [*BAD, *(text for text, _ in REFUSED if "<?xml-stylesheet" not in text)])
def test_bad_drawings_are_refused(text: str) -> None:
    refusal = opened("a.svg", text)
    assert isinstance(refusal, InputError), text
    assert str(refusal).startswith("a.svg")
    assert "\n" not in str(refusal)


def test_a_browser_reads_the_same_trees() -> None:
    program = chromium()
    from playwright.sync_api import sync_playwright

    source = "\n".join((FOLDER / name).read_text() for name in ("words.js", "view/files.js"))
    source = "\n".join(line for line in source.splitlines() if not line.startswith(("import ", "export ")))
    read = f"""(texts) => {{ {source}
      return texts.map((text) => refusing(() => drawingTree(text, "a.svg"), ({{ message }}) => message)); }}"""
    entity = "<!DOCTYPE svg [<!ENTITY e 'M 0 0 L 9 9'>]>"
    texts = [*TEXTS, svg("<path d='&e;'/>", "", entity), svg(BODIES[0], "", "<?xml version='1.0'?><!-- c -->")]
    with sync_playwright() as control:
        browser = control.chromium.launch(executable_path=program, args=["--no-sandbox"])
        found: list[Any] = browser.new_page().evaluate(
            read, [*texts, *BROKEN, "<?xml-stylesheet href='a'?><svg/>"]
        )
        browser.close()
    assert found[: len(texts)] == [drawing_tree(text) for text in texts]
    assert all(words.startswith("a.svg is not SVG: ") and "\n" not in words for words in found[len(texts) : -1])
    assert "save the drawing with its style" in found[-1]
