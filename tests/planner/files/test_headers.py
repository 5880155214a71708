"""schedule.h and tracker.h in C99, C++11 and C++17, with tables in memory or in flash: the same numbers."""

from __future__ import annotations

import re
import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from planner.files.plan_files import controller_header, milliseconds
from planner.files.tracker_header import tracker_header
from planner.paths.path import circle
from planner.planning.plan import plan
from planner.planning.planned import Plan
from sim.model.presets import PRESETS
from tests.planner.compiled import LANGUAGES, MEMORIES, CompiledTracker, compile_c
from tests.processes import LIMIT

_SCHEDULE = """#include <stdio.h>
#include "schedule.h"
int main(void)
{
    for (int i = 0; i < SCHEDULE_COUNT; i++) printf("%d ", (int)schedule_dwell_ms(i));
    for (int i = 0; i < SCHEDULE_CHECKPOINTS; i++) {
        schedule_checkpoint c = schedule_checkpoint_at(i);
        printf("%.9g %.9g %.9g %.9g ", (double)c.ms, (double)c.x, (double)c.y, (double)c.heading);
    }
    return 0;
}
"""
# Poses near the estimate, with flips as they are announced; the same on the microcontroller and here.
_FIRMWARE = """#include <stdio.h>
#include "tracker.h"
#include "schedule.h"
#ifdef __AVR__
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
static int put(char c, FILE *file)
{
    (void)file;
    while (!(UCSR0A & (1 << UDRE0))) {}
    UDR0 = c;
    return 0;
}
static FILE line = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);
#endif
static tracker keeper;
int main(void)
{
    int n, i;
    tracker_advice advice;
#ifdef __AVR__
    UCSR0B = 1 << TXEN0;
    stdout = &line;
#endif
    tracker_begin(&keeper, (tracker_real)0.01, (tracker_real)0.01, 0);
    advice = tracker_feed(&keeper, 0, 0, 0);
    for (n = 0; n < 30; n++) {
        double now = advice.flip_at + 0.0005;
        tracker_real pose[3];
        advice = tracker_feed(&keeper, now, 0, 0);
        for (i = 0; i < 3; i++) pose[i] = keeper.state[i] + (tracker_real)(0.005 * (i - 1));
        if (n % 3 == 2) advice = tracker_feed(&keeper, now, pose, now - 1.0);
        printf("%ld %d %d\\n", (long)(advice.flip_at * 1000 + 0.5), advice.direction, (int)schedule_dwell_ms(n));
    }
#ifdef __AVR__
    cli();
    sleep_enable();
    sleep_cpu();
#endif
    return 0;
}
"""


@cache
def planned() -> Plan:
    return plan(circle(1.5), PRESETS["paper-control"])


def answers(tracker: CompiledTracker) -> np.ndarray:
    """Feed flips and poses near the plan, and return all answers and states."""
    rng, now, rows = np.random.default_rng(3), 0.0, []
    for n in range(60):
        pose = tuple(planned().poses[n] + 0.01 * rng.normal(size=3)) if n % 2 else None
        command = tracker.update(now, pose)  # type: ignore[arg-type]
        rows.append([command.direction, command.flip_at, command.error, *tracker.state])
        now = command.flip_at
    return np.array(rows)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    return answers(CompiledTracker(planned(), tmp_path_factory.mktemp("plain")))


@pytest.mark.parametrize("memory", MEMORIES)
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_tracker_is_the_same_in_every_language_and_memory(
    language: str, memory: str, plain: np.ndarray, tmp_path: Path
) -> None:
    """C++ used to warn of a compound literal, and on AVR the tables were too large."""
    other = answers(CompiledTracker(planned(), tmp_path, language=language, memory=memory))
    assert other == pytest.approx(plain, rel=1e-12, abs=1e-15)
    assert np.ptp(plain[:, 3]) > 0.1


@pytest.mark.parametrize("memory", MEMORIES)
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_schedule_is_the_same_in_every_language_and_memory(language: str, memory: str, tmp_path: Path) -> None:
    (tmp_path / "schedule.h").write_text(controller_header(planned(), "test"))
    (tmp_path / "main.c").write_text(_SCHEDULE)
    compile_c(tmp_path / "main.c", tmp_path / "main", *MEMORIES[memory], language=language)
    done = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True, timeout=LIMIT)
    numbers = [float(word) for word in done.stdout.split()]
    dwells = milliseconds(planned().seconds)
    assert numbers[: len(dwells)] == dwells
    checkpoints = np.array(numbers[len(dwells) :]).reshape(-1, 4)
    assert checkpoints[0, 1:] == pytest.approx(planned().poses[0], abs=1e-5)
    assert checkpoints[-1, 1:] == pytest.approx(planned().poses[-1], abs=1e-5)
    assert checkpoints[-1, 0] == sum(dwells)


