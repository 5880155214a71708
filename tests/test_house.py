"""The layout: imports run one way, files stay readable, and importing a package loads only what it uses."""

from __future__ import annotations

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from tests.processes import LIMIT

ROOT = Path(__file__).parents[1]
# The rooms of each package, folders and single files; each imports only from those before it. Packages import only
# from packages before them.
ROOMS = {
    "sim": ["arrays", "compiling", "lanes", "lane_code", "lane_rows", "called_code", "machine_code", "object_code",
            "compile_stages", "io", "linear", "model", "effects", "inputs", "mechanics", "solve", "reference",
            "motion", "__main__"],
    "dataset": ["rows", "storage", "report", "workers", "build", "__main__"],
    "surrogate": ["networks", "interface", "error_modes", "input_ranges", "loops", "wrench", "one_robot", "table",
                  "training",
                  "export", "compile_loops", "__main__"],
    "planner": ["draws", "paths", "vehicle", "planning", "goal", "jobs", "tracking", "files", "page",
                "command_line", "fleet_command", "job_commands", "tracking_commands", "page_command",
                "replay_command", "__main__"],
    "calibration": ["statistics", "attribution", "verdict", "swimmer", "laws", "report", "examples", "__main__"],
    "softflagella": ["shadowing", "api", "replanning", "demo_figures", "demo_files", "demo_page", "demo",
                     "__init__", "__main__"],
}  # fmt: skip
ORDER = list(ROOMS)


def modules_imported(file: Path) -> set[str]:
    """List the full names of what a file imports, wherever in the file; `from a import b` counts as a.b."""
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


def room(package: str, file: Path) -> str:
    """Return the folder of a package that a file is in, or the file's own name."""
    return file.relative_to(ROOT / package).parts[0].removesuffix(".py")


def rooms_imported(package: str) -> dict[str, set[str]]:
    """Map each room to the other rooms that its files import, in functions and under TYPE_CHECKING, too."""
    graph: dict[str, set[str]] = {}
    for file in (ROOT / package).rglob("*.py"):
        here = room(package, file)
        names = [name.split(".")[1] for name in modules_imported(file) if name.startswith(f"{package}.")]
        targets = {name if name in ROOMS[package] else "__init__" for name in names}
        graph.setdefault(here, set()).update(targets - {here})
    return graph


def modules() -> dict[str, Path]:
    """Find every module of the packages by its full name; a package stands for its __init__.py."""
    files = [file for package in ORDER for file in (ROOT / package).rglob("*.py")]
    names = [".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for file in files]
    return dict(zip(names, files, strict=True))


@pytest.mark.parametrize("package", ORDER)
def test_imports_run_one_way(package: str) -> None:
    allowed = set(ORDER[: ORDER.index(package) + 1])
    files = list((ROOT / package).rglob("*.py"))
    assert files
    for file in files:
        assert imported(file) <= allowed, file


@pytest.mark.parametrize("package", ORDER)
def test_rooms_of_a_package_import_one_way(package: str) -> None:
    rooms, graph = ROOMS[package], rooms_imported(package)
    assert set(graph) == {*rooms, "__init__"}
    if "__init__" not in rooms:
        assert graph.pop("__init__") == set()
    for name, targets in graph.items():
        assert targets <= set(rooms[: rooms.index(name)]), name
    assert set(TopologicalSorter(graph).static_order()) == set(rooms)  # raises where there is a circle


def test_only_tests_and_teaching_use_the_reference() -> None:
    graph = rooms_imported("sim")
    assert "reference" not in graph["motion"] | graph["__main__"]


def test_statistics_and_swimmer_of_a_calibration_know_little() -> None:
    """Statistics are independent of the robot, and the robot knows no verdict."""
    graph = rooms_imported("calibration")
    assert graph["statistics"] == set()
    assert graph["swimmer"] == {"statistics"}
    for file in (ROOT / "calibration" / "statistics").glob("*.py"):
        names = {name for name in modules_imported(file) if name.split(".")[0] in ORDER}
        assert all(name.startswith(("sim.arrays", "sim.io", "calibration.statistics")) for name in names), file


def test_files_do_not_import_in_a_circle() -> None:
    """Not even in functions or for type checkers alone."""
    files = modules()
    graph = {}
    for name, file in files.items():
        names = modules_imported(file)
        targets = {target if target in files else target.rpartition(".")[0] for target in names}
        graph[name] = {target for target in targets if target in files} - {name}
    assert sum(map(len, graph.values())) > 200
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
    [*((package, set()) for package in ORDER), *((f"{package}.__main__", set()) for package in ORDER)],
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
    assert own == {"softflagella", "softflagella.shadowing"}


def test_a_query_and_a_plan_load_no_training_code() -> None:
    """Nor what training alone needs: data sets, pandas, joblib."""
    code = """
import sys
from planner.paths.path import circle
from planner.planning.plan import plan
from sim.inputs import load_robot
from surrogate.table.model_file import load_table
table, robot = load_table(), load_robot("paper-control")
table.query({name: [value] for name, value in robot.group_values().items()})
plan(circle(2.0), robot, lookup=table)
print(*sys.modules)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT, timeout=LIMIT
    )
    loaded = set(done.stdout.split())
    assert "surrogate.table.wrench_table" in loaded
    training = {f"surrogate.networks.{name}" for name in ("training_loop", "bfgs", "checkpoints")}
    assert not loaded & (training | {"dataset", "surrogate.training", "surrogate.compile_loops"})
    assert not loaded & {"joblib", "pandas"}
