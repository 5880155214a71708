"""What a robot is calibrated with: a table of runs or a track, from a file, a pipe or another program."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from calibration.swim.measured_swim import MeasuredSwim, read_swims
from common.errors import InputError
from softflagella.__main__ import main
from tests.calibration.toy_tables import toy_table
from tests.calibration.zigzag import PLAN, track
from tests.camera.tracked_files import deeplabcut

PIXELS = 0.05  # cm
FILMED: dict[str, Any] = {"written_by": "deeplabcut", "scale": "0.5mm", "fps": 2.5}


class ReadError(Exception):
    """The swims were read, and are not fitted."""


@pytest.fixture
def swims(monkeypatch: pytest.MonkeyPatch) -> list[MeasuredSwim]:
    """Collect the swims that would be fitted."""
    fitted: list[MeasuredSwim] = []

    def collect(robot: object, swims: list[MeasuredSwim], **settings: object) -> NoReturn:
        fitted.extend(swims)
        raise ReadError

    monkeypatch.setattr("softflagella.robot_loop.swim_model", collect)
    return fitted


def filmed(folder: Path, **names: str) -> Path:
    """Write a track as DeepLabCut would, with two dots, 12 pixels before and behind the head's centre."""
    table = track()
    frames = np.rint(table["time_s"] * FILMED["fps"]).astype(int)
    heading = np.radians(table["heading_deg"])
    columns: dict[tuple[str, str], Any] = {}
    for name, side in (("front", 12), ("rear", -12)):
        part = names.get(name, name)
        columns[part, "x"] = table["x_cm"] / PIXELS + side * np.cos(heading) + 900
        columns[part, "y"] = 700 - table["y_cm"] / PIXELS - side * np.sin(heading)
        columns[part, "likelihood"] = np.ones(len(table))
    written = pd.DataFrame(columns).set_index(frames)
    written.columns = pd.MultiIndex.from_tuples([("net", *name) for name in columns])
    written.columns.names = ["scorer", "bodyparts", "coords"]
    written.to_csv(folder / "swimDLC_net.csv")
    return folder / "swimDLC_net.csv"


@contextmanager
def piped(table: pd.DataFrame) -> Iterator[str]:
    """Hand a table over as a shell does; it is short."""
    reading, writing = os.pipe()
    os.write(writing, table.round(4).to_csv(index=False).encode())
    os.close(writing)
    try:
        yield f"/dev/fd/{reading}"
    finally:
        os.close(reading)


def test_the_track_of_another_program_is_calibrated_with(swims: list[MeasuredSwim], tmp_path: Path) -> None:
    (expected,) = read_swims(track().drop(columns="direction"), PLAN)
    file = filmed(tmp_path)
    with pytest.raises(ReadError):
        sf.calibrate(file, "paper-control", plan=PLAN, **FILMED, origin=(900.0, 700.0))
    (swum,) = swims
    assert swum.name == "swim"
    assert swum.poses == pytest.approx(expected.poses, abs=1e-9)
    assert swum.flips == pytest.approx(expected.flips, abs=1e-6)


def test_the_command_has_the_options_of_check(
    swims: list[MeasuredSwim], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a folder each file is a swim."""
    monkeypatch.setattr("calibration.swim.measured_swim.load_plan", {"plan.json": PLAN}.get)
    folder = tmp_path / "tracked"
    folder.mkdir()
    filmed(folder, front="tip", rear="disc").rename(folder / "firstDLC_net.csv")
    filmed(folder, front="tip", rear="disc").rename(folder / "secondDLC_net.csv")
    words = ["calibrate", str(folder), "--robot", "paper-control", "--plan", "plan.json", "--out", str(tmp_path)]
    options = ["--front", "tip", "--rear", "disc", "--scale", "0.5mm", "--fps", "2.5"]
    with pytest.raises(InputError, match="--front is for tracks of another program; say which with --from"):
        main([*words, "--front", "tip"])
    with pytest.raises(InputError, match="has no point 'front' and no 'rear' but tip, disc"):
        main([*words, "--from", "deeplabcut", *options[4:]])
    with pytest.raises(ReadError):
        main([*words, "--from", "deeplabcut", *options])
    assert [swum.name for swum in swims] == ["first", "second"]


@pytest.mark.parametrize("options", [
    {"written_by": "deeplabcut", "scale": "1mm", "fps": 25.0},
    {"written_by": "idtrackerai", "scale": "1mm"},
    {"written_by": "tum"},
    {"scale": "1mm"},
])  # fmt: skip
def test_a_table_of_runs_has_no_program(options: Any, tmp_path: Path) -> None:
    file = tmp_path / "runs.csv"
    toy_table(3).drop(columns="session").to_csv(file, index=False)
    with pytest.raises(InputError) as refusal:
        sf.calibrate(file, "paper-control", **options)
    assert str(refusal.value) == (
        f"{file} is no track of another program; a table of runs is read without --from and its options"
    )


def test_options_are_for_files_and_for_robots(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="scale is for the file of another program, not for a DataFrame"):
        sf.calibrate(track(), "paper-control", plan=PLAN, written_by=None, scale="1mm")
    model = sf.Model(
        lambda columns, numbers: {"v": numbers["k"]}, {"v": sf.Output("speed")}, [sf.Number("k", 1.0)]
    )
    with pytest.raises(InputError, match="written_by is not for a model of your own"):
        sf.calibrate("falls.csv", model, written_by="tum")
    file = tmp_path / "swimDLC.csv"
    file.write_bytes(deeplabcut())
    with pytest.raises(InputError, match=f"{file} is no table of poses; say what wrote it: --from deeplabcut"):
        sf.calibrate(file, "paper-control")


def test_a_table_is_read_once(swims: list[MeasuredSwim]) -> None:
    """A pipe can be read no more than once."""
    with piped(toy_table(3)[:20]) as pipe, pytest.raises(InputError, match=f"{pipe}: 20 usable runs"):
        sf.calibrate(pipe, "paper-control")
    with piped(track()) as pipe, pytest.raises(ReadError):
        sf.calibrate(pipe, "paper-control")
    assert len(swims) == 1
