"""Camera tracks: circles and lines fitted to them, bad samples, units, axes, and what the robot as given does."""

from __future__ import annotations

import math
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calibration.__main__ import program
from camera.circle import fit_track
from camera.measured_runs import measure_tracks
from camera.pictures import draw_tracks
from common.errors import InputError, run_command
from sim.inputs import load_robot
from sim.motion.steady import steady
from tests.calibration.track import RADIUS, RATE, SLIP, track

RUNS = pd.DataFrame({"run": [1], "N": 2, "l_cm": 11.0, "omega_rpm": -150.0})
TWO = pd.concat([RUNS, RUNS.assign(run=2)], ignore_index=True)


def test_bad_samples_and_short_tracks_are_named() -> None:
    samples = pd.concat([track(0), track(1).assign(run=2).head(5)]).astype({"x_cm": object})
    samples.iloc[3, 2] = "lost"
    measured_runs = measure_tracks(samples, TWO)
    table, aside = measured_runs.table, measured_runs.excluded
    assert table["R_yr_cm"][0] == pytest.approx(RADIUS, rel=5e-3)
    assert np.isnan(table["R_yr_cm"][1])
    assert [line.split(":")[0] for line in aside] == ["run 1", "run 2"]
    with pytest.raises(InputError, match=r"no track gives a number \(run 1: 5 samples"):
        measure_tracks(track(0).head(5), RUNS)
    with pytest.raises(InputError, match="heading_deg"):
        measure_tracks(samples.drop(columns="heading_deg"), TWO)


def test_headings_in_radians_are_refused() -> None:
    with pytest.raises(InputError, match=r"run 1: heading_deg .* radians"):
        measure_tracks(track(0).assign(heading_deg=lambda t: np.radians(t["heading_deg"])), RUNS)
    straight = track(1, rate=0.002, wobble=0.0).assign(heading_deg=lambda t: 0.5 + 0.02 * t["time_s"])
    measure_tracks(straight, RUNS.assign(omega_rpm=150.0))


def test_a_picture_s_y_axis_is_noticed_and_can_be_said() -> None:
    picture = track(0).assign(y_cm=lambda t: -t["y_cm"], heading_deg=lambda t: -t["heading_deg"])
    with pytest.raises(InputError, match=r"all runs turn to the other side .*: give --y-down"):
        measure_tracks(picture, RUNS)
    seen, expected = measure_tracks(picture, RUNS, y_down=True).table, measure_tracks(track(0), RUNS).table
    for name in ("omega_yr_rad_s", "R_yr_cm", "theta_deg"):
        assert seen[name][0] == pytest.approx(expected[name][0], rel=1e-6)
    with pytest.raises(InputError, match="leave out --y-down"):
        measure_tracks(track(0), RUNS, y_down=True)


def test_tracks_in_other_units_are_converted() -> None:
    given = track(0)
    other = pd.DataFrame({
        "run": given["run"], "t [ms]": 1000 * given["time_s"], "X (mm)": 10 * given["x_cm"],
        "Y (mm)": 10 * given["y_cm"], "heading_rad": np.radians(given["heading_deg"]),
    })  # fmt: skip
    seen = measure_tracks(other, RUNS.rename(columns={"omega_rpm": "rpm"}))
    expected = measure_tracks(given, RUNS)
    pd.testing.assert_frame_equal(seen.table, expected.table, rtol=1e-6)
    assert [note.split(" converted")[0].split(" read")[0] for note in seen.converted] == [
        "column t [ms]", "column X (mm)", "column Y (mm)", "column heading_rad", "column rpm",
    ]  # fmt: skip
    with pytest.raises(InputError, match=r"'x' has no unit; .* x_m, x_cm"):
        measure_tracks(given.rename(columns={"x_cm": "x"}), RUNS)


def test_a_folder_of_another_program_s_files_has_a_run_for_each(tmp_path: Path) -> None:
    """In pixels of 0.1 cm, y downwards; the table of runs names the files."""
    for run, seed in enumerate((0, 1), 1):
        given = track(seed)
        x, y, heading = given["x_cm"] * 10, -given["y_cm"] * 10, np.radians(given["heading_deg"])
        forward, down = 20 * np.cos(heading), -20 * np.sin(heading)
        table = pd.DataFrame({
            "track": "", "frame_idx": range(len(given)), "instance.score": 1.0, "front.x": x + forward,
            "front.y": y + down, "front.score": 0.9, "rear.x": x - forward, "rear.y": y - down, "rear.score": 0.9,
        })  # fmt: skip
        table.loc[[3, 9], "rear.x"] = np.nan
        table.to_csv(tmp_path / f"swim-{run}.csv", index=False)
    runs = TWO.assign(run=["swim-1", "swim-2"])
    measured = measure_tracks(tmp_path, runs, written_by="sleap", scale="1mm", fps=5.0)
    expected = measure_tracks(pd.concat([track(0), track(1).assign(run=2)]), TWO).table
    for name in ("omega_yr_rad_s", "R_yr_cm", "theta_deg"):
        assert measured.table[name].to_numpy() == pytest.approx(expected[name].to_numpy(), rel=2e-3)
    assert [line.rpartition("/")[2] for line in measured.excluded] == [
        "swim-1.csv: 2 of 300 poses are lost", "swim-2.csv: 2 of 300 poses are lost"
    ]  # fmt: skip


