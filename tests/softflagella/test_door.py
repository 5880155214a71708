"""The public face: every name is there, documented, with an example that runs; importing is light."""

from __future__ import annotations

import ast
import doctest
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import softflagella as sf
from sim.io.errors import run_command
from softflagella.__main__ import PACKAGES, main
from tests.processes import LIMIT

SOURCE = Path(sf.__file__)
NAMES = [name for name in sf.__all__ if not name.startswith("_")]


def imported_for_type_checkers() -> dict[str, str]:
    """Name -> home, from the block under TYPE_CHECKING."""
    block = next(node for node in ast.parse(SOURCE.read_text()).body if isinstance(node, ast.If))
    homes = {}
    for node in block.body:
        assert isinstance(node, ast.ImportFrom)
        for alias in node.names:
            renamed = f":{alias.name}" if alias.asname else ""
            homes[alias.asname or alias.name] = f"{node.module}{renamed}"
    return homes


def test_the_three_lists_of_names_are_one() -> None:
    assert sorted(sf._HOMES) == sorted(sf.__all__)
    assert imported_for_type_checkers() == sf._HOMES
    assert set(sf.__all__) <= set(dir(sf))


@pytest.mark.parametrize("name", sf.__all__)
def test_every_name_is_what_its_home_has(name: str) -> None:
    module, _, attribute = sf._HOMES[name].partition(":")
    assert getattr(sf, name) is getattr(import_module(module), attribute or name)


@pytest.mark.parametrize("name", NAMES)
def test_every_name_has_an_example_that_runs(name: str) -> None:
    thing = getattr(sf, name)
    examples = doctest.DocTestFinder(recurse=False).find(thing, name)
    assert examples[0].examples, f"{name} has no example"
    results = [doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test) for test in examples]
    assert sum(result.failed for result in results) == 0


def test_a_name_that_is_not_there() -> None:
    with pytest.raises(AttributeError, match="no attribute 'swim'"):
        sf.swim  # noqa: B018


def test_an_old_name_warns_and_works() -> None:
    with pytest.warns(DeprecationWarning, match="Voyage is now GoalPlan"):
        assert sf.Voyage is sf.GoalPlan


def test_importing_the_package_loads_nothing_heavy() -> None:
    heavy = ("numpy", "torch", "numba", "pandas", "matplotlib", "scipy", "pyarrow", "sim")
    code = f"import sys, softflagella; print([name for name in {heavy!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=LIMIT)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("package", PACKAGES)
def test_one_command_has_those_of_all_packages(package: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([package, "--help"])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    assert f"usage: softflagella {package}" in said
    for command in import_module(f"{package}.__main__").program.names:
        assert command in said


def test_the_command_runs_what_the_package_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(main, ["sim", "robot", "paper-control", "--out", str(tmp_path / "robot.toml")]) == 0
    assert sf.load_robot(tmp_path / "robot.toml") == sf.load_robot("paper-control")
    assert run_command(main, ["sim", "robot", "nobody", "--out", str(tmp_path / "other.toml")]) == 2
    assert "no preset 'nobody'" in capsys.readouterr().err


def test_version_and_unknown_words(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--version"])
    assert capsys.readouterr().out == f"softflagella {sf.__version__}\n"
    main([])
    assert "usage: softflagella" in capsys.readouterr().out
    with pytest.raises(SystemExit) as ended:
        main(["swim"])
    assert ended.value.code == 2
    assert "no package 'swim'" in capsys.readouterr().err
