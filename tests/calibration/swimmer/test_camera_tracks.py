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
    runs = pd.DataFrame({"run": [1, 2], "N": 2, "l_cm": 11.0, "omega_rpm": -150.0})
    table, aside = measure_tracks(samples, runs)
    assert table["R_yr_cm"][0] == pytest.approx(RADIUS, rel=5e-3)
    assert np.isnan(table["R_yr_cm"][1])
    assert [line.split(":")[0] for line in aside] == ["run 1", "run 2"]
    with pytest.raises(InputError, match="heading_deg"):
        measure_tracks(samples.drop(columns="heading_deg"), runs)


RUNS = pd.DataFrame({"run": [1], "N": 2, "l_cm": 11.0, "omega_rpm": -150.0})


def test_headings_in_radians_are_refused() -> None:
    """They used to give a slow straight run, without a word."""
    with pytest.raises(InputError, match=r"run 1: heading_deg turns by .* the headings seem to be in radians"):
        measure_tracks(track(0).assign(heading_deg=lambda t: np.radians(t["heading_deg"])), RUNS)
    straight = track(1, rate=0.002, wobble=0.0).assign(heading_deg=lambda t: 0.5 + 0.02 * t["time_s"])
    measure_tracks(straight, RUNS.assign(omega_rpm=150.0))


def test_a_picture_s_y_axis_is_noticed_and_can_be_said() -> None:
    """Left and right used to be exchanged, without a word."""
    picture = track(0).assign(y_cm=lambda t: -t["y_cm"], heading_deg=lambda t: -t["heading_deg"])
    with pytest.raises(InputError, match=r"all runs turn to the other side .*: give --y-down"):
        measure_tracks(picture, RUNS)
    seen, expected = measure_tracks(picture, RUNS, y_down=True)[0], measure_tracks(track(0), RUNS)[0]
    for name in ("omega_yr_rad_s", "R_yr_cm", "theta_deg"):
        assert seen[name][0] == pytest.approx(expected[name][0], rel=1e-6)
    with pytest.raises(InputError, match="leave out --y-down"):
        measure_tracks(track(0), RUNS, y_down=True)


def test_tracks_without_any_number_are_an_error() -> None:
    with pytest.raises(InputError, match=r"no track gives a number \(run 1: 5 samples"):
        measure_tracks(track(0).head(5), RUNS)
