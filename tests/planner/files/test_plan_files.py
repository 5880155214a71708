"""The files of a plan agree with it and with each other; pictures; the error of a track."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from camera.pose_tracks import read_tracks
from common.errors import InputError, run_command
from planner.files.headers import milliseconds
from planner.files.pictures import draw_plan
from planner.files.plan_files import write_plan
from planner.vehicle.vehicle import Switches, roll_out
from sim.model.schedule import load_schedule
from softflagella.__main__ import main
from tests.camera.tracked_files import deeplabcut, two_robots
from tests.planner.compiled import compile_c
from tests.planner.plans import CONTROL, planned, predicted_track
from tracking.tracks import check, tracking_error, what_next

SVG = "{http://www.w3.org/2000/svg}"


def test_files_of_a_plan(tmp_path: Path) -> None:
    result = planned("square:3l", minimum_dwell=0.8)
    written = write_plan(result, tmp_path / "out")
    assert [p.name for p in written] == ["plan.json", "plan.csv", "schedule.h", "plan.svg"]
    content = json.loads(written[0].read_text())
    assert content["stated_error_over_l"] == pytest.approx(result.stated_error)
    assert content["model"] == result.tracked.model
    schedule = load_schedule(written[0])
    assert np.array_equal(schedule.dwells, result.dwells)
    assert schedule.first_direction == result.first_direction
    assert schedule.robot == result.to_dict()["robot"]["groups"]
    header = written[2].read_text()
    numbers = [int(v) for v in header.split("{")[1].split("}")[0].replace("\n", " ").split(",")]
    assert sum(numbers) == pytest.approx(1000 * result.seconds.sum(), abs=1)
    assert f"SCHEDULE_COUNT {len(numbers)}" in header
    assert "<svg" in written[3].read_text()
    table = result.to_frame()
    assert table["dwell_s"].sum() == pytest.approx(result.seconds.sum())
    for k, name in enumerate(("x", "y")):
        assert table[f"{name}_over_l"].to_numpy() == pytest.approx(result.poses[:-1, k])
        assert table[f"{name}_cm"].to_numpy() == pytest.approx(11 * table[f"{name}_over_l"].to_numpy())
    assert np.radians(table["heading_deg"].to_numpy()) == pytest.approx(table["heading_rad"].to_numpy())
    assert table.attrs["units"]["x_cm"] == "cm"


def test_milliseconds_carry_rounding_and_split_long_dwells() -> None:
    assert sum(milliseconds(np.full(1000, 0.0104))) == 10400
    assert milliseconds(np.array([1.0, 140.0])) == [1000, 65535, 0, 65535, 0, 8930]
    assert milliseconds(np.array([65.535, 65.536])) == [65535, 65535, 0, 1]
    with pytest.raises(InputError, match="longer minimum dwell"):
        milliseconds(np.array([1.0, 0.0001]))


def identities(folder: Path) -> set[str]:
    """What the files of a plan say which plan they belong to."""
    header = (folder / "schedule.h").read_text().split("Plan ")[1][:12]
    (column,) = set(pd.read_csv(folder / "plan.csv")["plan_id"])
    named = (folder / "plan.svg").read_text().split("<dc:identifier>")[1].split("<")[0].strip()
    return {json.loads((folder / "plan.json").read_text())["id"], column, header, named}


def test_all_files_name_the_same_plan_and_another_plan_replaces_them(tmp_path: Path) -> None:
    (tmp_path / "goal.json").write_text("{}")
    write_plan(planned(), tmp_path)
    first = identities(tmp_path)
    assert not (tmp_path / "goal.json").exists()
    write_plan(planned("circle:2l", objective="flips"), tmp_path)
    assert len(first) == len(identities(tmp_path)) == 1
    assert first != identities(tmp_path)


def test_a_plan_that_cannot_be_drawn_leaves_the_plan_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_plan(planned(), tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def broken(*_: object) -> None:
        raise RuntimeError

    monkeypatch.setattr("planner.files.plan_files.write_figure", broken)
    with pytest.raises(RuntimeError):
        write_plan(planned("circle:2l", objective="flips"), tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    "name",
    [r"a$\frac$b", "*/ #error", '"', "a < b & c", "ü\n", "机器人"],
    ids=["formula", "comment", "quote", "markup", "line", "letters"],
)
def test_any_name_of_a_robot_can_be_drawn_and_compiled(name: str, tmp_path: Path) -> None:
    result = planned("circle:2l", objective="flips")
    named = replace(result, tracked=result.tracked._replace(robot=replace(CONTROL, name=name)))
    write_plan(named, tmp_path)
    assert len(identities(tmp_path)) == 1
    assert name.split("\n")[0] in "".join(ElementTree.parse(tmp_path / "plan.svg").getroot().itertext())
    source = '#include "schedule.h"\nint main(void){return schedule_ms[0]==0;}'
    (tmp_path / "main.c").write_text(source)
    compile_c(tmp_path / "main.c", tmp_path / "main", "-O0", "-Wno-unused")


@pytest.mark.parametrize(
    "path", ["circle:2l", ((0.0, 0.0), (12.0, 0.0)), ((0.0, 0.0), (12.0, 4.0)), ((0.0, 0.0), (0.3, 6.0))]
)
def test_the_frame_holds_the_plan_at_one_scale(path: Any) -> None:
    """A flat or narrow plan, too, has a frame with room for numbers and labels."""
    (axes,) = draw_plan(planned(path, objective="flips")).axes
    axes.apply_aspect()
    across, up = (axes.transData.transform((1.0, 1.0)) - axes.transData.transform((0.0, 0.0))).tolist()
    assert across == pytest.approx(up)
    drawn, shown = axes.dataLim, axes.viewLim
    margin = 0.04 * max(drawn.size)  # on all sides, for the labels of places
    assert (shown.min < drawn.min - margin).all()
    assert (shown.max > drawn.max + margin).all()
    assert (axes.bbox.size / axes.figure.dpi >= (4.0, 1.0)).all()
    assert len(axes.get_xticks()) > 2
    assert len(axes.get_yticks()) > 2


def test_a_plan_has_one_picture_with_words(tmp_path: Path) -> None:
    """The same bytes each time; words can be found."""
    pictures = [write_plan(planned(), tmp_path / name)[-1].read_text() for name in ("one", "two")]
    assert pictures[0] == pictures[1]
    texts = {word.text for word in ElementTree.fromstring(pictures[0].encode()).iter(f"{SVG}text")}
    assert {"x [cm]", "y [cm]", "path as given", "declared", "predicted", "0"} <= texts
    assert any("dwells" in str(text) for text in texts)


def test_a_long_dwell_is_drawn_as_a_curve() -> None:
    """Eight samples a dwell would be a polygon."""
    switches = Switches(1, np.array([60.0, 60.0]), planned().poses[:1])
    switches = replace(switches, poses=roll_out(planned().tracked.vehicle, switches).flips)
    long = replace(planned(), switches=switches)
    kinks = []
    for track in (roll_out(long.tracked.vehicle, long.switches, 0.0).track, long.smooth_track):
        turns = np.diff(np.unwrap(np.arctan2(*np.diff(track, axis=0).T)))
        kinks.append((np.abs(turns) > np.radians(8)).sum())
    assert kinks[1] <= 2 < kinks[0]


@cache
def tracks() -> tuple[dict[str, Any], pd.DataFrame]:
    """Return a plan, and the track that it predicts at the flips, 1 mm off."""
    track = predicted_track(planned())
    return planned().to_dict(), track.assign(x_over_l=track["x_over_l"] + 0.001 / CONTROL.tail_length)


def test_a_track_of_a_camera_has_the_error_of_the_same_track_in_tail_lengths() -> None:
    record, track = tracks()
    columns = {
        "time_min": track["time_bar"] * CONTROL.time_scale / 60,
        "X (mm)": 1000 * CONTROL.tail_length * track["x_over_l"],
        "y_cm": 100 * CONTROL.tail_length * track["y_over_l"],
        "heading_deg": np.degrees(track["heading_rad"]),
    }
    expected, error = tracking_error(record, track), tracking_error(record, pd.DataFrame(columns))
    for name in ("rms", "largest", "raw_rms", "raw_largest", "missed"):
        assert getattr(error, name) == pytest.approx(getattr(expected, name), rel=1e-9)
    assert error.largest * CONTROL.tail_length < 0.0035
    assert f"{1000 * error.rms * CONTROL.tail_length:.3g} mm ({error.rms:.3g} l) rms" in error.line


def test_times_without_a_new_pose_are_told() -> None:
    """A whole track has none, of even or uneven steps; parts that are cut out or repeated are told."""
    record, track = tracks()
    assert tracking_error(record, track).gaps == ()
    times = np.linspace(track["time_bar"].iloc[0], track["time_bar"].iloc[-1], 500)
    dense = pd.DataFrame({name: np.interp(times, track["time_bar"], track[name]) for name in track})
    repeated = dense.copy()
    repeated.loc[200:259, ["x_over_l", "y_over_l", "heading_rad"]] = repeated.iloc[200, 1:].to_numpy()
    seconds = 60 * np.diff(times)[0] * CONTROL.time_scale
    for given, words in ((dense.drop(index=range(200, 260)), "no pose"), (repeated, "the same pose")):
        error = tracking_error(record, given)
        (line,) = error.gaps
        assert re.fullmatch(rf"{words} for \d+ s \(12 % of the time\)", line)
        assert int(line.split()[-7]) == pytest.approx(seconds, abs=4)
        assert error.line.endswith(f"; {line}")


def test_check_of_a_track_that_misses_a_part_ends_with_status_3(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record, track = tracks()
    json_file, whole, part = (tmp_path / name for name in ("plan.json", "whole.csv", "part.csv"))
    json_file.write_text(json.dumps(record))
    track.to_csv(whole, index=False)
    track.head(len(track) // 2).to_csv(part, index=False)
    assert run_command(main, ["check", str(json_file), str(whole)]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert "within the stated error" in line
    overlay = tmp_path / "overlay.png"
    assert run_command(main, ["check", str(json_file), str(part), "--out", str(overlay)]) == 3
    told = capsys.readouterr()
    assert told.out.startswith("MISSED a part of the declared path")
    assert told.err == f"error: {part} misses a part of the declared path\n"
    words = f"softflagella calibrate {part} --robot paper-control --plan {json_file} --out calibrated"
    assert told.out.splitlines()[1:] == [f"-> {overlay}", f"find out what the model lacks: {words}"]
    assert overlay.exists()


def test_what_is_next_names_the_robot_as_far_as_it_is_known() -> None:
    """A preset by its name, unless it was changed; a measured vehicle has no model that could lack anything."""
    record = planned().to_dict()
    assert what_next(record, "my track.csv").endswith(
        " calibrate 'my track.csv' --robot paper-control --out calibrated"
    )
    changed = {**record, "robot": {**record["robot"], "time_scale_s": 1.1 * record["robot"]["time_scale_s"]}}
    assert what_next(changed, "track.csv").endswith(" calibrate track.csv --robot robot.toml --out calibrated")
    assert what_next({**record, "robot": {"name": "toy", "vehicle": {}}}, "track.csv") == ""


def test_tracks_of_another_program_are_read_as_options_say(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of one robot; what is lost is told."""
    json_file, file = tmp_path / "plan.json", tmp_path / "swimDLC_resnet50.csv"
    json_file.write_text(json.dumps(tracks()[0]))
    file.write_bytes(deeplabcut())
    options: dict[str, Any] = {"written_by": "deeplabcut", "scale": "0.5mm", "fps": 25.0}
    wanted = tracking_error(tracks()[0], read_tracks(file, **options, origin=(900.0, 700.0)).drop(columns="run"))
    words = ["--from", "deeplabcut", "--scale", "0.5mm", "--fps", "25", "--origin", "900", "700"]
    with pytest.raises(InputError, match="misses a part of the declared path"):
        main(["check", str(json_file), str(file), *words])
    out, err = capsys.readouterr()
    assert err == f"{file}: 1 of 40 poses are lost\n"
    told, line = out.splitlines()
    assert told == wanted.line
    command = line.partition("softflagella ")[2]
    told_options = "--from deeplabcut --scale 0.5mm --fps 25.0 --origin 900 700"
    assert command.endswith(f"--plan {json_file} {told_options} --out calibrated")
    with pytest.raises(InputError, match="a swim needs 60 poses; there are 39"):
        main(shlex.split(command))
    with pytest.warns(UserWarning, match="1 of 40 poses are lost") as warned:
        assert check(json_file, file, **options, origin=(900.0, 700.0)).rms == wanted.rms
    assert [each.filename for each in warned] == [__file__]
    file.write_bytes(two_robots())
    with pytest.raises(InputError, match="2 tracks, of swim one, swim two"):
        check(tracks()[0], file, **options)


