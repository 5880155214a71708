"""A session in which one output is in another unit is refused; days that differ otherwise are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibration.table.runs import Runs
from calibration.table.unit_slips import refuse_unit_slips
from common.arrays import Floats
from common.errors import InputError

_OUTPUTS = ("v", "R", "theta")


def _runs(
    seed: int, apart: float, sessions: int = 3, *, zero: float = 0.0, noise: float = 0.03
) -> tuple[Runs, Floats]:
    """Make runs of days that differ in each output by a factor up to `apart`, and a model that is 20 % off.

    Args:
        zero: is taken from the angles.
    """
    rng, count = np.random.default_rng(seed), 20 * sessions
    condition, session = np.arange(count) % 7, np.arange(count) % sessions
    true = np.stack([1 + 0.3 * condition, 2 - 0.2 * condition, np.log(0.8 + 0.05 * condition)], 1)
    days = rng.uniform(-1, 1, (sessions, 3)) * np.log(apart)
    y = true + days[session] + noise * rng.normal(size=(count, 3))
    given = true + 0.2 * rng.normal(size=3)
    y[:, 2], given[:, 2] = np.exp(y[:, 2]) - zero, np.exp(given[:, 2]) - zero
    names = tuple(f"day {i + 1}" for i in range(sessions))
    inputs = condition[:, None].astype(float)
    runs = Runs(
        _OUTPUTS, y, condition, session, names, inputs, ("setting",), np.arange(count) + 1, (), (),
        output_scales={"theta": (1.0, "rad")},
    )  # fmt: skip
    return runs, given


def _slipped(runs: Runs, output: int, factor: float) -> Runs:
    """Multiply an output of day 2."""
    y, rows = runs.y.copy(), runs.session == 1
    if _OUTPUTS[output] == "theta":
        y[rows, output] *= factor
    else:
        y[rows, output] += np.log(factor)
    return replace(runs, y=y)


@pytest.mark.parametrize("sessions", [2, 3, 5])
@pytest.mark.parametrize("output", range(3))
@pytest.mark.parametrize("factor", [10, 0.1, 60, 1 / 60, 2 * np.pi, 180 / np.pi, np.pi / 180, 100, 1000])
def test_one_day_in_another_unit_is_refused(output: int, factor: float, sessions: int) -> None:
    runs, given = _runs(1, 1.02, sessions)
    with pytest.raises(InputError, match=f"^{_OUTPUTS[output]} of session day 2 is .* as if it were in"):
        refuse_unit_slips(_slipped(runs, output, factor), given)


@pytest.mark.parametrize("sessions", [2, 3])
@pytest.mark.parametrize("factor", [180 / np.pi, -np.pi / 180, -1, 10])
def test_angles_that_cross_zero_are_compared_by_regression(factor: float, sessions: int) -> None:
    runs, given = _runs(1, 1.0, sessions, zero=0.95, noise=0.003)
    assert (runs.y[:, 2] < 0).any()
    assert (runs.y[:, 2] > 0).any()
    refuse_unit_slips(runs, given)
    words = "check its sign" if factor < 0 else "convert it"
    with pytest.raises(InputError, match=f"theta of session day 2 is .*{words}"):
        refuse_unit_slips(_slipped(runs, 2, factor), given)


def test_days_without_common_conditions_are_compared_by_the_model() -> None:
    runs, given = _runs(1, 1.02)
    apart = replace(_slipped(runs, 1, 10.0), condition=runs.condition + 7 * runs.session)
    with pytest.raises(InputError, match=r"R of session day 2 is .* in mm there and in cm"):
        refuse_unit_slips(apart, given)


@pytest.mark.parametrize("factor", [8.5, 10.6, 0.115, 30.0])
def test_a_factor_that_is_not_that_of_two_units_is_none(factor: float) -> None:
    runs, given = _runs(1, 1.0, noise=0.005)
    refuse_unit_slips(_slipped(runs, 0, factor), given)


@pytest.mark.parametrize("other", [10.0, 0.1, 8.0])
def test_a_day_on_which_another_output_has_the_same_factor_is_none(other: float) -> None:
    runs, given = _runs(1, 1.02)
    refuse_unit_slips(_slipped(_slipped(runs, 0, 10.0), 1, other), given)


def test_runs_that_do_not_agree_on_a_factor_are_no_slip() -> None:
    """The factor grows over the settings of a day; its median is 10."""
    runs, given = _runs(1, 1.02)
    y, rows = runs.y.copy(), runs.session == 1
    y[rows, 0] += np.log(10) * runs.condition[rows] / 3
    refuse_unit_slips(replace(runs, y=y), given)


def test_days_that_differ_by_a_third_are_no_slip() -> None:
    for seed in range(100):
        for sessions in (2, 4):
            refuse_unit_slips(*_runs(seed, 1.3, sessions))


def test_a_factor_that_was_checked_is_no_slip() -> None:
    runs, given = _runs(1, 1.02)
    slipped = replace(_slipped(runs, 0, 10.0), unit_checked={"v": False})
    with pytest.raises(InputError, match="; if it is right, declare its Output with unit_checked=True"):
        refuse_unit_slips(slipped, given)
    refuse_unit_slips(replace(slipped, unit_checked={"v": True}), given)
