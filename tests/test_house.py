"""The house: imports run one way, files stay readable, and importing a package loads only what it uses."""

from __future__ import annotations

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from tests.processes import LIMIT

ROOT = Path(__file__).parents[1]
ORDER = ["sim", "dataset", "surrogate", "planner", "calibration", "softflagella"]
# Folders of the simulator; each imports from those before it only. Single files of `sim` are listed as well.
ROOMS = ["arrays", "compiling", "io", "model", "effects", "inputs", "linear", "mechanics", "solve", "reference",
         "motion", "__main__"]  # fmt: skip


def modules_imported(file: Path) -> set[str]:
    """Full names of what a file imports, wherever in the file; `from a import b` counts as a.b."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{file} imports by a relative name"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def imported(file: Path) -> set[str]:
    return {name.split(".")[0] for name in modules_imported(file)} & set(ORDER)


def room_of(file: Path) -> str:
    """The folder of the simulator that a file is in, or the file's own name."""
    return file.relative_to(ROOT / "sim").parts[0].removesuffix(".py")


def rooms_imported() -> dict[str, set[str]]:
    """Room -> other rooms that its files import."""
    found: dict[str, set[str]] = {}
    for file in (ROOT / "sim").rglob("*.py"):
        names = {name.split(".")[1] for name in modules_imported(file) if name.startswith("sim.")}
        found.setdefault(room_of(file), set()).update(names - {room_of(file)})
    return found


@pytest.mark.parametrize("package", ORDER)
def test_imports_run_one_way(package: str) -> None:
    allowed = set(ORDER[: ORDER.index(package) + 1])
    files = list((ROOT / package).rglob("*.py"))
    assert files
    for file in files:
        assert imported(file) <= allowed, file


def test_rooms_of_the_simulator_import_one_way() -> None:
    found = rooms_imported()
    assert set(found) == {*ROOMS, "__init__"}
    assert found.pop("__init__") == set()
    for room, others in found.items():
        assert others <= set(ROOMS[: ROOMS.index(room)]), room
    assert "reference" not in found["motion"] | found["__main__"]  # for tests and teaching only
    assert set(TopologicalSorter(found).static_order()) == set(ROOMS)  # raises where there is a circle


def test_files_of_a_package_do_not_import_in_a_circle() -> None:
    files = {
        ".".join(file.relative_to(ROOT).with_suffix("").parts): file
        for package in ORDER
        for file in (ROOT / package).rglob("*.py")
    }
    graph = {}
    for name, file in files.items():
        tops = {f"{n.module}.{a.name}" for n in ast.parse(file.read_text()).body if isinstance(n, ast.ImportFrom)
                for a in n.names}  # fmt: skip
        wanted = tops | {top.rpartition(".")[0] for top in tops}
        graph[name] = {other for other in wanted if other in files} - {name}
    assert sum(map(len, graph.values())) > 300
    assert set(TopologicalSorter(graph).static_order()) == set(files)


def test_tests_do_not_import_benchmarks() -> None:
    """What both need is an oracle: it lives in `tests.oracles`, or in `sim.reference`."""
    files = list((ROOT / "tests").rglob("*.py"))
    assert len(files) > 100
    for file in files:
        assert "benchmarks" not in {name.split(".")[0] for name in modules_imported(file)}, file


def test_files_stay_readable() -> None:
    files = [file for folder in (*ORDER, "tests", "benchmarks") for file in (ROOT / folder).rglob("*.py")]
    assert len(files) > 150
    for file in files:
        text = file.read_text()
        assert len(text.splitlines()) <= 400, file
        assert ast.get_docstring(ast.parse(text)) or not text, file


# Large libraries, and the parts of the simulator that a plan must do without.
LIBRARIES = {
    "joblib",
    "matplotlib",
    "numba",
    "numpy",
    "onnx",
    "pandas",
    "pyarrow",
    "safetensors",
    "scipy",
    "svgelements",
    "torch",
    "tqdm",
}
SIMULATOR = {"sim.linear", "sim.motion", "sim.reference", "sim.solve"}


@pytest.mark.parametrize(
    ("module", "may_load"),
    [
        *((package, set()) for package in ORDER),
        *((f"{package}.__main__", set()) for package in ORDER),
    ],
)
def test_importing_loads_only_what_is_used(module: str, may_load: set[str]) -> None:
    """Of the large libraries, of the other packages but `sim`, and of the simulator."""
    code = f"import sys, {module}; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT, timeout=LIMIT
    )
    loaded = set(done.stdout.split())
    assert module in loaded
    own = {"sim", module.split(".")[0]}
    assert loaded & (LIBRARIES | SIMULATOR | set(ORDER)) - own <= may_load


def test_importing_softflagella_loads_none_of_the_other_packages() -> None:
    code = "import sys, softflagella; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT, timeout=LIMIT
    )
    own = {name for name in done.stdout.split() if name.split(".")[0] in ORDER}
    assert own == {"softflagella"}
