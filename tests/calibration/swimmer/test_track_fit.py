"""Circles and lines are fitted to tracks, with errors that hold."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from calibration.swimmer.track_fit import measure_track
from tests.calibration.track import RADIUS, RATE, SLIP, track


def measured(table: pd.DataFrame) -> dict[str, float]:
    return vars(measure_track(*(table[c].to_numpy() for c in ("time_s", "x_cm", "y_cm", "heading_deg"))))


@pytest.mark.parametrize("rate", [RATE, -RATE])
def test_a_circle_gives_rate_radius_angle_and_speed(rate: float) -> None:
    motion = measured(track(0, rate=rate))
    assert motion["omega_yr_rad_s"] == pytest.approx(rate, rel=5e-3)
    assert motion["R_yr_cm"] == pytest.approx(RADIUS, rel=5e-3)
    assert motion["theta_deg"] == pytest.approx(SLIP, abs=0.5)
    assert motion["v_cm_s"] == pytest.approx(abs(rate) * RADIUS, rel=5e-3)


def test_a_current_drifts_the_circle_and_leaves_its_radius() -> None:
    still = track(2)
    moved = still.assign(x_cm=still["x_cm"] + 0.05 * still["time_s"], y_cm=still["y_cm"] - 0.02 * still["time_s"])
    motion = measured(moved)
    assert motion["drift_x_cm_s"] == pytest.approx(0.05, abs=4 * motion["drift_error"])
    assert motion["drift_y_cm_s"] == pytest.approx(-0.02, abs=4 * motion["drift_error"])
    assert motion["drift_error"] < 0.005
    assert motion["R_yr_cm"] == pytest.approx(measured(still)["R_yr_cm"], rel=1e-3)
    assert np.isnan(measured(track(2, seconds=30.0))["drift_x_cm_s"])  # two thirds of a turn


def test_errors_are_as_large_as_the_scatter_of_repeated_tracks() -> None:
    many = pd.DataFrame([measured(track(seed)) for seed in range(60)])
    for value, error in (
        ("omega_yr_rad_s", "omega_yr_error"),
        ("R_yr_cm", "R_yr_error"),
        ("theta_deg", "theta_error"),
    ):
        assert 0.5 < many[error].mean() / many[value].std() < 3


def test_a_run_that_hardly_turns_gives_a_speed_alone() -> None:
    motion = measured(track(1, rate=0.002, wobble=0.0))
    assert np.isnan(motion["R_yr_cm"])
    assert np.isnan(motion["omega_yr_rad_s"])
    assert motion["v_cm_s"] == pytest.approx(0.02, rel=0.1)
