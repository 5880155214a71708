"""Files of a plan, tracks that are compared with it, and what the page says of both, are Python's."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from planner.files.plan_files import milliseconds, write_plan
from planner.files.plan_json import load_plan
from planner.files.tracker_header import DIRECTIONS, c_part, header_template
from planner.files.tracking_error import tracking_error
from planner.planning.planned import Plan
from sim.io.provenance import code_version
from tests.planner.page.cases import CONTROL, followed
from tests.planner.page.page_core import EXACT, answer, answers, check_near
from tests.planner.page.parity import check_header, check_parity, check_same, refusal_of

PARTS = {"codeVersion": code_version(), "directions": DIRECTIONS, "flash": c_part("schedule_flash.h"),
         "schedule": c_part("schedule.h"), "tracker": header_template()}  # fmt: skip
PLANS: dict[str, tuple[str, str, float, dict[str, Any]]] = {
    "circle": ("circle", "symmetric", 0.0, {"objective": "flips"}),
    "bend": ("bend", "biased", CONTROL.head_length / 2 / CONTROL.tail_length, {"objective": "flips"}),
    "line": ("line", "in a current", 0.0, {"objective": "time"}),
}


def plan_of(name: str) -> Plan:
    path, car, offset, options = PLANS[name]
    return followed(path, car, offset, **options)


def named(result: Plan, name: str) -> Plan:
    return replace(result, tracked=result.tracked._replace(robot=replace(result.robot, name=name)))


@pytest.mark.parametrize("name", PLANS)
def test_files_are_written_byte_for_byte(name: str, tmp_path: Path) -> None:
    result = plan_of(name) if name != "line" else named(plan_of(name), "böse */ 3.1 #_-²½")  # could end a comment
    write_plan(result, tmp_path)
    content = result.to_dict()
    found, columns, bare, seconds, duration = answers(
        [
            ("plan_files.js", "planFiles", result, PARTS),
            *(("planned.js", f"plan{name}", result) for name in ("Columns", "Record", "Seconds", "Duration")),
        ]
    )
    wanted = {file: (tmp_path / file).read_text(encoding="utf-8") for file in found}
    check_header(found.pop("tracker.h"), wanted.pop("tracker.h"), 1e-13)
    assert found == wanted
    assert load_plan(tmp_path / "plan.json")["id"] == bare["id"] == content["id"]
    assert bare["text"] == json.dumps(content)
    check_same(columns, {name: column.tolist() for name, column in result.columns().items()})
    assert (seconds, duration) == (result.seconds.tolist(), result.duration)


def test_warnings() -> None:
    result = plan_of("circle")
    tight = replace(result.tracked.vehicle, tail_gap=0.7)
    cases = [
        result,
        replace(result, errors=replace(result.errors, stated=9.0, table_share=0.9)),
        replace(result, errors=replace(result.errors, distance=9 * result.errors.distance + 1)),
        replace(result, tracked=result.tracked._replace(vehicle=tight)),
        replace(result, declared=replace(result.declared, warnings=("the shape is lost in part: …",))),
    ]
    found = answers([("planned.js", "planWarnings", case) for case in cases])
    assert found == [list(case.warnings) for case in cases]
    assert sum(map(len, found)) == 4


def test_whole_milliseconds() -> None:
    rng = np.random.default_rng(0)
    some = [[65.535, 65.536, 200.0, 0.001], [0.0005, 0.001, 0.0015], [1.0, 0.0001], [0.0004]]
    cases = [(rng.uniform(0.01, 3, 200),), *((np.array(dwells),) for dwells in some)]
    assert check_parity("plan_files.js", "milliseconds", milliseconds, cases) >= 2


def track_of(result: Plan, noise: float = 0.0) -> pd.DataFrame:
    """Make a track of the head's centre near a plan's poses."""
    rng = np.random.default_rng(0)
    poses = result.poses + noise * rng.normal(size=result.poses.shape)
    time = np.concatenate([[0.0], np.cumsum(result.dwells)])
    columns = {"time_bar": time, "x_over_l": poses[:, 0], "y_over_l": poses[:, 1], "heading_rad": poses[:, 2]}
    return pd.DataFrame(columns)


def table_of(frame: pd.DataFrame) -> dict[str, Any]:
    plans = frame.get("plan_id", pd.Series(dtype=str)).unique().tolist()
    numbers = frame.drop(columns="plan_id", errors="ignore")
    return {"names": list(numbers), "columns": [numbers[name].to_list() for name in numbers], "plans": plans}


@pytest.mark.parametrize("noise", [0.0, 0.05, 2.0])
@pytest.mark.parametrize("name", ["circle", "bend"])
def test_errors_of_a_track_and_their_sentence(name: str, noise: float) -> None:
    result = plan_of(name)
    content, frame = result.to_dict(), track_of(result, noise)
    cm = 100 * result.robot.tail_length
    lab = {
        "time [min]": frame["time_bar"] * result.robot.time_scale / 60, "x_mm": frame["x_over_l"] * 10 * cm,
        "Y [cm]": frame["y_over_l"] * cm, "heading_deg": np.degrees(frame["heading_rad"]),
    }  # fmt: skip
    for table in (frame, pd.DataFrame(lab)):
        wanted = tracking_error(content, table)
        found = answer("tracking_error.js", "trackingError", content, table_of(table))
        for of_python, page in {"rms": "rms", "largest": "largest", "raw_rms": "rawRms", "missed": "missed",
                                "raw_largest": "rawLargest", "stated": "stated"}.items():  # fmt: skip
            assert found[page] == pytest.approx(getattr(wanted, of_python), abs=EXACT)
        check_near(found["track"], wanted.track)
        assert answer("tracking_error.js", "trackingLine", found) == wanted.line


BAD: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "a missing column": lambda frame: frame.drop(columns="heading_rad"),
    "still": lambda frame: frame.assign(time_bar=1.0),
    "back": lambda frame: frame.iloc[[0, 2, 1, 3]],
    "far away": lambda frame: frame.assign(x_over_l=1e101),
    "another robot": lambda frame: frame.assign(  # of tails of 15 cm
        x_cm=15 * frame["x_over_l"], y_cm=15 * frame["y_over_l"], heading_deg=np.degrees(frame["heading_rad"])),
    "another plan": lambda frame: frame.assign(plan_id="p0123456789a"),
    "no unit": lambda frame: frame.set_axis(["time", "x_cm", "y_cm", "heading_deg"], axis=1),
}  # fmt: skip


@pytest.mark.parametrize("change", BAD)
def test_bad_tracks_are_refused(change: str) -> None:
    result = plan_of("circle")
    frame, content = BAD[change](track_of(result)), result.to_dict()
    wanted = refusal_of(tracking_error, content, frame)
    assert str(answer("tracking_error.js", "trackingError", content, table_of(frame))) == wanted


def test_a_track_is_compared_in_cm_and_can_be_laid_on_the_plan() -> None:
    result = plan_of("circle")
    content, table = result.to_dict(), {**table_of(track_of(result)), "plans": ["p1"]}
    time, x, y, heading = (np.array(column) for column in table["columns"])
    turned = {"names": table["names"], "columns": [time + 3, -y, x, heading + np.pi / 2]}
    measured, laid = answers(
        [("compared_track.js", "comparedTrack", content, *given) for given in ((table, "none"), (turned, "rigid"))]
    )
    assert (measured["shift"], measured["ofPlan"], laid["ofPlan"]) == ("", "p1", "")
    assert "first pose" in laid["shift"]
    assert 0 < measured["error"]["largest"] <= 11 * result.predicted_max * (1 + 1e-9)
    check_near(laid["points"], measured["points"])
    assert laid["error"]["rms"] == pytest.approx(measured["error"]["rms"])
    assert laid["csv"].splitlines()[0] == "time_s,x_cm,y_cm,heading_deg"
