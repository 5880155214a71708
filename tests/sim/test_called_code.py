"""Machine code of large loops: kept on disk, and read by other processes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.processes import LIMIT

LINES = "\n".join(f"    y = (y * {1 + i / 128} + x) / (1.0 + y * y) - {i / 3}" for i in range(36))
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
