"""The commands of the planner: units, what they write, `track`, `check` and `replay`; refusals in one line."""

from __future__ import annotations

import io
import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from common.errors import run_command
from planner.files.plan_files import write_plan
from sim.inputs import save_robot
from softflagella.__main__ import main
from tests.planner.plans import CONTROL, planned, trip
from tests.processes import LIMIT
from tracking.tracker import Tracker
from tracking.tracks import tracking_error

pytestmark = pytest.mark.slow

CM = 100 * CONTROL.tail_length
POSE = (0.3, -2.5, 1.0)
Capture = pytest.CaptureFixture[str]


FILES_OF_REFUSALS = {
    "path.csv": "x,y\n0,0\n3,0\n3,3\n",
    "line.csv": "x,y\n0,0\n4,0\n",
    "empty.csv": "x,y\n",
    "x_mm.csv": "x_mm,y_mm\n0,0\n300,0\n300,300\n",
    "path.svg": "<svg><path d='M 0 0 h 3 v 3'/></svg>",
    "track.csv": "time_s,x_cm,y_cm,heading_deg\n0,0,0,0\n",
    "no_heading.csv": "time_s,x_cm,y_cm\n0,0,0\n",
    "back.csv": "time_s,x_cm,y_cm,heading_deg\n2,0,0,0\n1,1,0,0\n",
    "far.csv": "time_s,x_cm,y_cm,heading_deg\n0,0,0,0\n1,1e300,0,0\n",
    "nan.csv": "time_s,x_cm,y_cm,heading_deg\n0,nan,0,0\n",
    "empty.json": "",
    "none.json": "{}",
    "words.json": "not json",
    "part.json": '{"format": 2, "robot": {"groups": {"omega_bar": 10}, "time_scale_s": 1}, "first_direction": 1}',
}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the files, and with the folder of a plan."""
    folder = tmp_path_factory.mktemp("files")
    for name, text in FILES_OF_REFUSALS.items():
        (folder / name).write_text(text)
    write_plan(planned(), folder / "made")
    for name in ("tour.json", "cover.json"):
        (folder / "made" / name).write_text("{}")
    return folder


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        # lengths and their units
        ("plan square:3 R", "square:3: its lengths have no unit; write it behind them, 24cm or 3l"),
        ("plan path.csv R", "path.csv: its lengths have no unit; write it behind them, 24cm or 3l"),
        ("plan path.svg R", "path.svg: its lengths have no unit;"),
        ("plan square:3l --unit cm R", "square:3l: --unit cm: it has a size of its own, it is 1.3"),
        ("plan x_mm.csv --unit cm R", "x_mm.csv: --unit cm: it has a size of its own"),
        ("plan square:3l --tolerance 5 R", "--tolerance: 5 has no unit; write 5cm, or 5l in tail"),
        ("plan square:3l --smooth 1 R", "--smooth: 1 has no unit"),
        ("plan square:3l --keep-out circle:9cm,0,2 R", "circle:9cm,0,2: 2 has no unit"),
        ("plan square:3l --keep-out box:0,0,2l R", "write box"),
        ("plan square:3l --walls path.csv R", "path.csv: its lengths have no unit"),
        ("plan square:3l --walls circle:0,0,3l R", "give a box or an outline"),
        ("track circle:1l --start 1 0 0 R", "--start: 1 has no unit"),
        ("track circle:1l --noise 1 R", "--noise: 1 has no unit"),
        ("goal --goal 300 200 0 R", "--goal: 300 has no unit"),
        ("goal --goal 3l 0 0 --via 2l -1 R", "--via: -1 has no unit"),
        ("goal --goal 3l 0 east R", "--goal: east; write the heading in degrees"),
        ("goal --start 1e9m 0 0 --goal 1e9m 1l 0 R", "start: give x, y and heading, as finite numbers below"),
        ("goal --goal 3l 0 0 --via 1e9m 0 R", "--via: give x and y, as finite numbers below 1e+06"),
        ("tour 0,0 300,0 R", "place 300,0: 300 has no unit"),
        ("tour path.csv R", "path.csv: its lengths have no unit"),
        ("hold 2,1 R", "place 2,1: 2 has no unit"),
        ("page --path square:3 R", "square:3: its lengths have no unit"),
        # paths, regions, cameras
        ("plan empty.csv --unit l R", "no rows"),
        ("plan path.csv --unit l --loop R", "a path that repeats is closed"),
        ("goal --goal 5l 0 0 --keep-out circle:5l,0,1l R", "error: there is no way: at the goal"),
        ("goal --goal 5l 0 0 --keep-out boxx:0,0,1,1 R",
         "boxx:0,0,1,1: no such file or region; is it box:0,0,1,1? regions are circle:X,Y,RADIUS, box:"),
        ("plan line.csv --unit l --keep-out ring:0,1 R", "ring:0,1: no such file or region; regions are circle:X"),
        ("plan line.csv --unit l --keep-out circle:0,0.2,0.4 R", "the path begins at"),
        ("plan line.csv --unit l --keep-out box:1.8,-1,2.2,1 --walls box:-1,-0.8,5,0.8 R",
         "where the robot has 0 cm (0 l) around it; it needs"),
        ("plan circle:1l --camera-errors 0.02l 0.03 1.5 0.5 1.1 R", "camera: lost is 1.1"),
        ("plan circle:1l --camera-errors 0.02 0.03 1.5 0.5 0.1 R", "0.02 has no unit"),
        ("plan circle:1l --camera-errors 0.02l 0.03cm 1.5 0.5 0.1 R", "-errors 0.02l 0.03cm 1.5 0.5 0.1: RAD"),
        ("plan circle:1l --camera-errors 0.02l 0.03 1.5 0.5 10% R", "numbers without a unit"),
        ("plan circle:1l --dwell 1 --objective time R", "dwell and objective: the objective chooses"),
        ("tour 0,0 2,0 --unit l --dwell 1 --objective error R", "leave one of them out"),
        ("plan circle:1l --dwell 0.5 --minimum-seconds 2 R",
         "dwell 1.1 s (0.5 time units) is shorter than the minimum, 2 s (0.91 time units)"),
        ("hold 2l,1l --dwell 0.5 --minimum-dwell 0.6 R", "is shorter than the minimum, 1.3"),
        ("plan circle:1l --dwell 4 --tolerance 0.01l R", "tolerance 1.1 mm (0.01 l) cannot be kept"),
        # jobs
        ("tour 0l,0 R", "two or more"),
        ("tour 0,0 1,1 0,0 --unit l R", "places 1 and 3 are the same"),
        ("tour 0,0 one,1 --unit l R", "place one,1: one; write a length"),
        ("tour 0,0 nan,0 --unit l R", "nan; write a length"),
        ("tour 0,0 1 --unit l R", "write X,Y"),
        ("tour 1e9m,0 1e9m,1l R", "place 1e9m,0: give x and y, as finite numbers below 1e+06"),
        ("tour 0,0 2,0 4,0 --unit l --keep-out circle:2,0,0.5 R", "place 2 at"),
        ("hold 1,2 --for 5 --unit cm R", "with its unit"),
        ("hold 1,2 --for=-3min --unit cm R", "above 0"),
        # saved plans
        ("track made/plan.json --smooth 0.3", "--smooth: made/plan.json is planned already"),
        ("track made R", "--robot: made is planned already"),
        ("track made --keep-out circle:0,0,1", "--keep-out: made is planned already"),
        ("track made --closed", "--closed: made is planned already"),
        ("track made --start 0 inf 0", "--start: inf; write a length"),
        ("track made --noise 0", "--noise: 0; write a length above 0"),
        ("track circle:2l", "circle:2l is no saved plan, so --robot is needed"),
        ("track made/tour.json", "tour.json"),
        ("track made/cover.json", "coverage of an area is planned no longer; give the plan.json beside it"),
        ("track made --camera 0", "--camera needs --view view.toml"),
        ("track made --camera 0 --view view.toml --start 0 0 0", "leave --start out"),
        ("track made --serial /dev/ttyACM0", "--view, --serial, --lost-seconds and --show are for --camera"),
        ("track made --lost-seconds 5", "--view, --serial, --lost-seconds and --show are for --camera"),
        ("track made --camera 0 --view view.toml --lost-seconds 0", "--lost-seconds 0.0; give a number above 0"),
        ("track made --camera film.mp4 --view none.toml", "none.toml: no such file"),
        ("check made/plan.json no_heading.csv", "no column 'heading_deg'"),
        ("check made/plan.json nan.csv", "row 1 of the track"),
        ("check made/plan.json back.csv", "time goes back at row 2"),
        ("check made/plan.json far.csv", "row 2 of the track"),
        ("check made/none.json track.csv", "none.json: no such file"),
        ("check made/plan.csv track.csv", "is not a plan.json"),
        ("check made/plan.json none.csv", "none.csv: no such file"),
        ("replay empty.json", "not a plan.json"),
        ("replay none.json", "no entry 'format'"),
        ("replay part.json", "no entry"),
        ("replay words.json", "not a plan.json"),
        ("replay made", "made is the folder of a plan; give made/plan.json"),
    ],
)  # fmt: skip
def test_refusals_are_one_line_and_write_nothing(
    words: str, expected: str, files: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.chdir(files)
    given = words.replace(" R", " --robot paper-control").split()
    if given[0] in ("plan", "tour", "hold") and "--dwell" not in given:
        given += ["--objective", "flips"]
    given += [] if given[0] == "track" else ["--out", "out"]
    assert run_command(main, given) == (3 if "no way" in expected else 2)
    out, err = capsys.readouterr()
    *said, error = err.splitlines()
    assert expected in error
    assert not (out and given[0] == "track")  # no header of a track that there is not
    assert not said or words.startswith("track circle")  # it prints the plan first
    assert not Path("out").exists()


@pytest.mark.parametrize(
    "words", ["square:240mm --tolerance 0.5cm", "path.csv --closed --unit cm --tolerance 0.5"]
)
def test_a_square_and_its_tolerance_have_units(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("path.csv").write_text("x,y\n0,0\n24,0\n24,24\n0,24\n")
    asked = ["plan", *words.split(), "--robot", "paper-control", "--objective", "flips", "--out", "out"]
    assert run_command(main, asked) == 0
    plan = json.loads(Path("out/plan.json").read_text())
    assert np.ptp(np.array(plan["raw_path"]), axis=0) == pytest.approx(0.24 / CONTROL.tail_length)
    assert plan["stated_error_over_l"] <= 0.005 / CONTROL.tail_length


def test_a_circle_is_a_lap(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["plan", "circle:1l", "--loop", "--robot", "paper-control", "--out", str(tmp_path)]
    assert run_command(main, words) == 0
    assert "repeat it: a lap ends" in capsys.readouterr().out
    assert "lap" in json.loads((tmp_path / "plan.json").read_text())


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a plan."""
    write_plan(planned(), tmp_path / "plan")
    return tmp_path / "plan"


