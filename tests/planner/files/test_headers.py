"""schedule.h in C and C++, with its tables in memory or in flash: dwells and checkpoints of the plan."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from planner.files.headers import milliseconds, schedule_header
from planner.jobs.plan import plan
from planner.planning.plan import Plan
from sim.model.presets import PRESETS
from tests.planner.compiled import MEMORIES, SOURCES, WARNINGS, compile_c
from tests.processes import LIMIT
from tests.shared import shared

pytestmark = pytest.mark.slow


@shared
def bent() -> Plan:
    share = np.linspace(0, 1, 200)
    path = np.stack([2.4 * share, 0.3 * np.sin(np.pi * share)], 1)
    return plan(path, PRESETS["paper-control"], minimum_dwell=0.6, point="head_tip")


def program(folder: Path) -> Path:
    """Write the source of a program that prints the tables of the plan."""
    (folder / "schedule.h").write_text(schedule_header(bent(), "test"))
    return Path(shutil.copy(SOURCES / "schedule.c", folder / "main.c"))


def check_tables(said: str) -> None:
    """Assert that the tables are those of the plan, up to the last digit of the header."""
    result, numbers = bent(), [int(word) for word in re.findall(r"= (-?\d+)", said)]
    dwells = milliseconds(result.seconds)
    assert numbers[: len(dwells)] == dwells
    checkpoints = np.array(numbers[len(dwells) : -3]).reshape(-1, 4)
    assert checkpoints[0, 1:] == pytest.approx(1e5 * result.poses[0], abs=1)
    assert checkpoints[-1, 1:] == pytest.approx(1e5 * result.poses[-1], abs=1)
    assert checkpoints[-1, 0] == numbers[-3] == sum(dwells)
    assert sum(dwells) == pytest.approx(1000 * result.seconds.sum(), abs=1)
    x_cm, degrees = 100 * result.robot.length_scale * result.start[0], np.degrees(result.start[2])
    assert numbers[-2:] == pytest.approx([1e4 * x_cm, 1e3 * degrees], abs=1)


@pytest.mark.parametrize(
    ("language", "memory"),
    [("c99", "constants"), ("c99", "far flash"), ("c++11", "near flash"), ("c++17", "constants")],
)
def test_the_schedule_is_the_same_in_every_language_and_memory(language: str, memory: str, tmp_path: Path) -> None:
    compile_c(program(tmp_path), tmp_path / "main", *MEMORIES[memory], language=language)
    done = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True, timeout=LIMIT)
    check_tables(done.stdout)


def avr(folder: Path, device: str, *flags: str) -> Path:
    """Compile the program for an AVR; the test is skipped where there is no avr-gcc."""
    compiler = shutil.which("avr-gcc")
    if compiler is None:
        pytest.skip("no avr-gcc on this machine (Debian: gcc-avr, avr-libc)")
    words = [compiler, "-std=gnu99", f"-mmcu={device}", *WARNINGS[:3], "-Os", "-DF_CPU=16000000UL", *flags]
    words += ["-o", str(folder / "main.elf"), str(program(folder))]
    subprocess.run(words, check=True, timeout=LIMIT)
    return folder / "main.elf"


@pytest.mark.rest
@pytest.mark.parametrize("device", ["atmega644p", "atmega1284p", "atmega2560"])
def test_on_an_avr_the_tables_need_no_ram(device: str, tmp_path: Path) -> None:
    size = ["avr-size", avr(tmp_path, device, "-c")]
    sizes = subprocess.run(size, capture_output=True, text=True, check=True, timeout=LIMIT).stdout
    _, data, bss, *_ = map(int, sizes.splitlines()[1].split()[:4])
    assert data + bss < 32  # what printf needs


@pytest.mark.rest
@pytest.mark.parametrize("device", ["atmega644p", "atmega2560"])
def test_a_simulated_avr_reads_the_same_tables(device: str, tmp_path: Path) -> None:
    elf = avr(tmp_path, device)
    simulator = shutil.which("simavr")
    if simulator is None:
        pytest.skip("no simavr on this machine (Debian: simavr)")
    words = [simulator, "-m", device, "-f", "16000000", elf]
    done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=LIMIT)
    check_tables(done.stdout + done.stderr)
