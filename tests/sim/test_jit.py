"""Compiled loops: numba is imported late, machine code is read by other processes and belongs to its sources."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import sim
from common.errors import run_command
from sim import jit
from tests.processes import LIMIT

SIM = Path(sim.__file__).parent
ROOT = SIM.parent
LAZY = """
import sys
import sim.solve.orbit, sim.motion.steady, sim.motion.response
print("numba" in sys.modules)
"""
LOOPS = """
from sim.jit import compiled, formula, inlined
from someones_number import NUMBER

@formula
def double(x):
    return 2 * x

@compiled
def inner(x):
    return double(x) + NUMBER

@inlined
def signed(x, y):
    if x < 0:
        y = y / 0.0
    return y

@compiled
def outer(x):
    return signed(x, inner(x))
"""
USE = """
import numba, sys
from pathlib import Path
from sim import jit
jit.CACHE = Path(sys.argv[1])
before = numba.config.OPT, numba.config.CACHE_DIR
from someones_loops import outer, double, signed
print(outer(1.0), outer(-1.0), double([3]), sum(outer.kernel.stats.cache_hits.values()))
assert (numba.config.OPT, numba.config.CACHE_DIR) == before
assert not signed.part.signatures
"""

MEMORY = """
import gc
from dataclasses import replace
import numpy as np
from numba.core.runtime import rtsys
from sim.effects import catalogue
from sim.model.presets import PRESETS
from sim.model.schedule import Schedule
from sim.motion.replay import replay
from sim.motion.response import responses
from sim.motion.sensitivity import sensitivities
from sim.motion.steady import orbits

robot = PRESETS["paper-control"]
alone = robot.groups()
pair = alone.select(np.zeros(2, int))
further = {effect.name: 1e-3 for effect in catalogue().values() if effect.reach == "nonlocal"}
schedule = Schedule({**robot.group_values(), "N": 4}, 1, np.full(2, 0.2), (0.0, 0.0, 0.0), robot.time_scale)

def held():
    for groups in (alone, pair):
        effects = {name: np.full(len(groups), size) for name, size in further.items()}
        orbits(groups, stability=True), orbits(replace(groups, effects=effects), stability=True)
        sensitivities(groups, ["C_t"]), responses(groups)
    replay(schedule)
    gc.collect()
    now = rtsys.get_allocation_stats()
    return now.alloc - now.free, now.alloc

held()
(before, first), (after, second) = held(), held()
print(second > first, after - before)
"""


def python(*words: str, folder: Path = ROOT, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder that it imports from first."""
    path = os.pathsep.join([str(folder), str(ROOT)])
    given = {**os.environ, "PYTHONPATH": path, **environment}
    return subprocess.run([sys.executable, *words], env=given, capture_output=True, text=True, timeout=LIMIT)


def test_numba_is_not_imported_before_the_first_call() -> None:
    assert python("-c", LAZY).stdout == "False\n"


def test_another_process_reads_what_one_has_compiled_until_the_sources_change(tmp_path: Path) -> None:
    def used(number: int) -> tuple[str, str]:
        (tmp_path / "someones_number.py").write_text(f"NUMBER = {number}\n")
        # Within a second, Python would take the new number's file for the one that it has the code of.
        done = python("-B", "-c", USE, str(tmp_path / "cache"), folder=tmp_path)
        return done.stdout, done.stderr

    said = "compiling loops for first use; softflagella sim compile does so beforehand\n"
    (tmp_path / "someones_loops.py").write_text(LOOPS)
    assert used(1) == ("3.0 -inf [3, 3] 0\n", said)
    assert used(1) == ("3.0 -inf [3, 3] 1\n", "")
    assert used(5) == ("7.0 inf [3, 3] 0\n", said)


def test_numba_without_its_compiler_is_refused_in_one_line() -> None:
    code = "from common.errors import run_command as run; from sim.linear.spectral import differentiation as d"
    done = python("-c", f"{code}; run(lambda _: d(3))", NUMBA_DISABLE_JIT="1")
    assert re.fullmatch("error: NUMBA_DISABLE_JIT: .*; unset it\n", done.stderr)