def test_a_table_in_flash_is_not_read_as_a_constant(tmp_path: Path) -> None:
    """The pretended flash would notice it; and schedule_ms does not exist there."""
    source = tracker_header(planned(), "test").replace(
        "TRACKER_REAL(tracker_knots, k + 1)", "tracker_knots[k + 1]"
    )
    (tmp_path / "tracker.h").write_text(source)
    (tmp_path / "schedule.h").write_text(controller_header(planned(), "test"))
    (tmp_path / "main.c").write_text(
        '#include <stdio.h>\n#include "tracker.h"\nint main(void){tracker_real lag[3];'
        'tracker_lag_of(0, (tracker_real)1.1, 1, lag);printf("%.12g", (double)lag[2]);return 0;}'
    )
    printed = []
    for memory in ("constants", "far flash"):
        compile_c(tmp_path / "main.c", tmp_path / "main", "-Wno-unused", *MEMORIES[memory])
        ran = subprocess.run([tmp_path / "main"], capture_output=True, timeout=LIMIT)
        printed.append((ran.returncode, ran.stdout))
    assert printed[0][0] == 0
    assert printed[0] != printed[1]  # what is read elsewhere may not be there at all
    (tmp_path / "main.c").write_text('#include "schedule.h"\nint main(void){return schedule_ms[0]==0;}')
    with pytest.raises(subprocess.CalledProcessError):
        compile_c(tmp_path / "main.c", tmp_path / "main", *MEMORIES["near flash"])


def avr(folder: Path, device: str, *flags: str) -> Path:
    """Compile the firmware for an AVR; the test is skipped where there is no avr-gcc."""
    compiler = shutil.which("avr-gcc")
    if compiler is None:
        pytest.skip("no avr-gcc on this machine (Debian: gcc-avr, avr-libc)")
    (folder / "tracker.h").write_text(tracker_header(planned(), "test"))
    (folder / "schedule.h").write_text(controller_header(planned(), "test"))
    (folder / "main.c").write_text(_FIRMWARE)
    words = [
        compiler,
        "-std=gnu99",
        f"-mmcu={device}",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-Os",
        "-DF_CPU=16000000UL",
        *flags,
    ]
    subprocess.run([*words, "-o", folder / "main.elf", folder / "main.c", "-lm"], check=True, timeout=LIMIT)
    return folder / "main.elf"


@pytest.mark.parametrize("device", ["atmega644p", "atmega1284p", "atmega2560"])
def test_on_an_avr_the_tables_need_no_ram(device: str, tmp_path: Path) -> None:
    elf = avr(tmp_path, device, "-c")
    sizes = subprocess.run(["avr-size", elf], capture_output=True, text=True, check=True, timeout=LIMIT).stdout
    _, data, bss, *_ = map(int, sizes.splitlines()[1].split()[:4])
    assert data + bss < 1100  # the tracker, 100 bytes of small tables, and what printf needs


def test_a_simulated_avr_gives_the_same_orders(tmp_path: Path) -> None:
    """All in single precision, times included."""
    elf = avr(tmp_path, "atmega2560")
    simulator = shutil.which("simavr")
    if simulator is None:
        pytest.skip("no simavr on this machine (Debian: simavr)")
    words = [simulator, "-m", "atmega2560", "-f", "16000000", elf]
    simulated = subprocess.run(words, capture_output=True, text=True, check=True, timeout=LIMIT)
    compile_c(tmp_path / "main.c", tmp_path / "main", "-DTRACKER_FLOAT")
    here = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True, timeout=LIMIT)
    row = re.compile(r"(\d+) (-?1) (\d+)")
    orders = [np.array([[int(v) for v in r] for r in row.findall(done)]) for done in
              (simulated.stdout + simulated.stderr, here.stdout)]  # fmt: skip
    assert len(orders[0]) == len(orders[1]) == 30
    assert (orders[0][:, 1:] == orders[1][:, 1:]).all()
    assert np.abs(orders[0][:, 0] - orders[1][:, 0]).max() <= 1
