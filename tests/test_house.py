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


# Large libraries, and the parts of the simulator that a plan must do without.
LIBRARIES = {"joblib", "matplotlib", "numba", "pandas", "pyarrow", "scipy", "torch"}
SIMULATOR = {"sim.linear", "sim.motion", "sim.reference", "sim.solve"}


@pytest.mark.parametrize(
    ("module", "may_load"),
    [
        *((package, set()) for package in ORDER if package != "planner"),
        ("planner", {"pandas", "pyarrow", "scipy", "torch", "surrogate"}),  # its interface is the package itself
        ("dataset.__main__", set()),
        ("surrogate.__main__", set()),
        ("calibration.__main__", set()),
        ("sim.__main__", {"pandas", "pyarrow"}),
        ("planner.__main__", {"pandas", "pyarrow", "scipy", "torch", "surrogate"}),
    ],
)
def test_importing_loads_only_what_is_used(module: str, may_load: set[str]) -> None:
    """Of the large libraries, of the other packages but `sim`, and of the simulator."""
    code = f"import sys, {module}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    loaded = set(done.stdout.split())
    assert module in loaded
    own = {"sim", module.split(".")[0]}
    assert loaded & (LIBRARIES | SIMULATOR | set(ORDER)) - own <= may_load
