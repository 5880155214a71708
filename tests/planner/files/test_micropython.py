"""The MicroPython modules of a plan do as planned, in MicroPython and on a pretended board."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from common.errors import InputError
from planner.files.boards import write_micropython
from planner.files.headers import milliseconds, schedule_header
from planner.planning.plan import Plan
from softflagella.__main__ import main
from tests.planner.files.test_arduino import directions, laps, once
from tests.processes import LIMIT

pytestmark = pytest.mark.slow

BOARD = Path(__file__).parents[1] / "micropython" / "board.py"
PLUS, MINUS, DUTY = 14, 15, 65535
HALF = 2**29  # ms; of the time in which a clock starts anew
ENDLESS = 10**12
INTERPRETERS = {"CPython": (sys.executable,), "MicroPython": (sys.executable, "-m", "micropython_unix")}


@pytest.fixture(params=INTERPRETERS)
def python(request: pytest.FixtureRequest) -> tuple[str, ...]:
    if request.param == "MicroPython" and find_spec("micropython_unix") is None:
        pytest.skip("no MicroPython; pip install 'softflagella[boards]'")
    return INTERPRETERS[request.param]


def run(
    python: tuple[str, ...],
    modules: Path,
    name: str,
    *words: str,
    first: int | str = 0,
    late: int = 0,
    until: int = ENDLESS,
) -> tuple[np.ndarray, list[str]]:
    """Run a program; return rows of time, pin and duty, times in ms, and further lines."""
    command = [*python, str(BOARD), name, *map(str, (first, late, until)), *words]
    done = subprocess.run(command, cwd=modules, capture_output=True, text=True, timeout=LIMIT)
    lines = (done.stdout + done.stderr).splitlines()
    events = [[int(word) for word in line.split()] for line in lines if re.fullmatch(r"[-\d ]+", line)]
    return np.array(events), [line for line in lines if not re.fullmatch(r"[-\d ]+", line)]


def turns_of(events: np.ndarray) -> list[tuple[int, int]]:
    return directions(events, PLUS, MINUS, DUTY)


def with_dwells(result: Plan, dwells: np.ndarray) -> Plan:
    """A plan with other dwells, whose errors nobody asks for."""
    poses = np.resize(result.poses, (len(dwells) + 1, 3))
    changed = replace(result, switches=replace(result.switches, dwells=dwells, poses=poses))
    vars(changed).update(identity=result.identity, unmeasured_error=None)
    return changed


@pytest.mark.parametrize(("first", "late", "longest"), [(0, 0, 0), (2**30 - 30_000, 7, 0), (HALF, 0, HALF + 1000)])
def test_the_motor_flips_when_the_plan_says(
    first: int, late: int, longest: int, python: tuple[str, ...], tmp_path: Path
) -> None:
    """Also where the clock starts anew, in a dwell too; late flips do not add up; dwells of 0 ms are none."""
    result = once()
    if longest:
        result = with_dwells(result, np.array([1.0, longest, longest]) / (1000 * result.robot.time_scale))
    assert 0 in milliseconds(result.seconds)
    modules = write_micropython(result, tmp_path / "modules")
    events, further = run(python, modules, "swim", first=first, late=late)
    turns, flips = turns_of(events), np.round(1000 * np.cumsum(result.seconds)).astype(int)
    assert further == []
    assert [turn for _, turn in turns] == [
        *(result.first_direction * (-1) ** k for k in range(len(result.dwells))),
        0,
    ]
    assert len(events) == 2 + 1 + 2 * (len(result.dwells) - 1) + 1  # no pin changes but at rest, start, flips, end
    after = np.array([time for time, _ in turns]) - [0, *flips]
    assert after.min() >= 0
    assert after.max() <= 2 * late  # the first flip waits for the motor's start


@pytest.mark.parametrize("before", [100, 3000, 61_500, 200_000])
@pytest.mark.parametrize("kind", ["4294967", "4294967:plain", "1073741824:plain"])
def test_a_clock_that_starts_anew_elsewhere_delays_by_one_entry_at_most(
    kind: str, before: int, python: tuple[str, ...], tmp_path: Path
) -> None:
    """In short entries and in those of a dwell of two minutes."""
    result = with_dwells(once(), np.array([3.5, 2.5, 130.0, 2.0] * 3) / once().robot.time_scale)
    modules = write_micropython(result, tmp_path / "modules")
    first = int(kind.partition(":")[0]) - before
    events, further = run(python, modules, "swim", first=f"{first}:{kind}", late=1)
    turns, flips = turns_of(events), np.round(1000 * np.cumsum(result.seconds)).astype(int)
    assert further == []
    after = np.array([time for time, _ in turns]) - [0, *flips]
    assert len(turns) == len(result.dwells) + 1
    assert after.min() >= 0
    assert after.max() <= max(milliseconds(result.seconds)) + 10


def test_a_plan_that_repeats_goes_on_until_it_is_stopped(python: tuple[str, ...], tmp_path: Path) -> None:
    result = laps()
    modules = write_micropython(result, tmp_path / "modules")
    lap = np.round(1000 * np.cumsum(result.seconds)).astype(int)
    until = 2 * int(lap[-1]) + 1
    events, further = run(python, modules, "swim", until=until)
    turns = turns_of(events)
    flips = [0, *lap.tolist(), *(lap[-1] + lap).tolist()]
    assert [time for time, _ in turns] == [*flips, until]
    assert {a * b for (_, a), (_, b) in pairwise(turns[:-1])} == {-1}
    assert turns[-1][1] == 0
    assert further == [f"{until} Ctrl-C 0"]


FAILING = """
def failing():
    calls = []
    def turn(direction):
        calls.append(direction)
        print("turn", direction)
        if len(calls) == 3:
            raise OSError("a pin fails")
    swim(turn)
