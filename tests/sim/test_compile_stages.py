"""Compiling stage by stage says how much is left: a bar on a terminal, elsewhere a line for each stage."""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path

import pytest

import sim.motion.warm
from sim import compiling
from sim.compile_stages import count_loops, count_ready, run_stages, saying_first_use

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
"""


@pytest.mark.parametrize("terminal", [False, True])
def test_stages_say_how_many_loops_are_left(
    terminal: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    name = f"loops_{'on' if terminal else 'off'}_a_terminal"
    (tmp_path / f"{name}.py").write_text(LOOPS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(compiling, "CACHE", tmp_path / "cache")
    module = importlib.import_module(name)
    folder = compiling.folder_of_package(tmp_path)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    stages = (("first", lambda: module.outer(1.0)), ("second", lambda: module.another(1.0)))
    assert count_loops(name) == 3
    assert run_stages(name, stages, folder) > 0
    assert count_ready(folder) == 3
    shown = capsys.readouterr().err
    if terminal:
        assert "compiling 2/2: second" in shown
        assert "2 of 3 loops" in shown
        assert "left" in shown
    else:
        assert shown.splitlines() == [
            "compiling 1/2: first (0 of 3 loops are ready) …",
            "compiling 2/2: second (2 of 3 loops are ready) …",
        ]
    assert "first use" not in shown


@pytest.mark.parametrize("terminal", [False, True])
def test_the_first_use_says_of_how_many_loops(
    terminal: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It used to count without an end."""
    name = f"loops_used_{'on' if terminal else 'off'}_a_terminal"
    (tmp_path / f"{name}.py").write_text(LOOPS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(compiling, "CACHE", tmp_path / "cache")
    module = importlib.import_module(name)
    folder = compiling.folder_of_package(tmp_path)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    for _ in range(2):  # the second time, nothing is compiled
        with saying_first_use(name, folder):
            assert module.outer(1.0) == 3.0
    shown = capsys.readouterr().err
    if terminal:
        assert "compiling for first use" in shown
        assert "2 of at most 3 loops" in shown
    else:
        assert shown == "first use: compiling at most 3 loops, about a minute\n"
    assert " done in " not in shown


def test_all_loops_of_the_simulator_are_counted() -> None:
    files = (Path(compiling.__file__).parent).rglob("*.py")
    decorated = sum(len(re.findall(r"(?m)^@compiled(?:_exactly)?$", file.read_text())) for file in files)
    assert sim.motion.warm is not None
    assert count_loops("sim") == decorated > 100
