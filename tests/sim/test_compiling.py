"""Compiled loops on disk: a version for the sources that they are made of, old versions go, the newest stay."""

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
from sim import compiling
from sim.compiling import CACHE, cache_folder, code_digest, folder_for_code, folder_of_package, prune
from sim.io.errors import run_command
from sim.machine_code import Locator
from tests.processes import LIMIT

SIM = Path(sim.__file__).parent
MARKS = {"compiled", "compiled_exactly", "formula"}


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
    """A user without a home used to get a traceback; no folder belongs to this one, and `~` is not known."""
    monkeypatch.setenv("XDG_CACHE_HOME", variable)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    assert run_command(lambda _: print(cache_folder(apart / "code"))) == 2
    assert re.fullmatch("error: .* set XDG_CACHE_HOME to the path of one\n", capsys.readouterr().err)


def test_numba_without_its_compiler_is_refused_in_one_line() -> None:
    """`NUMBA_DISABLE_JIT=1 softflagella steady robot.toml` used to end with a traceback."""
    code = "from sim.io.errors import run_command as run; run(lambda _: __import__('sim.machine_code'))"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=LIMIT)
    assert re.fullmatch("error: NUMBA_DISABLE_JIT: .*; unset it\n", done.stderr)


def has_loops(file: Path) -> bool:
    """Tell whether a function of the file is compiled, or inlined in functions that are."""
    functions = (node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.FunctionDef))
    return any(isinstance(mark, ast.Name) and mark.id in MARKS for f in functions for mark in f.decorator_list)


def imported(file: Path) -> set[Path]:
    """Return files of the simulator that a file imports."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        found |= {SIM.parent / f"{name.replace('.', '/')}.py" for name in names if name.split(".")[0] == "sim"}
    return {path for path in found if path.is_file()}


def with_imports(files: set[Path]) -> set[Path]:
    """Collect `files`, what they import, and so on."""
    whole: set[Path] = set()
    while files - whole:
        whole |= files
        files = {path for file in whole for path in imported(file)}
    return whole


LOOPS = {file for file in SIM.rglob("*.py") if has_loops(file)}
MADE_OF = sorted(str(path.relative_to(SIM)) for path in with_imports(LOOPS))
ELSEWHERE = sorted(
    str(p.relative_to(SIM)) for room in ("effects", "motion", "io") for p in (SIM / room).glob("*.py")
)


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Path(
        shutil.copytree(SIM, tmp_path_factory.mktemp("code") / "sim", ignore=shutil.ignore_patterns("__pycache__"))
    )


def digest_with_a_change(root: Path, name: str) -> str:
    """Compute the digest while a file has one line more."""
    text = (root / name).read_bytes()
    (root / name).write_bytes(text + b"CHANGED = 1\n")
    digest = code_digest(root)
    (root / name).write_bytes(text)
    return digest


def test_the_folder_is_named_by_the_code(copied: Path) -> None:
    assert CACHE.name == f"compiled-{code_digest(SIM)}"
    assert code_digest(copied) == code_digest(SIM)


def test_sources_are_parsed_once_for_each_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A start of the program reads its sources, but parses them only where they have changed."""
    (tmp_path / "code").mkdir()
    source = tmp_path / "code" / "loop.py"
    source.write_text("x = 1\n")
    folder = folder_for_code(tmp_path, "loops", tmp_path / "code", ["*.py"])
    folder.mkdir()
    folder_for_code(tmp_path, "loops", tmp_path / "code", ["*.py"])
    parsed: list[Path] = []
    monkeypatch.setattr(
        compiling, "code_digest", lambda root, _: parsed.append(root) or code_digest(root, ["*.py"])
    )
    assert folder_for_code(tmp_path, "loops", tmp_path / "code", ["*.py"]) == folder
    assert not parsed
    source.write_text("x = 1  # a comment\n")
    assert folder_for_code(tmp_path, "loops", tmp_path / "code", ["*.py"]) == folder
    source.write_text("x = 2\n")
    assert folder_for_code(tmp_path, "loops", tmp_path / "code", ["*.py"]) != folder
    assert len(parsed) == 2


def test_loops_are_found_where_they_are() -> None:
    """The lists of the tests below are not empty."""
    assert {SIM / "linear" / "gmres.py", SIM / "mechanics" / "drag.py", SIM / "solve" / "newton.py"} <= LOOPS
    assert {"arrays.py", "compiling.py", "model/body.py", "mechanics/drag.py", "mechanics/rod.py"} <= set(MADE_OF)
    assert {"effects/inertia.py", "motion/run.py"} <= set(ELSEWHERE)


@pytest.mark.parametrize("name", MADE_OF)
def test_a_change_of_what_loops_are_made_of_is_another_version(name: str, copied: Path) -> None:
    assert digest_with_a_change(copied, name) != code_digest(copied)


@pytest.mark.parametrize("name", ELSEWHERE)
def test_a_change_elsewhere_is_the_same_version(name: str, copied: Path) -> None:
    """An effect or a way to use the loops is no reason to compile them anew."""
    assert digest_with_a_change(copied, name) == code_digest(copied)


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


def test_loops_of_another_package_are_compiled_again_when_any_of_its_files_changes(tmp_path: Path) -> None:
    """A loop in one folder is made of functions in another one."""
    for folder in ("package", "package/formulas", "package/table"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "__init__.py").touch()
    formula = tmp_path / "package" / "formulas" / "drag.py"
    formula.write_text("NUMBER = 1\n")
    before = folder_of_package(tmp_path / "package")
    folder_of_package.cache_clear()
    formula.write_text("NUMBER = 2\n")
    assert folder_of_package(tmp_path / "package") != before
    inside = Locator("package.table.balance", tmp_path / "package" / "table" / "balance.py")
    assert inside.get_cache_path() == str(folder_of_package(tmp_path / "package"))


def test_machine_code_is_read_where_the_sources_have_moved(tmp_path: Path) -> None:
    """Two checkouts of the same code, or a touched file, share what was compiled."""
    code = (
        "import sys; sys.path[:0] = sys.argv[1:]; from loops.one import twice; "
        "print(twice(3.0), sum(twice.dispatcher.stats.cache_hits.values()))"
    )
    for place in ("here", "there"):
        (tmp_path / place / "loops").mkdir(parents=True)
        (tmp_path / place / "loops" / "__init__.py").touch()
        text = '"""{}."""\nfrom sim.compiling import compiled\n\n@compiled\ndef twice(x):\n    return 2 * x\n'
        (tmp_path / place / "loops" / "one.py").write_text(text.format(place))
    said = [
        subprocess.run([sys.executable, "-c", code, str(tmp_path / place), str(SIM.parent)], capture_output=True,
                       text=True, check=True, timeout=LIMIT).stdout.split()
        for place in ("here", "there")
    ]  # fmt: skip
    folder_of_package.cache_clear()
    shutil.rmtree(folder_of_package(tmp_path / "here" / "loops"))
    assert said == [["6.0", "0"], ["6.0", "1"]]
