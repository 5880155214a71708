"""Tracks of a robot that reverses its turns at known times, as cameras and programs give them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from calibration.statistics.study import quarter_of_conditions
from calibration.swim.measured_swim import MeasuredSwim, is_track, read_swims
from calibration.swim.swim_runs import runs_of_swims
from calibration.table.excluded import summary_of_excluded
from camera.pose_tracks import read_tracks
from common.errors import InputError
from planner.files.plan_files import write_plan
from sim.motion.replay import replay
from tests.calibration.zigzag import DWELLS, FLIPS, PLAN, poses_at, track
from tests.planner.plans import BIASED, planned
from tracking.swim import swim


def read(table: pd.DataFrame | str | Path, plan: Any = None) -> MeasuredSwim:
    file = None if isinstance(table, pd.DataFrame) else table
    (swum,) = read_swims(read_tracks(table), plan, file=file)
    assert (np.diff(swum.time) > 0).all()
    assert len(swum.time) == len(swum.poses) >= 60
    assert (swum.time >= swum.flips[0]).all()
    assert (swum.time <= swum.flips[-1]).all()
    return swum


def assert_true(swum: MeasuredSwim, *, clock: float = 0.0, sigmas: float = 7.0, flips: np.ndarray = FLIPS) -> None:
    """Its poses are those of the robot, with the right number of turns but for whole ones of all."""
    off = swum.poses - poses_at(swum.time - clock, flips)
    off[:, 2] -= 2 * np.pi * np.rint(off[0, 2] / (2 * np.pi))
    assert np.abs(off / [3e-4, 3e-4, np.radians(0.5)]).max() < sigmas


def test_a_clean_track_is_read_as_it_is() -> None:
    swum = read(track())
    assert_true(swum)
    assert (swum.name, swum.said, swum.first_direction, swum.clock_known) == ("swim", (), -1, True)
    assert len(swum.time) == len(track())
    assert swum.dwells.shape == DWELLS.shape
    assert np.abs(swum.flips - FLIPS).max() <= 0.4 + 1e-9
    assert swum.flip_error == pytest.approx(0.4 / np.sqrt(12))
    assert np.std(swum.flips[1:-1] - FLIPS[1:-1]) == pytest.approx(swum.flip_error, rel=0.3)


@pytest.mark.parametrize(("name", "factor"), [("x_mm", 10.0), ("X [m]", 0.01)])
def test_other_units_are_converted(name: str, factor: float) -> None:
    table = track()
    table[name] = factor * table.pop("x_cm")
    table["heading_rad"] = np.radians(table.pop("heading_deg"))
    assert np.allclose(read(table).poses, read(track()).poses, atol=1e-12)


def test_rests_of_the_motor_are_left_out() -> None:
    table = track(rest=10.0)
    swum = read(table)
    assert_true(swum)
    assert swum.said == ()
    assert swum.flips[[0, -1]] == pytest.approx(FLIPS[[0, -1]], abs=0.4)
    assert len(swum.time) >= (table["direction"] != 0).sum()
    rests = table["time_s"].between(FLIPS[20] + 0.2, FLIPS[20] + 8.2)  # as if the motor had been stopped
    swum = read(table.assign(direction=table["direction"] * ~rests))
    assert len(swum.dwells) == 38
    assert swum.flips[0] == pytest.approx(FLIPS[20] + 8.2, abs=0.4)
    assert "the motor rests in between; kept is the longest part" in swum.said[0]


def test_outliers_are_dropped_and_flips_are_none() -> None:
    """Wrong places, wrong headings, headings turned by half a turn: single ones, and several in a row."""
    table, rng = track(), np.random.default_rng(3)
    wrong = np.sort(rng.choice(np.arange(5, len(table) - 5), 12, replace=False))
    table.loc[wrong[:4], "x_cm"] += 2.0
    table.loc[wrong[4:8], "heading_deg"] += [40.0, -60.0, 90.0, 140.0]
    table.loc[wrong[8:], "heading_deg"] += 180.0
    table.loc[300:302, "y_cm"] += 1.5
    turned = list(range(400, 406))
    table.loc[turned, "heading_deg"] -= 180.0
    swum = read(table)
    assert_true(swum)
    gone = np.setdiff1d(table["time_s"], swum.time)
    expected = table["time_s"][sorted({*wrong, 300, 301, 302, *turned})]
    assert np.array_equal(gone, expected)
    assert len(swum.dwells) == len(DWELLS)
    assert "poses jump away from the others (the first at " in swum.said[0]
    assert "poses are turned by half a turn (the first at " in swum.said[1]


@pytest.mark.parametrize("every", [0.05, 0.4, 1.2, 2.4])
@pytest.mark.parametrize("seed", range(5))
def test_no_pose_of_a_good_track_is_dropped(every: float, seed: int) -> None:
    for noise in (0.0, 1.0, 3.0):
        swum = read(track(every, noise=noise, seed=seed))
        assert swum.said == ()
        assert_true(swum, sigmas=15.0)
        assert len(swum.time) == len(track(every))


def test_a_long_time_with_turned_headings_is_left_out() -> None:
    table = track()
    long = table["time_s"].between(100, 160)
    table.loc[long, "heading_deg"] += 180.0
    swum = read(table)
    assert_true(swum)
    assert len(swum.time) == (~long).sum()
    assert f"{long.sum()} of " in swum.said[0]


def test_a_frozen_camera_and_lost_poses_are_told() -> None:
    table = track()
    frozen = table["time_s"].between(100, 110)
    table.loc[frozen, ["x_cm", "y_cm", "heading_deg"]] = table.loc[frozen].iloc[0][1:4].to_numpy()
    table.loc[100:104, ["x_cm", "y_cm", "heading_deg"]] = np.nan
    swum = read(table)
    assert_true(swum)
    assert len(swum.dwells) == len(DWELLS)
    assert swum.said[0] == f"5 of {len(table)} rows have no pose"
    assert any(line.startswith("the same pose for") for line in swum.said)


def test_flips_in_a_time_without_rows_are_not_invented() -> None:
    """Two flips that no row shows change the heading; the longer part is kept, with its own flips."""
    table = track()
    for last in (21, 22):  # of two or three flips
        gap = table["time_s"].between(FLIPS[20] - 1, FLIPS[last] + 1)
        swum = read(table[~gap])
        assert_true(swum)
        assert swum.time[0] > FLIPS[last]
        assert swum.flips[1] <= swum.time[0]  # its memory of the dwell before is short
        assert swum.flips[-37:] == pytest.approx(FLIPS[-37:], abs=0.4)
        assert "in 1 gaps" in swum.said[-1]
        assert swum.first_direction == (-1) ** (len(swum.dwells) - len(DWELLS) + 1)
    short = table["time_s"].between(FLIPS[20] + 0.5, FLIPS[21] - 0.5)  # rows are missing, flips are not
    assert len(read(table[~short]).dwells) == len(DWELLS)


def test_a_plan_beside_directions_counts_where_it_was_carried_out() -> None:
    table = track(rest=5.1)
    gap = table["time_s"].between(FLIPS[20] - 1, FLIPS[22] + 1)
    swum = read(table[~gap], PLAN)
    assert_true(swum)
    assert np.abs(swum.flips - FLIPS).max() < 0.05
    assert swum.flip_error < 0.02
    early = track(flips=np.append(FLIPS[:40], FLIPS[39] + 1.9), rest=4.0)  # it was stopped
    assert read(early, PLAN).flips[-1] == pytest.approx(FLIPS[39] + 1.9, abs=0.4)
    assert read(early, PLAN).flips[:-1] == pytest.approx(FLIPS[:40], abs=0.05)
    assert len(read(track(flips=FLIPS[:41], rest=4.0), PLAN).dwells) == 40
    assert swum.clock_known
    led = {**PLAN, "dwell_s": [1.03 * dwell for dwell in PLAN["dwell_s"]]}
    other = read(table, led)
    assert np.array_equal(other.flips, read(table).flips)
    assert "a tracker led the robot" in other.said[0]


@pytest.mark.parametrize("clock", [0.0, 7.3, -250.0])
def test_the_start_of_a_plan_is_found_in_the_headings(clock: float) -> None:
    table = track(rest=20.0).drop(columns="direction")
    table["time_s"] += clock
    table.loc[::50, "heading_deg"] += 150.0
    swum = read(table, PLAN)
    assert_true(swum, clock=clock)
    assert swum.flips == pytest.approx(FLIPS + clock, abs=0.3)
    assert not swum.clock_known
    assert swum.flip_error == 0.0
    part = read(table[300:600], PLAN)  # the camera was started later, and stopped earlier
    assert_true(part, clock=clock)
    nearest = np.abs(np.subtract.outer(part.flips, FLIPS + clock)).min(1)
    assert nearest.max() < 0.3


def test_laps_of_a_plan_go_on_as_long_as_the_track() -> None:
    flips = np.append(0.0, np.cumsum(np.tile(DWELLS[:20], 3)))
    lap = {**PLAN, "dwell_s": DWELLS[:20].tolist(), "lap": {}}
    for table in (track(flips=flips), track(flips=flips).drop(columns="direction")):
        swum = read(table, lap)
        assert_true(swum, flips=flips)
        assert swum.flips == pytest.approx(flips, abs=0.3)


def test_a_long_dwell_that_turns_far_has_no_outliers() -> None:
    flips = np.append(0.0, np.cumsum([*DWELLS[:30], 50.0, *DWELLS[30:]]))
    table = track(flips=flips)
    swum = read(table)
    assert_true(swum, flips=flips)
    assert (len(swum.time), swum.said) == (len(table), ())


def test_another_plan_is_refused() -> None:
    table = track().drop(columns="direction")
    dwells = np.random.default_rng(9).uniform(3.0, 6.0, 60)
    assert any("was it carried out" in line for line in read(table, {**PLAN, "dwell_s": dwells.tolist()}).said)
    with pytest.raises(InputError, match="was it carried out"):
        read(table, {**PLAN, "dwell_s": (3 * dwells).tolist()})
    with pytest.raises(InputError, match="the track is of plan p2, not of p1"):
        read(table.assign(plan_id="p2"), PLAN)
    with pytest.raises(InputError, match="no column 'direction'"):
        read(table)


def test_runs_are_swims() -> None:
    late = track(seed=2)
    late["time_s"] += 1000
    both = pd.concat([track().assign(run=7.0), late.assign(run=8.0)], ignore_index=True)
    first, second = read_swims(both.sample(frac=1.0, random_state=0).sort_values("time_s"))
    assert (first.name, second.name) == ("7", "8")
    assert_true(second, clock=1000)
    assert np.array_equal(first.poses, read(track()).poses)
    with pytest.raises(InputError, match="8: a swim needs 60 poses"):
        read_swims(both[: len(late) + 20])


def test_bad_tables_are_refused_in_one_line(tmp_path: Path) -> None:
    def refusal(table: pd.DataFrame) -> str:
        file = tmp_path / "track.csv"
        table.to_csv(file, index=False)
        with pytest.raises(InputError) as caught:
            read_swims(read_tracks(file), file=file)
        assert str(caught.value).startswith(str(file))
        return str(caught.value).removeprefix(f"{file}: ")

    good = track().round(6).astype(object)

    def changed(row: int, column: str, value: object) -> pd.DataFrame:
        table = good.copy()
        table.loc[row, column] = value
        return table

    assert refusal(changed(4, "x_cm", "wide")) == "row 5 (line 6): x_cm is wide; give a finite number"
    assert refusal(changed(4, "y_cm", "1e12")).startswith("row 5 (line 6): y_cm is 1")
    assert refusal(changed(4, "direction", 2)) == "row 5 (line 6): direction is 2; give 1, -1 or 0"
    assert refusal(changed(4, "direction", "")) == "row 5 (line 6): direction is nan; give 1, -1 or 0"
    assert refusal(changed(4, "time_s", "")) == "row 5 (line 6): time_s is nan; give a finite number"
    assert refusal(changed(4, "time_s", 900)).startswith("the time of track goes back at row 6 (line 7)")
    assert refusal(good.drop(columns="y_cm")).startswith("the track has no column 'y_cm'")
    assert refusal(good[:40]) == "a swim needs 60 poses; there are 40"
    assert refusal(good[good["time_s"].astype(float) < FLIPS[11] - 1]) == (
        "a swim needs 12 dwells between flips of the motor; there are 11"
    )
    assert refusal(good.assign(direction=0)).startswith("the motor rests all the time")
    assert "other side than its motor" in refusal(good.assign(direction=-good["direction"]))
    twice = good.assign(direction=good["direction"].where(good.index != 7, -good["direction"]))
    twice.loc[6:8, "time_s"] = good["time_s"][6]
    assert "changes twice at" in refusal(twice)
    noisy = track()
    noisy.loc[::6, "x_cm"] += 3.0
    assert "poses jump away from the others" in refusal(noisy)


def test_a_camera_too_slow_for_the_robot_is_refused() -> None:
    table = track(every=1.2, noise=0.0)
    table["heading_deg"] = 15 * np.degrees(poses_at(table["time_s"].to_numpy())[:, 2])
    with pytest.raises(InputError, match="more pictures per second"):
        read(table)


def test_times_that_repeat_count_once() -> None:
    table = track()
    twice = pd.concat([table, table.assign(x_cm=table["x_cm"] + 1)]).sort_values("time_s", kind="stable")
    assert np.array_equal(read(twice).poses, read(table).poses)


def test_tracks_of_the_simulator_have_exact_flips(tmp_path: Path) -> None:
    """Also of another robot, from the file; and of a tracker, whose flips are not those of the plan."""
    plan = planned()
    json_file = write_plan(plan, tmp_path)[0]
    for robot in (None, BIASED):
        table = replay(plan.schedule(robot))
        table.to_csv(tmp_path / "track.csv", index=False)
        for source in (table, tmp_path / "track.csv"):
            swum = read(source, plan)
            assert swum.said == ()
            assert swum.dwells == pytest.approx(plan.seconds)
            assert swum.flip_error == 0.0
            assert len(swum.time) == len(table)
    assert swum.name == "track"
    led = swim(plan, truth=BIASED)
    swum = read(led.to_frame(), json.loads(json_file.read_text()))
    assert swum.dwells == pytest.approx(led.dwells * plan.robot.time_scale)
    assert "a tracker led the robot" in swum.said[0]


def test_answers_on_a_pipe_turn_the_motor_in_their_rows() -> None:
    """Poses beside answers: a line at each flip has no pose."""
    at_flips = pd.DataFrame({"time_s": FLIPS, "direction": [*(-1, 1) * 30, 0]})
    table = pd.concat([track(), at_flips]).sort_values("time_s", kind="stable").assign(flip_at_s=1.0)
    swum = read(table)
    assert_true(swum)
    assert swum.flips == pytest.approx(FLIPS)
    assert swum.flip_error == 0.0


def test_tracks_of_other_programs_need_the_plan(tmp_path: Path) -> None:
    """A TUM trajectory: seconds, metres and a quaternion."""
    table = track()
    poses = poses_at(table["time_s"].to_numpy())
    half, zero = poses[:, 2] / 2, np.zeros(len(table))
    columns = [table["time_s"].to_numpy(), poses[:, 0], poses[:, 1], zero, zero, zero, np.sin(half), np.cos(half)]
    np.savetxt(tmp_path / "track.tum", np.stack(columns, 1))
    assert is_track(read_tracks(tmp_path / "track.tum"))
    assert_true(read(tmp_path / "track.tum", PLAN))
    both = pd.concat([table.assign(run=1), table.assign(run=2)])
    both.attrs["lost"] = ["2 poses are lost"]
    assert [each.said for each in read_swims(both)] == [("2 poses are lost",), ()]


def test_what_is_said_of_a_track_is_kept_with_its_poses() -> None:
    table = track()
    table.loc[100:104, ["x_cm", "y_cm", "heading_deg"]] = np.nan
    runs, held_out = runs_of_swims([read(table)], 0.1)
    assert runs.row == "pose"
    assert summary_of_excluded(runs.excluded, len(runs)) == [f"swim: 5 of {len(table)} rows have no pose"]
    assert quarter_of_conditions(runs, ~held_out)[1] == "a quarter of the stretches"


def test_a_track_is_told_from_a_table_of_runs() -> None:
    assert is_track(track())
    assert is_track(track().rename(columns={"x_cm": "X [mm]"}))
    assert not is_track(pd.DataFrame({"N": [2], "l_cm": [10.0], "omega_rpm": [10.0], "R_yr_cm": [3.0]}))
    assert not is_track(pd.DataFrame({"time_s": [1.0], "x_cm": [1.0], "speed_cm_s": [1.0]}))
