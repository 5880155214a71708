"""The held-out session has no say and judges; results repeat; intervals by profile."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.statistics.fit import least_determined
from calibration.statistics.study import DRAWS, middle_session
from calibration.swimmer.measured_table import read_measurements
from calibration.verdict.verdict_json import verdict_record
from tests.calibration.toy_tables import calibrated, calibrated_toy, toy_table


@pytest.mark.usefixtures("toy_model", "few_candidates")
def test_the_locked_session_has_no_say() -> None:
    """Ruining the held-out session changes the reported errors and nothing else."""
    table = toy_table(5, end_over_end_drag=5.0)
    result = calibrated(table)
    data = read_measurements(table)
    name = data.session_names[data.session[middle_session(data)][0]]
    ruined = table.copy()
    ruined.loc[ruined["session"] == name, "omega_yr_rad_s"] *= 1.5
    result_of_ruined = calibrated(ruined)
    assert result.final.parameters == result_of_ruined.final.parameters
    assert result.evidence.misfit.p_value == result_of_ruined.evidence.misfit.p_value
    assert result_of_ruined.error_after > 1.5 * result.error_after


@pytest.mark.rest
@pytest.mark.usefixtures("toy_model")
def test_the_result_is_deterministic() -> None:
    first = calibrated(toy_table(5, end_over_end_drag=5.0))
    second = calibrated(toy_table(5, end_over_end_drag=5.0))
    assert verdict_record(first, table="t") == verdict_record(second, table="t")


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_the_locked_session_is_judged_and_used_in_the_end() -> None:
    """p is nothing for a bad model; the last fit has all runs."""
    ruined = toy_table(3)
    good = calibrated_toy(3)
    assert good.errors.p_value > 0.01
    ruined.loc[ruined["session"] == good.conditions.split.names, "omega_yr_rad_s"] *= 1.5
    result = calibrated(ruined)
    assert result.errors.p_value < 0.01
    assert result.fits.final_refit.parameters["C_yr"] != pytest.approx(result.final.parameters["C_yr"], rel=0.02)


@pytest.mark.rates
@pytest.mark.usefixtures("toy_model")
def test_p_of_the_locked_session_is_even_for_a_good_model() -> None:
    good = [calibrated(toy_table(seed), draws=DRAWS).errors.p_value for seed in range(17, 25)]
    assert 0.2 < np.mean(good) < 0.8


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model")
def test_profile_intervals_are_those_of_the_covariance_where_the_model_is_linear() -> None:
    """And lean to one side where it is not."""
    result = calibrated_toy(5, end_over_end_drag=5.0)
    for name, (low, high) in result.fits.final_intervals.items():
        wald = result.final.interval(name)
        assert low < result.final.parameters[name] < high
        assert (low, high) == pytest.approx(wald, abs=0.35 * (wald[1] - wald[0]))
    direction, error = least_determined(result.base)
    assert set(direction) == {"C_t", "C_r", "C_yr"}
    assert sum(part**2 for part in direction.values()) == pytest.approx(1.0)
    assert 0 < error < 1.0
