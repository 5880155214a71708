"""Compiled loops on disk: a version for the sources that they are made of, old versions go, the newest stay."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import sim
from sim import compiling
from sim.compiling import CACHE, cache_folder, code_digest, folder_for_code, folder_of_package, prune
from sim.io.errors import run_command
from sim.machine_code import Locator
from tests.processes import LIMIT

SIM = Path(sim.__file__).parent


def test_only_the_newest_versions_are_kept(tmp_path: Path) -> None:
    for age, name in enumerate(("compiled-c", "compiled-a", "compiled-b", "other")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "loop.nbc").write_text("")
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    prune(tmp_path, 2)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["compiled-a", "compiled-c", "other"]
    prune(tmp_path / "nowhere", 2)


@pytest.fixture
def apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of code with a folder for its loops, the user's cache folder beside it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr(compiling, "code_digest", lambda *_: "digest")
    (tmp_path / "code" / "compiled-digest").mkdir(mode=0o700, parents=True)
    return tmp_path


def test_loops_are_kept_beside_the_code(apart: Path) -> None:
    assert cache_folder(apart / "code") == apart / "code" / "compiled-digest"
    shutil.rmtree(apart / "code")
    (apart / "code").mkdir()
    assert cache_folder(apart / "code").stat().st_mode & 0o777 == 0o700


def let_others_write(folder: Path) -> None:
    folder.chmod(0o775)


def put_a_link(folder: Path) -> None:
    folder.rmdir()
    (folder.parent / "elsewhere").mkdir(mode=0o700)
    folder.symlink_to("elsewhere")


def take_the_code_away(folder: Path) -> None:
    folder.rmdir()
    folder.parent.rmdir()
    folder.parent.write_text("no folder can be made in a file")


@pytest.mark.parametrize("spoil", [let_others_write, put_a_link, take_the_code_away])
def test_loops_that_others_could_write_are_not_run(spoil: Callable[[Path], None], apart: Path) -> None:
    spoil(apart / "code" / "compiled-digest")
    assert cache_folder(apart / "code") == apart / "home" / "softflagella" / "compiled-digest"


@pytest.mark.parametrize("variable", ["", "relative"])
def test_without_a_folder_one_line_says_what_to_set(
    variable: str, apart: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", variable)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    assert run_command(lambda _: print(cache_folder(apart / "code"))) == 2
    assert re.fullmatch("error: .* set XDG_CACHE_HOME to the path of one\n", capsys.readouterr().err)


def test_numba_without_its_compiler_is_refused_in_one_line() -> None:
    code = "from sim.io.errors import run_command as run; run(lambda _: __import__('sim.machine_code'))"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=LIMIT)
    assert re.fullmatch("error: NUMBA_DISABLE_JIT: .*; unset it\n", done.stderr)


def imported(file: Path) -> set[Path]:
    """Return files of the simulator that a file imports."""
    names = re.findall(r"(?m)^(?:from|import) sim\.([\w.]+)", file.read_text())
    return {path for name in names if (path := SIM / f"{name.replace('.', '/')}.py").is_file()}


def test_the_version_is_named_by_all_files_that_loops_are_made_of() -> None:
    """An effect or a way to use the loops is no reason to compile them anew."""
    sources = {path for pattern in compiling._SOURCES for path in SIM.glob(pattern)}
    made_of: set[Path] = set()
    mark = re.compile(r"(?m)^@(compiled|compiled_exactly|formula)$")
    loops = left = {file for file in SIM.rglob("*.py") if mark.search(file.read_text())}
    assert {SIM / "linear" / "gmres.py", SIM / "mechanics" / "drag.py", SIM / "solve" / "newton.py"} <= loops
    while left:
        made_of |= left
        left = {path for file in left for path in imported(file)} - made_of
    assert made_of <= sources
    assert not [path for path in sources if path.parent.name in ("effects", "motion", "io")]
    assert CACHE.name == f"compiled-{code_digest(SIM)}"


def test_a_folder_is_found_again_until_the_code_changes(tmp_path: Path) -> None:
    (tmp_path / "code").mkdir()
    source = tmp_path / "code" / "loop.py"
    names = []
    for text in ("x = 1\n", "x = 1\n", "x = 1  # a comment\n", "x = 2\n"):
        source.write_text(text)
        folder = folder_for_code(tmp_path, "loops", tmp_path / "code", ["*.py"])
        folder.mkdir(exist_ok=True)
        names.append(folder.name)
    assert names[0] == names[1] == names[2] != names[3]


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("def f(x):\n    return 2 * x\n", True),
        ('"""Another."""\n# comment\n\ndef f(x):\n    """Return."""\n    return 2 * x  # twice\n', True),
        ("def f(x):\n    return 3 * x\n", False),
        ("def f(x):\n    return x * 2\n", False),
        ("def f(y):\n    return 2 * y\n", False),
        ("def f(x):\n    return 2.0 * x\n", False),
        ("LIMIT = -0.0\ndef f(x):\n    return 2 * x\n", False),
    ],
)
def test_words_are_not_code(text: str, same: bool, tmp_path: Path) -> None:
    """A change of a comment or a docstring must not cost two minutes of compiling; any other change must."""
    (tmp_path / "loop.py").write_text('"""A loop."""\n\n\ndef f(x):\n    return 2 * x\n')
    before = code_digest(tmp_path, ["*.py"])
    (tmp_path / "loop.py").write_text(text)
    assert (code_digest(tmp_path, ["*.py"]) == before) == same


def test_loops_of_another_package_belong_to_the_code_of_all_its_files(tmp_path: Path) -> None:
    """A loop in one folder is made of functions in another one."""
    for folder in ("package", "package/table"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "__init__.py").touch()
    place = "package.table.balance", tmp_path / "package" / "table" / "balance.py"
    before = Locator(*place).get_cache_path()
    assert before == str(folder_of_package(tmp_path / "package"))
    (tmp_path / "package" / "drag.py").write_text("NUMBER = 1\n")
    folder_of_package.cache_clear()
    assert Locator(*place).get_cache_path() != before
