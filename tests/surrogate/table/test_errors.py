"""Figures of errors, and warnings about a table that is inaccurate."""

from __future__ import annotations

import numpy as np
import pytest

from surrogate.table.errors import shortcomings, summary
from tests.surrogate.small import table


def test_a_table_of_few_rows_says_that_it_is_poor() -> None:
    words = shortcomings(table().errors)
    assert any("net speed" in line for line in words)
    assert all("learn more rows" in line for line in words)


def test_figures_of_errors() -> None:
    figures = summary({"v": np.array([0.1, -0.2, 5.0])}, np.array([True, True, False]))["v"]
    assert figures["rms"] == pytest.approx(np.sqrt(0.025))
    assert figures["largest"] == pytest.approx(0.2)
    assert figures["rms_with_touching"] > 2
