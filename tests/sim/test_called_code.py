"""Large loops are called, not copied: same numbers, whoever compiled what, and whatever is missing on disk."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.processes import LIMIT

LINES = "\n".join(f"    y = (y * {1 + i / 128} + x) / (1.0 + y * y) - {i / 3}" for i in range(60))
LOOPS = f"""
from sim.compiling import compiled, compiled_exactly, copied

def bent(x):
    y = x
{LINES}
    return y

@compiled_exactly
def part(x):
    y = x
{LINES}
    return y

@copied
@compiled_exactly
def copy(x):
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

@compiled_exactly
def with_copy(x):
    return copy(x)
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
    exec(LOOPS.replace("@compiled_exactly", "").replace("@compiled", "").replace("@copied", ""), given)
    return float(given[name](0.7)).hex()  # type: ignore[operator]


def use(folder: Path, names: str, *words: str) -> list[str]:
    """Call loops in another process; return its lines: name, number, and how often it was read from disk."""
    line = [sys.executable, "-c", USE, str(folder), str(ROOT), names, *words]
    done = subprocess.run(line, capture_output=True, text=True, check=True, timeout=LIMIT, cwd=folder)
    return done.stdout.splitlines()


def files(folder: Path, name: str) -> list[Path]:
    return list((folder / "cache").rglob(f"someones.{name}-*"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "someones.py").write_text(LOOPS)
    return tmp_path


@pytest.mark.parametrize("name", ["whole", "loose"])
def test_what_one_process_compiles_another_one_reads(name: str, folder: Path) -> None:
    """A large loop, a small one, and one that calls both; and a caller whose sums may be reordered."""
    assert use(folder, name) == [f"{name} {expected(name)} 0", "part 0"]
    assert use(folder, name) == [f"{name} {expected(name)} 1", "part 1"]
    assert use(folder, f"part,{name}") == [f"part {expected('part')} 1", f"{name} {expected(name)} 1", "part 1"]


@pytest.mark.parametrize("words", [(), ("another",)])
def test_a_loop_that_is_missing_is_compiled_again(words: tuple[str, ...], folder: Path) -> None:
    """So is its caller, if the name of its symbol has changed."""
    use(folder, "whole")
    for file in files(folder, "part"):
        file.unlink()
    assert use(folder, "whole", *words) == [f"whole {expected('whole')} {0 if words else 1}", "part 0"]
    assert use(folder, "whole", *words) == [f"whole {expected('whole')} 1", "part 1"]


def test_a_caller_that_is_compiled_later_uses_what_was_read(folder: Path) -> None:
    """The small loop between them is read from disk, and with it what it calls."""
    use(folder, "small")
    assert use(folder, "whole") == [f"whole {expected('whole')} 0", "part 1"]
    assert use(folder, "whole") == [f"whole {expected('whole')} 1", "part 1"]


def test_large_loops_are_not_copied(folder: Path) -> None:
    """The file of a caller is smaller than that of one which asked for a copy."""
    assert use(folder, "small,with_copy") == [
        f"small {expected('small')} 0", f"with_copy {expected('with_copy')} 0", "part 0"
    ]  # fmt: skip
    sizes = [sum(file.stat().st_size for file in files(folder, name)) for name in ("small", "with_copy")]
    assert 1.1 * sizes[0] < sizes[1]
