"""Functions whose machine code is kept: no numba where the file is there, and compiled again where it is not."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sim import compiling, object_code
from sim.object_code import COUNT, FLOATS, INTEGERS, Kept, array_at, kept
from surrogate.table.support import novelty_rows
from tests.processes import LIMIT

PACKAGE = """
import math
import numpy as np
from sim.compiling import compiled
from sim.object_code import COUNT, FLOATS, array_at, kept

@compiled
def bent(x):
    return np.arctan2(x, 2.0) + math.sin(x)

@kept(FLOATS, COUNT, FLOATS)
def bend(x, count, y):
    found, wanted = array_at(x, count), array_at(y, count)
    for i in range(count):
        wanted[i] = bent(found[i])
"""
USE = """
import sys
sys.path[:0] = sys.argv[1:3]
from pathlib import Path
import sim.compiling
sim.compiling.CACHE = Path(sys.argv[1]) / "cache"
import numpy as np
from bent import bend
x, y = np.linspace(-2, 5, 9), np.zeros(9)
bend(x, 9, y)
print(y.tobytes().hex(), "numba" in sys.modules)
"""
ROOT = Path(__file__).parents[2]


def use(folder: Path) -> list[str]:
    words = [sys.executable, "-c", USE, str(folder), str(ROOT)]
    done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=LIMIT, cwd=folder)
    return done.stdout.split()


def test_a_process_compiles_and_the_next_ones_do_without_numba(tmp_path: Path) -> None:
    """The same numbers to the last bit; also after the file was damaged, or could not be written."""
    (tmp_path / "bent.py").write_text(PACKAGE)
    numbers, with_numba = use(tmp_path)
    assert with_numba == "True"
    x = np.linspace(-2, 5, 9)
    assert np.frombuffer(bytes.fromhex(numbers)) == pytest.approx(np.arctan2(x, 2.0) + np.sin(x), rel=1e-14)
    assert use(tmp_path) == [numbers, "False"]
    (file,) = (tmp_path / "cache").rglob("bent.bend-*.o")
    for damaged in (file.read_bytes()[:-100], b"", file.read_bytes()[:-1] + b"x"):
        file.write_bytes(damaged)
        assert use(tmp_path) == [numbers, "True"]
        assert use(tmp_path) == [numbers, "False"]
    file.unlink()
    file.mkdir()
    assert use(tmp_path) == [numbers, "True"]
    assert not list(file.parent.glob("*.part-*"))


@kept(COUNT, FLOATS)
def _allocates(count: int, x: object) -> None:
    """Return the wrong way: by memory of its own."""
    total = array_at(x, count)
    total[0] = np.ones(count).sum()


@kept(COUNT, FLOATS)
def _raises(count: int, x: object) -> None:
    """Assign arrays of different lengths, which raises."""
    values = array_at(x, count)
    values[:count] = values[: count // 2]


@pytest.mark.parametrize("function", [_allocates, _raises])
def test_what_allocates_or_raises_is_refused(function: Kept) -> None:
    with pytest.raises(TypeError, match="may neither allocate nor raise"):
        object_code.object_code(function)


@pytest.mark.parametrize(
    "array", [np.zeros(8, dtype=np.float32), np.zeros(16)[::2], np.zeros((4, 2)).T, np.zeros(8, dtype=np.int64)]
)
def test_arrays_of_another_kind_are_refused(array: np.ndarray) -> None:
    """Compiled functions do not look at the type of what they read."""
    with pytest.raises(TypeError, match="where floats are needed"):
        novelty_rows(1, 7, 120, np.zeros(240, dtype=np.int64), array, np.zeros(7), np.zeros(1), np.zeros(200))
    with pytest.raises(TypeError, match="where integers are needed"):
        novelty_rows(1, 7, 120, np.zeros(240), np.zeros(9), np.zeros(7), np.zeros(1), np.zeros(200))


def test_too_few_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="zip"):
        novelty_rows(1, 7)


def test_the_file_belongs_to_code_processor_and_library(monkeypatch: pytest.MonkeyPatch) -> None:
    assert novelty_rows.path.name.startswith("surrogate.table.support.novelty_rows-")
    assert novelty_rows.path.is_relative_to(compiling.CACHE)
    before = object_code._machine()
    object_code._machine.cache_clear()
    monkeypatch.setattr("llvmlite.binding.get_host_cpu_name", lambda: "another")
    assert object_code._machine() != before
    object_code._machine.cache_clear()


def test_array_at_is_for_compiled_code() -> None:
    with pytest.raises(TypeError, match="kept functions alone"):
        array_at(0, 3)
    assert {FLOATS, INTEGERS, COUNT} >= set(novelty_rows.kinds)
