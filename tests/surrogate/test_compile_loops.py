"""The first query has the table's loops compiled in another process; later ones only read them."""

from __future__ import annotations

import pytest

from surrogate import loops
from surrogate.table.model_file import load
from surrogate.training.simulated import draw_robots


def test_the_first_query_compiles_apart_and_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    apart: list[str] = []
    monkeypatch.setattr(loops, "all_compiled", lambda folder: folder != loops.FOLDER)
    monkeypatch.setattr(loops, "compile_apart", apart.append)
    loops.compile_once.cache_clear()
    robots = draw_robots(4, 0, wide=False)
    for _ in range(2):
        load().query(robots, flag=True)
    loops.compile_once.cache_clear()
    assert apart == ["surrogate.compile_loops"]
    assert "first use" in capsys.readouterr().err
