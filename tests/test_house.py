"""Imports run one way and load only what is used; targets of tests; bars of progress."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from collections import defaultdict
from functools import cache
from graphlib import TopologicalSorter
from itertools import product
from pathlib import Path

import pytest

from tests.processes import LIMIT, ROOT

# Each imports those before it.
ORDER = ("common", "sim", "camera", "dataset", "surrogate", "planner", "tracking", "calibration", "softflagella")
ROBOTS = {"model", "effects", "inputs", "mechanics", "solve", "motion", "pictures"}  # rooms that know robots


@cache
def imported(file: Path) -> set[str]:
    """List by full names what a file imports of the packages, wherever in it; `from a import b` counts as a.b."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{file} imports by a relative name"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in names if name.split(".")[0] in ORDER}


def rooms_imported(package: str) -> dict[str, set[str]]:
    """Map each folder or file of a package to the others that it imports, in functions and for types, too."""
    rooms = {path.stem for path in (ROOT / package).iterdir()}
    graph: dict[str, set[str]] = {}
    for file in (ROOT / package).rglob("*.py"):
        room = file.relative_to(ROOT / package).parts[0].removesuffix(".py")
        names = {name.split(".")[1] for name in imported(file) if name.startswith(f"{package}.")}
        targets = {name if name in rooms else "__init__" for name in names}
        graph.setdefault(room, set()).update(targets - {room})
    return graph


@pytest.mark.parametrize("package", ORDER)
def test_imports_run_one_way(package: str) -> None:
    before = ORDER[: ORDER.index(package) + 1]
    for file in (ROOT / package).rglob("*.py"):
        assert {name.split(".")[0] for name in imported(file)} <= set(before), file
    assert tuple(TopologicalSorter(rooms_imported(package)).static_order())  # raises where there is a circle


@pytest.mark.parametrize("package", ORDER)
def test_no_files_import_each_other(package: str) -> None:
    """Not in a circle either, in functions and for types, too; packages run one way."""
    files = {file.with_suffix("").relative_to(ROOT): file for file in (ROOT / package).rglob("*.py")}
    modules = {".".join(path.parts).removesuffix(".__init__"): file for path, file in files.items()}
    graph = {
        module: {name if name in modules else name.rpartition(".")[0] for name in imported(file)} - {module}
        for module, file in modules.items()
    }
    assert tuple(TopologicalSorter(graph).static_order())  # raises where there is a circle


def test_statistics_and_networks_know_no_robot() -> None:
    """A table knows no model, and the swimmer no verdict."""
    networks = [ROOT / "surrogate" / name for name in ("network.py", "training/bfgs.py", "training/networks.py")]
    rooms = rooms_imported("calibration")
    assert (rooms["linear"], rooms["table"], rooms["statistics"]) == (set(), {"linear"}, {"linear", "table"})
    assert rooms_imported("surrogate")["network"] == set()
    below = ("linear", "table", "statistics")
    engine = [file for room in below for file in (ROOT / "calibration" / room).glob("*.py")]
    own = (*(f"calibration.{room}" for room in below), "surrogate.network.", "surrogate.training.")
    for file in (*engine, *networks):
        names = imported(file)
        assert not {name.split(".")[1] for name in names if name.startswith("sim.")} & ROBOTS, file
        others = {name for name in names if not name.startswith(("common.", "sim."))}
        assert all(name.startswith(own) for name in others), file
    assert rooms["swimmer"] == set(below)
    for file in (ROOT / "calibration").rglob("*.py"):
        plans = {name.split(".")[0] for name in imported(file)} & {"planner", "tracking"}
        assert not plans or file.parent.name == "swim", file


def test_the_engine_of_a_verdict_knows_no_robot() -> None:
    code = "import sys, calibration.verdict.calibrate; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=LIMIT)
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert "calibration" in loaded, done.stderr
    assert not loaded & {"sim", "camera", "surrogate", "planner", "tracking", "softflagella"}


def test_an_own_model_is_calibrated_without_what_robots_and_reports_need() -> None:
    """One that no effect explains, so that forms are adopted."""
    code = "import sys; from tests.oracles.others import calibrated; calibrated('tube-2017'); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=LIMIT)
    loaded = set(done.stdout.split())
    assert "calibration.attribution.nearest" in loaded, done.stderr
    assert not loaded & {"jinja2", "matplotlib", "numba", "scipy.stats", "calibration.laws", "calibration.swimmer"}
    assert not loaded & {"camera", "planner", "surrogate", "tracking", "sim.effects", "sim.motion", "sim.solve"}


