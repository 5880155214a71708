"""Sizes that make no sense are refused, with the unit that was probably meant."""

from __future__ import annotations

import pytest

from planner.planning.plan import plan
from sim.io.errors import InputError
from sim.model.presets import PRESETS

CONTROL = PRESETS["paper-control"]


def test_millimetres_taken_for_tail_lengths_are_refused() -> None:
    with pytest.raises(InputError, match=r"if you gave l and mean mm, it is 27.3 l: --unit mm"):
        plan([[0, 0], [900, 0], [900, 700], [0, 700], [0, 200]], CONTROL)