def test_the_track_of_another_robot_or_plan_is_refused() -> None:
    """Places in cm disagree with those in l; a track that has no id is taken as it is."""
    record, track = tracks()
    own, other = (
        track.assign(x_cm=size * track["x_over_l"], y_cm=size * track["y_over_l"], heading_deg=0.0)
        for size in (100 * CONTROL.tail_length, 15.0)
    )
    assert tracking_error(record, own).rms == tracking_error(record, track).rms
    with pytest.raises(InputError, match=r"x_over_l and x_cm .* disagree .* 11 cm"):
        tracking_error(record, other)
    own = track.assign(plan_id=record["id"]).astype({"plan_id": object})
    own.loc[3, "plan_id"] = None
    assert tracking_error(record, own).rms == tracking_error(record, track).rms
    with pytest.raises(InputError, match=f"of plan p0123456789a, not of {record['id']}"):
        tracking_error(record, track.assign(plan_id="p0123456789a"))


def test_a_robot_that_stays_where_it_is_is_away_from_its_path() -> None:
    record, track = tracks()
    still = track.assign(**track.loc[0, ["x_over_l", "y_over_l", "heading_rad"]])
    error = tracking_error(record, still)
    away = np.hypot(*(np.array(record["raw_path"]) - error.track[0]).T)
    assert error.rms == pytest.approx(error.largest)
    assert error.missed == pytest.approx(away.max(), rel=1e-3)


def test_a_track_that_cannot_be_read_is_refused() -> None:
    record, track = tracks()
    camera = {"time_s": [0.0], "x_cm": [0.0], "y_cm": [0.0], "heading_deg": [0.0]}
    for bad, expected in (
        (track.drop(columns="time_bar"), "no column 'time_s'; it needs time_s, x_cm, y_cm and heading_deg"),
        (pd.DataFrame(camera).drop(columns="x_cm"), "no column 'x_cm'; it needs"),
        (pd.DataFrame(camera).rename(columns={"y_cm": "y"}), "'y' has no unit"),
        (track.assign(x_over_l=np.nan), "not a finite number"),
        (track[::-1], "time goes back at row 2; give a row for each time, in order"),
    ):
        with pytest.raises(InputError, match=expected):
            tracking_error(record, bad)
