"""The page writes the files of the command, and reads or refuses files as the command does."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from common.errors import InputError
from common.provenance import code_version
from common.reading import sealed
from common.units import Sigma
from planner.files.headers import schedule_template
from planner.files.plan_files import write_plan
from planner.files.saved_plan import load_plan, restore_plan
from planner.jobs.plan import plan
from planner.page.first_state import first_options, slider_ends
from planner.paths.path import circle, shape_of
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest
from planner.vehicle.measured import MeasuredVehicle
from sim.inputs import load_robot
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.robot_toml import robot_toml
from sim.model.schedule import plan_id
from tests.planner.page.cases import CONTROL, MEASURED_VEHICLES, PATHS, followed, shipped
from tests.planner.page.page_core import (
    TABLE,
    answer,
    answers,
    call,
    check_header,
    check_near,
    opened,
    page_options,
    refusal_of,
    to_page,
)
from tests.planner.plans import planned, predicted_track
from tests.sim.model.test_robot_toml import LAB, REFUSALS
from tracking.tracks import tracking_error

pytestmark = pytest.mark.usefixtures("empty_folder")

PARTS = {"codeVersion": code_version(), "schedule": schedule_template()}
PLANS: dict[str, tuple[str, str, float, dict[str, Any]]] = {
    "circle": ("circle", "symmetric", 0.0, {"objective": "flips"}),
    "bend": ("bend", "biased", CONTROL.head_length / 2 / CONTROL.tail_length, {"objective": "flips"}),
    "line": ("line", "in a current", 0.0, {"objective": "time"}),
}


def plan_of(name: str) -> Plan:
    path, car, offset, options = PLANS[name]
    return followed(path, car, offset, **options)


@pytest.mark.parametrize("name", PLANS)
def test_files_of_a_plan_differ_by_rounding_alone(name: str, tmp_path: Path) -> None:
    result = plan_of(name)
    if name == "line":  # its name could end a comment in C
        result = replace(
            result, tracked=result.tracked._replace(robot=replace(result.robot, name="böse */ #_-²½"))
        )
    write_plan(result, tmp_path)
    found = answer("plan_files.js", "planFiles", result, PARTS)
    for file, text in found.items():
        check_header(text, (tmp_path / file).read_text(encoding="utf-8"), 1e-9)
    Path("plan.json").write_text(found["plan.json"], encoding="utf-8")
    assert load_plan(Path("plan.json"))["id"] == result.to_dict()["id"]


def test_files_of_a_measured_vehicle_are_those_of_the_command(tmp_path: Path) -> None:
    car = MEASURED_VEHICLES["with a body"]
    result = plan(circle(2.0), car, objective="flips")
    write_plan(result, tmp_path)
    swims = call("measured_vehicle.js", "trackedMeasured", car, "head_centre")
    made = call("plan.js", "makePlan", result.drawn, swims, call("plan.js", "planRequest", {"objective": "flips"}))
    found = answer("plan_files.js", "planFiles", made, PARTS)
    ours, theirs = (json.loads(text) for text in (found["plan.json"], (tmp_path / "plan.json").read_text()))
    assert (list(ours), list(ours["robot"])) == (list(theirs), list(theirs["robot"]))
    assert ours["robot"] == theirs["robot"]
    for name in ("dwell_bar", "predicted_poses", "stated_error_over_l", "feedback_error_over_l"):
        check_near(ours[name], theirs[name], 1e-8)
    csv = found["plan.csv"].split(",p")[0]  # up to the plan's identity
    assert csv == (tmp_path / "plan.csv").read_text().split(",p")[0]
    header = (tmp_path / "schedule.h").read_text().split("\n", 1)[1]
    check_header(found["schedule.h"].split("\n", 1)[1], header, 1e-8)
    Path("plan.json").write_text(found["plan.json"], encoding="utf-8")
    assert restore_plan(Path("plan.json")).robot == car


@pytest.mark.parametrize("name", MEASURED_VEHICLES)
def test_a_vehicle_of_the_page_is_read_back_and_is_no_robot(name: str) -> None:
    car = MEASURED_VEHICLES[name]
    text = answer("measured_vehicle.js", "vehicleToml", car)
    Path("car.toml").write_text(text, encoding="utf-8")
    read = MeasuredVehicle.load("car.toml")
    assert read.to_dict() == car.to_dict()
    refusal = str(opened("car.toml", text))
    assert refusal.startswith(
        "car.toml is a measured vehicle; make a page of it: softflagella page --robot car.toml"
    )


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
    found = answers([("plan_files.js", "planWarnings", case) for case in cases])
    assert found == [list(case.warnings) for case in cases]
    assert sum(map(len, found)) == 4


def test_a_plan_of_the_page_is_restored() -> None:
    request = call("plan.js", "planRequest", {"objective": "flips"})
    tracked = call("from_table.js", "trackedVehicle", CONTROL, TABLE, "head_centre")
    made = call("plan.js", "makePlan", PATHS["wave"], tracked, request)
    theirs = json.loads(answer("plan_files.js", "planRecord", made)["text"])
    restored = restore_plan(theirs, lookup=shipped())
    check_near([restored.predicted_max, restored.predicted_rms],
               [theirs["predicted_max_over_l"], theirs["predicted_rms_over_l"]])  # fmt: skip


def compared(content: dict[str, Any], frame: pd.DataFrame, how: str = "none") -> Any:
    plans = frame.get("plan_id", pd.Series(dtype=str)).unique().tolist()
    numbers = frame.drop(columns="plan_id", errors="ignore")
    table = {"names": list(numbers), "columns": [numbers[name].to_list() for name in numbers], "plans": plans}
    return answer("measured.js", "comparedTrack", content, table, how)


@pytest.mark.parametrize("noise", [0.0, 2.0])
@pytest.mark.parametrize("name", ["circle", "bend"])
def test_errors_of_a_track(name: str, noise: float) -> None:
    result = plan_of(name)
    content, frame = result.to_dict(), predicted_track(result, noise)
    cm = 100 * result.robot.length_scale
    lab = {
        "time [min]": frame["time_bar"] * result.robot.time_scale / 60, "x_mm": frame["x_over_l"] * 10 * cm,
        "Y [cm]": frame["y_over_l"] * cm, "heading_deg": np.degrees(frame["heading_rad"]),
    }  # fmt: skip
    for table in (frame, pd.DataFrame(lab)):
        wanted, found = tracking_error(content, table), compared(content, table)
        for of_python, page in {"rms": "rms", "largest": "largest", "raw_rms": "rawRms", "stated": "stated",
                                "raw_largest": "rawLargest"}.items():  # fmt: skip
            assert found["error"][page] == pytest.approx(cm * getattr(wanted, of_python), rel=1e-8, abs=1e-8)
        check_near(found["points"], cm * np.array(wanted.track), 1e-8)


BAD: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "a missing column": lambda frame: frame.drop(columns="heading_rad"),
    "still": lambda frame: frame.assign(time_bar=1.0),
    "back": lambda frame: frame.iloc[[0, 2, 1, 3]],
    "far away": lambda frame: frame.assign(x_over_l=1e101),
    "another robot": lambda frame: frame.assign(  # of tails of 15 cm
        x_cm=15 * frame["x_over_l"], y_cm=15 * frame["y_over_l"], heading_deg=np.degrees(frame["heading_rad"])),
    "no unit": lambda frame: frame.set_axis(["time", "x_cm", "y_cm", "heading_deg"], axis=1),
    "another plan": lambda frame: frame.assign(plan_id=np.where(np.arange(len(frame)) % 2, "p1", "p2")),
}  # fmt: skip


@pytest.mark.parametrize("change", BAD)
def test_bad_tracks_are_refused(change: str) -> None:
    result = plan_of("circle")
    frame, content = BAD[change](predicted_track(result)), result.to_dict()
    assert str(compared(content, frame)) == refusal_of(tracking_error, content, frame)


def test_a_track_can_be_laid_on_the_plan() -> None:
    result = plan_of("circle")
    content, frame = result.to_dict(), predicted_track(result)
    turned = frame.assign(time_bar=frame["time_bar"] + 3, x_over_l=-frame["y_over_l"], y_over_l=frame["x_over_l"],
                          heading_rad=frame["heading_rad"] + np.pi / 2, plan_id=content["id"])  # fmt: skip
    measured, laid = compared(content, frame), compared(content, turned, "rigid")
    assert measured["shift"] == ""
    assert "first pose" in laid["shift"]
    check_near(laid["points"], measured["points"])
    assert laid["error"]["rms"] == pytest.approx(measured["error"]["rms"])
    assert laid["csv"].splitlines()[0] == "time_s,x_cm,y_cm,heading_deg"


ROBOTS = [
    *PRESETS.values(),
    replace(CONTROL, name='it\'s "quoted" \\ ü\n\x7f', disc_offset=0.0123, tails=3),
    replace(CONTROL, tail_length=0.1 / 3, viscosity=1 / 7, motor_speed=4.44),
    replace(CONTROL, sigmas={"viscosity": Sigma(0.05, True), "tail_length": Sigma(0.00123, False)}),
]
TEXT = robot_toml(CONTROL)
VISCOSITY, NAME = "viscosity_Pa_s = 1.49", 'name = "paper-control"'
CHANGES = [
    *((LAB, old, new) for old, new, _ in REFUSALS.values()),
    *((TEXT, old, new) for old, new in (
        ("length_cm = 11", "length_mm = 110"), ("length_cm = 11", "length_in = 4.5"), ("count = 2", "count = 2.5"),
        (VISCOSITY, "viscosity_mPa_s = 1490"), ("count = 2", "count = true"), ("= 11", "= 1e200"),
        *((VISCOSITY, f"{VISCOSITY}\nviscosity{more}") for more in (
            "_Pa_s_sigma = '10 %'", "_Pa_s_sigma = 0.1", "_sigma = 1")),
        ("C_t = 3.0", "C_t = 3.0\nC_t_sigma = 0.1"), ("C_t = 3.0", "C_t = 3"), (NAME, ""),
        ("C_t = 3.0", "C_t = [\n'3', # three\n]"), ("C_t = 3.0", "C_t = 3,0"),
        ("radius_mm = 3.2", "radius_mm = 32"), ("C_t = 3.0", "C_t = inf"), ("[drag]", "[tails]\n[drag]"),
        (NAME, 'name = "a'), (NAME, "name = 'a # b' # c"), (NAME, 'name = "\\u00e9 \\U0001F41F \\" \\\\"'),
        (NAME, 'name = "\\q"'), ("count = 2", "count = 02"), ("C_t = 3.0", "C_t = 3.0 4"))),
]  # fmt: skip


def check_robot(found: Any, wanted: Robot) -> None:
    page = to_page(wanted)
    del page["effects"]
    for name in ("timeScale", "omegaBar"):
        assert found.pop(name) == pytest.approx(page.pop(name), rel=1e-14)
    assert found == page


def test_robots_are_written_and_read_back_by_both() -> None:
    for robot in ROBOTS:
        text = answer("robot.js", "robotToml", robot)
        Path("robot.toml").write_text(text, encoding="utf-8")
        check_robot(opened("robot.toml", text)["fields"], robot)
        assert to_page(load_robot("robot.toml")) == to_page(robot)


@pytest.mark.parametrize(("text", "old", "new"), CHANGES)
def test_texts_of_robots_are_read_or_refused(text: str, old: str, new: str) -> None:
    assert old in text
    text = text.replace(old, new, 1)
    Path("robot.toml").write_bytes(text.encode())
    found = opened("robot.toml", text)
    try:
        wanted = load_robot("robot.toml")
    except InputError:
        assert isinstance(found, InputError)
        assert "robot.toml" in str(found)
        assert len(str(found).splitlines()) == 1
    else:
        check_robot(found["fields"], wanted)


@pytest.mark.parametrize("table", ["effects", "learnt_from", "calibration"])
def test_a_robot_that_python_must_make_is_refused(table: str) -> None:
    found = opened("robot.toml", f"{TEXT}\n[{table}]\nx = 1\n")
    assert f"has [{table}]" in str(found)
    assert "softflagella page --robot robot.toml" in str(found)


def test_a_correction_is_refused_as_by_python() -> None:
    text = f"{TEXT}\n[correction]\nx = 1\n"
    Path("robot.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as refusal:
        load_robot("robot.toml")
    assert str(opened("robot.toml", text)) == str(refusal.value)


def test_robots_that_cannot_be_are_refused() -> None:
    cases: list[dict[str, Any]] = [
        {"tails": 0}, {"tails": 65}, {"tails": 2.5}, {"tail_length": 0.0}, {"viscosity": -1.5}, {"C_t": -1e-7},
        {"motor_speed": 0.0}, {"disc_offset": -0.01}, {"tail_radius": 0.03}, {"youngs_modulus": 1e-320},
        {"tail_length": 1e200, "tail_radius": 1e-200}, {"viscosity": 1e-310, "motor_speed": 1e-300},
    ]  # fmt: skip
    for changes in cases:
        given = {**to_page(CONTROL), **page_options(changes)}
        with pytest.raises(ValueError, match=r".") as refusal:
            replace(CONTROL, **changes)
        assert str(answer("robot.js", "makeRobot", given)) == str(refusal.value)


def test_sliders_end_where_the_look_up_table_does() -> None:
    domain, units = shipped().domain, {"motor_speed": 2 * np.pi / 60, "viscosity": 1.0, "youngs_modulus": 1e6}
    ends = slider_ends(CONTROL, domain)
    for field, key in zip(units, ("motorSpeed", "viscosity", "youngsModulus"), strict=True):
        reached = sorted(replace(CONTROL, **{field: end * units[field]}).omega_bar for end in ends[key])
        assert reached == pytest.approx(domain["omega_bar"], rel=0.1)


@pytest.mark.parametrize("wanted", [PlanRequest(dwell=1.0), PlanRequest(seed=3)])
def test_a_plan_that_the_page_cannot_make_is_refused(wanted: PlanRequest) -> None:
    with pytest.raises(InputError, match="no option for a dwell or a seed"):
        first_options(wanted, CONTROL, None)


def test_shapes_of_the_page_have_their_size() -> None:
    for name, size in (("circle", 20.5), ("square", 3.0), ("triangle", 7.0), ("polygon:6", 2.0)):
        wanted = shape_of(f"{name}:{size}cm")
        assert wanted is not None
        check_near(answer("path.js", "pageShape", name, size)["points"], wanted[0].points)
    eight, wave = answers([("path.js", "pageShape", name, 40) for name in ("eight", "wave")])
    assert (eight["closed"], wave["closed"]) == (True, False)
    assert np.ptp(np.array(eight["points"])[:, 0]) == pytest.approx(40, rel=1e-3)
    assert np.ptp(np.array(wave["points"])[:, 0]) == pytest.approx(40)
    refused = answers([("path.js", "pageShape", "eight", size) for size in (0, -3, None)])
    assert all(isinstance(refusal, InputError) for refusal in refused)


def test_paths_tracks_robots_runs_and_drawings_are_told_apart() -> None:
    path = opened("a.csv", "x_mm;y_mm\n0;0\n300,5;0\n")
    assert (path["kind"], path["unit"]) == ("path", pytest.approx(0.1))
    check_near(path["paths"][0]["points"], [[0, 0], [300.5, 0]])
    assert opened("b.csv", "x,y\n0,0\n3,0\n")["unit"] is None
    track = opened("t.csv", "time_s,x_cm,y_cm,heading_deg,plan_id\n0,0,0,0,p1\n1,0,0,0,\n2,0,0,0,p1\n")
    assert (track["kind"], track["table"]["plans"]) == ("track", ["p1"])
    runs = ("N,l_cm,omega_rpm,theta_deg\n3,9,100,20\n", "tails;rpm\n3;100\n", "theta_deg,R_yr_mm\n3,4\n")
    assert [opened("runs.csv", text)["kind"] for text in runs] == ["runs"] * 3
    drawing = opened("two.svg", '<svg><path id="a" d="M0 0 h 9"/><path id="b" d="M0 0 v 9 h 3 z"/></svg>')
    assert [(path["name"], path["closed"]) for path in drawing["paths"]] == [("a", False), ("b", True)]


def check_plan_opened(content: dict[str, Any]) -> None:
    found = opened("plan.json", json.dumps(content, indent=1))
    (drawn,) = found["paths"]
    assert (found["kind"], found["unit"], drawn["closed"]) == ("path", pytest.approx(11.0), content["closed"])
    check_near(drawn["points"], content["raw_path"][:-1] if content["closed"] else content["raw_path"])


def test_a_plan_with_more_than_a_path_gives_it() -> None:
    content = {**planned("circle:2l", objective="flips").to_dict(), "lap": {"period_s": 1.0}}
    check_plan_opened({**content, "id": plan_id(content)})


@pytest.mark.rest
def test_plans_with_laps_or_walls_give_their_paths() -> None:
    walls = [sf.Circle(6.0, 0.0, 0.5)]
    options: dict[str, dict[str, Any]] = {"lap": {"loop": True}, "kept_clear": {"keep_out": walls}}
    for kind, option in options.items():
        content = sf.plan(circle(2.0), CONTROL, objective="flips", **option).to_dict()
        assert kind in content
        check_plan_opened(content)


def test_an_edited_plan_and_a_robot_that_was_cut_are_refused() -> None:
    content = {**planned("circle:2l", objective="flips").to_dict(), "code_version": "0"}
    check_plan_opened(content)
    content["raw_path"][1][0] += 0.1
    assert "plan.json was edited or damaged after it was written" in str(opened("plan.json", json.dumps(content)))
    whole = sealed(robot_toml(CONTROL))
    assert opened("robot.toml", whole)["kind"] == "robot"
    for text in (whole[:-30], whole.replace("C_t = 3.", "C_t = 4.")):
        assert "robot.toml was edited, damaged or cut short" in str(opened("robot.toml", text))


def test_other_files_are_refused_in_one_line() -> None:
    for name, content in (
        ("names.csv", b"a,b\n1,2\n2,3\n"), ("none.svg", b"<svg></svg>"), ("html.svg", b"<html></html>"),
        ("picture.png", b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR"), ("robot.toml", b"tails = 2\nlenght_cm = 3\n"),
        ("robot.toml", b"\xff\xfe\x00"), ("track.csv", b"time_s,x_cm,y_cm,heading_deg\n"), ("plan.json", b"{"),
        ("plan.json", b"{}"), ("plan.json", b'{"format": 1}'), ("plan.json", b'{"format": 2}'),
        ("plan.json", b"[1, 2]"),
        ("plan.json", b'{"format": 2, "robot": {"tail_length_m": 0.1}, "raw_path": [[0, 1], [2]]}'),
        ("plan.json", b'{"format": 2, "robot": {"tail_length_m": 0.1}, "raw_path": 3}'),
    ):  # fmt: skip
        refusal = opened(name, content)
        assert isinstance(refusal, InputError), content
        assert len(str(refusal).splitlines()) == 1
