"""The numbers of a table come back bit by bit, and are few."""

from __future__ import annotations

import json

import numpy as np
import pytest

from planner.page.table_data import packed_data, table_data
from surrogate.table.lookup import table_content
from tests.planner.page.page_core import answer
from tests.planner.page.robots import shipped, shipped_data

MOST_LETTERS = 1_350_000


@pytest.mark.parametrize("count", [0, 1, 2, 3, 5, 1000])
def test_numbers_come_back_exactly(count: int) -> None:
    rng = np.random.default_rng(count)
    numbers = rng.normal(size=(count, 2)) * 10.0 ** rng.integers(-300, 300, size=(count, 2))
    content = {"a": {"b": [numbers, "text", None, 2.5]}, "c": np.arange(3.0)}
    found = answer("table_data.js", "readData", json.loads(packed_data(content)))
    assert found["a"]["b"][0] == {"shape": [count, 2], "values": numbers.ravel().tolist()}
    assert found["a"]["b"][1:] == ["text", None, 2.5]
    assert found["c"]["values"] == [0.0, 1.0, 2.0]


def test_the_shipped_table_comes_back_exactly() -> None:
    found = answer("table_data.js", "readData", json.loads(shipped_data()))
    content, wanted = found["content"], table_content(shipped())
    assert found["identity"] == shipped().identity
    assert content["ranges"] == {name: list(ends) for name, ends in shipped().ranges.items()}
    assert content["curve_errors"]["curves"]["values"] == wanted["curve_errors"]["curves"].ravel().tolist()
    for part, network in zip(content["wrench"], wanted["wrench"], strict=True):
        for name, array in network["state"].items():
            assert part["state"][name] == {"shape": list(array.shape), "values": array.ravel().tolist()}


def test_the_text_is_short_and_means_nothing_in_html() -> None:
    assert len(shipped_data()) <= MOST_LETTERS
    assert not set("<>&`'\\") & set(shipped_data())
    assert table_data(shipped()) == shipped_data()
