"""plan.json, goal.json and fleet.toml: what is written reads back; edited and foreign files are refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from planner.files.fleet_files import distance_apart, read_fleet
from planner.files.plan_files import write_plan
from planner.files.saved_plan import load_goal, load_plan
from planner.goal.trip import FORMAT as GOAL_FORMAT
from sim.io.errors import InputError, run_command
from sim.model.presets import PRESETS
from sim.model.schedule import FORMAT, load_schedule, plan_id
from tests.planner.plans import WALLS, hindered_trip, planned
from tests.shared import shared

pytestmark = pytest.mark.slow

READERS = [load_plan, load_schedule]  # of the planner and of the simulator


@cache
def record() -> dict[str, Any]:
    return json.loads(json.dumps(planned().to_dict()))  # type: ignore[no-any-return]


def written(folder: Path, **changes: Any) -> Path:
    path = folder / "plan.json"
    path.write_text(json.dumps({**record(), **changes}))
    return path


def test_a_changed_number_is_noticed(tmp_path: Path) -> None:
    dwells = record()["dwell_bar"]
    changed = {"dwell_bar": [dwells[0] * 1.01, *dwells[1:]]}
    damaged = r"was edited or damaged after it was written: .*; plan again, or delete"
    for reader in READERS:
        with pytest.raises(InputError, match=damaged):
            reader(written(tmp_path, **changed))
    edited = {name: value for name, value in {**record(), **changed}.items() if name != "id"}
    (tmp_path / "edited.json").write_text(json.dumps(edited))
    assert load_plan(tmp_path / "edited.json") == {**edited, "id": plan_id(edited)}
    assert load_plan(written(tmp_path, **changed, id="0123456789ab"))["id"] == "0123456789ab"


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (f'"format": {FORMAT}', '"format": 99', f"has format 99, this version reads {FORMAT}"),
        ('"omega_bar": ', '"omega_bar": 9e9, "was": ', "omega_bar is not between"),
        ('"dwell_bar": [', '"dwell_bar": [NaN, ', "NaN is no finite number"),
        ('"predicted_rms_over_l": ', '"predicted_rms_over_l": 1e999, "was": ', "1e999 is no finite number"),
    ],
    ids=["format", "range", "NaN", "overflow"],
)
def test_both_readers_refuse_the_same_files(
    reader: Callable[[Path], object], tmp_path: Path, old: str, new: str, expected: str
) -> None:
    text = json.dumps(record())
    assert old in text
    (tmp_path / "plan.json").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=expected) as caught:
        reader(tmp_path / "plan.json")
    assert "\n" not in str(caught.value)


OTHER = ["", "[1, 2]", "{}", "\x00", "3", '{"format": FORMAT}', "[" * 100_000]


@pytest.mark.parametrize("text", OTHER, ids=range(len(OTHER)))
@pytest.mark.parametrize(
    ("reader", "name", "number"),
    [*((reader, "plan.json", FORMAT) for reader in READERS), (load_goal, "goal.json", GOAL_FORMAT)],
)
def test_other_files_are_refused(
    reader: Callable[[Path], object], name: str, number: int, tmp_path: Path, text: str
) -> None:
    (tmp_path / name).write_text(text.replace("FORMAT", str(number)))
    with pytest.raises(InputError, match=f"not a {name}".replace(".", r"\.")):
        reader(tmp_path / name)


@shared
def goal_file() -> str:
    """Return goal.json of a trip, as it is written."""
    with TemporaryDirectory() as folder:
        write_plan(hindered_trip(), Path(folder))
        content = load_goal(Path(folder, "goal.json"))
        made = load_plan(Path(folder, "plan.json"))
        assert content["plan_id"] == made["id"]
        assert made["predicted_poses"][-1] == pytest.approx(content["predicted_end"])
        return Path(folder, "goal.json").read_text()


def test_a_goal_reads_back(tmp_path: Path) -> None:
    content = json.loads(goal_file())
    (tmp_path / "goal.json").write_text(goal_file())
    assert load_goal(tmp_path / "goal.json") == content
    assert content["goal"] == [3, 0, 0]
    assert [next(iter(region)) for region in content["keep_out"]] == ["circle", "polygon"]
    assert np.array(content["walls"]) == pytest.approx(np.array(WALLS))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"format": 99}, f"format 99, this version reads {GOAL_FORMAT}"),
        ({"format": FORMAT, "reference": []}, f"format {FORMAT}"),
        ({"goal": [1.0, 2.0]}, "goal.json: goal must be 3 finite numbers"),
        ({"goal": [1.0, 2.0, float("nan")]}, "goal must be 3 finite numbers"),
        ({"margin_over_l": float("inf")}, "margin_over_l must be a finite number"),
        ({"margin_over_l": "wide"}, "margin_over_l must be a finite number"),
        ({"via": 3}, "via must be 0 or more rows of 2 finite numbers"),
        ({"via": [[1, 2, 3]]}, "via must be 0 or more rows of 2 finite numbers"),
        ({"keep_out": [{"circle": [0, 0, -1]}]}, "radius above 0"),
        ({"keep_out": [{"square": [0, 0, 1]}]}, "not a goal.json"),
        ({"walls": [[0, 0], [1, 1]]}, "three or more points"),
        ({"plan_id": 3}, "plan_id must be text"),
    ],
)
def test_edited_goals_are_refused(tmp_path: Path, changes: dict[str, Any], expected: str) -> None:
    (tmp_path / "goal.json").write_text(json.dumps({**json.loads(goal_file()), **changes}))
    with pytest.raises(InputError, match=expected) as caught:
        load_goal(tmp_path / "goal.json")
    assert "\n" not in str(caught.value)


TWO = """
apart = "3cm"
robot = "paper-control"
objective = "flips"
[[member]]
name = "right"
path = "right.csv"
[[member]]
path = "up.csv"
delay_s = 10
"""


def write_files(folder: Path, text: str = TWO) -> Path:
    (folder / "right.csv").write_text("x_cm,y_cm\n0,0\n33,0\n")
    (folder / "up.csv").write_text("x_cm,y_cm\n11,-21\n11,24\n")
    (folder / "fleet.toml").write_text(text)
    return folder / "fleet.toml"


def command(path: Path, out: Path, *words: str) -> int:
    from planner.__main__ import main

    return run_command(main, ["fleet", str(path), "--out", str(out), *words])


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (TWO, "apart = 1\n", "no robots"),
        ('apart = "3cm"', "", "how far apart"),
        ('apart = "3cm"', 'apart = "3 apples"', "distance apart: 3 apples; write a length"),
        ('apart = "3cm"', 'apart = "30cm"', "right and robot-2 start"),
        ('"right"', '"../right"', "names a folder"),
        ('"right"', '"robot-2"', "two robots are named robot-2"),
        ("delay_s = 10", "delay_s = -1", "start delay"),
        ("delay_s = 10", 'delay_s = "soon"', "delay_s"),
        ('path = "right.csv"', "", "one of path, goal, places, region"),
        ('path = "right.csv"', 'path = "right.csv"\ngoal = [1, 1, 1]', "one of path, goal, places, region"),
        ('path = "right.csv"', 'path = "wrong.csv"', "wrong.csv"),
        ('path = "right.csv"', 'path = "right.csv"\nspeed = 3', "--speed"),
        ('path = "right.csv"', 'path = "right.csv"\narduino = "board"', "arduino is of a plan on its own"),
        ('path = "right.csv"', 'path = "right.csv"\ntrade_off = true', "trade_off is of a plan on its own"),
        ('robot = "paper-control"', 'robot = "no-such"', "no robot 'no-such'"),
        ('robot = "paper-control"', "", "give robot, and one of"),
        ('apart = "3cm"', 'apart = "3cm"\nfeedback = 1', "write true or false"),
    ],
)
def test_it_refuses_in_one_line_and_writes_nothing(
    old: str, new: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert old in TWO
    path = write_files(tmp_path, TWO.replace(old, new, 1))
    assert command(path, tmp_path / "out") == 2
    error = capsys.readouterr().err
    assert expected in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_options_for_all_robots_and_places(tmp_path: Path) -> None:
    path = write_files(tmp_path, 'unit = "cm"\n[[member]]\nrobot = "paper-control"\nplaces = [[0, 0], [-30, 5]]\n'
                                 'return = true\nkeep_out = ["circle:1,2,3", "circle:4,5,6"]\n'
                                 '[[member]]\nrobot = "r"\nstart = [1, 0, 0]\ngoal = [3, 2, 90]\n')  # fmt: skip
    robot, other = read_fleet(path).robots
    assert other.command == "goal"
    assert other.words == ("--robot", "r", "--unit", "cm", "--start", "1", "0", "0", "--goal", "3", "2", "90")
    assert robot.command == "tour"
    assert robot.words == (
        "--robot", "paper-control", "--unit", "cm", "--return", "--keep-out", "circle:1,2,3", "--keep-out",
        "circle:4,5,6", "--", "0,0", "-30,5",
    )  # fmt: skip


def test_the_old_name_of_the_array_is_read(tmp_path: Path) -> None:
    new, old = 'path = "right.csv"\n', TWO.replace('robot = "paper-control"\n', "", 1)
    old = old.replace("[[member]]", '[[robot]]\nrobot = "paper-control"')
    assert new in old
    assert read_fleet(write_files(tmp_path, old)) == read_fleet(write_files(tmp_path, TWO))


def test_distances_have_units() -> None:
    control, other = PRESETS["paper-control"], PRESETS["paper-measured"]
    assert distance_apart("10 cm", None, [control, other]) == pytest.approx(0.1)
    assert distance_apart(10, "cm", [control, other]) == pytest.approx(0.1)
    assert distance_apart("0.5l", None, [control, control]) == pytest.approx(0.5 * control.tail_length)
    with pytest.raises(InputError, match=r"distance apart: 0\.5 has no unit"):
        distance_apart(0.5, None, [control, control])
    with pytest.raises(InputError, match="different tail lengths"):
        distance_apart(0.5, "l", [control, replace(other, tail_length=0.1)])
    with pytest.raises(InputError, match="above 0"):
        distance_apart("0cm", None, [control])
