"""Synthetic tables are refused where the simulator has no steady motion."""

from __future__ import annotations

from dataclasses import replace

import pytest

from calibration.swimmer.synthetic_table import make_table
from sim.io.errors import InputError
from sim.model.presets import PRESETS


def test_a_motion_that_does_not_settle_is_refused_and_named() -> None:
    thins = replace(PRESETS["paper-control"], effects={"shear_thinning": 0.8})
    with pytest.raises(InputError, match=r"1 of 1 motions .* example N = 2, l = 11 cm"):
        make_table(thins, seed=0, tails=(2,), lengths_cm=(11.0,), motor_rpm=(100.0,), trials=1, title="")
