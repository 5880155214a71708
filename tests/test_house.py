"""The house: imports run one way, and importing a package loads only what it uses."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ORDER = ["sim", "dataset", "surrogate", "planner", "calibration"]


def imported(file: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module.split(".")[0])
    return names & set(ORDER)


@pytest.mark.parametrize("package", ORDER)
def test_imports_run_one_way(package: str) -> None:
    allowed = set(ORDER[: ORDER.index(package) + 1])
    files = list((ROOT / package).rglob("*.py"))
    assert files
    for file in files:
        assert imported(file) <= allowed, file


def test_files_stay_readable() -> None:
    for package in ORDER:
        for file in (ROOT / package).rglob("*.py"):
            assert len(file.read_text().splitlines()) <= 400, file
            assert ast.get_docstring(ast.parse(file.read_text())), file


@pytest.mark.parametrize(
    ("statement", "absent"),
    [
        ("import sim", ("torch", "pandas")),
        ("import dataset", ("torch", "matplotlib")),
        ("import planner", ("matplotlib", "sim.solve.newton", "numba", "calibration")),
    ],
)
def test_importing_loads_only_what_is_used(statement: str, absent: tuple[str, ...]) -> None:
    code = f"import sys; {statement}; print([m for m in {absent!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"
