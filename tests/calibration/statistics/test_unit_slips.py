"""A session in which one output is in another unit is named; days that differ are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibration.statistics.statistical_model import Runs
from calibration.statistics.unit_slips import unit_slips
from common.arrays import Floats

_OUTPUTS = ("v", "R", "theta")


def _runs(seed: int, apart: float, sessions: int = 3) -> tuple[Runs, Floats]:
    """Make runs of days that differ in each output by a factor up to `apart`, and a model that is 20 % off."""
    rng, count = np.random.default_rng(seed), 20 * sessions
    condition, session = np.arange(count) % 7, np.arange(count) % sessions
    true = np.stack([1 + 0.3 * condition, 2 - 0.2 * condition, np.log(0.8 + 0.05 * condition)], 1)
    days = rng.uniform(-1, 1, (sessions, 3)) * np.log(apart)
    y = true + days[session] + 0.03 * rng.normal(size=(count, 3))
    given = true + 0.2 * rng.normal(size=3)
    y[:, 2], given[:, 2] = np.exp(y[:, 2]), np.exp(given[:, 2])
    names = tuple(f"day {i + 1}" for i in range(sessions))
    inputs = condition[:, None].astype(float)
    runs = Runs(_OUTPUTS, y, condition, session, names, inputs, ("setting",), np.arange(count) + 1, (), ())
    return runs, given


@pytest.mark.parametrize("sessions", [2, 3, 5])
@pytest.mark.parametrize("output", range(3))
@pytest.mark.parametrize("factor", [10, 0.1, 60, 1 / 60, 2 * np.pi, 180 / np.pi, np.pi / 180, 100, 1000])
def test_one_day_in_another_unit_is_named(output: int, factor: float, sessions: int) -> None:
    runs, given = _runs(1, 1.02, sessions)
    y, slipped = runs.y.copy(), runs.session == 1
    if _OUTPUTS[output] == "theta":
        y[slipped, output] *= factor
    else:
        y[slipped, output] += np.log(factor)
    (slip,) = unit_slips(replace(runs, y=y), given, ("theta",))
    assert (slip.output, slip.session) == (output, "day 2")
    assert slip.factor == pytest.approx(factor, rel=0.1)


def test_days_that_differ_by_a_third_are_no_slip() -> None:
    tables = (_runs(seed, 1.3, sessions) for seed in range(100) for sessions in (2, 4))
    assert not [slip for runs, given in tables for slip in unit_slips(runs, given, ("theta",))]
