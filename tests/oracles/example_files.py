"""Examples of all formats of files, what matters to each format, and how files are sealed with their hash."""

from __future__ import annotations

import io
import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from calibration.findings.next_runs import Explanation
from calibration.linear.gls import Noise
from common.provenance import fingerprint
from dataset.data_set import sweep_key
from dataset.schema import rows_version
from planner.jobs.plan import plan
from planner.paths.path import circle
from sim.knowledge import CalibrationKnowledge, knowledge_toml
from sim.model.learnt_range import LearntRange
from sim.model.presets import PRESETS
from sim.model.robot_toml import robot_toml
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate import tensor_file
from surrogate.robot_table import FORMAT as TABLE_FORMAT
from surrogate.robot_table import RobotTable, _digest
from surrogate.table import FORMAT
from surrogate.table_file import SHIPPED, load
from tests.calibration.track import track
from tests.dataset.sweeps import design, invented, write_rows
from tests.shared import shared

ROBOT = PRESETS["paper-control"]


Files = Mapping[str, bytes]  # by name; the first is the one that is mutated


def text(columns: Mapping[str, Any] | pd.DataFrame) -> bytes:
    """Write a table as CSV."""
    return pd.DataFrame(columns).to_csv(index=False).encode()


@cache
def corrected() -> bytes:
    learnt_from = LearntRange((2.0, 1.9, -6.0), (4.0, 2.1, -4.0))
    robot = replace(ROBOT, effects={"end_over_end_drag": 4.5}, disc_offset=0.012, learnt_from=learnt_from)
    knowledge = CalibrationKnowledge(("C_t", "viscosity"), np.array([[0.01, 0.001], [0.001, 0.02]]), (1e-4, 0.0))
    return f"{robot_toml(robot)}\n{knowledge_toml(knowledge)}".encode()


@cache
def robots() -> pd.DataFrame:
    rows = [{**ROBOT.group_values(), "omega_bar": speed, "a_over_R": 1.0} for speed in (8.0, 10.0, 12.0)]
    return pd.DataFrame(rows)


def parquet() -> bytes:
    file = io.BytesIO()
    robots().to_parquet(file)
    return file.getvalue()


def spreadsheet() -> bytes:
    file = io.BytesIO()
    robots().to_excel(file, index=False)
    return file.getvalue()


@cache
def data_set() -> dict[str, bytes]:
    """Make a finished data set of 16 synthetic rows."""
    sweep = design(16)
    points = {**sweep.points(), "history": sweep.history()}
    with tempfile.TemporaryDirectory() as folder:
        write_rows(Path(folder), sweep, {**invented(points), "row": sweep.indices()}, rows_version())
        files = [path for path in Path(folder).rglob("*") if path.is_file()]
        return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def of_data_set(first: str) -> Files:
    return {first: data_set()[first], **data_set()}


def json_of(name: str, *left_out: str) -> Any:
    content = json.loads(data_set()[name])
    return {key: value for key, value in content.items() if key not in left_out}


def sealed_sweep(content: Any) -> bytes:
    if isinstance(content, dict) and {"config", "code", "rows_by"} <= set(content):
        content = {**content, "key": sweep_key(content["config"], content["code"], content["rows_by"])}
    return json.dumps(content).encode()


def sealed_manifest(content: Any) -> bytes:
    if isinstance(content, dict):
        content = {**content, "digest": fingerprint(content)}
    return json.dumps(content).encode()


@cache
def robot_table() -> dict[str, Any]:
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
def robot_table_file() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        RobotTable(**robot_table()).save(Path(folder, "a.json"))
        return Path(folder, "a.json").read_bytes()


def sealed_robot_table(content: Any) -> bytes:
    if isinstance(content, dict):
        content = {"format": TABLE_FORMAT, "hash": _digest(content), **content}
    return json.dumps(content).encode()


@cache
def model_content() -> dict[str, Any]:
    return tensor_file.read(SHIPPED, FORMAT, "")


def sealed_model(content: Any) -> bytes:
    return tensor_file.packed(content, FORMAT)


@shared
def plan_file() -> bytes:
    """Make a plan.json without its id, so that a mutation is read, not refused as one."""
    content = plan(circle(1.0), ROBOT).to_dict()
    return json.dumps({name: value for name, value in content.items() if name != "id"}).encode()


