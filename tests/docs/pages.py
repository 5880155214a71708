"""Read the pages of the documentation: blocks of code, the glossary."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(p for p in DOCS.rglob("*.md") if not {"generated", "_build"} & set(p.relative_to(DOCS).parts))
_NOT_RUN = r"(?P<before><!-- not run: (?P<reason>.+?) -->\s*\n+)?"
_BLOCK = re.compile(_NOT_RUN + r"^```(?P<language>\w+)\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)
_NAME = re.compile(r"`([^`]+)`")


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


def glossary() -> dict[str, str]:
    """Return units by name in code; a unit is empty in tables without units."""
    units: dict[str, str] = {}
    header: list[str] = []
    for line in (DOCS / "reference" / "glossary.md").read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not line.startswith("|"):
            header = []
        elif not header:
            header = cells
        elif not cells[0].startswith("---"):
            row = dict(zip(header, cells, strict=True))
            for name in _NAME.findall(row.get("in code", row.get("name", ""))):
                units.setdefault(name, row.get("unit", ""))
    return units


def replaced_words() -> list[str]:
    """Return the words that the glossary replaces by terms."""
    _, _, section = (DOCS / "reference" / "glossary.md").read_text().partition("## Replaced words")
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("|")]
    return [word.strip() for cell in rows[2:] for word in cell.split(",")]


def generator() -> ModuleType:
    """Import docs/generate.py as a module."""
    return module_of_docs("generate")


def module_of_docs(name: str) -> ModuleType:
    """Import a module of the folder docs."""
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
