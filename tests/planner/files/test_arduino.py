"""The Arduino library of a plan compiles for boards, and on a board with a pretended clock it does as planned."""

from __future__ import annotations

import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from common.errors import InputError
from planner.files.boards import write_arduino
from planner.files.headers import milliseconds
from planner.jobs.plan import plan
from planner.planning.plan import Plan
from sim.model.presets import PRESETS
from softflagella.__main__ import main
from tests.planner.compiled import SOURCES, WARNINGS, compile_c
from tests.processes import LIMIT
from tests.shared import shared

pytestmark = pytest.mark.slow

BOARD = SOURCES.parent / "arduino"
PLUS, MINUS, LIGHT, WAIT = 9, 10, 13, 20_000
NEARLY_OVER = 2**32 - 30_000  # of the clock: it starts anew soon after the motor has started
COMPILERS = {
    "AVR": ("avr-g++", "-mmcu=atmega328p", "gcc-avr, avr-libc"),
    "Cortex-M": ("arm-none-eabi-g++", "-mcpu=cortex-m0plus", "gcc-arm-none-eabi"),
}


@shared
def once() -> Plan:
    """A plan with dwells of more than 65 s, which the header splits."""
    return plan("circle:6l", PRESETS["paper-control"], minimum_seconds=66.0)


@shared
def laps() -> Plan:
    return plan("circle:1.2l", PRESETS["paper-control"], objective="flips", loop=True)


def run(library: Path, name: str, total: int, *words: str, first: int = 0, step: int = 1) -> np.ndarray:
    """Run a sketch for a time, with a clock that begins at `first`; rows of time, pin, value; all times in ms."""
    sketch, program = library / "examples" / name / f"{name}.ino", library.with_name(name)
    flags = ("-I", str(BOARD), "-I", str(library / "src"), "-include", "Arduino.h", str(BOARD / "board.cpp"))
    compile_c(sketch, program, *flags, language="c++11")
    command = [str(program), *map(str, (total, first, step)), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=LIMIT)
    return np.array([[int(word) for word in line.split()] for line in done.stdout.splitlines()])


def directions(events: np.ndarray, plus: int = PLUS, minus: int = MINUS, full: int = 255) -> list[tuple[int, int]]:
    """Times and directions of the motor: which input is at the full duty; never both are on."""
    pins, turns = {plus: 0, minus: 0}, [(0, 0)]
    for time, pin, value in events[np.isin(events[:, 1], [plus, minus])].tolist():
        pins[pin] = value
        assert sorted(pins.values()) in ([0, 0], [0, full])
        turn = (pins[plus] - pins[minus]) // full
        turns = [*turns[: -1 if turns[-1][0] == time else None], (time, turn)]
    return [turn for k, turn in enumerate(turns) if k == 0 or turn[1] != turns[k - 1][1]]


@pytest.mark.parametrize(("first", "step"), [(0, 1), (NEARLY_OVER, 7)])
def test_the_motor_flips_when_the_plan_says(first: int, step: int, tmp_path: Path) -> None:
    """Also where the clock, of 32 bits, starts anew; late loops do not add up; dwells of 0 ms are none."""
    result = once()
    assert 0 in milliseconds(result.seconds)
    library = write_arduino(result, tmp_path / "library")
    flips = WAIT + np.round(1000 * np.cumsum(result.seconds)).astype(int)
    events = run(library, "open_loop", int(flips[-1]) + 5000, first=first, step=step)
    turns = directions(events)
    assert turns[0] == (0, 0)
    expected = [result.first_direction * (-1) ** k for k in range(len(result.dwells))]
    assert [turn for _, turn in turns[1:]] == [*expected, 0]
    late = np.array([time for time, _ in turns[1:]]) - [WAIT, *flips]
    assert late.min() >= 0
    assert late.max() < step
    assert events[events[:, 1] == LIGHT].tolist() == [[0, LIGHT, 1], [WAIT, LIGHT, 0]]