@pytest.fixture
def apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of code with folders for loops of five versions, the user's cache folder beside it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr(jit, "digest", lambda _: "digest")
    names = ("compiled-c", "compiled-a", "compiled-b", "compiled-d", "other", "compiled-digest")
    for age, name in enumerate(names):
        (tmp_path / "code" / name).mkdir(mode=0o700, parents=True)
        os.utime(tmp_path / "code" / name, (1e9 - age, 1e9 - age))
    return tmp_path


def test_loops_are_kept_beside_the_code_for_the_newest_versions(apart: Path) -> None:
    assert jit.cache_folder(apart / "code") == apart / "code" / "compiled-digest"
    shutil.rmtree(apart / "code" / "compiled-digest")
    assert jit.cache_folder(apart / "code").stat().st_mode & 0o777 == 0o700
    names = sorted(path.name for path in (apart / "code").iterdir())
    assert names == ["compiled-a", "compiled-b", "compiled-c", "compiled-digest", "other"]


def let_others_write(folder: Path) -> None:
    folder.chmod(0o775)


def put_a_link(folder: Path) -> None:
    folder.rmdir()
    (folder.parent / "elsewhere").mkdir(mode=0o700)
    folder.symlink_to("elsewhere")


def take_the_code_away(folder: Path) -> None:
    shutil.rmtree(folder.parent)
    folder.parent.write_text("no folder can be made in a file")


@pytest.mark.parametrize("spoil", [let_others_write, put_a_link, take_the_code_away])
def test_loops_that_others_could_write_are_not_run(spoil: Callable[[Path], None], apart: Path) -> None:
    spoil(apart / "code" / "compiled-digest")
    assert jit.cache_folder(apart / "code") == apart / "home" / "softflagella" / "compiled-digest"


@pytest.mark.parametrize("variable", ["", "relative"])
def test_without_a_folder_one_line_says_what_to_set(
    variable: str, apart: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", variable)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    assert run_command(lambda _: print(jit.cache_folder(apart / "code"))) == 2
    assert re.fullmatch("error: .* set XDG_CACHE_HOME to the path of one\n", capsys.readouterr().err)


def imported(file: Path) -> set[Path]:
    """Return files of the simulator that a file imports."""
    names = re.findall(r"(?m)^(?:from|import) sim\.([\w.]+)", file.read_text())
    return {path for name in names if (path := SIM / f"{name.replace('.', '/')}.py").is_file()}


def test_what_loops_allocate_is_freed() -> None:
    """Loops that count no references must not take an array over from another loop."""
    done = python("-c", MEMORY, NUMBA_NRT_STATS="1")
    assert done.stdout == "True 0\n", done.stderr


def test_the_version_is_named_by_all_files_that_loops_are_made_of() -> None:
    """An effect or a way to use the loops is no reason to compile them anew."""
    sources = {path for pattern in jit.SOURCES for path in SIM.glob(pattern)}
    made_of: set[Path] = set()
    mark = re.compile(r"(?m)^@(compiled|compiled_fast|borrowing|inlined|formula)$")
    loops = left = {file for file in SIM.rglob("*.py") if mark.search(file.read_text())}
    assert {SIM / "linear" / "gmres.py", SIM / "mechanics" / "drag.py", SIM / "solve" / "newton.py"} <= loops
    arguments = SIM / "solve" / "assembly.py"  # of loops, made from what the robots are
    while left:
        made_of |= left
        left = {path for file in left - {arguments} for path in imported(file)} - made_of
    assert made_of <= sources
    assert not [path for path in sources if path.parent.name in ("effects", "motion")]
    assert jit.CACHE.name == f"compiled-{jit.digest(sources)}"


def test_nothing_private_of_numba_is_used() -> None:
    """`_getvalue` is how numba's guide to extensions reads a structure that it has filled."""
    for file in (SIM / "jit.py", SIM / "lane_code.py"):
        nodes = ast.walk(ast.parse(file.read_text()))
        attributes = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
        private = {name for name in attributes if name.startswith("_") and not name.startswith("__")}
        assert private <= {"_getvalue"}
        assert not re.search(r"import .*\b_[a-z]", file.read_text())
