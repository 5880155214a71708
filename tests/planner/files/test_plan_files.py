"""The files of a plan agree with it and with each other; pictures; the error of a track."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from planner.__main__ import main
from planner.files.headers import milliseconds
from planner.files.pictures import SvgAxes
from planner.files.plan_files import write_plan
from planner.files.tracks import check, tracking_error
from planner.vehicle.vehicle import Switches, roll_out
from sim.io.errors import InputError
from sim.io.pose_tracks import read_tracks
from sim.model.schedule import load_schedule
from tests.planner.compiled import compile_c
from tests.planner.plans import CONTROL, planned, predicted_track
from tests.sim.io.tracked_files import deeplabcut, two_robots


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
    write_plan(planned(), tmp_path, pictures={"trade_off.svg": Figure()})
    first = identities(tmp_path)
    assert not (tmp_path / "goal.json").exists()
    write_plan(planned("circle:2l", objective="flips"), tmp_path)
    assert len(first) == len(identities(tmp_path)) == 1
    assert first != identities(tmp_path)
    assert not (tmp_path / "trade_off.svg").exists()


def test_a_plan_that_cannot_be_drawn_leaves_the_plan_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_plan(planned(), tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def broken(*_: object) -> None:
        raise RuntimeError

    monkeypatch.setattr("planner.files.plan_files.plan_svg", broken)
    with pytest.raises(RuntimeError):
        write_plan(planned("circle:2l", objective="flips"), tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    "name", [r"a$\frac$b", "*/ #error", '"', "ü\n"], ids=["formula", "comment", "quote", "line"]
)
def test_any_name_of_a_robot_can_be_drawn_and_compiled(name: str, tmp_path: Path) -> None:
    result = planned("circle:2l", objective="flips")
    named = replace(result, tracked=result.tracked._replace(robot=replace(CONTROL, name=name)))
    write_plan(named, tmp_path)
    assert len(identities(tmp_path)) == 1
    source = '#include "schedule.h"\nint main(void){return schedule_ms[0]==0;}'
    (tmp_path / "main.c").write_text(source)
    compile_c(tmp_path / "main.c", tmp_path / "main", "-O0", "-Wno-unused")


SVG = "{http://www.w3.org/2000/svg}"


def places(text: str) -> list[np.ndarray]:
    """Return the points of every path in px."""
    found = []
    for path in ElementTree.fromstring(text.encode()).iter(f"{SVG}path"):
        pairs = [word.split(",") for word in path.attrib["d"].split()[1:] if "," in word]
        found.append(np.array(pairs, dtype=float))
    return found


@pytest.mark.parametrize("size", [(3.0, 1.0), (1.0, 400.0), (0.002, 0.002), (5.0, 0.0)])
def test_scales_are_equal_and_ticks_are_in_place(size: tuple[float, float]) -> None:
    axes = SvgAxes()
    corners = np.array([7.0, -2.0]) + np.array([[0.0, 0.0], [size[0], 0.0], size, [0.0, size[1]]])
    axes.fill(*corners.T, color="#aabbcc")
    text = axes.text("p1")
    drawn, root = places(text)[0], ElementTree.fromstring(text.encode())
    _, frame = (rect.attrib for rect in root.iter(f"{SVG}rect"))
    x, y, width, height = (float(frame[name]) for name in ("x", "y", "width", "height"))
    assert ((drawn > [x, y]) & (drawn < [x + width, y + height])).all()
    scale = np.ptp(drawn, axis=0).max() / max(size)
    x, y = (drawn - drawn[0]).T
    assert x == pytest.approx(scale * (corners - corners[0])[:, 0], abs=0.02)
    assert y == pytest.approx(-scale * (corners - corners[0])[:, 1], abs=0.02)
    words = [word for word in root.iter(f"{SVG}text") if word.text]
    below = [word for word in words if word.attrib["text-anchor"] == "middle"]
    assert 2 <= len(below) <= 7
    for word in below:
        number = float((word.text or "").replace("−", "-"))
        assert float(word.attrib["x"]) == pytest.approx(drawn[0, 0] + scale * (number - 7.0), abs=0.6)


def test_any_words_can_be_written() -> None:
    axes = SvgAxes()
    axes.plot(1.0, 2.0, "o", color="#000000", label='a < b & "c"')
    axes.set_title("first\n<second>")
    axes.set_xlabel("x")
    axes.set_ylabel("y")
    texts = [word.text for word in ElementTree.fromstring(axes.text("p&1").encode()).iter(f"{SVG}text")]
    assert {"first", "<second>", 'a < b & "c"', "x", "y"} <= set(texts)


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
    main(["check", str(json_file), str(file), *words])
    assert capsys.readouterr() == (f"{wanted.line}\n", f"{file}: 1 of 40 poses are lost\n")
    with pytest.warns(UserWarning, match="1 of 40 poses are lost") as warned:
        assert check(json_file, file, **options, origin=(900.0, 700.0)).rms == wanted.rms
    assert [each.filename for each in warned] == [__file__]
    file.write_bytes(two_robots())
    with pytest.raises(InputError, match="there are 2 tracks, of swim one, swim two …; give that of one robot"):
        check(tracks()[0], file, **options)


def test_the_track_of_another_robot_or_plan_is_refused() -> None:
    """Places in cm disagree with those in l; a track that has no id is taken as it is."""
    record, track = tracks()
    own, other = (
        track.assign(x_cm=size * track["x_over_l"], y_cm=size * track["y_over_l"], heading_deg=0.0)
        for size in (100 * CONTROL.tail_length, 15.0)
    )
    assert tracking_error(record, own).rms == tracking_error(record, track).rms
    with pytest.raises(InputError, match=r"x_over_l and x_cm of the track disagree with .* tail length, 11 cm"):
        tracking_error(record, other)
    own = track.assign(plan_id=record["id"]).astype({"plan_id": object})
    own.loc[3, "plan_id"] = None
    assert tracking_error(record, own).rms == tracking_error(record, track).rms
    with pytest.raises(InputError, match=f"the track is of plan p0123456789a, not of {record['id']}"):
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
