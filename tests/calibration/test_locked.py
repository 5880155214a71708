"""The locked session has no say and judges; results repeat; intervals by profile."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.statistics.profile_intervals import least_determined
from calibration.statistics.splits import middle_session
from calibration.swimmer.measured_table import read_measurements
from calibration.verdict.verdict_json import verdict_record
from tests.calibration.toy_tables import closed, toy_table


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_the_locked_session_has_no_say() -> None:
    """Ruining the locked session changes the reported errors and nothing else."""
    table = toy_table(5, end_over_end_drag=5.0)
    data = read_measurements(table)
    name = data.session_names[data.session[middle_session(data)][0]]
    ruined = table.copy()
    ruined.loc[ruined["session"] == name, "omega_yr_rad_s"] *= 1.5
    one, two = closed(table), closed(ruined)
    assert one.final.parameters == two.final.parameters
    assert one.misfit.p_value == two.misfit.p_value
    assert two.error_after > 1.5 * one.error_after


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_the_result_is_deterministic() -> None:
    table = toy_table(9, end_over_end_drag=5.0)
    one, two = (verdict_record(closed(table, seed=4), table="t") for _ in range(2))
    assert one == two


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_the_locked_session_is_judged_and_used_in_the_end() -> None:
    """p is even for a good model and nothing for a bad one; the last fit has all runs."""
    table = toy_table(17)
    good = [closed(toy_table(seed)).errors.p_value for seed in range(17, 25)]
    assert 0.2 < np.mean(good) < 0.8
    name = closed(table).conditions.split.names
    ruined = table.copy()
    ruined.loc[ruined["session"] == name, "omega_yr_rad_s"] *= 1.5
    result = closed(ruined)
    assert result.errors.p_value < 0.01
    assert result.fits.final_refit.parameters["C_yr"] != pytest.approx(result.final.parameters["C_yr"], rel=0.02)


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_profile_intervals_are_those_of_the_covariance_where_the_model_is_linear() -> None:
    """And lean to one side where it is not."""
    result = closed(toy_table(19, end_over_end_drag=5.0))
    for name, (low, high) in result.fits.final_intervals.items():
        wald = result.final.interval(name)
        assert low < result.final.parameters[name] < high
        assert (low, high) == pytest.approx(wald, abs=0.35 * (wald[1] - wald[0]))
    combination, error = least_determined(result.base)
    assert "C_" in combination
    assert 0 < error < 1.0