def told(
    words: list[str], lines: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> list[str]:
    """Run the command on lines; return its answers."""
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(lines.encode("latin-1")), "utf-8"))
    capsys.readouterr()
    assert run_command(main, ["track", *words]) == 0
    return capsys.readouterr().out.splitlines()


def test_a_saved_plan_gives_the_orders_of_the_plan_in_memory(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    scale = CONTROL.time_scale
    tracker = Tracker(planned(), start=POSE)
    pose = f"{POSE[0]} {POSE[1]} {POSE[2]}"
    start = [str(CM * POSE[0]), str(CM * POSE[1]), str(math.degrees(POSE[2]))]
    in_l = [f"{x}l" for x in POSE[:2]]
    commands = [tracker.command, tracker.update(1.0 / scale), tracker.update(2.0 / scale, (0.31, -2.49, 1.01))]
    expected = [[command.direction, command.flip_at * scale] for command in commands]
    later = "1\n2 0.31 -2.49 1.01\n"
    for words, lines in (
        ([str(folder / "plan.json")], f"0 {pose}\n{later}"),
        ([str(folder), "--start", *start, "--unit", "cm"], f"0\n{later}"),
        (["circle:2l", "--robot", "paper-control", "--start", *in_l, start[2]], f"0\n{later}"),
    ):
        answers = [[float(word) for word in line.split()[:2]] for line in told(words, lines, monkeypatch, capsys)]
        assert answers == [pytest.approx(order, abs=1e-4) for order in expected]


def test_a_goal_trip_is_tracked_from_its_goal_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    write_plan(trip(), tmp_path)
    lines = "0\n1 0 0.1 0.1\n1.5 \xb0\n"  # the last one is no UTF-8
    first, second, _ = told([str(tmp_path / "goal.json")], lines, monkeypatch, capsys)
    assert first == "0 1.000000000 nan 0"
    assert second.split()[0] in ("1", "-1")


def test_another_robot_carries_out_a_plan_and_its_tracking_error_is_told(tmp_path: Path, capsys: Capture) -> None:
    """Its track is in the plan's tail lengths; without a terminal no bar is written."""
    result = planned("circle:1l", objective="flips")
    other = replace(CONTROL, name="other", tail_length=0.9 * CONTROL.tail_length)
    write_plan(result, tmp_path)
    save_robot(other, tmp_path / "other.toml")
    words = [str(tmp_path / "plan.json"), "--out", str(tmp_path / "track.csv"), "--no-error"]
    assert run_command(main, ["replay", *words, "--robot", str(tmp_path / "other.toml")]) == 0
    output = capsys.readouterr()
    assert "replay:" not in output.err
    told = output.out.splitlines()[-1]
    assert run_command(main, ["check", *words[:1], words[2]]) == 3
    assert capsys.readouterr().out.splitlines()[:-1] == [told]
    track = pd.read_csv(tmp_path / "track.csv")[["time_s", "x_cm", "y_cm", "heading_deg"]]
    assert tracking_error(result.to_dict(), track).line == told
    seconds = float(result.seconds.sum())
    assert track["time_s"].iloc[-1] == pytest.approx(seconds, rel=1e-6)
    assert "ABOVE the stated error" in told
    twin = write_plan(planned("circle:1.2l", objective="flips"), tmp_path / "twin")[0]
    assert run_command(main, ["check", str(twin), words[2]]) == 2
    assert f"is of plan {result.identity}, not of" in capsys.readouterr().err


_COMPILED = """
import shlex, sys
from softflagella.__main__ import main
from sim.jit import Loop
def loops():
    modules = list(sys.modules.values())
    known = {each for module in modules for each in vars(module).values() if isinstance(each, Loop)}
    return {(each.__name__, types) for each in known if "kernel" in vars(each) for types in each.kernel.signatures}
for words in sys.argv[1:-1]:
    main(shlex.split(words))
before = loops()
main(shlex.split(sys.argv[-1]))
assert before and loops() == before, loops() - before
"""


@pytest.mark.parametrize(
    ("first", "words"),
    [
        ([], "plan circle:2l --robot paper-control --feedback --out plan"),
        (["steady paper-control"], "steady paper-control --vary motor.speed_rpm=20,40,60 --plot motion.png"),
        (["sweep --rows 96 --out sweep --jobs 1"], "train sweep --out model.safetensors --epochs 1"),
    ],
)
def test_commands_need_no_loops_but_those_that_are_compiled_beforehand(
    first: list[str], words: str, tmp_path: Path
) -> None:
    command = [sys.executable, "-c", _COMPILED, "sim compile", "planner compile", *first, words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_a_motor_too_fast_to_simulate_its_flips_is_refused_at_once(tmp_path: Path, capsys: Capture) -> None:
    words = ["plan", "circle:3l", "--robot", "paper-control", "--set", "motor.speed_rpm=6000"]
    assert run_command(main, [*words, "--out", str(tmp_path / "p")]) == 2
    assert "too fast to flip: are all units right?" in capsys.readouterr().err
