"""Films to tracks: poses, spins, missing and doubled frames, and a line for each film that cannot be used."""

from __future__ import annotations

import math
import re
import time
import tracemalloc
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pandas as pd
import pytest

from camera.film import Film
from camera.measured_films import measure_films
from camera.measured_runs import measure_tracks
from camera.spin import Spin, fit_spin
from camera.tracks import FilmTracks, track_film, turn_sense
from camera.view import Setup, read_setup
from common.arrays import Floats
from common.errors import InputError, run_command
from sim.inputs import load_robot
from softflagella.__main__ import main
from tests.oracles.tank import LENGTH, TAIL, Motion, Tank, circling
from tests.shared import FOLDER, shared
from tracking.live import FROZEN, watch

RATE, SECONDS = 12.0, 20.0
HEAD, TAILS, YAW, RADIUS = -4.6, 6.2, 0.25, 0.06  # rad/s, m
DOUBLED = (77, 150)
SWUM = circling(YAW, RADIUS, head=HEAD, tails=TAILS)
RPM = (TAILS - HEAD) * 30 / math.pi
RUNS = pd.DataFrame({"run": ["a"], "N": [2], "l_cm": [11.0], "omega_rpm": [RPM]})


def setup_of(tank: Tank, folder: Path) -> Setup:
    (folder / "view.toml").write_text(tank.view_toml())
    return read_setup(folder / "view.toml")


def small(**given: float) -> Tank:
    return Tank(width=320, height=240, scale=0.001, **given)  # type: ignore[arg-type]


def replace_robots(setup: Setup, **given: float) -> Setup:
    return Setup(setup.view, tuple(each._replace(**given) for each in setup.robots))  # type: ignore[arg-type]


def errors_of(table: pd.DataFrame, motion: Motion) -> tuple[Floats, Floats, list[float]]:
    """Return errors of places (F, 2) [m] and headings (F,) [deg], and the shares within 1.96 stated errors."""
    truth = np.array([motion(time) for time in table["time_s"]])
    off = np.abs(table[["x_cm", "y_cm"]].to_numpy() / 100 - truth[:, :2])
    turned = np.abs((table["heading_deg"].to_numpy() - np.degrees(truth[:, 2]) + 180) % 360 - 180)
    stated = table[["x_error_cm", "heading_error_deg"]].to_numpy()
    return off, turned, [(100 * off < 1.96 * stated[:, :1]).mean(), (turned < 1.96 * stated[:, 1]).mean()]


@shared
def film() -> Path:
    """Film a robot for 20 s with an uneven light, dropped and doubled frames and a hand; with its view.toml."""
    folder = FOLDER / "film"
    folder.mkdir(exist_ok=True)
    tank = small(shade=0.3)
    setup_of(tank, folder)
    return tank.film(folder / "swim.mp4", SWUM, SECONDS, RATE, doubled=DOUBLED, hand=(180, 200))


def test_a_film_gives_poses_at_its_time_stamps_and_says_what_it_left_out() -> None:
    tracked = track_film(film(), read_setup(film().parent / "view.toml"), head_length=LENGTH)
    table = tracked.tables["1"]
    assert len(table) > 0.88 * RATE * SECONDS
    off, turned, within = errors_of(table, SWUM)
    assert np.hypot(*off.T).max() < 0.02 * TAIL
    assert np.sqrt((turned**2).mean()) < 1
    assert min(within) > 0.9
    assert not set(DOUBLED) & set(table["frame"])
    assert tracked.notes[0] == f"{len(DOUBLED)} of 240 frames are copies of the frame before, and left out"
    assert any(re.search("frames without a pose: (no red|no green|red|green)", note) for note in tracked.notes[1:])