ROBOT = load_robot("paper-measured")


def swum(rpm: float) -> tuple[pd.DataFrame, pd.DataFrame]:
    """A track of the simulated motion of ROBOT, and its run."""
    robot = replace(ROBOT, motor_speed=rpm * np.pi / 30)
    motion = steady(robot.groups())
    rate = float(motion.omega_yr[0]) / robot.time_scale
    radius = 100 * robot.tail_length * float(motion.turn_radius[0])
    time = np.linspace(0, 60, 240)
    heading = np.degrees(rate * time) + 90 + np.degrees(float(motion.slip_angle[0]))
    circle = {"x_cm": radius * np.cos(rate * time), "y_cm": radius * np.sin(rate * time)}
    samples = pd.DataFrame({"run": 1, "time_s": time, **circle, "heading_deg": heading})
    noise = np.random.default_rng(1).normal(scale=0.01, size=(len(time), 3))
    samples[["x_cm", "y_cm", "heading_deg"]] += noise
    return samples, pd.DataFrame({"run": [1], "N": robot.tails, "l_cm": 100 * robot.tail_length, "omega_rpm": rpm})


def test_tracks_are_compared_with_the_robot_as_given() -> None:
    samples, runs = swum(100.0)
    measure_tracks(samples, runs, robot=ROBOT)
    for wrong, words in (
        (samples.assign(x_cm=10 * samples["x_cm"], y_cm=10 * samples["y_cm"]), "R_yr_cm is .* seems to be in mm"),
        (samples.assign(time_s=1000 * samples["time_s"]), "omega_yr_rad_s is 0.001 times what the robot"),
    ):
        with pytest.raises(InputError, match=words):
            measure_tracks(wrong, runs, robot=ROBOT)
    with pytest.raises(InputError, match="no column 'l_cm'"):
        measure_tracks(samples, runs.drop(columns="l_cm"), robot=ROBOT)


def test_tracks_and_runs_come_from_pipes(tmp_path: Path) -> None:
    """The tables of this test are smaller than what a pipe holds."""
    pipes = []
    for table in (track(0).iloc[::2].round(4), RUNS):
        pipe, writing = os.pipe()
        with open(writing, "w") as file:
            table.to_csv(file, index=False)
        pipes.append(f"/dev/fd/{pipe}")
    assert run_command(program.main, ["tracks", *pipes, "--out", str(tmp_path / "table.csv")]) == 0
    assert pd.read_csv(tmp_path / "table.csv")["R_yr_cm"].iloc[0] == pytest.approx(RADIUS, rel=0.01)


def test_the_picture_has_a_panel_for_each_run_with_track_and_fit() -> None:
    samples = pd.concat([track(0), track(1, rate=0.002).assign(run=2)])
    figure = draw_tracks(measure_tracks(samples, TWO).tracks)
    first, second = (axes for axes in figure.axes if axes.get_visible())
    assert first.get_title().startswith("run 1\nR = 10")
    assert "turns right" in first.get_title()
    assert second.get_title().startswith("run 2\nline")
    drawn, fitted = (np.array(line.get_xydata()) for line in first.get_lines()[:2])
    assert drawn == pytest.approx(track(0)[["x_cm", "y_cm"]].to_numpy())
    assert np.linalg.norm(fitted - [3, -2], axis=1) == pytest.approx(np.full(len(fitted), RADIUS), rel=0.01)


@pytest.mark.parametrize("change", [0.0, 8.0, None], ids=["zeros", "restart", "wrap"])
def test_a_clock_that_goes_back_excludes_its_run(change: float | None) -> None:
    samples = pd.concat([track(0), track(1).assign(run=2)], ignore_index=True)
    late = (samples["run"] == 1) & (samples["time_s"] > 30)
    samples.loc[late, "time_s"] = samples["time_s"] % 20 if change is None else samples["time_s"] - 30 + change
    if change == 0.0:
        samples.loc[late, "time_s"] = 0.0
    measured = measure_tracks(samples, TWO)
    assert measured.excluded == [
        "run 1: its time goes back at row 152; give its samples in order, with a clock that runs on"
    ]
    assert measured.table["R_yr_cm"].isna().tolist() == [True, False]


@pytest.mark.parametrize("start", [1.7e9, "2026-05-01 12:00:00"])
def test_a_track_may_begin_at_any_time(start: float | str) -> None:
    given = track(0)
    seconds = given["time_s"]
    date = (
        start + seconds if isinstance(start, float) else pd.Timestamp(start) + pd.to_timedelta(seconds, unit="s")
    )
    seen, expected = measure_tracks(given.assign(time_s=date), RUNS).table, measure_tracks(given, RUNS).table
    pd.testing.assert_frame_equal(seen, expected, rtol=1e-4)