LIBRARIES = {"jinja2", "joblib", "matplotlib", "numba", "numpy", "pandas", "pyarrow", "safetensors", "scipy",
             "svgelements", "torch", "tqdm"}  # fmt: skip
SOLVERS = {"sim.linear", "sim.motion", "sim.solve"}
SIMULATOR = {"sim.solve.newton", "sim.solve.orbit", "sim.motion.steady", "sim.motion.replay", "sim.motion.run"}
TRAINING = {"surrogate.training", "surrogate.training.networks"}
CODE = """
import json, sys
from importlib import import_module
loaded = {}
for name in sys.argv[1:]:
    before = set(sys.modules)
    import_module(name)
    loaded[name] = sorted(set(sys.modules) - before)
from planner.paths.path import circle
from planner.jobs.plan import plan
from sim.inputs import load_robot
from surrogate.table_file import load_table
table, robot = load_table(), load_robot("paper-control")
table.query({name: [value] for name, value in robot.group_values().items()})
plan(circle(2.0), robot, lookup=table)
print(json.dumps([loaded, sorted(sys.modules)]))
"""


def test_importing_loads_only_what_is_used() -> None:
    """A package loads no library and no package but `sim`; a query and a plan no simulator and no training."""
    names = [name for package in reversed(ORDER[1:]) for name in (package, f"{package}.__main__")]
    command = [sys.executable, "-c", CODE, *names]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT, timeout=LIMIT)
    loaded, after_a_plan = json.loads(done.stdout)
    own = {name for name in loaded["softflagella"] if name.split(".")[0] in ORDER}
    assert own == {"softflagella", "softflagella.shadowing"}
    for name, modules in loaded.items():
        others = set(ORDER) - {"common", "sim", name.split(".")[0]}
        assert not set(modules) & (LIBRARIES | SOLVERS | others), name
    assert "surrogate.motions" in after_a_plan
    assert not set(after_a_plan) & (SIMULATOR | TRAINING | {"joblib", "pandas", "torch"})


def test_each_test_belongs_to_one_target() -> None:
    selections = re.findall(
        r'^test\S*:.*\n\t\$\(RUN\) \$\(PYTEST\) -m "?([^"\n]+)"?$', (ROOT / "Makefile").read_text(), re.MULTILINE
    )
    assert len(selections) == 3
    for rest, rates in product((False, True), repeat=2):
        marks = {"rest": rest, "rates": rates}
        assert sum(eval(selection, marks) for selection in selections) == 1


def test_bars_are_for_terminals() -> None:
    """A bar in a file is a long line that nobody reads; tqdm hides it there if `disable` is None."""
    for package in ORDER:
        for file in (ROOT / package).rglob("*.py"):
            text = file.read_text()
            for node in ast.walk(ast.parse(text)):
                if isinstance(node, ast.Call) and ast.unparse(node.func) == "tqdm":
                    options = {key.arg: ast.unparse(key.value) for key in node.keywords}
                    hidden = options.get("disable", "hidden")  # named so where it is computed before
                    where = text if hidden == "hidden" else hidden
                    assert re.search("or None|=None|^None$|isatty", where), f"{file}: {ast.unparse(node)}"


@pytest.mark.parametrize("package", [*ORDER, "tests", "benchmarks"])
def test_a_class_has_a_name_of_its_own(package: str) -> None:
    """In its package."""
    homes: defaultdict[str, list[str]] = defaultdict(list)
    for file in (ROOT / package).rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ClassDef):
                homes[node.name].append(f"{file.relative_to(ROOT)}:{node.lineno}")
    assert {name: places for name, places in homes.items() if len(places) > 1} == {}


def test_a_public_name_is_that_of_one_object() -> None:
    """What is imported as another name is not hidden behind it."""
    names: list[str] = []
    for node in ast.parse((ROOT / "softflagella" / "__init__.pyi").read_text()).body:
        if isinstance(node, ast.ImportFrom):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.Assign):
            names += [target.id for target in node.targets if isinstance(target, ast.Name)]
    assert len(names) > 50
    assert len(names) == len(set(names))
