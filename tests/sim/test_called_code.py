"""Machine code of large loops and of loops without numba: kept on disk, and read by other processes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sim import compiling, object_code
from sim.object_code import COUNT, FLOATS, INTEGERS, Kept, array_at, kept
from tests.processes import LIMIT

LINES = "\n".join(f"    y = (y * {1 + i / 128} + x) / (1.0 + y * y) - {i / 3}" for i in range(60))
LOOPS = f"""
from sim.compiling import compiled, compiled_exactly

def bent(x):
    y = x
{LINES}
    return y

@compiled_exactly
def part(x):
    y = x
{LINES}
    return y

@compiled_exactly
def small(x):
    return 2.0 * part(x)

@compiled_exactly
def whole(x):
    return small(x) + part(2.0 * x)

@compiled
def loose(x):
    return part(x)
"""
USE = """
import sys
sys.path[:0] = [sys.argv[1], sys.argv[2]]
from pathlib import Path
import sim.compiling
sim.compiling.CACHE = Path(sys.argv[1]) / "cache"
from sim import called_code
called_code._HERE = Path(sys.argv[1])
if "another" in sys.argv:
    called_code.digest_of_code = lambda code: "another"
import someones
for name in sys.argv[3].split(","):
    loop = getattr(someones, name)
    print(name, loop(0.7).hex(), sum(loop.dispatcher.stats.cache_hits.values()))
print("part", sum(someones.part.dispatcher.stats.cache_hits.values()))
"""
ROOT = Path(__file__).parents[2]


def expected(name: str) -> str:
    """Compute what a loop returns in Python."""
    given: dict[str, object] = {}
    exec(LOOPS.replace("@compiled_exactly", "").replace("@compiled", ""), given)
    return float(given[name](0.7)).hex()  # type: ignore[operator]


def run(code: str, folder: Path, *words: str) -> list[str]:
    """Run code in another process, given the folder and that of the packages; return its lines."""
    line = [sys.executable, "-c", code, str(folder), str(ROOT), *words]
    done = subprocess.run(line, capture_output=True, text=True, check=True, timeout=LIMIT, cwd=folder)
    return done.stdout.splitlines()


def use(folder: Path, names: str, *words: str) -> list[str]:
    """Call loops in another process; return its lines: name, number, and how often it was read from disk."""
    return run(USE, folder, names, *words)


def files(folder: Path, name: str) -> list[Path]:
    return list((folder / "cache").rglob(f"someones.{name}-*"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "someones.py").write_text(LOOPS)
    return tmp_path


@pytest.mark.rest
def test_what_one_process_compiles_another_one_reads(folder: Path) -> None:
    """A large loop, a small one, and two that call both, of which one may reorder its sums."""
    names = ("part", "whole", "loose")
    small = expected("small")
    part, whole, loose = (f"{name} {expected(name)}" for name in names)
    assert use(folder, "small") == [f"small {small} 0", "part 0"]
    assert use(folder, "whole,loose") == [f"{whole} 0", f"{loose} 0", "part 1"]  # part is read, with small
    assert use(folder, "part,whole,loose") == [f"{part} 1", f"{whole} 1", f"{loose} 1", "part 1"]
    for words, hits in (((), 1), (("another",), 0)):  # with another name of its symbol, a loop's callers go, too
        for file in files(folder, "part"):
            file.unlink()
        assert use(folder, "whole", *words) == [f"{whole} {hits}", "part 0"]


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
USE_BENT = """
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


@pytest.mark.rest
def test_a_process_compiles_and_the_next_ones_do_without_numba(tmp_path: Path) -> None:
    """The same numbers to the last bit; also after the file was damaged, or could not be written."""
    (tmp_path / "bent.py").write_text(PACKAGE)
    ((numbers, with_numba),) = map(str.split, run(USE_BENT, tmp_path))
    assert with_numba == "True"
    x = np.linspace(-2, 5, 9)
    assert np.frombuffer(bytes.fromhex(numbers)) == pytest.approx(np.arctan2(x, 2.0) + np.sin(x), rel=1e-14)
    assert run(USE_BENT, tmp_path) == [f"{numbers} False"]
    (file,) = (tmp_path / "cache").rglob("bent.bend-*.o")
    for damaged in (b"", file.read_bytes()[:-1] + b"x"):
        file.write_bytes(damaged)
        assert run(USE_BENT, tmp_path) == [f"{numbers} True"]
    file.unlink()
    file.mkdir()
    assert run(USE_BENT, tmp_path) == [f"{numbers} True"]
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


@kept(COUNT, FLOATS, INTEGERS)
def _reads(count: int, x: object, places: object) -> None:
    """Do nothing."""


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
        _reads(8, array, np.zeros(8, dtype=np.int64))
    with pytest.raises(TypeError, match="where integers are needed"):
        _reads(8, np.zeros(8), np.zeros(8))
    with pytest.raises(ValueError, match="zip"):
        _reads(1, 7)
    with pytest.raises(TypeError, match="kept functions alone"):
        array_at(0, 3)


def test_the_file_belongs_to_code_processor_and_library(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _reads.path.name.startswith(f"{__name__}._reads-")
    assert _reads.path.is_relative_to(compiling.CACHE)
    before = object_code._machine()
    object_code._machine.cache_clear()
    monkeypatch.setattr("llvmlite.binding.get_host_cpu_name", lambda: "another")
    assert object_code._machine() != before
    object_code._machine.cache_clear()