def test_names_of_runs_are_compared_as_text_and_rows_without_are_named() -> None:
    for name in (1, 1.0, "1", " 1 ", "1.0", "01"):
        measured = measure_tracks(track(0).assign(run=[str(name)] * 299 + ["checkerboard"]), RUNS.assign(run=1))
        assert measured.excluded == ["run checkerboard: a track, but no row among the runs"]
        assert measured.table["R_yr_cm"].notna().all()
    for blank in (None, float("nan"), "", " "):
        named = track(0).assign(run=pd.Series([1.0] * 299 + [blank], dtype=object))
        assert measure_tracks(named, RUNS).excluded == ["1 samples have no name of a run"]
        with pytest.raises(InputError, match="row 1 of the runs has no name of a run"):
            measure_tracks(track(0), RUNS.assign(run=pd.Series([blank], dtype=object)))
    with pytest.raises(InputError, match=r"no run has a track: .* run 1; .* 1"):
        measure_tracks(track(0), RUNS.assign(run="run 1"))
    with pytest.raises(InputError, match="run 1 is there twice"):
        measure_tracks(track(0), pd.concat([RUNS, RUNS.assign(run="1.0")]))


def measured(table: pd.DataFrame) -> dict[str, float]:
    return vars(fit_track(*(table[c].to_numpy() for c in ("time_s", "x_cm", "y_cm", "heading_deg"))).result)


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


GAPS = {
    "one": [(15, 90)],
    "several": [(20, 60), (80, 110), (112, 140)],
    "almost at the start": [(1, 51)],
    "almost at the end": [(80, 149)],
}


@pytest.mark.parametrize("frozen", [False, True])
@pytest.mark.parametrize("gaps", GAPS.values(), ids=GAPS)
@pytest.mark.parametrize("rate", [0.004, -0.04, RATE, 1.0])
def test_turns_within_a_gap_are_counted_or_parts_left_out(
    rate: float, gaps: list[tuple[float, float]], frozen: bool
) -> None:
    """Whether poses are missing, or a frozen camera repeats one."""
    given = track(0, rate=rate, seconds=150.0)
    for start, end in gaps:
        inside = (given["time_s"] > start) & (given["time_s"] < end)
        if frozen:
            repeated = given.loc[inside, ["x_cm", "y_cm", "heading_deg"]].iloc[0]
            given.loc[inside, ["x_cm", "y_cm", "heading_deg"]] = repeated.to_numpy()
        else:
            given = given[~inside]
    measured_runs = measure_tracks(given, RUNS.assign(omega_rpm=math.copysign(150.0, rate)))
    assert measured_runs.table["omega_yr_rad_s"][0] == pytest.approx(rate, rel=0.02)
    assert measured_runs.table["R_yr_cm"][0] == pytest.approx(RADIUS, rel=0.02)
    told, *rest = measured_runs.excluded
    total = sum(end - start for start, end in gaps)
    words, seconds, share = re.match(r"run 1: (.*) for (\d+) s \((\d+) %", told).groups()  # type: ignore[union-attr]
    assert words == ("the same pose" if frozen else "no pose")
    assert abs(int(seconds) - total) < 2
    assert abs(int(share) - total / 1.5) < 2
    assert all("samples are used" in line for line in rest)


def test_rates_that_disagree_across_a_gap_leave_the_longer_part() -> None:
    slowing = track(0, rate=0.5, seconds=150.0)
    fast = slowing["time_s"] < 40
    slow = track(0, rate=0.4, seconds=150.0)
    given = pd.concat([slowing[fast], slow[slow["time_s"] > 90]])
    measured_runs = measure_tracks(given, RUNS.assign(omega_rpm=150.0))
    assert measured_runs.table["omega_yr_rad_s"][0] == pytest.approx(0.4, rel=0.01)
    assert "run 1: 299 of 499 samples are used" in measured_runs.excluded[1]
    assert len(measured_runs.tracks[0].x) == len(measured_runs.tracks[0].fit.path) == 299


def test_errors_are_as_large_as_the_scatter_of_repeated_tracks() -> None:
    many = pd.DataFrame([measured(track(seed)) for seed in range(60)])
    errors = {"omega_yr_rad_s": "omega_yr_error", "R_yr_cm": "R_yr_error", "theta_deg": "theta_error"}
    for value, error in errors.items():
        assert 0.5 < many[error].mean() / many[value].std() < 3


def test_a_run_that_hardly_turns_gives_a_speed_alone() -> None:
    motion = measured(track(1, rate=0.002, wobble=0.0))
    assert np.isnan(motion["R_yr_cm"])
    assert np.isnan(motion["omega_yr_rad_s"])
    assert motion["v_cm_s"] == pytest.approx(0.02, rel=0.1)
