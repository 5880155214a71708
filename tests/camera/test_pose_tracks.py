"""Tracks of other programs: the same poses from every program's file, what is lost, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from camera.pose_tracks import read_tracks
from common.errors import InputError
from tests.camera import tracked_files as files
from tests.camera.tracked_files import FPS, poses

FILMED: dict[str, Any] = {"scale": "0.5mm", "fps": FPS}
TRACKS = {"front": "0", "rear": "1"}
ANIMALS = {"front": "1", "rear": "2"}
WRITTEN: dict[str, tuple[str, bytes | Callable[[Path], None], dict[str, Any]]] = {
    "run3DLC_resnet50_swim.csv": ("deeplabcut", files.deeplabcut(), FILMED),
    "run3DLC_resnet50_swim.h5": ("deeplabcut", files.deeplabcut_h5, FILMED),
    "run3.analysis.csv": ("sleap", files.sleap(), FILMED),
    "run3.analysis.h5": ("sleap", files.sleap_h5, FILMED),
    "older.analysis.h5": ("sleap", partial(files.sleap_h5, scores=False), FILMED),
    "spots.csv": ("trackmate", files.trackmate(), {"scale": "0.5mm", **TRACKS}),
    "older.csv": ("trackmate", files.trackmate_older(), {**FILMED, **TRACKS}),
    "run3.xml": ("trackmate", files.trackmate_xml(), {**FILMED, **TRACKS}),
    "run3_Tracks.xml": ("trackmate", files.trackmate_tracks(), {"scale": "0.5mm", **TRACKS}),
    "run3.txt": ("tracker", files.tracker(), {"scale": "1cm"}),
    "trajectories.csv": ("idtrackerai", files.idtrackerai_csv(), {"scale": "0.5mm", **ANIMALS}),
    "trajectories.h5": ("idtrackerai", files.idtrackerai_h5, {"scale": "0.5mm", **ANIMALS}),
    "take.csv": ("motive", files.motive(), {}),
    "trajectory.tum": ("tum", files.tum(), {}),
    "markers.csv": ("motive", files.motive(), {"front": "front", "rear": "rear"}),
}


def written(name: str, folder: Path) -> Path:
    """Write a file; the test is skipped where it needs h5py and that is missing."""
    content = WRITTEN[name][1]
    if isinstance(content, bytes):
        (folder / name).write_bytes(content)
    else:
        pytest.importorskip("h5py", reason="HDF5 needs h5py: pip install 'softflagella[hdf5]'")
        content(folder / name)
    return folder / name


@pytest.mark.parametrize("name", WRITTEN)
def test_every_file_has_the_same_poses(name: str, tmp_path: Path) -> None:
    source, _, options = WRITTEN[name]
    path = written(name, tmp_path)
    table = read_tracks(path, written_by=source, **options)
    assert table["run"].unique().tolist() == [path.stem.partition("DLC")[0]]
    seen, expected = table.drop(columns="run"), poses()
    seen["heading_deg"] = np.degrees(np.unwrap(np.radians(seen["heading_deg"])))
    pd.testing.assert_frame_equal(seen.reset_index(drop=True), expected, rtol=1e-6, atol=1e-6)
    assert table.attrs["lost"] == [f"{path}: 1 of 40 poses are lost"]
    moved = read_tracks(path, written_by=source, **options, origin=(2.0, -1.0))
    unit = {"tracker": 1.0, "motive": 100.0, "tum": 100.0}.get(source, 0.05)
    assert moved["x_cm"].to_numpy() == pytest.approx(table["x_cm"].to_numpy() - 2 * unit)
    turned = -1.0 if source in ("tracker", "tum") else 1.0
    assert moved["y_cm"].to_numpy() == pytest.approx(table["y_cm"].to_numpy() - unit * turned)


def test_each_robot_of_a_film_and_each_film_of_a_folder_is_a_run(tmp_path: Path) -> None:
    (tmp_path / "aDLC_x.csv").write_bytes(files.deeplabcut())
    (tmp_path / "bDLC_x.csv").write_bytes(files.two_robots())
    (tmp_path / "bDLC_x.h5").write_bytes(b"")  # the same film
    table = read_tracks(tmp_path, written_by="deeplabcut", **FILMED)
    x = table.groupby("run")["x_cm"].first()
    assert list(x.index) == ["a", "b one", "b two"]
    assert x.to_numpy() - x["a"] == pytest.approx([0, 0, 5])
    assert len(table.attrs["lost"]) == 2
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"has no files of Tracker: .txt, .csv"):
        read_tracks(tmp_path / "empty", written_by="tracker")


def test_of_a_point_that_is_seen_twice_at_a_time_the_first_counts(tmp_path: Path) -> None:
    """A track of TrackMate that splits has two spots in a frame."""
    path = tmp_path / "spots.csv"
    path.write_bytes(files.trackmate() + b"ID990,990,1,9.5,5,5,0,0,0,3\n")
    table = read_tracks(path, written_by="trackmate", scale="0.5mm", **TRACKS)
    assert table["x_cm"].to_numpy() == pytest.approx(poses()["x_cm"].to_numpy())


@pytest.mark.parametrize(("name", "options", "words"), [
    ("run3DLC_resnet50_swim.csv", {"scale": "0.5mm"}, "counts frames; give the frames per second"),
    ("run3DLC_resnet50_swim.csv", {"fps": 0.0, "scale": "0.5mm"}, "counts frames; give the frames per second"),
    ("run3DLC_resnet50_swim.csv", {"fps": 25.0}, "has no unit of length; give the length of a pixel"),
    ("run3DLC_resnet50_swim.csv", {"fps": 25.0, "scale": "0.5"}, r"--scale 0.5; give the length of a pixel"),
    ("run3DLC_resnet50_swim.csv", {"fps": 25.0, "scale": "2s"}, r"--scale 2s; give the length of a pixel"),
    ("run3DLC_resnet50_swim.csv", {**FILMED, "rear": "tail"}, "has no point 'tail' but front, rear; a heading"),
    ("run3DLC_resnet50_swim.csv", {**FILMED, "rear": "front"}, "heading; --front and --rear are both 'front'"),
    ("run3DLC_resnet50_swim.csv", {**FILMED, "origin": (np.nan, 0.0)}, "--origin nan 0; give two finite numbers"),
    ("spots.csv", FILMED, "has its own units; leave out --fps"),
    ("take.csv", {"scale": "0.5mm"}, "has its own units; leave out --scale"),
    ("spots.csv", {"fps": 25.0, **TRACKS}, "leave out --fps, and it has no unit of length; .* --scale 0.2mm"),
    ("run3.xml", TRACKS, "counts frames; .* --fps 30, and it has no unit of length; .* --scale 0.2mm"),
    ("run3.xml", {}, "--fps 30, and it has no unit of length; .* no point 'front' and no 'rear' but 0, 1"),
    ("run3.xml", {**FILMED, "fps": 1e-320}, "counts frames; give the frames per second"),
])  # fmt: skip
def test_what_is_missing_or_too_much_is_said(
    name: str, options: dict[str, Any], words: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=words):
        read_tracks(written(name, tmp_path), written_by=WRITTEN[name][0], **options)


def test_a_file_without_its_program_is_told_all_that_is_missing(tmp_path: Path) -> None:
    needs = "--from trackmate; it counts frames; .*--fps 30; it has no unit of length; .*; it has no point 'front'"
    with pytest.raises(InputError, match=needs):
        read_tracks(written("run3.xml", tmp_path))


@pytest.mark.parametrize("name", [name for name in WRITTEN if name != "trajectory.tum"])
def test_a_file_of_another_program_is_recognized(name: str, tmp_path: Path) -> None:
    path = written(name, tmp_path)
    if name == "markers.csv":
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    source = WRITTEN[name][0]
    with pytest.raises(InputError, match=f"is no table of poses; say what wrote it: --from .*{source}"):
        read_tracks(path)
    other: Any = "motive" if source != "motive" else "sleap"
    with pytest.raises(InputError, match=rf"{path.name} is not as (Motive|SLEAP) writes it \(") as refusal:
        read_tracks(path, written_by=other)
    assert len(str(refusal.value).splitlines()) == 1


def test_options_without_a_program_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--fps is for .*--from"):
        read_tracks(tmp_path / "track.csv", fps=30.0)


def test_without_a_program_a_table_is_read_as_it_is(tmp_path: Path) -> None:
    poses().to_csv(tmp_path / "track.csv", index=False)
    table = read_tracks(tmp_path / "track.csv", written_by=None)
    pd.testing.assert_frame_equal(table.reset_index(drop=True), poses())


@pytest.mark.parametrize(("first", "comments"), [(0, b""), (2, b""), (2, b"# of a run\n# frame: /camera\n")])
def test_a_trajectory_with_its_own_units_needs_no_options(first: int, comments: bytes, tmp_path: Path) -> None:
    path = tmp_path / "trajectory.txt"
    path.write_bytes(comments + b"\n".join(files.tum().splitlines()[first:]) + b"\n")
    table = read_tracks(path).drop(columns="run")
    assert table.to_numpy() == pytest.approx(poses().to_numpy(), abs=1e-5)
    path.write_text("# time_s x_cm y_cm heading_deg a b c d\n" + "0 1 2 3 4 5 6 7\n")
    assert read_tracks(path)["heading_deg"].tolist() == [3]


@pytest.mark.parametrize("interval", ["0", "-0.04", "inf", "nan"])
def test_intervals_that_cannot_be_are_refused(interval: str, tmp_path: Path) -> None:
    path = tmp_path / "tracks.xml"
    path.write_bytes(files.trackmate_tracks().replace(b'"0.04"', f'"{interval}"'.encode()))
    with pytest.raises(InputError, match=r"frameInterval is .*; correct it, above 0 and finite"):
        read_tracks(path, written_by="trackmate", scale="0.5mm", **TRACKS)


def test_a_pickle_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "trajectories.npy"
    np.save(path, {"trajectories": np.zeros((4, 2, 2)), "frames_per_second": 25}, allow_pickle=True)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"npy: it is a pickle.* export CSV or HDF5 from idtracker.ai"):
        read_tracks(path, written_by="idtrackerai", scale="0.5mm")
