"""All formats of files that people bring: a valid example of each, and the function that reads it.

Whatever a file holds, its reader returns a result, or raises an `InputError` of one line that names the file, or
another one in its folder; nothing else, and no warning. Files that are protected by a hash appear twice: as they
are, and as somebody could forge them, with the hash of their changed content (`seal`).
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from calibration.findings.next_runs import read_explanations
from calibration.swim.measured_swim import read_swims
from calibration.swimmer.measured_table import read_measurements
from camera.measured_runs import measure_tracks
from camera.pose_tracks import read_tracks
from common.errors import InputError, InputWarning, naming
from common.tables import read_table
from common.track_options import Source
from dataset.data_set import MANIFEST, SWEEP, batches, read_design
from dataset.design import SWEEP_TOML, load_design
from dataset.folder import Folder
from dataset.schema import schema
from dataset.shards import BadFileError, checked_part, file_name
from planner.files.saved_plan import load_goal, load_plan, restore_plan
from planner.options import read_regions
from planner.paths.path_files import read_path
from planner.vehicle.from_table import default_table
from sim.inputs import check_columns, load_robot
from sim.knowledge import read_knowledge
from sim.model.robot_toml import robot_toml
from sim.model.schedule import load_schedule
from surrogate.robot_table import load_robot_table
from surrogate.table_file import SHIPPED, load
from tests.calibration.zigzag import PLAN, track
from tests.camera import tracked_files
from tests.oracles.example_files import (
    JSON,
    NOTED,
    ROBOT,
    SVG,
    SVG_TOKENS,
    TABLE,
    TOML,
    Files,
    corrected,
    file,
    json_of,
    model_content,
    of_data_set,
    parquet,
    plan_file,
    replayed,
    robot_table,
    robot_table_file,
    robots,
    runs,
    samples,
    sealed_manifest,
    sealed_model,
    sealed_robot_table,
    sealed_sweep,
    spreadsheet,
    text,
    verdict,
)
from tests.oracles.mutations import changed_content, mutated
from tests.planner.plans import goal_file
from tracking.tracker import Tracker
from tracking.tracks import tracking_error


@dataclass(frozen=True)
class FileFormat:
    """A format of files; with `seal`, entries of the content are changed, not bytes."""

    example: Callable[[], Files]  # a valid file, and the files beside it that its reader needs
    read: Callable[[Path], object]  # reads the file of this path, and checks what it returns
    tokens: tuple[bytes, ...] = ()  # what matters to the format
    seal: Callable[[Any], bytes] | None = None  # makes the file, with its hash, of its content
    content: Callable[[], Any] | None = None  # of the example
    first_bytes: int | None = None  # that are mutated: a header, where the rest is numbers

    def install(self, folder: Path) -> Path:
        """Write the example into a folder; return the path of the file that is read."""
        for name, data in self.example().items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)
        return folder / next(iter(self.example()))

    def mutated(self, random: Random) -> bytes:
        """Mutate the example's file."""
        if self.seal is None or self.content is None:
            data = next(iter(self.example().values()))
            rest = b"" if self.first_bytes is None else data[self.first_bytes :]
            return mutated(data[: self.first_bytes], self.tokens, random) + rest
        return self.seal(changed_content(self.content(), random))


