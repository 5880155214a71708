"""Camera tracks: circles, lines, errors that hold, and bad samples."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from calibration.swimmer.camera_tracks import measure_track, measure_tracks
from sim.io.errors import InputError
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


def test_bad_samples_and_short_tracks_are_named() -> None:
    samples = pd.concat([track(0), track(1).assign(run=2).head(5)]).astype({"x_cm": object})
    samples.iloc[3, 2] = "lost"
    runs = pd.DataFrame({"run": [1, 2], "N": 2, "l_cm": 11.0, "omega_rpm": 150.0})
    table, aside = measure_tracks(samples, runs)
    assert table["R_yr_cm"][0] == pytest.approx(RADIUS, rel=5e-3)
    assert np.isnan(table["R_yr_cm"][1])
    assert [line.split(":")[0] for line in aside] == ["run 1", "run 2"]
    with pytest.raises(InputError, match="heading_deg"):
        measure_tracks(samples.drop(columns="heading_deg"), runs)
