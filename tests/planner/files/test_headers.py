"""schedule.h and tracker.h in C and C++, with tables in memory or in flash: the same orders as in Python."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.files.headers import milliseconds, rounded, schedule_header, table_bytes, tracker_header
from planner.jobs.plan import plan
from planner.planning.plan import Plan
from planner.planning.request import POSE, Camera
from planner.tracking.swim import swim
from planner.tracking.tracker import SLACK, Command, Tracker
from planner.vehicle.vehicle import Vehicle
from sim.model.presets import PRESETS
from tests.planner.compiled import MEMORIES, SOURCES, WARNINGS, CompiledTracker, compile_c
from tests.planner.plans import planned
from tests.planner.vehicles import PROMPT, root_mean_square
from tests.processes import LIMIT
from tests.shared import shared

pytestmark = pytest.mark.slow

# A difference in the last digit grows, because each flip decides the later ones. So answers are compared up to
# SHORT; after it the two are only as good as each other.
SHORT, ROUNDING = 36.0, 1e-11
# Each language and each memory, beside C99 with constants.
OTHERS = [("c99", "far flash"), ("c++11", "near flash"), ("c++17", "constants")]


@shared
def bent() -> Plan:
    """Plan a short path: see ROUNDING."""
    share = np.linspace(0, 1, 200)
    path = np.stack([2.4 * share, 0.3 * np.sin(np.pi * share)], 1)
    return rounded(plan(path, PRESETS["paper-control"], minimum_dwell=0.6, point="head_tip"))


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> CompiledTracker:
    return CompiledTracker(bent(), tmp_path_factory.mktemp("double"))


def answers(tracker: CompiledTracker) -> np.ndarray:
    """Feed flips and poses near the plan, and return all answers and states."""
    tracker.restart()
    rng, now, rows = np.random.default_rng(3), 0.0, []
    for n in range(60):
        pose = tuple(bent().poses[n] + 0.01 * rng.normal(size=3)) if n % 2 else None
        command = tracker.update(now, pose)  # type: ignore[arg-type]
        rows.append([command.direction, command.flip_at, command.error, *tracker.state])
        now = command.flip_at
    return np.array(rows)


@pytest.mark.parametrize(("language", "memory"), OTHERS)
def test_the_tracker_is_the_same_in_every_language_and_memory(
    language: str, memory: str, compiled: CompiledTracker, tmp_path: Path
) -> None:
    plain = answers(compiled)
    other = answers(CompiledTracker(bent(), tmp_path, language=language, memory=memory))
    assert other == pytest.approx(plain, rel=1e-12, abs=1e-15)
    assert np.ptp(plain[:, 3]) > 0.1


@pytest.mark.parametrize(("language", "memory"), [("c99", "constants"), *OTHERS])
def test_the_schedule_is_the_same_in_every_language_and_memory(language: str, memory: str, tmp_path: Path) -> None:
    result = bent()
    (tmp_path / "schedule.h").write_text(schedule_header(result, "test"))
    shutil.copy(SOURCES / "schedule.c", tmp_path / "main.c")
    compile_c(tmp_path / "main.c", tmp_path / "main", *MEMORIES[memory], language=language)
    done = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True, timeout=LIMIT)
    numbers = [float(word) for word in done.stdout.split()]
    dwells = milliseconds(result.seconds)
    assert numbers[: len(dwells)] == dwells
    checkpoints = np.array(numbers[len(dwells) : -3]).reshape(-1, 4)
    assert checkpoints[0, 1:] == pytest.approx(result.poses[0], abs=1e-5)
    assert checkpoints[-1, 1:] == pytest.approx(result.poses[-1], abs=1e-5)
    assert checkpoints[-1, 0] == numbers[-3] == sum(dwells)
    assert sum(dwells) == pytest.approx(1000 * result.seconds.sum(), abs=1)
    start = [100 * result.robot.length_scale * result.start[0], math.degrees(result.start[2])]
    assert numbers[-2:] == pytest.approx(start, abs=1e-3)


def avr(folder: Path, device: str, *flags: str) -> Path:
    """Compile the firmware for an AVR; the test is skipped where there is no avr-gcc."""
    compiler = shutil.which("avr-gcc")
    if compiler is None:
        pytest.skip("no avr-gcc on this machine (Debian: gcc-avr, avr-libc)")
    (folder / "tracker.h").write_text(tracker_header(bent(), "test"))
    (folder / "schedule.h").write_text(schedule_header(bent(), "test"))
    shutil.copy(SOURCES / "firmware.c", folder / "main.c")
    words = [compiler, "-std=gnu99", f"-mmcu={device}", *WARNINGS[:3], "-Os", "-DF_CPU=16000000UL", *flags]
    subprocess.run([*words, "-o", folder / "main.elf", folder / "main.c", "-lm"], check=True, timeout=LIMIT)
    return folder / "main.elf"


@pytest.mark.rest
@pytest.mark.parametrize("device", ["atmega644p", "atmega1284p", "atmega2560"])
def test_on_an_avr_the_tables_need_no_ram(device: str, tmp_path: Path) -> None:
    elf = avr(tmp_path, device, "-c")
    sizes = subprocess.run(["avr-size", elf], capture_output=True, text=True, check=True, timeout=LIMIT).stdout
    _, data, bss, *_ = map(int, sizes.splitlines()[1].split()[:4])
    symbols = subprocess.run(
        ["avr-nm", "-S", elf], capture_output=True, text=True, check=True, timeout=LIMIT
    ).stdout
    tracker = int(next(line.split()[1] for line in symbols.splitlines() if line.endswith(" keeper")), 16)
    assert data + bss - tracker < 32  # what printf needs
    assert tracker < 1150


@pytest.mark.rest
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


class Both:
    """Feeds the trackers in Python and in C, and compares their answers."""

    def __init__(self, one: Tracker, other: CompiledTracker, start: POSE | None = None):
        self.one, self.other, self.calls, self.over = one, other, 0, False
        other.restart(start)
        self.last, self.told = one.command, other.update(0.0)
        self.plan, self.start = one.plan, one.start

    def update(self, now: float, pose: POSE | None = None, seen_at: float | None = None) -> Command:
        seen = now if seen_at is None else seen_at
        flips = now >= self.last.flip_at - SLACK
        expected = self.one.update(now, pose, seen)
        self.over |= self.one._now > SHORT
        if self.over:
            self.last = expected
            return expected
        answer = self.other.update(max(now, self.told.flip_at) if flips else now, pose, seen)
        words = (expected.direction, expected.finished, expected.alarm)
        assert words == (answer.direction, answer.finished, answer.alarm)
        assert answer.flip_at == pytest.approx(expected.flip_at, rel=ROUNDING)
        assert answer.error == pytest.approx(expected.error, rel=ROUNDING)
        learned = list(self.one.learned.values())
        assert learned == pytest.approx(self.other.state.tolist(), rel=ROUNDING, abs=ROUNDING)
        self.calls, self.last, self.told = self.calls + 1, expected, answer
        return expected


def slower() -> Vehicle:
    """Make a robot that is slower than planned and turns faster to the left."""
    car = bent().tracked.vehicle
    return replace(car, twist=car.twist * np.array([[0.97, 0.97, 1.04], [0.97, 0.97, 0.98]]))


@pytest.mark.parametrize(
    "camera",
    [
        PROMPT,
        replace(PROMPT, lost=1.0),
        replace(PROMPT, delay_s=2.0, lost=0.2, wrong=0.1),
        pytest.param(
            replace(PROMPT, every_s=0.21, delay_s=0.9, lost=0.5, wrong=0.3, seed=1), marks=pytest.mark.rest
        ),
    ],
    ids=["good", "none at all", "late, gaps, wrong", "often and bad"],
)
def test_the_same_orders_as_in_python(compiled: CompiledTracker, camera: Camera) -> None:
    both = Both(Tracker(bent()), compiled)
    swim(both, slower(), camera)
    assert both.calls > 40
    assert both.one.command.finished


@pytest.mark.parametrize("told", [True, False], ids=["told", "seen"])
def test_the_same_way_back_as_in_python(compiled: CompiledTracker, told: bool) -> None:
    """From 0.6 l beside the start: the way is planned at once, or when the camera has seen where the robot is."""
    x, y, heading = bent().start
    start = x - 0.6 * math.sin(heading), y + 0.6 * math.cos(heading), heading + 1.0
    both = Both(Tracker(bent(), start=start if told else None), compiled, start if told else None)
    result = swim(both, bent().tracked.vehicle, replace(PROMPT, every_s=0.7), start=start)
    assert both.calls > 40
    assert both.one._law._way is not None or both.one.command.finished
    assert result.distance[-50:].max() < 0.1


@pytest.mark.parametrize(
    "seed", [*range(6), *(pytest.param(seed, marks=pytest.mark.rest) for seed in range(6, 20))]
)
def test_the_same_orders_from_nonsense(compiled: CompiledTracker, seed: int) -> None:
    """Times that go back and jump, poses from anywhere, late by any time, no numbers."""
    rng = np.random.default_rng(seed)
    both = Both(Tracker(bent()), compiled)
    odd = [math.nan, math.inf, -math.inf, 1e300, -1e300, 0.0]
    now = 0.0
    for _ in range(300):
        now = max(now + float(rng.choice([0.1, 0.5, 3.0, -1.0]) * rng.random()), 0.0)
        near = np.array(both.one._estimate.pose) + rng.normal(size=3) * rng.choice([0.01, 0.1, 3.0])
        pose = tuple(float(v) if rng.random() < 0.97 else float(rng.choice(odd)) for v in near)
        time = now if rng.random() < 0.95 else float(rng.choice(odd))
        seen = float(now - rng.exponential(rng.choice([0.1, 2.0, 20.0])))
        both.update(time, pose if rng.random() < 0.7 else None, seen)  # type: ignore[arg-type]


def test_in_c_the_robot_stays_on_its_path_as_well(tmp_path: Path, compiled: CompiledTracker) -> None:
    """In double and in single precision; and their memory is what the documentation says."""
    single = CompiledTracker(bent(), tmp_path, single=True)
    camera = replace(PROMPT, delay_s=1.0, lost=0.2)
    python = swim(Tracker(bent()), slower(), camera).distance
    compiled.restart()
    for tracker in (compiled, single):
        result = swim(tracker, slower(), camera)
        assert root_mean_square(result.distance) == pytest.approx(root_mean_square(python), rel=0.03)
        assert min(result.dwells[:-1]) >= bent().minimum_dwell * (1 - 1e-6)
    assert single.memory <= 1350
    assert compiled.memory <= 2350
    rows = len(bent().declared.reference.q)
    assert table_bytes(bent()) == 2 * (2 * 33 * 101 * 3 + 2 * 101 * 3) + 12 * rows


def test_the_example_in_the_header_compiles(tmp_path: Path) -> None:
    text = tracker_header(bent(), "test")
    (tmp_path / "tracker.h").write_text(text)
    lines = [line[3:] for line in text.splitlines()[:16] if line.startswith(" *     ")]
    code = "\n".join(line.partition(";")[0] + ";" for line in lines)
    given = "double now = 0, seen = 0; tracker_real x = 0, y = 0, heading = 0;"
    program = f'#include "tracker.h"\nint main(void){{ {given}\n{code}\nreturn advice.direction == 0; }}\n'
    (tmp_path / "main.c").write_text(program)
    compile_c(tmp_path / "main.c", tmp_path / "main")


def test_sixteen_bits_are_enough() -> None:
    """Path and lags as the header has them: the planned flips change by less than a millisecond."""
    one, other = Tracker(planned()), Tracker(rounded(planned()))
    for _ in range(200):
        assert one.command.flip_at == pytest.approx(other.command.flip_at, abs=4e-4)
        one.update(one.command.flip_at)
        other.update(other.command.flip_at)