def test_spins_and_circle_of_a_film_are_those_that_were_drawn() -> None:
    tracked = track_film(film(), read_setup(film().parent / "view.toml"), head_length=LENGTH)
    runs = RUNS.assign(run="swim")
    measured = measure_tracks(tracked.tables["1"], runs)
    assert measured.excluded == []
    row = measured.table.iloc[0]
    for column, truth in (("omega_h", HEAD), ("omega_t", TAILS)):
        error = row[f"{column}_rpm"] * math.pi / 30 - truth
        assert abs(error) < 0.005 * abs(truth)
        assert abs(error) < 3 * row[f"{column}_error"] * math.pi / 30 < 0.02 * abs(truth)
    noted = measure_tracks(tracked.tables["1"], runs.assign(omega_h_rpm=-44.0)).table
    assert list(noted["omega_h_rpm"]) == [-44.0]
    assert row["omega_yr_rad_s"] == pytest.approx(YAW, rel=0.005)
    assert row["R_yr_cm"] == pytest.approx(100 * RADIUS, rel=0.01)
    assert row["theta_deg"] == pytest.approx(math.degrees(1.17), abs=1)


def test_a_dot_that_shows_no_spin_is_named() -> None:
    time = np.arange(0, 20, 1 / RATE)
    left, area = np.random.default_rng(0).normal(size=(2, len(time)))
    for count, fastest, reason in ((len(time), 15.0, "the dot does not come and go regularly; check its colour"),
                                   (30, 4.0, "the track is too short for a spin; film at least three turns"),
                                   (11, 15.0, "the dot is seen in 11 frames; check its colour")):  # fmt: skip
        said = fit_spin(time[:count], left[:count], np.abs(area[:count]), fastest)
        assert isinstance(said, str)
        assert said.startswith(reason)


