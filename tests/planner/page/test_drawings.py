"""Paths of SVG drawings are Python's, and what is not read is refused in the same words."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from planner.paths.svg_drawing import read_svg
from sim.io.errors import InputError
from tests.planner.page.page_core import EXACT, answer
from tests.planner.page.parity import check_parity, without_digits
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
    "<path d='M0 0A3 1 20 0 0 5 5' transform='rotate(40)'/>", "<path d='M0 0L1 2' transform='none'/>",
    "<defs><path id='p' d='M0 0L1 2 3 1'/></defs><use href='#p' x='3' y='1' transform='scale(2)'/>",
    "<g style='display:none'><path d='M0 0L9 9'/></g><path d='M0 0L1 1'/>", "<path d='M0 0L1e1,2.5e-1.5.5'/>",
    "<!-- c --><path d='M0 0L&#49; 1'/><text><![CDATA[<]]></text><title>t &amp; &#x41;</title>",
    "<g xmlns:p='v' p:d='1'><p:c p:d='1' e='2'/><path d=\"M0 0L1 1\"\n/></g>",
]  # fmt: skip
ROOTS = ["width='5cm' height='5cm' viewBox='0 0 100 100'", "width='70mm' height='30mm' viewBox='1 2 100 100'",
         "viewBox='0 0 10 10' width='200' height='100' preserveAspectRatio='xMaxYMin slice'"]  # fmt: skip
BEFORE = ["<?xml version='1.0'?><!-- c -->", "<!DOCTYPE svg [<!ENTITY e 'x'>]>", "\ufeff"]
SEVERAL = (
    "<defs><clipPath id='c'><path d='M 0 0 L 9 9'/></clipPath></defs>"
    "<path id='outline' d='M 0 0 L 1 0 M 5 5 L 5 7'/><rect width='2' height='2'/><text>no path</text>"
)
BAD = [
    "<svg", "", "<svg/>", "<svg><path d='M 0 0'/></svg>", "<svg><path d='nonsense'/></svg>", "no xml",
    "<svg><path d='M 0 0 L 0 0'/></svg>", "<svg><text>hi</text></svg>", "<svg><g></svg>", "<svg></svg><svg/>",
    "<svg><path d='M0 0L1 1' transform='matrix(1 2)'/></svg>", "<svg b='1' b='2'/>", "<svg b=1/>",
    "<svg b='&x;'/>", "<svg><path d='M0 0L1 1' transform='rotate(a)'/></svg>",
    "<svg xmlns:xlink='http://www.w3.org/1999/xlink'><g id='a'><use xlink:href='#a'/></g></svg>",
    f"<svg><path d='M{'1 ' * 50_001}'/></svg>", f"<svg>{'<g>' * 120}{'</g>' * 120}</svg>", f"<svg>{SEVERAL}</svg>",
]  # fmt: skip


def svg(body: str, root: str = "", before: str = "") -> str:
    return f"{before}<svg xmlns='http://www.w3.org/2000/svg' {root}>{body}</svg>"


def read(text: str, name: str, closed: bool | None = None, shape: str | None = None) -> dict[str, Any]:
    """Read a drawing with Python; each refusal begins with the file's name, as the page's do."""
    Path(name).write_text(text, encoding="utf-8")
    try:
        path, unit = read_svg(Path(name), closed, shape)
    except InputError as refusal:
        raise InputError(f"{name}: {str(refusal).removeprefix(f'{name}: ')}") from None
    return {"path": path, "unit": unit}


def without_name(message: object) -> str:
    return re.sub(r": line #+, column #+", "", without_digits(str(message).removeprefix("a.svg: ")))


def check(cases: list[tuple[Any, ...]]) -> int:
    return check_parity("svg_drawing.js", "readSvg", read, cases, EXACT, without_name)


def test_drawings() -> None:
    texts = [svg(body) for body in BODIES]
    texts += [svg(body, root) for root in ROOTS for body in (BODIES[5], BODIES[11], "<circle cx='5' r='3cm'/>")]
    texts += [svg(BODIES[0], "", before) for before in BEFORE] + [text for pair in ALIKE for text in pair]
    assert check([(text, "a.svg") for text in texts]) == 0


def test_names_of_several_paths() -> None:
    names = ["outline/1", "outline/2", "rect1"]
    assert answer("svg_drawing.js", "pathNames", svg(SEVERAL), "a.svg") == names
    assert check([(svg(SEVERAL), "a.svg", None, name) for name in names]) == 0
    assert check([(svg(BODIES[0]), "a.svg", True)]) == 0


def test_bad_drawings_are_refused() -> None:
    texts = [*BAD, *(text for text, _ in REFUSED)]
    assert check([(text, "a.svg") for text in texts]) == len(texts)
    assert check([(text, "a.svg", None, "circle9") for text in BAD]) == len(BAD)
