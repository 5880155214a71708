"""Patterns of the readers, in Python and on the page: their time grows as the length of what they are fed with."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from typing import Any

import pytest

from planner.page.constants import constants
from tests.patterns import IDLE, SIZES, STEEP, texts
from tests.planner.page.page_core import node
from tests.processes import ROOT, printed

OWN_TEXTS = {"__init__", "commands", "notebook", "pages", "words"}  # do not read what people bring
READERS = [
    ".".join(file.relative_to(ROOT).with_suffix("").parts)
    for folder in ("common", "planner/paths")
    for file in sorted((ROOT / folder).glob("*.py"))
    if file.stem not in OWN_TEXTS and "re." in file.read_text()
]
WHOLE = {"NUMBER", "MISSING", "CLOCK"}  # of which the page makes patterns of whole texts
_LITERAL = re.compile(r"(?<=[(,=:?&|!\[\s])/(?![*/\s])((?:[^/\\\n\[]|\\.|\[(?:[^\]\\\n]|\\.)*\])+)/([dgimsuy]*)")
_PUT_TOGETHER = re.compile(r"new RegExp\(`(.*\$\{N\}.*)`\)")


def _run(command: list[str], given: str = "") -> str:
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    assert process.stdin
    process.stdin.write(given)
    process.stdin.close()
    process.stdin = None
    return str(printed(process)[0])


@pytest.mark.parametrize("module", READERS)
def test_the_time_of_a_pattern_grows_as_the_text(module: str) -> None:
    assert not _run([sys.executable, "-m", "tests.patterns", module])


def _patterns(value: Any, name: str = "") -> Iterator[tuple[str, str]]:
    """Yield the patterns among the page's constants, and their flags."""
    if isinstance(value, re.Pattern):
        flags = "".join(letter for letter, flag in (("i", re.I), ("m", re.M)) if value.flags & flag)
        yield f"^(?:{value.pattern})$" if name in WHOLE else value.pattern, flags
    elif isinstance(value, Mapping):
        for key, part in value.items():
            yield from _patterns(part, name or (key if key.isupper() else ""))


def _of_page() -> Iterator[tuple[str, str]]:
    """Yield the patterns of the page, and their flags."""
    found = constants()
    yield from _patterns(found)
    yield from ((start, "iy") for _, start in found["path_files"]["KINDS"].values())
    files = sorted((ROOT / "planner/page").glob("**/*.js"))
    for file in (file for file in files if file.stem not in OWN_TEXTS):
        code = re.sub(r"/\*.*?\*/", "", file.read_text(), flags=re.DOTALL)
        yield from _LITERAL.findall(code)
        for number in map(json.loads, re.findall(r'^const N = (".*");$', code, re.MULTILINE)):
            yield number, ""
            yield from (
                (json.loads(f'"{word}"').replace("${N}", number), "") for word in _PUT_TOGETHER.findall(code)
            )


def test_the_time_of_a_pattern_of_the_page_grows_as_the_text() -> None:
    given = []
    for source, flags in _of_page():
        alike = source
        for own, other in (("[^]", r"[\s\S]"), (r"\p{L}\p{N}", r"\w"), (r"\p{C}", r"\x00"), ("[[", r"[\[")):
            alike = alike.replace(own, other)
        known = sum(flag for letter, flag in (("i", re.I), ("m", re.M)) if letter in flags)
        given.append([source, flags if set(flags) & set("gy") else flags + "g", texts(alike, known)])
    sizes = map(str, (STEEP, IDLE, *SIZES))
    assert not _run([node(), str(ROOT / "tests/patterns.mjs"), *sizes], json.dumps(given))
