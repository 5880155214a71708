"""The first query has the table's loops compiled in another process; later ones only read them."""

from __future__ import annotations

import pytest

from surrogate import compile_loops as warm
from surrogate.table.model_file import load
from surrogate.training.simulated import drawn


def test_the_first_query_compiles_apart_and_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    apart: list[str] = []
    monkeypatch.setattr(warm, "all_compiled", lambda folder: folder != warm.FOLDER)
    monkeypatch.setattr(warm, "compile_apart", apart.append)
    warm.compile_once.cache_clear()
    robots = drawn(4, 0, wide=False)
    for _ in range(2):
        load().query(robots, flag=True)
    warm.compile_once.cache_clear()
    assert apart == ["surrogate.compile_loops"]
    assert "first use" in capsys.readouterr().err
