"""The gap between tails."""

from __future__ import annotations

import math

import pytest

from sim.mechanics.contact import tail_gap
from sim.mechanics.geometry import straight
from tests.sim.robots import CONTROL_VALUES


def test_tail_gap_of_straight_tails() -> None:
    offset, radius = 1 / CONTROL_VALUES["l_over_R"], 1 / CONTROL_VALUES["l_over_r0"]
    tails = straight(8, 4, offset)
    assert tail_gap(tails, offset, radius) == pytest.approx(math.sqrt(2) * offset / (2 * radius), rel=1e-12)
    assert math.isinf(tail_gap(tails[:, :1].copy(), offset, radius))
