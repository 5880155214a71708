"""docs/install.md says what the code does: its extras, its folders, and where activation is said."""

from __future__ import annotations

import re
import tomllib

from sim.compiling import CACHE
from tests.docs.pages import DOCS, PAGES, ROOT

PAGE = (DOCS / "install.md").read_text()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_the_optional_packages_exist() -> None:
    named = {extra for part in re.findall(r"'\.\[([\w,]+)\]'", PAGE) for extra in part.split(",")}
    assert named
    assert named <= set(PROJECT["optional-dependencies"])


def test_the_python_version_and_the_packages_are_those_of_the_project() -> None:
    assert f"Python {PROJECT['requires-python'].removeprefix('>=')} or newer" in PAGE
    for package in ("softflagella", "sim", "dataset", "surrogate", "planner", "calibration"):
        assert f"`{package}`" in PAGE
        assert (ROOT / package / "__init__.py").exists()


def test_compiled_loops_are_where_the_page_says() -> None:
    assert CACHE.parent.parts[-2:] in {("sim", "__pycache__"), (".cache", "softflagella")}
    assert "`sim/__pycache__`" in PAGE
    assert "`~/.cache/softflagella`" in PAGE


def test_activation_is_explained_once_and_first() -> None:
    entries = [line for line in (DOCS / "index.md").read_text().splitlines() if (DOCS / f"{line}.md").exists()]
    assert entries[0] == "install"
    elsewhere = [
        page for page in PAGES if ".venv" in page.read_text() and page.name not in ("install.md", "log.md")
    ]
    assert elsewhere == []
