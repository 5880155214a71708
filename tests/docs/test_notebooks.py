"""Notebooks of the documentation are kept without outputs, and need nothing deeper than softflagella."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import pytest

from tests.docs.pages import DOCS
from tests.docs.test_glossary import prose, replaced

NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))
IMPORTED = {"softflagella", "matplotlib.pyplot", "numpy", "pandas", "dataclasses"}


def cells(notebook: Path, kind: str) -> list[dict[str, Any]]:
    return [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == kind]


def source(cell: dict[str, Any]) -> str:
    return "".join(cell["source"])


def test_there_is_one_and_pages_list_it() -> None:
    entries = (DOCS / "index.md").read_text().splitlines()
    assert len(NOTEBOOKS) == 1
    assert all(f"notebooks/{notebook.stem}" in entries for notebook in NOTEBOOKS)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda n: n.stem)
def test_a_notebook_is_kept_without_outputs(notebook: Path) -> None:
    """Outputs come from the execution when the pages are built."""
    assert cells(notebook, "code")
    for cell in cells(notebook, "code"):
        assert cell["outputs"] == []
        assert cell["execution_count"] is None
        assert cell["metadata"] == {}


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda n: n.stem)
def test_a_notebook_needs_no_deeper_import_than_softflagella(notebook: Path) -> None:
    for cell in cells(notebook, "code"):
        for node in ast.walk(ast.parse(source(cell))):
            if isinstance(node, ast.Import):
                assert {alias.name for alias in node.names} <= IMPORTED
            elif isinstance(node, ast.ImportFrom):
                assert node.module in IMPORTED


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda n: n.stem)
def test_a_notebook_uses_the_terms_of_the_glossary(notebook: Path) -> None:
    for cell in cells(notebook, "markdown"):
        assert replaced(prose(source(cell))) == set()