def judged(form: FileFormat, path: Path) -> bool:
    """Read a file; return whether it was read, or refused in one line that names it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", InputWarning)
            form.read(path)
    except InputError as refusal:
        message = str(refusal)
        assert len(message.splitlines()) == 1, f"more than one line: {message!r}"
        assert path.name in message or str(path.parent) in message, f"it does not name {path.name}: {message!r}"
        return False
    return True


def _finite(*values: Any) -> None:
    for value in values:
        assert np.isfinite(np.asarray(value, dtype=float)).all(), "a result is not finite"


def _read_robot(path: Path) -> None:
    robot, knowledge = load_robot(path), read_knowledge(path)
    _finite(robot.time_scale, knowledge.covariance)
    with naming(path):  # a law holds within its runs
        _finite(list(robot.group_values().values()))
    again = path.with_name("again.toml")
    again.write_text(robot_toml(robot), encoding="utf-8")
    assert load_robot(again) == robot, "it is not read back as it was"


def _read_robots(path: Path) -> None:
    table = read_table(path)
    with naming(path):
        columns = check_columns({str(name): table[name].to_numpy() for name in table})
    _finite(*columns.values())


def _read_design(path: Path) -> None:
    sweep = load_design(path)
    _finite(*sweep.with_rows(4).points().values())


def _read_rows(path: Path) -> None:
    for batch in batches(path.parent):
        assert batch.num_rows


def _read_sweep(path: Path) -> None:
    _, design = read_design(Folder(path.parent))
    _finite(*design.with_rows(4).points().values())


def _read_shard(path: Path) -> None:
    try:
        checked_part(path.read_bytes(), 0, 16, schema(), json_of(SWEEP)["key"])
    except BadFileError as bad:  # such a file is removed, and its rows are simulated again
        raise InputError(f"{path}: {bad}") from None


def _read_robot_table(path: Path) -> None:
    table = load_robot_table(path)
    columns = {name: np.array([value]) for name, value in table.robot.items()}
    _finite(*(table.query(columns)[name] for name in ("omega_yr_bar", "v_x", "v_z")))
    response = table.response(columns)
    _finite(response.lag, response.memory, response.rest, response.spread)


def _read_model(path: Path) -> None:
    _finite(*load(path).query({name: np.array([value]) for name, value in ROBOT.group_values().items()}).values())


def _read_path(path: Path) -> None:
    drawing = read_path(path)
    _finite(drawing.path.points, drawing.path.length, drawing.unit or 1.0)
    assert len(drawing.path.points) >= 2


def _read_plan(path: Path) -> None:
    content, schedule = load_plan(path), load_schedule(path)
    _finite(schedule.dwells, schedule.start, content["stated_error_over_l"])


def _read_saved_plan(path: Path) -> None:
    command = Tracker(restore_plan(path, lookup=default_table())).command
    _finite(command.flip_at, command.error)


def _read_goal(path: Path) -> None:
    content = load_goal(path)
    _finite(content["start"], content["goal"], content["predicted_end"], content["margin_over_l"])


def _read_track(path: Path) -> None:
    content = load_plan(path.with_name("plan.json"))
    with naming(path):
        error = tracking_error(content, read_table(path))
    _finite(error.rms, error.largest, error.raw_rms)


def _read_runs(path: Path) -> None:
    runs = read_measurements(path)
    _finite(runs.y, runs.inputs, runs.length, runs.omega, runs.noted)


def _measure(path: Path) -> None:
    table = measure_tracks(path.with_name("tracks.csv"), path.with_name("runs.csv")).table
    for name in ("omega_yr_rad_s", "R_yr_cm", "v_cm_s"):
        assert name not in table or not np.isinf(table[name]).any(), "a result is infinite"


def _read_swims(plan: dict[str, Any] | None, path: Path) -> None:
    for swum in read_swims(read_tracks(path), plan, file=path):
        _finite(swum.time, swum.poses, swum.flips, swum.flip_error)
        assert (np.diff(swum.time) > 0).all(), "times do not increase"
        assert (swum.dwells > 0).all(), "a dwell has no length"


def _read_tracks(source: Source, options: dict[str, Any], path: Path) -> None:
    table = read_tracks(path, written_by=source, **options)
    _finite(table.drop(columns="run"))


def _tracked(name: str, source: Source, content: Callable[[], bytes], **options: Any) -> FileFormat:
    """Say how a file of another program is made and read."""
    return FileFormat(
        file(name, content), partial(_read_tracks, source, options), () if name.endswith("npy") else TABLE
    )


def _read_verdict(path: Path) -> None:
    explanations, sessions = read_explanations(path)
    for explanation in explanations:
        size = len(explanation.parameters)
        assert explanation.covariance.shape == (size, size), "a covariance of another size"
        _finite(explanation.covariance, list(explanation.parameters.values()), explanation.noise.run_covariance)
        _finite(explanation.noise.session_ratio)
        hash(explanation.title)
    assert all(isinstance(session, str) for session in sessions)


FORMATS: dict[str, FileFormat] = {
    "robot": FileFormat(file("robot.toml", lambda: robot_toml(ROBOT).encode()), _read_robot, TOML),
    "corrected robot": FileFormat(file("corrected.toml", corrected), _read_robot, TOML),
    "sweep": FileFormat(file("sweep.toml", SWEEP_TOML.read_bytes), _read_design, TOML),
    "sweep.json": FileFormat(partial(of_data_set, SWEEP), _read_sweep, JSON),
    "sweep.json, sealed": FileFormat(
        partial(of_data_set, SWEEP), _read_sweep, JSON, sealed_sweep, partial(json_of, SWEEP)
    ),
    "manifest": FileFormat(partial(of_data_set, MANIFEST), _read_rows, JSON),
    "manifest, sealed": FileFormat(
        partial(of_data_set, MANIFEST), _read_rows, JSON, sealed_manifest, partial(json_of, MANIFEST, "digest")
    ),
    "file of rows": FileFormat(partial(of_data_set, file_name(0, 16)), _read_shard),
    "table of robots": FileFormat(file("robots.csv", lambda: text(robots())), _read_robots, TABLE),
    "table of robots, Parquet": FileFormat(file("robots.parquet", parquet), _read_robots),
    "table of robots, xlsx": FileFormat(file("robots.xlsx", spreadsheet), _read_robots),
    "table of one robot": FileFormat(file("robot.table.json", robot_table_file), _read_robot_table, JSON),
    "table of one robot, sealed": FileFormat(
        file("robot.table.json", robot_table_file), _read_robot_table, JSON, sealed_robot_table, robot_table
    ),
    "model": FileFormat(
        file("model.safetensors", SHIPPED.read_bytes), _read_model, JSON, first_bytes=20_000
    ),
    "model, sealed": FileFormat(
        file("model.safetensors", SHIPPED.read_bytes), _read_model, JSON, sealed_model, model_content
    ),
    "path": FileFormat(file("path.csv", lambda: text({"x": [0, 1, 2.5], "y": [0, 1.5, 1]})), _read_path, TABLE),
    "drawing": FileFormat(file("path.svg", lambda: SVG), _read_path, SVG_TOKENS),
    "region": FileFormat(
        file("region.csv", lambda: text({"x": [0, 1, 1, 0], "y": [0, 0, 1, 1]})),
        lambda path: read_regions(str(path), "cm", ROBOT), TABLE,
    ),
    "plan": FileFormat(file("plan.json", plan_file), _read_plan, JSON),
    "plan to track": FileFormat(file("plan.json", plan_file), _read_saved_plan, JSON),
    "goal": FileFormat(file("goal.json", goal_file), _read_goal, JSON),
    "replayed track": FileFormat(file("track.csv", replayed, plan_json=plan_file), _read_track, TABLE),
    "measured runs": FileFormat(file("table.csv", lambda: text(runs())), _read_runs, TABLE),
    "camera tracks": FileFormat(
        file("tracks.csv", lambda: text(samples()), runs_csv=lambda: text(NOTED)), _measure, TABLE
    ),
    "runs of camera tracks": FileFormat(
        file("runs.csv", lambda: text(NOTED), tracks_csv=lambda: text(samples())), _measure, TABLE
    ),
    "swim": FileFormat(
        file("track.csv", lambda: text(track(1.2).round(4))), partial(_read_swims, None), TABLE
    ),
    "swim as planned": FileFormat(
        file("track.csv", lambda: text(track(1.2).round(4).drop(columns="direction"))),
        partial(_read_swims, PLAN), TABLE,
    ),
    "DeepLabCut": _tracked("a.csv", "deeplabcut", tracked_files.deeplabcut, scale="0.5mm", fps=25.0),
    "SLEAP": _tracked("a.csv", "sleap", tracked_files.sleap, scale="0.5mm", fps=25.0),
    "TrackMate": _tracked("a.csv", "trackmate", tracked_files.trackmate, scale="1mm", front="0", rear="1"),
    "TrackMate, XML": _tracked(
        "a.xml", "trackmate", tracked_files.trackmate_xml, scale="1mm", fps=25.0, front="0", rear="1"
    ),
    "Tracker": _tracked("a.txt", "tracker", tracked_files.tracker, scale="1cm"),
    "idtracker.ai": _tracked(
        "a.csv", "idtrackerai", tracked_files.idtrackerai_csv, scale="1mm", front="1", rear="2"
    ),
    "Motive": _tracked("a.csv", "motive", tracked_files.motive),
    "verdict": FileFormat(file("verdict.json", lambda: json.dumps(verdict()).encode()), _read_verdict, JSON),
}  # fmt: skip
