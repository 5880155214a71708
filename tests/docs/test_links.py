"""What README, pages, notebooks, docstrings and messages name exists: sections, files, modules, commands."""

from __future__ import annotations

import ast
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
MODULE = re.compile(rf"`((?:{TOP})(?:\.\w+)+)[`(]|python -m ((?:{TOP})(?:\.\w+)*)")
OF_USERS = {"src/schedule.h", "main.py"}  # code that runs on their boards
SUFFIXES = {"_bar", "_cm", "_over_l", "_sigma"}  # of columns
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


def without_blocks(page: Path) -> str:
    """Return the text of a page without its blocks of code."""
    return re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)


def defined_in(file: Path) -> set[str]:
    """Return the names that a module defines at its top level."""
    names = set()
    for node in ast.parse(file.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            names |= {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
    return names


@cache
def fields_of_classes() -> dict[str, set[str]]:
    """Return for each class of the sources what is defined and annotated in it."""
    fields: dict[str, set[str]] = {}
    for file in SOURCES:
        for node in ast.walk(ast.parse(file.read_text())) if file.suffix == ".py" else ():
            if isinstance(node, ast.ClassDef):
                own = {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
                own |= {part.target.id for part in node.body if isinstance(part, ast.AnnAssign)}  # type: ignore[union-attr]
                fields.setdefault(node.name, set()).update(own)
    return fields


@pytest.mark.parametrize("page", [*ROOT.glob("*.md"), *PAGES], ids=lambda page: page.relative_to(ROOT).as_posix())
def test_names_of_code_exist(page: Path) -> None:
    """`file.py`, `room/file.py`, `sf.name`, `Class.field`, and `_name` of a file that the page names."""
    codes = re.findall(r"`([^`\n]+)`", without_blocks(page))
    paths = [file.relative_to(ROOT).as_posix() for file in SOURCES]
    missing, files = [], list[Path]()
    for code in codes:
        if re.fullmatch(r"[\w./-]+\.(py|js|h)", code) and code not in OF_USERS:
            named = [path for path in paths if f"/{path}".endswith(f"/{code}")]
            files += [ROOT / path for path in named if path.endswith(".py")]
            missing += [] if named or (ROOT / code).exists() else [code]
        elif re.fullmatch(r"sf(\.\w+)+", code):
            missing += [] if exists(f"softflagella{code[2:]}") else [code]
        elif match := re.fullmatch(r"([A-Z]\w*[a-z]\w*)\.(\w+)(?:\(.*\))?", code):
            missing += [] if match[2] in fields_of_classes().get(match[1], ()) else [code]
    private = [code for code in codes if re.fullmatch(r"_\w+", code) and code not in SUFFIXES]
    missing += [name for name in private if not any(name in defined_in(file) for file in files)]
    assert missing == []


def test_the_page_of_python_has_each_public_name() -> None:
    page = (DOCS / "reference" / "api.md").read_text()
    documented = set(
        re.findall(
            r"^\.\. auto(?:function|class|exception|module):: (?:softflagella\.)?(\w+)$", page, re.MULTILINE
        )
    )
    assert documented == set(sf.__all__) - {"__version__"}