"""


def test_the_motor_stops_at_an_error(python: tuple[str, ...], tmp_path: Path) -> None:
    modules = write_micropython(laps(), tmp_path / "modules")
    with (modules / "motor.py").open("a") as module:
        module.write(FAILING)
    first = laps().first_direction
    _, lines = run(python, modules, "failing")
    assert lines[:4] == [f"turn {first}", f"turn {-first}", f"turn {first}", "turn 0"]
    assert lines[-1] == "OSError: a pin fails"


def test_orders_turn_the_motor_and_silence_stops_it(python: tuple[str, ...], tmp_path: Path) -> None:
    """Other bytes are ignored, and do not count as orders; before the first order the motor is at rest."""
    modules = write_micropython(laps(), tmp_path / "modules")
    words = ["100", "x\r\nF\n", "900", "F\n", "1500", "B\n", "2000", "S\n", "2300", "B\nF", "2600", "?\n\n"]
    expected = [(0, 0), (100, 1), (1500, -1), (2000, 0), (2300, 1)]
    anew = f"{2**32 // 1000 - 2900}:{2**32 // 1000}"  # elsewhere than expected: stops earlier
    for first, silence in ((0, 3300), (2**30 - 2800, 3300), (anew, 2900)):
        events, _ = run(python, modules, "obey", *words, first=first, until=6000)
        assert turns_of(events) == [*expected, (silence, 0)]


def test_the_first_test_turns_at_plus_one(python: tuple[str, ...], tmp_path: Path) -> None:
    modules = write_micropython(laps(), tmp_path / "modules")
    for until, end in ((ENDLESS, 10_000), (7000, 7000)):
        events, _ = run(python, modules, "first_turn", until=until)
        assert turns_of(events) == [(0, 0), (5000, 1), (end, 0)]


def test_a_damaged_schedule_does_not_start(python: tuple[str, ...], tmp_path: Path) -> None:
    modules = write_micropython(laps(), tmp_path / "modules")
    text, total = (modules / "schedule.py").read_text(), sum(milliseconds(laps().seconds))
    (modules / "schedule.py").write_text(text.replace(f"TOTAL_MS = {total}", f"TOTAL_MS = {total + 1}"))
    events, further = run(python, modules, "swim")
    assert turns_of(events) == [(0, 0)]
    assert further[-1] == "ValueError: schedule.py is damaged; copy it again"


def test_schedule_py_has_the_numbers_and_words_of_schedule_h(tmp_path: Path) -> None:
    for result in (once(), laps()):
        text = (write_micropython(result, tmp_path) / "schedule.py").read_text()
        header = schedule_header(result, result.identity)
        values: dict[str, object] = {}
        exec(text, values)
        assert values["REPEATS"] == ("SCHEDULE_REPEATS" in header)
        assert np.frombuffer(values["ENTRIES"], "<u2").tolist() == milliseconds(result.seconds)  # type: ignore[call-overload]
        assert values["TOTAL_MS"] == sum(milliseconds(result.seconds))
        for name in ("FIRST_DIRECTION", "COUNT", "MOTOR_RPM", "START_X_CM", "START_HEADING_DEG", "START_Y"):
            (number,) = re.findall(rf"#define SCHEDULE_{name} \(?([-\d.]+)", header)
            assert values[name] == float(number)
        words = [line.removeprefix("# ") for line in text.splitlines() if line.startswith("# ")]
        assert f"Plan {result.identity}." == words[0]
        assert all(line in header for line in words)


def test_a_folder_with_other_files_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["plan", "circle:2l", "--robot", "paper-control", "--out", str(tmp_path / "plan")]
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "main.py").write_text("")
    with pytest.raises(
        InputError, match=r"other files, such as main.py; give a folder of its own for --micropython"
    ):
        main([*words, "--micropython", str(tmp_path / "full")])
    same = ["--arduino", str(tmp_path / "both"), "--micropython", str(tmp_path / "both")]
    with pytest.raises(InputError, match=r"--micropython \S+ is the same file as arduino \S+; give another name"):
        main([*words, *same])
    assert [path.name for path in tmp_path.iterdir()] == ["full"]
    main([*words, "--micropython", str(tmp_path / "modules")])
    assert capsys.readouterr().out.rstrip().endswith(f", {tmp_path / 'modules'}")
    write_micropython(laps(), tmp_path / "modules")  # replaced
    assert laps().identity in (tmp_path / "modules" / "schedule.py").read_text()


@pytest.mark.skipif(find_spec("micropython_unix") is None, reason="no MicroPython")
def test_a_long_schedule_fits_the_memory_of_a_small_board(tmp_path: Path) -> None:
    """Of 24 kB, 1,475 dwells take little more than two bytes each."""
    modules = write_micropython(with_dwells(laps(), np.resize(laps().dwells, 1475)), tmp_path / "modules")
    code = (
        "import gc, sys; sys.path.insert(0, '.'); gc.collect(); before = gc.mem_alloc()\n"
        "import schedule; gc.collect(); print(schedule.COUNT, gc.mem_alloc() - before)"
    )
    command = [*INTERPRETERS["MicroPython"], "-X", "heapsize=24k", "-c", code]
    done = subprocess.run(command, cwd=modules, capture_output=True, text=True, timeout=LIMIT, check=True)
    entries, memory = map(int, done.stdout.split())
    assert entries == 1475
    assert memory < 2 * entries + 1500
