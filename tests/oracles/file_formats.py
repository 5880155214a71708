"""All formats of files that people bring: a valid example of each, and the function that reads it.

The contract of every reader, whatever a file holds: it returns a result, or it raises an `InputError` of one line
that names the file, or another one in its folder; nothing else, and no warning. `judged` checks it. Files that are protected by a hash appear
twice: as they are, and as somebody could forge them, with the hash of their changed content (`seal`).
"""

from __future__ import annotations

import io
import json
import tempfile
import warnings
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pandas as pd

from calibration.statistics.statistical_model import Noise
from calibration.swimmer.camera_tracks import measure_tracks
from calibration.swimmer.measured_table import read_measurements
from calibration.verdict.sequential_test import Explanation, read_explanations
from dataset.build.sweep_folder import load_sweep, sweep_key
from dataset.rows.design import SWEEP_TOML, load_design
from dataset.rows.schema import arrow_table, schema
from dataset.rows.version import rows_version
from dataset.storage.data_set import MANIFEST, ROWS, SWEEP, batches, manifest_content, write_manifest
from dataset.storage.shards import BadShardError, Shard, check_shard, shard_name, write_shard
from dataset.storage.storage import open_storage
from planner.files.goal_files import read_region
from planner.files.plan_files import write_plan
from planner.files.plan_json import load_plan
from planner.files.tracking_error import tracking_error
from planner.paths.path import circle
from planner.paths.path_files import read_path
from planner.planning.plan import plan
from planner.vehicle.calibration_table import CalibrationKnowledge, knowledge_toml, read_knowledge
from sim.inputs import check_columns, load_robot, robot_toml
from sim.io.errors import InputError, naming
from sim.io.provenance import fingerprint
from sim.io.tables import read_table
from sim.model.correction import Correction
from sim.model.presets import PRESETS
from sim.model.schedule import load_schedule
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.one_robot.robot_table import RobotTable, _digest, load_robot_table, save_robot_table
from surrogate.table import tensor_file
from surrogate.table.model_file import FORMAT, SHIPPED, load
from tests.calibration.toy_tables import install_toy, toy_table
from tests.calibration.track import track
from tests.dataset.sweeps import design, invented
from tests.oracles.mutations import changed_content, mutated

ROBOT = PRESETS["paper-control"]
Files = Mapping[str, bytes]  # by name; the first is the one that is mutated


