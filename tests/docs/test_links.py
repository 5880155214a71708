"""What README, pages, notebooks, docstrings and messages name exists: sections, files, modules, commands."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from pkgutil import resolve_name

import pytest

import softflagella as sf
from softflagella.shadowing import PACKAGES
from tests.docs.pages import DOCS, PAGES
from tests.processes import ROOT

TOP = "|".join((*PACKAGES, "softflagella", "benchmarks", "tests"))
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))
TEXTS = [*ROOT.glob("*.md"), *PAGES, *NOTEBOOKS]
SOURCES = [
    file for top in TOP.split("|") for file in (ROOT / top).rglob("*.*") if file.suffix in {".py", ".js", ".h"}
]
LINK = re.compile(r"(?:\]\(|href=\")(?!https?:)([^)\"\s#]*)#?([^)\"\s]*)[)\"]")
FILE = re.compile(rf"`((?:{TOP}|docs)/[\w/.-]+)`|(?<![\w/.-])(docs/[\w/-]+\.(?:md|py|ipynb))\b")
MODULE = re.compile(rf"`((?:{TOP})(?:\.\w+)+)`|python -m ((?:{TOP})(?:\.\w+)*)")
BENCHMARK = re.compile(r"python -m\s+benchmarks[ \n]([a-z_]+)\b")


def sections(page: Path) -> set[str]:
    """Return the names by which links reach the sections of a page."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    slugs = {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}
    return slugs | set(re.findall(r"^\((\w+)\)=$", text, re.MULTILINE))


@pytest.mark.parametrize("file", TEXTS, ids=lambda file: file.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(file: Path) -> None:
    for path, section in LINK.findall(file.read_text()):
        target = (file.parent / path) if path else file
        assert "generated" not in target.parts, f"{path} is written when the pages are built; a clone has none"
        assert target.exists(), path
        text = target.read_text() if target.suffix == ".md" else ""
        assert not section or "{include}" in text or section in sections(target), f"{path}#{section}"


@cache
def exists(name: str) -> bool:
    """Tell whether a dotted name is a module, something in one, or a field of a class in one."""
    owner, _, field = name.rpartition(".")
    try:
        return resolve_name(name) is not None
    except (ImportError, AttributeError):
        return bool(owner) and exists(owner) and field in getattr(resolve_name(owner), "__annotations__", {})


def test_what_is_named_exists() -> None:
    missing = []
    for file in (*TEXTS, *SOURCES):
        text = file.read_text()
        missing += [
            (file, path) for pair in FILE.findall(text) for path in pair if path and not (ROOT / path).exists()
        ]
        missing += [(file, name) for pair in MODULE.findall(text) for name in pair if name and not exists(name)]
        for name in BENCHMARK.findall(text):
            missing += [] if list((ROOT / "benchmarks").glob(f"*/{name}.py")) else [(file, name)]
    assert missing == []


def test_the_page_of_python_has_each_public_name() -> None:
    page = (DOCS / "reference" / "api.md").read_text()
    documented = set(
        re.findall(
            r"^\.\. auto(?:function|class|exception|module):: (?:softflagella\.)?(\w+)$", page, re.MULTILINE
        )
    )
    assert documented == set(sf.__all__) - {"__version__"}
