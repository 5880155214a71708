"""The command of the benchmarks lists each one with its duration, and runs it with its arguments."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def benchmarks(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "benchmarks", *words]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=300)


def programs() -> dict[str, ast.Module]:
    """Name -> syntax tree of the modules that have a function `main`."""
    trees = {file: ast.parse(file.read_text()) for file in (ROOT / "benchmarks").glob("*/*.py")}
    mains = {f: t for f, t in trees.items() if any(getattr(node, "name", "") == "main" for node in t.body)}
    assert len({file.stem for file in mains}) == len(mains), "two rooms have a benchmark of the same name"
    return {file.stem: tree for file, tree in mains.items()}


def test_the_list_has_each_benchmark_with_its_duration() -> None:
    lines = benchmarks().stdout.splitlines()
    for name, tree in programs().items():
        docstring = ast.get_docstring(tree)
        assert docstring
        assert (
            f"Usage: python -m benchmarks {name}" in docstring
            or f"\n       python -m benchmarks {name}" in docstring
        )
        line = next(line for line in lines if re.match(rf"[* ] {name} ", line))
        assert docstring.splitlines()[0] in line
        assert re.search(r"\(.*(second|minute|hour|day).*\)$", line)
    marked = {line.split()[1] for line in lines if line.startswith("* ")}
    assert {"accuracy", "speed", "lookup", "tracking"} <= marked <= set(programs())


def test_arguments_are_handed_on() -> None:
    done = benchmarks("obstacles", "0", "7")
    assert done.returncode != 0  # there is nothing to summarise
    assert done.stdout.startswith(" seed")


def test_an_unknown_name_is_refused() -> None:
    done = benchmarks("accurracy")
    assert done.returncode == 2
    assert done.stderr == "error: no benchmark 'accurracy'; `python -m benchmarks` lists all\n"


def test_arguments_that_do_not_fit_are_refused() -> None:
    usage = "python -m benchmarks hidden_laws [TABLES] [FIRST_SEED] [FILE]"
    for words, reason in (
        (("x",), "'x' is no whole number"),
        (("1", "1e3"), "'1e3' is no whole number"),
        (("1", "2", "a", "b"), "'b' is an argument too many"),
    ):
        done = benchmarks("hidden_laws", *words)
        assert done.returncode == 2
        assert done.stderr == f"error: hidden_laws: {reason}; {usage}\n"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("head_effects", "/nowhere.safetensors"), "no model /nowhere.safetensors"),
        (("branches", "x"), "no row 'x' of robustness; give whole numbers from 0 to 4095"),
        (("branches", "2571", "4096"), "no row '4096' of robustness"),
    ],
)
def test_bad_input_ends_with_one_line(words: tuple[str, ...], expected: str) -> None:
    done = benchmarks(*words)
    assert done.returncode == 2
    assert expected in done.stderr
    assert len(done.stderr.splitlines()) == 1