@dataclass(frozen=True)
class FileFormat:
    """A format of files.

    Attributes:
        example: a valid file, and the files beside it that its reader needs.
        read: reads the file of this path; what it returns has been checked.
        tokens: what matters to the format.
        seal: makes the file, with its hash, of its content; then entries of the content are changed, not bytes.
        content: of the example, if `seal` is given.
        first_bytes: how much of the file is mutated: its header, where the rest is numbers.
    """

    example: Callable[[], Files]
    read: Callable[[Path], object]
    tokens: tuple[bytes, ...] = ()
    seal: Callable[[Any], bytes] | None = None
    content: Callable[[], Any] | None = None
    first_bytes: int | None = None

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
    """Read a file; return whether it was read (or refused).

    Raises:
        AssertionError: a refusal is not one line that names the file.
        Exception: whatever the reader raised.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
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


def _text(columns: Mapping[str, Any]) -> bytes:
    return pd.DataFrame(columns).to_csv(index=False).encode()


# Robots and sweeps


def _read_robot(path: Path) -> None:
    robot, knowledge = load_robot(path), read_knowledge(path)
    _finite(robot.time_scale, knowledge.covariance)
    with naming(path):  # a correction holds within its runs
        _finite(list(robot.group_values().values()))
    again = path.with_name("again.toml")
    again.write_text(robot_toml(robot), encoding="utf-8")
    assert load_robot(again) == robot, "it is not read back as it was"


@cache
def _corrected() -> bytes:
    low = (2.0, 1.9, -6.0)
    correction = Correction(low, (1.0, 0.2, 0.5), low, (4.0, 2.1, -4.0), ((0, 0, 0), (1, 0, 2)),
                            {"C_t": (0.1, 0.0), "surface_couple": (0.2, -0.1)}, 0.02, 0.05)  # fmt: skip
    robot = replace(ROBOT, effects={"end_over_end_drag": 4.5}, disc_offset=0.012, correction=correction)
    knowledge = CalibrationKnowledge(("C_t", "viscosity"), np.array([[0.01, 0.001], [0.001, 0.02]]), (1e-4, 0.0))
    return f"{robot_toml(robot)}\n{knowledge_toml(knowledge)}".encode()


def _read_robots(path: Path) -> None:
    table = read_table(path)
    with naming(path):
        columns = check_columns({str(name): table[name].to_numpy() for name in table})
    _finite(*columns.values())


@cache
def _robots() -> pd.DataFrame:
    rows = [{**ROBOT.group_values(), "omega_bar": speed, "a_over_R": 1.0} for speed in (8.0, 10.0, 12.0)]
    return pd.DataFrame(rows)


def _parquet() -> bytes:
    file = io.BytesIO()
    _robots().to_parquet(file)
    return file.getvalue()


def _spreadsheet() -> bytes:
    file = io.BytesIO()
    _robots().to_excel(file, index=False)
    return file.getvalue()


def _read_design(path: Path) -> None:
    sweep = load_design(path)
    _finite(*sweep.with_rows(4).points().values())


# Data sets


@cache
def _data_set() -> dict[str, bytes]:
    """Make a finished data set of 16 synthetic rows."""
    sweep = design(16)
    config, code, by = sweep.config(), rows_version(), "dataset.rows.simulate.simulate"
    key = sweep_key(config, code, by)
    points = {**sweep.points(), "history": sweep.history()}
    with tempfile.TemporaryDirectory() as folder:
        storage = open_storage(folder)
        rows = arrow_table({**invented(points), "row": sweep.indices()}, schema())
        contents = write_shard(storage, shard_name(ROWS, 0, 16), rows, key)
        write_manifest(storage, manifest_content(config, key, code, [], [contents]))
        storage.write(SWEEP, json.dumps({"config": config, "code": code, "rows_by": by, "key": key}) + "\n")
        files = [path for path in Path(folder).rglob("*") if path.is_file()]
        return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def _of_data_set(first: str) -> Files:
    return {first: _data_set()[first], **_data_set()}


def _json_of(name: str, *left_out: str) -> Any:
    content = json.loads(_data_set()[name])
    return {key: value for key, value in content.items() if key not in left_out}


def _read_rows(path: Path) -> None:
    for batch in batches(path.parent):
        assert batch.num_rows


def _read_sweep(path: Path) -> None:
    sweep, function = load_sweep(open_storage(path.parent))
    _finite(*sweep.with_rows(4).points().values())
    assert isinstance(function, str)


def _read_shard(path: Path) -> None:
    storage, key = open_storage(path.parents[1]), _json_of(SWEEP)["key"]
    try:
        check_shard(storage, Shard(f"{ROWS}/{path.name}", 0, 16), schema(), key)
    except BadShardError as bad:  # such a shard is removed, and its rows are simulated again
        raise InputError(f"{path}: {bad}") from None


def _sealed_sweep(content: Any) -> bytes:
    if isinstance(content, dict) and {"config", "code", "rows_by"} <= set(content):
        content = {**content, "key": sweep_key(content["config"], content["code"], content["rows_by"])}
    return json.dumps(content).encode()


def _sealed_manifest(content: Any) -> bytes:
    if isinstance(content, dict):
        content = {**content, "digest": fingerprint(content)}
    return json.dumps(content).encode()


# Look-up tables


@cache
def _robot_table() -> dict[str, Any]:
    """Take the table of one robot from the look-up table; the simulator would take seconds."""
    groups, table = ROBOT.group_values(), load()
    both = {name: np.array([value, value]) for name, value in groups.items()}
    both["omega_bar"] = groups["omega_bar"] * np.array([1.0, -1.0])
    outputs, response = table.query(both), table.response(both)
    curves = {name: getattr(response, name).tolist() for name in ("lag", "memory", "rest", "spread")}
    made = RobotTable(
        robot=groups,
        steady={name: outputs[name].tolist() for name in STEADY_OUTPUTS},
        **curves,
        before=np.asarray(response.before).tolist(),
        slopes={"C_t": [[0.1, 0.2, 0.3], [0.1, 0.2, 0.3]]},
        errors={"omega_yr_bar": {"rms": 0.01}},
        provenance={"code_version": "0"},
    )
    return asdict(made)


@cache
def _robot_table_file() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        save_robot_table(RobotTable(**_robot_table()), Path(folder, "a.json"))
        return Path(folder, "a.json").read_bytes()


def _sealed_robot_table(content: Any) -> bytes:
    if isinstance(content, dict):
        written = json.loads(json.dumps(content))
        form = json.loads(_robot_table_file())["format"]
        content = {"format": form, "hash": _digest(written), **written}
    return json.dumps(content).encode()


def _read_robot_table(path: Path) -> None:
    table = load_robot_table(path)
    columns = {name: np.array([value]) for name, value in table.robot.items()}
    _finite(*(table.query(columns)[name] for name in ("omega_yr_bar", "v_x", "v_z")))
    response = table.response(columns)
    _finite(response.lag, response.memory, response.rest, response.spread)


@cache
def _model_content() -> dict[str, Any]:
    return tensor_file.read(SHIPPED, FORMAT, "")


def _sealed_model(content: Any) -> bytes:
    return tensor_file.packed(content, FORMAT)


def _read_model(path: Path) -> None:
    _finite(*load(path).query({name: np.array([value]) for name, value in ROBOT.group_values().items()}).values())


# Paths, regions and plans


def _read_path(path: Path) -> None:
    drawing = read_path(path)
    _finite(drawing.path.points, drawing.path.length, drawing.unit or 1.0)
    assert len(drawing.path.points) >= 2


@cache
def _plan() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return write_plan(plan(circle(1.0), ROBOT), folder)[0].read_bytes()


def _read_plan(path: Path) -> None:
    content, schedule = load_plan(path), load_schedule(path)
    _finite(schedule.dwells, schedule.start, content["stated_error_over_l"])


def _replayed() -> bytes:
    content = json.loads(_plan())
    poses = np.array(content["predicted_poses"])[::10]
    return _text({"time_bar": np.arange(len(poses)), "x_over_l": poses[:, 0], "y_over_l": poses[:, 1],
                  "heading_rad": poses[:, 2]})  # fmt: skip


def _read_track(path: Path) -> None:
    content = load_plan(path.with_name("plan.json"))
    with naming(path):
        error = tracking_error(content, read_table(path))
    _finite(error.rms, error.largest, error.raw_rms)


_SVG = b"""<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"
 width="30mm" height="20mm" viewBox="0 0 300 200">
