"""The factors that the runs at each value of an input ask for."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from calibration.laws.group_factors import GroupFactors

SPEEDS = np.array((80.0, 90.0, 100.0, 110.0, 120.0, 130.0, 140.0, 150.0))


def test_a_level_that_is_unknown_is_that_of_the_law() -> None:
    """And what the runs determine stays."""
    x = np.log(SPEEDS) - np.log(SPEEDS).mean()
    given = GroupFactors(
        symbol="ω", x=x, centre=float(np.log(SPEEDS).mean()), exponent=0.0, half_width=0.1, is_term=True,
        shifts=(SPEEDS / 110) ** 2 - 1, information=np.eye(len(x)) / 0.02**2,
    )  # fmt: skip
    common = np.ones(len(x)) / math.sqrt(len(x))
    unknown = (1 - 1e-6) * given.information[0, 0] * np.outer(common, common)
    vague = replace(given, information=given.information - unknown)
    shown = vague.levelled()
    assert vague.errors.min() > 3
    assert shown.errors.max() < 0.03
    assert shown.shifts.mean() == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(np.diff(shown.shifts), np.diff(given.shifts), atol=1e-6)
    assert given.levelled() is given