def replayed() -> bytes:
    content = json.loads(plan_file())
    poses = np.array(content["predicted_poses"])[::10]
    return text({"time_bar": np.arange(len(poses)), "x_over_l": poses[:, 0], "y_over_l": poses[:, 1],
                  "heading_rad": poses[:, 2]})  # fmt: skip


SVG = b"""<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"
 width="30mm" height="20mm" viewBox="0 0 300 200">
<g id="a" transform="translate(10 20) rotate(30)"><path id="p" d="M 0 0 h 100 v 50 C 120 60 150 90 30 100
 A 30 20 0 0 1 10 40 z" style="stroke:#000;stroke-width:2"/></g>
</svg>
"""


SVG_TOKENS = (
    b'<use xlink:href="#a"/>', b'<use href="#p"/>', b"<g>", b"</g>", b"</svg>", b"<circle r='5'/>",
    b'transform="', b"matrix(1 0 0 0 0 0)", b"scale(0)", b"scale(1e200)", b"skewX(90)", b"M", b"m", b" z",
    b" a 1 1 0 0 0 5 5", b" q", b" T 5 5", b"<polyline points='0,0 1,1'/>",
    b"<!DOCTYPE svg [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;'>]>", b"&b;", b"&#0;", b"<![CDATA[", b"<!--",
    b"<style>*{d:x}</style>", b'width="', b"%", b"1e-300mm", b'viewBox="', b"inherit", b"<clipPath id='c'>",
    b"<symbol id='s'>", b"<image href='file:///etc/passwd'/>", b"<text>x</text>", b"<defs>",
)  # fmt: skip


@cache
def runs() -> pd.DataFrame:
    table = pd.read_csv(Path(__file__).parents[1] / "reference" / "none.csv")
    return table.assign(elapsed_min=4.0 * np.arange(len(table)), temperature_C=22.0)


@cache
def samples() -> pd.DataFrame:
    seen = [track(seed, seconds=24.0).iloc[::6].assign(run=seed + 1) for seed in (0, 1)]
    return pd.concat(seen, ignore_index=True).round(4)


NOTED = {"run": [1, 2], "N": [2, 2], "l_cm": [11.0, 11.0], "omega_rpm": [-150.0, -150.0]}


@cache
def verdict() -> dict[str, Any]:
    noise = Noise(np.array([[1e-3, 0.0], [0.0, 2e-3]]), 0.2)
    records = [
        Explanation(title, {"C_t": 3.0, name: 1.0}, np.diag([0.01, 0.02]), noise, ("omega_h", "v")).record()
        for title, name in (("end-over-end drag", "end_over_end_drag"), ("inertia", "inertia"))
    ]
    return {"verdict": "ambiguous", "explanations": records, "sessions": ["1", "2"], "p_value": 1e-5}


TOML = (
    b"[", b"]", b"=", b"[[", b"]]", b'"""', b"'''", b"{", b"}", b",", b"inf", b"nan", b"true", b"1979-05-27",
    b"[head]", b"[effects]", b"[learnt_from]", b"[calibration]", b"length_m", b"_sigma", b'"10 %"', b"name = ",
    b"a.b.c = 1\n", b"inputs.C_t.range", b"rows = ", b"N = ", b"tail_contact = 1\n", b"left_right_bias = 0.1\n",
)  # fmt: skip


TABLE = (
    b",", b";", b"\t", b",,", b'"', b'""', b"N", b"run", b"omega_bar", b"[mm]", b" (cm)", b"_mm", b"_rpm",
    b"deg", b"# ", b"x", b"y", b"1,5", b"1.000,5", b"unnamed", b"index", b"\n\n", b"mm,mm\n",
)  # fmt: skip


JSON = (
    b"{", b"}", b"[", b"]", b":", b",", b"null", b"true", b"NaN", b"-Infinity", b"\\u0000", b"\\ud800",
    b'"format"', b'"tensor"', b'"key"', b'"digest"', b"//", b"1e400", b"[[],[]]", b'{"":""}',
)  # fmt: skip


def file(name: str, content: Callable[[], bytes], **beside: Callable[[], bytes]) -> Callable[[], Files]:
    """Make an example of one file, and of files beside it: `plan_json` stands for plan.json."""

    @cache
    def files() -> Files:
        return {name: content(), **{key.replace("_", "."): data() for key, data in beside.items()}}

    return files