def test_the_command_writes_a_track_that_planner_and_calibration_read_and_a_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    view = film().parent / "view.toml"
    words = ["tracks", film(), "--robot", "paper-control", "--view", view, "--start", 5, "--end", 12,
             "--out", tmp_path / "tracks.csv", "--check", tmp_path / "check.png"]  # fmt: skip
    assert run_command(main, [str(word) for word in words]) == 0
    assert " poses, turning left as with the motor at +1 -> " in capsys.readouterr().out
    table = pd.read_csv(tmp_path / "tracks.csv")
    assert table["time_s"].iloc[0] == pytest.approx(0, abs=1e-6)
    assert table["time_s"].iloc[-1] == pytest.approx(7, abs=0.2)
    assert (tmp_path / "check.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize("option", ["--out", "--check", "--films"])
def test_a_place_that_cannot_be_written_is_refused_before_a_film_is_tracked(
    option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("camera.tracks.track_film", None)
    (tmp_path / "file").write_text("")
    (tmp_path / "other").write_text("")
    view = ["--robot", "paper-control", "--view", str(film().parent / "view.toml")]
    words = ["tracks", str(film()), *view, "--out", str(tmp_path / "t.csv"), option, str(tmp_path)]
    if option == "--films":
        words = ["calibrate", "--films", str(tmp_path / "file"), *view, "--out", str(tmp_path / "other")]
    assert run_command(main, words) == 2
    assert re.search("is a (file; give a folder|folder; give the name of a file)", capsys.readouterr().err)


def test_films_that_cannot_be_used_are_refused_with_what_to_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    bare = Tank(width=320, height=240, scale=0.001, colours=("", "", "", ""))
    view = setup_of(small(), tmp_path)
    nothing = bare.film(tmp_path / "bare.mp4", SWUM, 1.0, RATE)
    with pytest.raises(InputError, match=r"no robot 1 in 12 frames \(no red\)"):
        track_film(nothing, view)
    good = small().film(tmp_path / "good.mp4", SWUM, 1.0, RATE)
    for length, told in ((LENGTH / 10, "0.6 cm"), (10 * LENGTH, "60 cm")):
        with pytest.raises(InputError, match=rf"bands are 4.4 cm apart, .* {told} long"):
            track_film(good, view, head_length=length)
    stopped = Film(good)
    seen = stopped._open()
    frozen = SimpleNamespace(grab=seen.grab, retrieve=seen.retrieve, get=lambda key: 40.0)
    monkeypatch.setattr(stopped, "_open", lambda: frozen)
    with pytest.raises(InputError, match=r"good\.mp4: the time stamp of frame 1"):
        list(stopped.frames())
    failing = SimpleNamespace(grab=seen.grab, retrieve=lambda: 1 / 0, get=seen.get)
    monkeypatch.setattr(stopped, "_open", lambda: failing)
    with pytest.raises(ZeroDivisionError):  # what happens in the thread that decodes
        list(stopped.frames())
    apart = replace_robots(view, apart=0.06)
    with pytest.raises(InputError, match=r"at a wrong distance\): correct \[scale\] in view\.toml"):
        track_film(good, apart)
    with pytest.raises(InputError, match="no frame between 5 and 9 s"):
        track_film(good, view, start=5, end=9)
    (tmp_path / "text.mp4").write_text("no film")
    with pytest.raises(InputError, match=r"text\.mp4 is no film that can be read"):
        Film(tmp_path / "text.mp4")
    assert capfd.readouterr().err == ""
    with pytest.raises(InputError, match="no such file"):
        Film(tmp_path / "none.mp4")


def test_films_of_runs_become_a_measured_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot = replace(load_robot("paper-control"), motor_speed=TAILS - HEAD)
    table = pd.DataFrame({"film": ["swim.mp4"] * 2, "N": 2, "l_cm": 11.0, "omega_rpm": RPM, "start_s": [0.0, 7.0]})
    table.assign(end_s=[8.0, 15.0]).to_csv(film().parent / "runs.csv", index=False)
    said: list[str] = []
    measured = measure_films(film().parent / "runs.csv", film().parent / "view.toml", robot, tell=said.append)
    assert said[0].startswith("swim.mp4: 1 of 97 frames are copies")
    assert not any("turns to the other side" in line for line in said)
    for column, truth in (("omega_h_rpm", HEAD * 30 / math.pi), ("omega_t_rpm", TAILS * 30 / math.pi),
                          ("omega_yr_rad_s", YAW), ("R_yr_cm", 100 * RADIUS)):  # fmt: skip
        assert measured.table[column].to_numpy() == pytest.approx(np.full(2, truth), rel=0.01)
    assert 0 < measured.table["camera_scale_sigma_percent"].max() < 2
    words = ["calibrate", "--films", film().parent / "runs.csv", "--view", film().parent / "view.toml",
             "--robot", "paper-control", "--out", tmp_path / "out"]  # fmt: skip
    assert run_command(main, [str(word) for word in words]) == 2
    assert "2 usable runs; a calibration needs at least 24" in capsys.readouterr().err
    assert len(pd.read_csv(tmp_path / "out" / "table.csv")) == 2
    said.clear()
    table.assign(omega_rpm=[RPM, -RPM], end_s=[7.0, 15.0]).to_csv(film().parent / "wrong.csv", index=False)
    measure_films(film().parent / "wrong.csv", film().parent / "view.toml", robot, tell=said.append)
    assert sum("swim.mp4: the robot turns to the other side than omega_rpm makes it" in line for line in said) == 1
    said.clear()
    table.assign(film=["swim.mp4", "none.mp4"]).to_csv(film().parent / "missing.csv", index=False)
    with pytest.raises(InputError, match=r"none\.mp4: no such file"):
        measure_films(film().parent / "missing.csv", film().parent / "view.toml", robot, tell=said.append)
    for wrong, line in ((table.drop(columns="N"), "the table has no column 'N'; it needs N, l_cm"),
                         (table.rename(columns={"l_cm": "l"}), "column 'l' has no unit; name it one of l_m"),
                         (table.assign(sesion="a"), "unknown column 'sesion': is it 'session'")):  # fmt: skip
        wrong.to_csv(film().parent / "wrong.csv", index=False)
        with pytest.raises(InputError, match=rf"wrong\.csv: {line}"):
            measure_films(film().parent / "wrong.csv", film().parent / "view.toml", robot, tell=said.append)
    assert not said
    table.drop(columns="film").to_csv(tmp_path / "runs.csv", index=False)
    with pytest.raises(InputError, match=r"runs\.csv has no column 'film'"):
        measure_films(tmp_path / "runs.csv", film().parent / "view.toml", robot)


def test_the_largest_error_of_a_tag_s_scale_counts_for_all_films(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = small().film(tmp_path / "a.mp4", SWUM, 3.0, RATE)
    setup_of(small(), tmp_path)
    errors = iter((0.02, 0.01))

    def tracked(*words: object, **given: float) -> FilmTracks:
        tracks = track_film(*words, **given)  # type: ignore[arg-type]
        return tracks._replace(view=replace(tracks.view, scale_error=next(errors)))

    monkeypatch.setattr("camera.measured_films.track_film", tracked)
    runs = pd.DataFrame({"film": [made.name] * 2, "N": 2, "l_cm": 11.0, "rpm": RPM})
    runs.to_csv(tmp_path / "runs.csv", index=False)
    measured = measure_films(tmp_path / "runs.csv", tmp_path / "view.toml", load_robot("paper-control"))
    assert measured.table["camera_scale_sigma_percent"].tolist() == [2.0, 2.0]
    assert measured.converted == ("column rpm read as omega_rpm",)


def test_times_are_those_of_the_stamps_where_the_rate_varies_and_frames_are_dropped(tmp_path: Path) -> None:
    """A robot that does not keep to the stamps would be 3 mm behind; a GIF has a duration for each frame."""
    from PIL import Image

    tank, fast = small(noise=0.0), circling(0.6, RADIUS, head=HEAD)
    steps = np.full(40, 100)
    steps[::2], steps[[10, 30]] = 60, 700  # ms
    times = np.append(0, np.cumsum(steps)[:-1]) / 1000
    pictures = [Image.fromarray(tank.frame(fast, time)[..., ::-1]) for time in times]
    pictures[0].save(tmp_path / "a.gif", save_all=True, append_images=pictures[1:], duration=steps.tolist())
    tracked = track_film(tmp_path / "a.gif", setup_of(tank, tmp_path))
    assert tracked.notes[0] == "2 gaps in the time stamps: the camera dropped frames"
    table = tracked.tables["1"]
    assert len(table) > 36
    truth = np.array([fast(time) for time in times])[table["frame"], :2]
    assert np.hypot(*(table[["x_cm", "y_cm"]].to_numpy() / 100 - truth).T).max() < 0.02 * TAIL
    assert table["time_s"].to_numpy() == pytest.approx(times[table["frame"]], abs=1e-6)


@pytest.mark.parametrize("scale", [0.0014, 0.0016])
def test_a_robot_with_bands_of_five_pixels_is_not_lost(scale: float, tmp_path: Path) -> None:
    tank = Tank(width=320, height=240, scale=scale, shade=0.3)
    swum = circling(0.5, RADIUS, centre=(160 * scale, 120 * scale))
    table = track_film(tank.film(tmp_path / "a.mp4", swum, 10.0, RATE), setup_of(tank, tmp_path)).tables["1"]
    assert len(table) >= 119
    _, _, (places, headings) = errors_of(table, swum)
    assert places > 0.95
    assert headings > 0.93


@pytest.mark.parametrize("given", [{"distortion": -0.3}, {"readout": 0.03}], ids=["lens", "rolling shutter"])
def test_errors_hold_in_films_through_a_lens_and_a_rolling_shutter(
    given: dict[str, float], tmp_path: Path
) -> None:
    """Without the lens in view.toml, or with a readout of 0.3 s, a quarter of the places are within."""
    tank, swum = small(**given), circling(YAW, 0.085, head=HEAD, tails=TAILS)
    tracked = track_film(tank.film(tmp_path / "a.mp4", swum, 8.0, RATE), setup_of(tank, tmp_path))
    table = tracked.tables["1"]
    off, _, (places, headings) = errors_of(table, swum)
    assert off.max() < 0.02 * TAIL
    assert places > 0.95
    assert headings > 0.93
    time, left, area = (table[name].to_numpy() for name in ("time_s", "head_left_cm", "head_area_mm2"))
    spin = fit_spin(time, left, area, TAILS - HEAD)
    assert isinstance(spin, Spin)
    assert abs(spin.omega / HEAD - 1) < min(0.01, 3 * spin.error / abs(HEAD))


@pytest.mark.parametrize("dot", ["blue", ""])
def test_a_robot_whose_front_and_rear_are_exchanged_is_named_and_its_runs_are_refused(
    dot: str, tmp_path: Path
) -> None:
    """A dot on the head is certain of it; the way it swims is not."""
    for front, rear in (("red", "green"), ("green", "red")):
        tank = Tank(width=320, height=240, scale=0.001, colours=(front, rear, dot, ""))
        made = tank.film(tmp_path / "a.mp4", SWUM, 6.0, RATE)
        setup = setup_of(Tank(width=320, height=240, scale=0.001, colours=("red", "green", dot, "")), tmp_path)
        tracked = track_film(made, setup, motor_speed=TAILS - HEAD)
        named = (
            "its head spins as if front and rear were exchanged; " if dot else "it moves tail first; if it did "
        )
        assert [f"robot 1: {named}" in note for note in tracked.notes] == [True] * (front == "green")
        if front == "red":
            measure_tracks(tracked.tables["1"], RUNS)
            continue
        with pytest.raises(InputError, match=r"all runs swim tail first, .* front and rear"):
            measure_tracks(tracked.tables["1"], RUNS)


@pytest.mark.parametrize(("rate", "rest", "seen"), [(0.8, 0.0, 0.6), (0.0, 0.0, 1.0), (0.8, 6.0, 0.98)])
def test_things_of_the_markers_colours_that_lie_in_the_tank_are_no_markers(
    rate: float, rest: float, seen: float, tmp_path: Path
) -> None:
    """The rim is red; on the circle of a robot that moves at once lie things as far apart as its bands."""
    tank = small()

    def swum(time: float) -> tuple[float, float, float, float, float]:
        return circling(rate=rate)(max(time - rest, 0.0))

    tank._floor[tank._y > 0.225] = (20, 20, 240)
    for paint, x, y in (((20, 20, 240), 0.16, 0.12), ((40, 220, 40), 0.16, 0.165), ((20, 20, 240), 0.21, 0.14)):
        if rate and not rest:
            tank._floor[np.hypot(tank._x - x, tank._y - y) < 0.01] = paint
    if rest:  # beside the front
        tank._floor[np.hypot(tank._x - 0.255, tank._y - 0.155) < 0.006] = (20, 20, 240)
    film, setup = tank.film(tmp_path / "a.mp4", swum, 8.0, RATE), setup_of(tank, tmp_path)
    tracked = track_film(film, setup, head_length=LENGTH)
    assert any("it hardly moves, so a thing" in note for note in tracked.notes) == (rate == 0)
    table = tracked.tables["1"]
    assert len(table) >= seen * 8 * RATE
    truth = np.array([swum(t) for t in table["time_s"]])
    off = table[["x_cm", "y_cm"]].to_numpy() / 100 - truth[:, :2]
    assert np.abs(off).max() < 0.002
    assert np.abs(np.angle(np.exp(1j * (np.radians(table["heading_deg"]) - truth[:, 2])))).max() < 0.06


def test_robots_that_share_a_colour_and_rest_most_of_the_time_are_seen_all_the_time(tmp_path: Path) -> None:
    tank = Tank(width=400, height=200, scale=0.001)
    tank._floor[np.hypot(tank._x - 0.2, tank._y - 0.1) < 0.008] = (60, 170, 60)
    paths = {"a": circling(0.4, 0.05, centre=(0.1, 0.1)), "b": circling(-0.4, 0.05, centre=(0.3, 0.1))}
    swum = {"a": lambda t: paths["a"](min(t, 3.3)), "b": lambda t: paths["b"](max(t - 8.7, 0.0))}
    paints = {"a": ("red", "green"), "b": ("blue", "green")}
    robots = [f'[[robots]]\nname = "{a}"\nfront = "{b}"\nrear = "{c}"\n' for a, (b, c) in paints.items()]
    (tmp_path / "view.toml").write_text(tank.view_toml(robots="".join(robots)))
    made = tank.film(tmp_path / "a.mp4", [(swum[name], paints[name]) for name in paints], 12.0, RATE)
    for name, table in track_film(made, read_setup(tmp_path / "view.toml")).tables.items():
        assert len(table) > 0.95 * 12 * RATE
        assert np.hypot(*errors_of(table, swum[name])[0].T).max() < 0.002


def test_a_place_that_drifts_leaves_the_circle(tmp_path: Path) -> None:
    """A camera that sags moves the picture, as a current moves the robot; a turn shows it."""

    def drifting(time: float) -> tuple[float, float, float, float, float]:
        x, y, heading, head, tails = SWUM(time)
        return x + 0.0006 * time, y - 0.0008 * time, heading, head, tails

    made = small().film(tmp_path / "a.mp4", drifting, 28.0, 8.0)
    table = track_film(made, setup_of(small(), tmp_path)).tables["1"]
    row = measure_tracks(table, RUNS).table.iloc[0]
    assert row["omega_yr_rad_s"] == pytest.approx(YAW, rel=0.005)
    assert row["R_yr_cm"] == pytest.approx(100 * RADIUS, rel=0.01)
    assert row["theta_deg"] == pytest.approx(math.degrees(1.17), abs=1)
    assert [row["drift_x_cm_s"], row["drift_y_cm_s"]] == pytest.approx([0.06, -0.08], abs=0.005)


def test_a_film_that_is_upside_down_gives_the_same_circle_and_spins(tmp_path: Path) -> None:
    """The tank's frame turns with it, and nothing else; upside down in a mirror is named."""
    rows = []
    for turned in (False, True):
        tank = small(upside_down=turned)
        table = track_film(tank.film(tmp_path / "a.mp4", SWUM, 8.0, RATE), setup_of(tank, tmp_path)).tables["1"]
        rows.append(measure_tracks(table, RUNS).table.iloc[0])
    for column in ("omega_yr_rad_s", "R_yr_cm", "theta_deg", "omega_h_rpm", "omega_t_rpm"):
        assert rows[1][column] == pytest.approx(rows[0][column], rel=0.02)


@pytest.mark.parametrize(("mirrored", "rate"), [(True, RATE), (False, 5.0)])
def test_mirrored_and_slow_films_are_named_when_runs_are_measured(
    mirrored: bool, rate: float, tmp_path: Path
) -> None:
    tank, runs = small(mirrored=mirrored), RUNS.assign(omega_rpm=150.0)
    made, setup = tank.film(tmp_path / "a.mp4", SWUM, 6.0, rate), setup_of(tank, tmp_path)
    tracked = track_film(made, setup, motor_speed=150 * math.pi / 30)
    assert turn_sense(tracked.tables["1"]) == (-1 if mirrored else 1)
    table, slow = tracked.tables["1"], [note for note in tracked.notes if "aliasing" in note]
    if mirrored:
        with pytest.raises(InputError, match=r'other side .* looks = "up"'):
            measure_tracks(table, runs)
        assert not slow
        return
    measured = measure_tracks(table, runs)
    assert slow == [
        "5 frames a second cannot tell spins up to 150 rpm apart (aliasing); film with 10 or more, or slow the "
        "motor down"
    ]
    assert measured.excluded[0] == f"run a: no spin of the head: {slow[0]}"
    assert measured.table["R_yr_cm"][0] == pytest.approx(100 * RADIUS, rel=0.02)


def written(path: Path, pictures: Iterable[Any], rate: float = 10) -> bytes:
    """Write a film of JPEG pictures, and return the file."""
    first, *others = pictures
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), rate, first.shape[1::-1])
    for picture in (first, *others):
        writer.write(picture)
    writer.release()
    return path.read_bytes()


def swimming(tank: Tank, count: int = 60) -> Iterator[Any]:
    return (tank.frame(SWUM, k / 10) for k in range(count))


def without(film: bytes, dropped: range) -> bytes:
    """Leave frames of an AVI empty, as a camera does that drops them, and leave out its index."""
    at = film.index(b"movi") + 4
    parts = [film[:at]]
    for k in range(60):
        size = int.from_bytes(film[at + 4 : at + 8], "little")
        end = at + 8 + size + size % 2
        parts.append(film[at : at + 4] + bytes(4) if k in dropped else film[at:end])
        at = end
    return b"".join(parts)


def test_what_comes_after_a_hole_in_an_avi_is_refused_since_it_comes_too_early(tmp_path: Path) -> None:
    """An AVI has no time stamps, whatever its name; what is before the hole is tracked where it is asked for."""
    tank, path = small(), tmp_path / "film.avi"
    whole, setup = written(path, swimming(tank)), setup_of(tank, tmp_path)
    assert track_film(path, setup).notes == []
    half = len(whole) // 2
    hole = whole[:half] + bytes(len(whole) // 6) + whole[half + len(whole) // 6 :]
    path.write_bytes(hole)
    (tmp_path / "film.mp4").write_bytes(hole)
    for name, start, end in (("film.avi", 0, math.inf), ("film.mp4", 0, math.inf), ("film.avi", 3.5, 4.5)):
        with pytest.raises(InputError, match=r"states 60 frames, \d\d can be read"):
            track_film(tmp_path / name, setup, start=start, end=end)
    assert len(track_film(path, setup, end=2.0).tables["1"]) == 21


def test_frames_that_are_missing_are_counted_where_times_are_right(tmp_path: Path) -> None:
    tank, path = small(), tmp_path / "film.avi"
    whole, setup = written(path, swimming(tank)), setup_of(tank, tmp_path)
    for damaged, read in ((whole[: len(whole) * 2 // 5], 23), (without(whole, range(30, 40)), 50)):
        path.write_bytes(damaged)
        tracked = track_film(path, setup, end=9.0)
        assert tracked.notes[0].startswith(f"the film states 60 frames, {read} can be read: it is damaged or cut")
        assert len(tracked.tables["1"]) == read
        assert errors_of(tracked.tables["1"], SWUM)[0].max() < 0.02 * TAIL


def test_a_film_that_states_no_length_is_learnt_from_as_one_that_does(tmp_path: Path) -> None:
    path = tmp_path / "film.mkv"
    whole = written(path, swimming(small()))
    usual = [*Film(path).samples(12)]
    place = whole.index(b"\x44\x89\x88")  # the element Duration, with eight bytes
    path.write_bytes(whole[:place] + b"\xec\x89" + bytes(9) + whole[place + 11 :])  # Void
    assert Film(path).count == 60
    assert np.array_equal([*Film(path).samples(12)], usual)
    path.write_bytes(whole[: len(whole) * 2 // 5])
    different = [picture.tobytes() for picture in Film(path).samples(12)]
    assert 1 < len(different) == len({*different})


def test_a_large_film_is_learnt_from_in_small_pictures(tmp_path: Path) -> None:
    """It takes fewer bytes than twelve of its pictures have; progress begins before they are looked at."""
    tank, path, told = small(), tmp_path / "film.avi", list[int]()
    written(path, (cv2.resize(picture, (3840, 2880)) for picture in swimming(tank, 24)))
    setup = setup_of(replace(tank, width=3840, height=2880, scale=0.001 / 12, fine=1), tmp_path)

    def tell(done: int, count: int) -> None:
        if not told:
            tracemalloc.start()
        told.append(done)

    table = track_film(path, setup, progress=tell).tables["1"]
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert told[:2] == [0, 0]
    assert most < 12 * 3840 * 2880 * 3
    assert len(table) == 24
    assert errors_of(table, SWUM)[0].max() < 0.02 * TAIL


def test_a_frozen_camera_shows_no_robot(tmp_path: Path) -> None:
    tank, path = small(), tmp_path / "film.avi"
    setup_of(tank, tmp_path)
    written(path, (FROZEN + 5) * [tank.frame(SWUM, 0.0)], 50)
    sights = [*watch(str(path), str(tmp_path / "view.toml"), "1", TAIL, 0.0)(time.monotonic)]
    assert [sight.pose is not None for sight in sights] == FROZEN * [True] + 5 * [False]
    assert sights[-1].why.endswith("is the camera frozen?")