def test_a_plan_that_repeats_goes_on(tmp_path: Path) -> None:
    result = laps()
    library = write_arduino(result, tmp_path / "library")
    lap = np.round(1000 * np.cumsum(result.seconds)).astype(int)
    turns = directions(run(library, "open_loop", WAIT + 2 * int(lap[-1]) + 1))
    flips = [WAIT, *(WAIT + lap).tolist(), *(WAIT + lap[-1] + lap).tolist()]
    assert [time for time, _ in turns[1:]] == flips
    assert {a * b for (_, a), (_, b) in pairwise(turns[1:])} == {-1}


def test_orders_turn_the_motor_and_silence_stops_it(tmp_path: Path) -> None:
    """Other bytes are ignored, and do not count as orders; before the first order the motor is at rest."""
    library = write_arduino(laps(), tmp_path / "library")
    words = ["100", "x\r\nF\n", "900", "F\n", "1500", "B\n", "2000", "S\n", "2300", "B\nF", "2600", "?\n\n"]
    expected = [(0, 0), (100, 1), (1500, -1), (2000, 0), (2300, 1), (3300, 0)]
    for first in (0, 2**32 - 2800):
        assert directions(run(library, "tracked", 6000, *words, first=first)) == expected


def test_the_first_test_turns_at_plus_one(tmp_path: Path) -> None:
    library = write_arduino(laps(), tmp_path / "library")
    assert directions(run(library, "first_turn", 20_000)) == [(0, 0), (5000, 1), (10_000, 0)]


@pytest.mark.parametrize("board", COMPILERS)
@pytest.mark.parametrize("sketch", ["first_turn", "open_loop", "tracked"])
def test_sketches_compile_for_boards(board: str, sketch: str, tmp_path: Path) -> None:
    """The schedule stays in flash."""
    compiler, machine, package = COMPILERS[board]
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler} on this machine (Debian: {package})")
    library = write_arduino(once(), tmp_path / "library")
    flags = ["-std=gnu++11", machine, *WARNINGS[:3], "-Os", "-ffunction-sections", "-c", "-x", "c++"]
    paths = ["-I", BOARD, "-I", library / "src", "-include", "Arduino.h"]
    source = library / "examples" / sketch / f"{sketch}.ino"
    words = [compiler, *flags, *paths, "-o", tmp_path / "sketch.o", source]
    subprocess.run(words, check=True, timeout=LIMIT)
    size = [compiler.replace("g++", "size"), tmp_path / "sketch.o"]
    sizes = subprocess.run(size, capture_output=True, text=True, check=True, timeout=LIMIT).stdout
    _, data, bss, *_ = map(int, sizes.splitlines()[1].split()[:4])
    assert data + bss < 64


def test_the_folder_is_an_arduino_library_and_is_replaced(tmp_path: Path) -> None:
    library = write_arduino(laps(), tmp_path / "library")
    write_arduino(once(), library)
    lines = (library / "library.properties").read_text().splitlines()
    properties = dict(line.split("=", 1) for line in lines)
    needed = "name version author maintainer sentence paragraph category url architectures"
    assert set(needed.split()) <= set(properties)
    assert properties["includes"] == "softflagella.h"
    assert once().identity in properties["sentence"]
    assert once().identity in (library / "src" / "schedule.h").read_text()
    assert "#define SCHEDULE_REPEATS" not in (library / "src" / "schedule.h").read_text()


def test_a_folder_with_other_files_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "thesis.tex").write_text("")
    with pytest.raises(InputError, match=r"has other files, such as src/thesis.tex; give a folder of its own"):
        write_arduino(laps(), tmp_path)
    words = ["plan", "circle:2l", "--robot", "paper-control", "--out", str(tmp_path / "plan")]
    with pytest.raises(InputError, match="has other files"):
        main([*words, "--arduino", str(tmp_path)])
    assert not (tmp_path / "plan").exists()
    goal = ["goal", "--goal", "5l", "0", "0", *words[2:], "--arduino", str(tmp_path / "src" / "thesis.tex")]
    monkeypatch.setattr("planner.goal.trip.to_goal", None)  # it is refused before
    with pytest.raises(InputError, match=r"thesis.tex is a file; give a folder"):
        main(goal)
    main([*words, "--arduino", str(tmp_path / "library")])
    assert capsys.readouterr().out.rstrip().endswith(f", {tmp_path / 'library'}")
    header = (tmp_path / "library" / "src" / "schedule.h").read_text()
    assert header == (tmp_path / "plan" / "schedule.h").read_text()
