"""Camera tracks: circles, lines, errors that hold, and bad samples."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from calibration.tracks import measure_track, measure_tracks
from sim.io.errors import InputError, run_command

RATE, RADIUS, SLIP = -0.14, 10.0, 70.0


def track(seed: int, *, rate: float = RATE, seconds: float = 60.0, wobble: float = 0.1) -> pd.DataFrame:
    """A robot on a circle, wobbling with its disc, seen with noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 0.2)
    angle = 0.4 + rate * time
    heading = angle + np.sign(rate) * np.pi / 2 + np.radians(SLIP)
    swing = wobble * np.cos(1.7 * time + rng.uniform(0, 6))
    return pd.DataFrame(
        {
            "run": 1,
            "time_s": time,
            "x_cm": 3 + (RADIUS + swing) * np.cos(angle) + rng.normal(scale=0.05, size=len(time)),
            "y_cm": -2 + (RADIUS + swing) * np.sin(angle) + rng.normal(scale=0.05, size=len(time)),
            "heading_deg": np.degrees(heading + rng.normal(scale=0.01, size=len(time))) % 360,
        }
    )


def measured(table: pd.DataFrame) -> dict[str, float]:
    return vars(measure_track(*(table[c].to_numpy() for c in ("time_s", "x_cm", "y_cm", "heading_deg"))))


@pytest.mark.parametrize("rate", [RATE, -RATE])
def test_a_circle_gives_rate_radius_angle_and_speed(rate: float) -> None:
    found = measured(track(0, rate=rate))
    assert found["omega_yr_rad_s"] == pytest.approx(rate, rel=5e-3)
    assert found["R_yr_cm"] == pytest.approx(RADIUS, rel=5e-3)
    assert found["theta_deg"] == pytest.approx(SLIP, abs=0.5)
    assert found["v_cm_s"] == pytest.approx(abs(rate) * RADIUS, rel=5e-3)


def test_a_current_drifts_the_circle_and_leaves_its_radius() -> None:
    still = track(2)
    moved = still.assign(x_cm=still["x_cm"] + 0.05 * still["time_s"], y_cm=still["y_cm"] - 0.02 * still["time_s"])
    found = measured(moved)
    assert found["drift_x_cm_s"] == pytest.approx(0.05, abs=4 * found["drift_error"])
    assert found["drift_y_cm_s"] == pytest.approx(-0.02, abs=4 * found["drift_error"])
    assert found["drift_error"] < 0.005
    assert found["R_yr_cm"] == pytest.approx(measured(still)["R_yr_cm"], rel=1e-3)
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
    found = measured(track(1, rate=0.002, wobble=0.0))
    assert np.isnan(found["R_yr_cm"])
    assert np.isnan(found["omega_yr_rad_s"])
    assert found["v_cm_s"] == pytest.approx(0.02, rel=0.1)


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


def test_the_command_writes_a_table(tmp_path: object, capsys: pytest.CaptureFixture[str]) -> None:
    from pathlib import Path

    from calibration.__main__ import main

    folder = Path(str(tmp_path))
    track(0).to_csv(folder / "tracks.csv", index=False)
    pd.DataFrame({"run": [1], "N": 2, "l_cm": 11.0, "omega_rpm": -150.0}).to_csv(folder / "runs.csv", index=False)
    arguments = [
        "tracks",
        str(folder / "tracks.csv"),
        str(folder / "runs.csv"),
        "--out",
        str(folder / "table.csv"),
    ]
    assert run_command(main, arguments) == 0
    assert {"omega_yr_rad_s", "R_yr_cm", "theta_deg", "v_cm_s"} <= set(pd.read_csv(folder / "table.csv"))
    assert "1 runs" in capsys.readouterr().out
