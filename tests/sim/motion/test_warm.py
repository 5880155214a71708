"""First use: compiling says what it does, and is done once."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path

import pytest

from sim import compiling, machine_code
from sim.motion import warm


def test_compiling_a_loop_is_announced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bar appears at once here; its text names the number of loops. The loop is never in the cache."""
    monkeypatch.setattr(compiling, "CACHE", tmp_path)
    shown = machine_code.tqdm
    monkeypatch.setattr(machine_code, "tqdm", lambda **options: shown(**{**options, "delay": 0, "mininterval": 0}))

    def formula(x: float) -> float:
        return 2 * x

    formula.__module__ = "sim.formula"
    loop = compiling.compiled(formula)
    assert loop(2.0) == 4.0
    assert "compiling loops for first use: 1 done" in capsys.readouterr().err
    loop(3.0)
    assert capsys.readouterr().err == ""


def test_processes_are_preceded_by_one_compilation(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    stages: tuple[tuple[str, Callable[[], object]], ...] = (("one", lambda: done.append("one")),)
    monkeypatch.setattr(warm, "_STAGES", stages)
    monkeypatch.setattr(warm, "all_compiled", lambda: bool(done))
    monkeypatch.setattr(warm, "mark_all_compiled", lambda: done.append("marked"))
    monkeypatch.setattr(warm, "compile_apart", lambda module: bool(warm.compile_all()) and module == warm.__name__)
    assert warm.compile_once()
    assert done == ["one", "marked"]
    assert "first use" in capsys.readouterr().err
    assert warm.compile_once()
    assert done == ["one", "marked"]
    assert capsys.readouterr().err == ""


LOOPS = """
from sim.compiling import compiled

@compiled
def part(x: float) -> float:
    return 2 * x

@compiled
def whole(x: float) -> float:
    return part(x) + 1

def compile_all() -> None:
    whole(1.0)
"""


def test_what_another_process_compiled_is_only_read_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Machine code that is compiled here may have other last digits."""
    (tmp_path / "someones_loops.py").write_text(LOOPS)
    monkeypatch.syspath_prepend(tmp_path)
    assert compiling.compile_apart("someones_loops")
    loops = importlib.import_module("someones_loops")
    assert loops.whole(2.0) == 5.0
    assert sum(loops.whole.dispatcher.stats.cache_hits.values()) == 1
    assert not loops.whole.dispatcher.stats.cache_misses
    assert not compiling.compile_apart("nobodys_loops")
