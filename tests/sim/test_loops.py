"""First use of compiled loops: numba is imported late, and what is compiled is said and done once."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from sim import compiling
from sim.compile_stages import count_loops, count_ready, run_stages, saying_first_use
from tests.processes import LIMIT

ROOT = Path(__file__).parents[2]
LAZY = """
import sys
import sim.solve.orbit, sim.motion.steady, sim.motion.response
print("numba" in sys.modules)
"""
LOOPS = """
from sim.compiling import compiled

@compiled
def inner(x: float) -> float:
    return 2 * x

@compiled
def outer(x: float) -> float:
    return inner(x) + 1

@compiled
def another(x: float) -> float:
    return x * x

def compile_all() -> None:
    outer(1.0)
"""


def test_numba_is_not_imported_before_the_first_call() -> None:
    words = [sys.executable, "-c", LAZY]
    done = subprocess.run(words, capture_output=True, text=True, check=True, cwd=ROOT, timeout=LIMIT)
    assert done.stdout == "False\n"


@pytest.fixture
def loops(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Three loops that nobody has compiled."""
    name = "loops_of_" + re.sub(r"\W", "_", request.node.name)
    (tmp_path / f"{name}.py").write_text(LOOPS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(compiling, "CACHE", tmp_path / "cache")
    return importlib.import_module(name)


@pytest.mark.parametrize("terminal", [False, True])
def test_stages_and_the_first_use_say_how_many_loops_are_left(
    terminal: bool,
    loops: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    folder = compiling.folder_of_package(tmp_path)
    assert count_loops(loops.__name__) == 3
    for _ in range(2):  # the second time, nothing is compiled
        with saying_first_use(loops.__name__, folder):
            assert loops.outer(1.0) == 3.0
    shown = capsys.readouterr().err
    if terminal:
        assert "compiling for first use" in shown
        assert "2 of at most 3 loops" in shown
    else:
        assert shown == "first use: compiling at most 3 loops, about a minute\n"
    stages = (("first", lambda: loops.outer(1.0)), ("second", lambda: loops.another(1.0)))
    assert run_stages(loops.__name__, stages, folder) > 0
    assert count_ready(folder) == 3
    shown = capsys.readouterr().err
    if terminal:
        assert all(words in shown for words in ("compiling 2/2: second", "2 of 3 loops", "left"))
    else:
        assert shown.splitlines()[1] == "compiling 2/2: second (2 of 3 loops are ready) …"


def test_all_loops_of_the_simulator_are_counted() -> None:
    importlib.import_module("sim.motion.warm")  # with all that it calls
    files = (Path(compiling.__file__).parent).rglob("*.py")
    decorated = sum(len(re.findall(r"(?m)^@compiled(?:_exactly)?$", file.read_text())) for file in files)
    assert count_loops("sim") == decorated > 100


def test_what_another_process_compiled_is_only_read_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Machine code that is compiled here may have other last digits."""
    (tmp_path / "someones_loops.py").write_text(LOOPS)
    monkeypatch.syspath_prepend(tmp_path)
    assert compiling.compile_apart("someones_loops")
    loops = importlib.import_module("someones_loops")
    assert loops.outer(2.0) == 5.0
    assert sum(loops.outer.dispatcher.stats.cache_hits.values()) == 1
    assert not loops.outer.dispatcher.stats.cache_misses
    assert not compiling.compile_apart("nobodys_loops")