<g id="a" transform="translate(10 20) rotate(30)"><path id="p" d="M 0 0 h 100 v 50 C 120 60 150 90 30 100
 A 30 20 0 0 1 10 40 z" style="stroke:#000;stroke-width:2"/></g>
</svg>
"""
_SVG_TOKENS = (
    b'<use xlink:href="#a"/>', b'<use href="#p"/>', b"<g>", b"</g>", b"</svg>", b"<circle r='5'/>", b'transform="',
    b"matrix(1 0 0 0 0 0)", b"scale(0)", b"scale(1e200)", b"skewX(90)", b"M", b"m", b" z", b" a 1 1 0 0 0 5 5", b" q",
    b" T 5 5", b"<polyline points='0,0 1,1'/>", b"<!DOCTYPE svg [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;'>]>", b"&b;",
    b"&#0;", b"<![CDATA[", b"<!--", b"<style>*{d:x}</style>", b'width="', b"%", b"1e-300mm", b'viewBox="', b"inherit",
    b"<clipPath id='c'>", b"<symbol id='s'>", b"<image href='file:///etc/passwd'/>", b"<text>x</text>", b"<defs>",
)  # fmt: skip


# Measurements


@cache
def _runs() -> pd.DataFrame:
    import pytest

    with pytest.MonkeyPatch.context() as patch:
        install_toy(patch)
        runs = toy_table(3, lengths_cm=(6.0, 9.0)).head(40)
    return runs.assign(elapsed_min=4.0 * np.arange(len(runs)), temperature_C=22.0)


def _read_runs(path: Path) -> None:
    runs = read_measurements(path)
    _finite(runs.y, runs.inputs, runs.length, runs.omega, runs.noted)


@cache
def _samples() -> pd.DataFrame:
    seen = [track(seed, seconds=24.0).iloc[::6].assign(run=seed + 1) for seed in (0, 1)]
    return pd.concat(seen, ignore_index=True).round(4)


_NOTED = {"run": [1, 2], "N": [2, 2], "l_cm": [11.0, 11.0], "omega_rpm": [-150.0, -150.0]}


def _measure(path: Path) -> None:
    table, _ = measure_tracks(path.with_name("tracks.csv"), path.with_name("runs.csv"))
    for name in ("omega_yr_rad_s", "R_yr_cm", "v_cm_s"):
        assert name not in table or not np.isinf(table[name]).any(), "a result is infinite"


@cache
def _verdict() -> dict[str, Any]:
    noise = Noise(np.array([[1e-3, 0.0], [0.0, 2e-3]]), 0.2)
    records = [
        Explanation(title, {"C_t": 3.0, name: 1.0}, np.diag([0.01, 0.02]), noise, ("omega_h", "v")).record()
        for title, name in (("end-over-end drag", "end_over_end_drag"), ("inertia", "inertia"))
    ]
    return {"verdict": "ambiguous", "explanations": records, "sessions": ["1", "2"], "p_value": 1e-5}


def _read_verdict(path: Path) -> None:
    explanations, sessions = read_explanations(path)
    for explanation in explanations:
        size = len(explanation.parameters)
        assert explanation.covariance.shape == (size, size), "a covariance of another size"
        _finite(explanation.covariance, list(explanation.parameters.values()), explanation.noise.run)
        _finite(explanation.noise.share)
        hash(explanation.title)
    assert all(isinstance(session, str) for session in sessions)


_TOML = (b"[", b"]", b"=", b"[[", b"]]", b'"""', b"'''", b"{", b"}", b",", b"inf", b"nan", b"true", b"1979-05-27", b"[head]",
         b"[effects]", b"[correction]", b"[calibration]", b"length_m", b"_sigma", b'"10 %"', b"name = ", b"a.b.c = 1\n",
         b"inputs.C_t.range", b"rows = ", b"N = ", b"tail_contact = 1\n", b"left_right_bias = 0.1\n")  # fmt: skip
