"""Elements, attributes and refusals are those of Python's XML parser."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

from tests.planner.page.page_core import answer, answers

GOOD = [
    "<a/>", "<a b='1' c=\"x &amp; y\"><d/>text<e f='&#65;'>t</e></a>",
    "<?xml version='1.0'?><!-- c --><a><![CDATA[<]]></a>",
    "<!DOCTYPE svg [<!ENTITY e 'x'>]><a/>", "<a xmlns='u'><b xmlns:p='v'><p:c p:d='1' e='2'/></b></a>",
    "\ufeff<a\n/>",
]  # fmt: skip


def plain(element: ElementTree.Element) -> dict[str, Any]:
    return {"tag": element.tag, "attributes": element.attrib, "children": [plain(part) for part in element]}


def bare(element: dict[str, Any]) -> dict[str, Any]:
    names = ("tag", "attributes")
    return {**{name: element[name] for name in names}, "children": [bare(part) for part in element["children"]]}


def test_elements() -> None:
    found = answers([("xml.js", "parseXml", text) for text in GOOD])
    assert list(map(bare, found)) == [plain(ElementTree.fromstring(text)) for text in GOOD]


def test_mistakes_have_the_parser_s_words() -> None:
    for text in ("<a>", "<a></b>", "<a/><b/>", "x", "<a b='1' b='2'/>", "<a b=1/>", "<a b='&x;'/>"):
        found = answer("svg_drawing.js", "pathNames", text, "a.svg")
        try:
            ElementTree.fromstring(text)
        except ElementTree.ParseError as broken:
            reason = str(broken).split(":")[0]
        assert str(found).startswith(f"a.svg is not SVG: {reason}"), text
