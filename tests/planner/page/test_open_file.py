"""Files say by their ending and their content what they are; others are refused in one line."""

from __future__ import annotations

import json
from typing import Any

import pytest

import softflagella as sf
from planner.paths.path import circle
from planner.planning.plan import plan
from sim.io.errors import InputError
from sim.io.seals import sealed
from sim.model.presets import PRESETS
from sim.model.robot_toml import robot_toml
from tests.planner.page.page_core import answer, check_near

ROBOT = PRESETS["paper-control"]


def opened(name: str, text: str | bytes) -> object:
    content = text.encode() if isinstance(text, str) else text
    return answer("open_file.js", "openFile", {"name": name, "bytes": list(content)})


def test_paths_tracks_robots_and_plans_are_told_apart() -> None:
    path = opened("a.csv", "x_mm;y_mm\n0;0\n300,5;0\n")
    assert (path["kind"], path["unit"]) == ("path", pytest.approx(0.1))  # type: ignore[index]
    check_near(path["paths"][0]["points"], [[0, 0], [300.5, 0]])  # type: ignore[index]
    assert opened("b.csv", "x,y\n0,0\n3,0\n")["unit"] is None  # type: ignore[index]
    track = opened("t.csv", "time_s,x_cm,y_cm,heading_deg,plan_id\n0,0,0,0,p1\n1,0,0,0,\n2,0,0,0,p1\n")
    assert (track["kind"], track["table"]["plans"]) == ("track", ["p1"])  # type: ignore[index]
    runs = ("N,l_cm,omega_rpm,theta_deg\n3,9,100,20\n", "tails;rpm\n3;100\n", "theta_deg,R_yr_mm\n3,4\n")
    assert [opened("runs.csv", text)["kind"] for text in runs] == ["runs"] * 3  # type: ignore[index]
    robot = opened("robot.toml", robot_toml(ROBOT))
    assert robot["fields"]["tailLength"] == ROBOT.tail_length  # type: ignore[index]
    content = plan(circle(1.5), ROBOT, objective="flips").to_dict()
    drawn = opened("plan.json", json.dumps(content))
    assert (drawn["unit"], drawn["paths"][0]["closed"]) == (pytest.approx(11.0), True)  # type: ignore[index]
    check_near(drawn["paths"][0]["points"], content["raw_path"][:-1])  # type: ignore[index]


def test_plans_with_walls_an_arrival_or_laps_give_their_paths() -> None:
    options: list[dict[str, Any]] = [
        {"loop": True}, {"arrive_seconds": 1800.0}, {"keep_out": [sf.Circle(6.0, 0.0, 0.5)]},
    ]  # fmt: skip
    for kind, option in zip(("lap", "arrival", "kept_clear"), options, strict=True):
        content = sf.plan(circle(2.0), ROBOT, objective="flips", **option).to_dict()
        assert kind in content
        found = opened("plan.json", json.dumps(content))
        assert found["paths"][0]["closed"] is content["closed"]  # type: ignore[index]
        raw = content["raw_path"][:-1] if content["closed"] else content["raw_path"]
        check_near(found["paths"][0]["points"], raw)  # type: ignore[index]


def test_an_edited_plan_and_a_robot_that_was_cut_are_refused() -> None:
    content = {**plan(circle(1.5), ROBOT, objective="flips").to_dict(), "code_version": "0"}
    assert opened("plan.json", json.dumps(content, indent=1))["kind"] == "path"  # type: ignore[index]
    content["raw_path"][1][0] += 0.1
    assert "plan.json was edited or damaged after it was written" in str(opened("plan.json", json.dumps(content)))
    whole = sealed(robot_toml(ROBOT))
    assert opened("robot.toml", whole)["kind"] == "robot"  # type: ignore[index]
    for text in (whole[:-30], whole.replace("C_t = 3.", "C_t = 4.")):
        assert "robot.toml was edited, damaged or cut short" in str(opened("robot.toml", text))


def test_a_drawing_with_several_paths_has_all_of_them() -> None:
    text = '<svg><path id="a" d="M0 0 h 9"/><path id="b" d="M0 0 v 9 h 3 z"/></svg>'
    drawing = opened("two.svg", text)
    assert [path["name"] for path in drawing["paths"]] == ["a", "b"]  # type: ignore[index]
    assert [path["closed"] for path in drawing["paths"]] == [False, True]  # type: ignore[index]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("empty.csv", b""), ("one.csv", b"x,y\n1,2\n"), ("nan.csv", b"x,y\n1,nan\n2,3\n"),
        ("text.csv", b"x,y\n1,a\n2,3\n"),
        ("names.csv", b"a,b\n1,2\n2,3\n"), ("none.svg", b"<svg></svg>"), ("broken.svg", b"<svg><path d='M'"),
        ("picture.png", b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR"), ("robot.toml", b"tails = 2\nlenght_cm = 3\n"),
        ("robot.toml", b"\xff\xfe\x00"), ("plan.json", b"{}"), ("plan.json", b'{"format": 1}'),
        ("plan.json", b"{"), ("plan.json", b'{"format": 2}'),
        ("plan.json", b'{"format": 2, "robot": {"tail_length_m": 0.1}, "raw_path": [[0, 1], [2]]}'),
        ("track.csv", b"time_s,x_cm,y_cm,heading_deg\n"),
    ],
)  # fmt: skip
def test_other_files_are_refused_in_one_line(name: str, content: bytes) -> None:
    refusal = opened(name, content)
    assert isinstance(refusal, InputError)
    assert len(str(refusal).splitlines()) == 1