_TABLE = (b",", b";", b"\t", b",,", b'"', b'""', b"N", b"run", b"omega_bar", b"[mm]", b" (cm)", b"_mm", b"_rpm", b"deg", b"# ",
          b"x", b"y", b"1,5", b"1.000,5", b"unnamed", b"index", b"\n\n", b"mm,mm\n")  # fmt: skip
_JSON = (b"{", b"}", b"[", b"]", b":", b",", b"null", b"true", b"NaN", b"-Infinity", b"\\u0000", b"\\ud800", b'"format"',
         b'"tensor"', b'"key"', b'"digest"', b"//", b"1e400", b"[[],[]]", b'{"":""}')  # fmt: skip


def _file(name: str, content: Callable[[], bytes], **beside: Callable[[], bytes]) -> Callable[[], Files]:
    """Make an example of one file, and of files beside it: `plan_json` stands for plan.json."""

    @cache
    def files() -> Files:
        return {name: content(), **{key.replace("_", "."): data() for key, data in beside.items()}}

    return files


FORMATS: dict[str, FileFormat] = {
    "robot": FileFormat(_file("robot.toml", lambda: robot_toml(ROBOT).encode()), _read_robot, _TOML),
    "corrected robot": FileFormat(_file("corrected.toml", _corrected), _read_robot, _TOML),
    "sweep": FileFormat(_file("sweep.toml", SWEEP_TOML.read_bytes), _read_design, _TOML),
    "sweep.json": FileFormat(partial(_of_data_set, SWEEP), _read_sweep, _JSON),
    "sweep.json, sealed": FileFormat(
        partial(_of_data_set, SWEEP), _read_sweep, _JSON, _sealed_sweep, partial(_json_of, SWEEP)
    ),
    "manifest": FileFormat(partial(_of_data_set, MANIFEST), _read_rows, _JSON),
    "manifest, sealed": FileFormat(
        partial(_of_data_set, MANIFEST), _read_rows, _JSON, _sealed_manifest, partial(_json_of, MANIFEST, "digest")
    ),
    "shard of rows": FileFormat(partial(_of_data_set, shard_name(ROWS, 0, 16)), _read_shard),
    "table of robots": FileFormat(_file("robots.csv", lambda: _text(_robots())), _read_robots, _TABLE),
    "table of robots, Parquet": FileFormat(_file("robots.parquet", _parquet), _read_robots),
    "table of robots, xlsx": FileFormat(_file("robots.xlsx", _spreadsheet), _read_robots),
    "table of one robot": FileFormat(_file("robot.table.json", _robot_table_file), _read_robot_table, _JSON),
    "table of one robot, sealed": FileFormat(
        _file("robot.table.json", _robot_table_file), _read_robot_table, _JSON, _sealed_robot_table, _robot_table
    ),
    "model": FileFormat(
        _file("model.safetensors", SHIPPED.read_bytes), _read_model, _JSON, first_bytes=20_000
    ),
    "model, sealed": FileFormat(
        _file("model.safetensors", SHIPPED.read_bytes), _read_model, _JSON, _sealed_model, _model_content
    ),
    "path": FileFormat(_file("path.csv", lambda: _text({"x": [0, 1, 2.5], "y": [0, 1.5, 1]})), _read_path, _TABLE),
    "drawing": FileFormat(_file("path.svg", lambda: _SVG), _read_path, _SVG_TOKENS),
    "region": FileFormat(
        _file("region.csv", lambda: _text({"x": [0, 1, 1, 0], "y": [0, 0, 1, 1]})),
        lambda path: read_region(str(path), "cm", ROBOT), _TABLE,
    ),
    "plan": FileFormat(_file("plan.json", _plan), _read_plan, _JSON),
    "replayed track": FileFormat(_file("track.csv", _replayed, plan_json=_plan), _read_track, _TABLE),
    "measured runs": FileFormat(_file("table.csv", lambda: _text(_runs())), _read_runs, _TABLE),
    "camera tracks": FileFormat(
        _file("tracks.csv", lambda: _text(_samples()), runs_csv=lambda: _text(_NOTED)), _measure, _TABLE
    ),
    "runs of camera tracks": FileFormat(
        _file("runs.csv", lambda: _text(_NOTED), tracks_csv=lambda: _text(_samples())), _measure, _TABLE
    ),
    "verdict": FileFormat(_file("verdict.json", lambda: json.dumps(_verdict()).encode()), _read_verdict, _JSON),
}  # fmt: skip
