"""Read the pages of the documentation and their blocks of code."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from tests.processes import ROOT

DOCS = ROOT / "docs"
PAGES = sorted(p for p in DOCS.rglob("*.md") if not {"generated", "_build"} & set(p.relative_to(DOCS).parts))
_NOT_RUN = r"(?P<before><!-- not run: (?P<reason>.+?) -->\s*\n+)?"
_BLOCK = re.compile(_NOT_RUN + r"^```(?P<language>\w+)\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """A block of code; it is run unless a reason says why not."""

    language: str
    code: str
    reason: str


def page_name(page: Path) -> str:
    """Return the path of a page in the folder of the documentation."""
    return page.relative_to(DOCS).as_posix()


def blocks(page: Path) -> list[Block]:
    """Find the blocks of code on a page, in order."""
    matches = _BLOCK.finditer(page.read_text())
    return [Block(match["language"], match["code"], match["reason"] or "") for match in matches]
