"""tracker.h: compiled without a warning, and the same orders as in Python, whatever it is fed."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from planner.files.tracker_header import rounded, table_bytes, tracker_header
from planner.paths.path import circle
from planner.planning.camera import Camera
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.tracking.clock import SLACK
from planner.tracking.swim import swim
from planner.tracking.tracker import POSE, Command, Tracker
from sim.model.presets import PRESETS
from tests.planner.compiled import CompiledTracker, compile_c
from tests.planner.vehicles import PROMPT, root_mean_square

# A difference in the last digit grows, because each flip decides the later ones. So answers are compared up to
# SHORT; after it the two are only as good as each other.
SHORT, ROUNDING = 36.0, 1e-11


@cache
def planned() -> Plan:
    """Plan a short path: see ROUNDING."""
    share = np.linspace(0, 1, 200)
    path = np.stack([2.4 * share, 0.3 * np.sin(np.pi * share)], 1)
    return rounded(plan(path, PRESETS["paper-control"], minimum_dwell=0.6, point="head_tip"))


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> CompiledTracker:
    return CompiledTracker(planned(), tmp_path_factory.mktemp("double"))


class Both:
    """Feeds the trackers in Python and in C, compares their answers, and holds them to the shortest dwell."""

    def __init__(self, one: Tracker, other: CompiledTracker, start: POSE | None = None):
        self.one, self.other, self.calls, self.over = one, other, 0, False
        other.restart(start)
        self.last, self.told, self.flipped_at = one.command, other.update(0.0), 0.0

    def update(self, now: float, pose: POSE | None = None, seen_at: float | None = None) -> Command:
        seen = now if seen_at is None else seen_at
        flips = now >= self.last.flip_at - SLACK
        announced = self.last.flip_at - self.one._clock.set_by
        expected = self.one.update(now, pose, seen)
        self.over |= self.one._now > SHORT
        if self.over:
            self.last = expected
            return expected
        answer = self.other.update(max(now, self.told.flip_at) if flips else now, pose, seen)
        assert (expected.direction, expected.finished, expected.alarm) == (
            answer.direction,
            answer.finished,
            answer.alarm,
        )
        assert answer.flip_at == pytest.approx(expected.flip_at, rel=ROUNDING)
        assert answer.error == pytest.approx(expected.error, rel=ROUNDING)
        assert list(self.one.learned.values()) == pytest.approx(
            self.other.state.tolist(), rel=ROUNDING, abs=ROUNDING
        )
        if expected.direction == -self.last.direction != 0:  # the flip that was announced has happened
            assert announced - self.flipped_at >= planned().minimum_dwell * (1 - 1e-12)
            self.flipped_at = announced
        self.calls, self.last, self.told = self.calls + 1, expected, answer
        return expected


@pytest.mark.parametrize(
    "camera",
    [
        PROMPT,
        replace(PROMPT, lost=1.0),
        replace(PROMPT, delay_s=2.0, lost=0.2, wrong=0.1),
        replace(PROMPT, every_s=0.21, delay_s=0.9, lost=0.5, wrong=0.3, seed=1),
    ],
    ids=["good", "none at all", "late, gaps, wrong", "often and bad"],
)
def test_the_same_orders_as_in_python(compiled: CompiledTracker, camera: Camera) -> None:
    car = planned().tracked.vehicle
    truth = replace(car, twist=car.twist * np.array([[0.97, 0.97, 1.04], [0.97, 0.97, 0.98]]))
    both = Both(Tracker(planned()), compiled)
    swim(both, planned(), truth, camera)
    assert both.calls > 40
    assert both.one.command.finished


@pytest.mark.parametrize("told", [True, False], ids=["told", "seen"])
def test_the_same_way_back_as_in_python(compiled: CompiledTracker, told: bool) -> None:
    """From 0.6 l beside the start: the way is planned at once, or when the camera has seen where the robot is."""
    x, y, heading = planned().start
    start = x - 0.6 * math.sin(heading), y + 0.6 * math.cos(heading), heading + 1.0
    both = Both(Tracker(planned(), start=start if told else None), compiled, start if told else None)
    result = swim(both, planned(), planned().tracked.vehicle, replace(PROMPT, every_s=0.7), start=start)
    assert both.calls > 40
    assert both.one._law._way is not None or both.one.command.finished
    assert result.distance[-50:].max() < 0.1


@pytest.mark.parametrize("seed", range(20))
def test_the_same_orders_from_nonsense(compiled: CompiledTracker, seed: int) -> None:
    """Times that go back and jump, poses from anywhere, late by any time, no numbers."""
    rng = np.random.default_rng(seed)
    both = Both(Tracker(planned()), compiled)
    odd = [math.nan, math.inf, -math.inf, 1e300, -1e300, 0.0]
    now = 0.0
    for _ in range(300):
        now = max(now + float(rng.choice([0.1, 0.5, 3.0, -1.0]) * rng.random()), 0.0)
        near = np.array(both.one._estimate.pose) + rng.normal(size=3) * rng.choice([0.01, 0.1, 3.0])
        pose = tuple(float(v) if rng.random() < 0.97 else float(rng.choice(odd)) for v in near)
        time = now if rng.random() < 0.95 else float(rng.choice(odd))
        seen = float(now - rng.exponential(rng.choice([0.1, 2.0, 20.0])))
        both.update(time, pose if rng.random() < 0.7 else None, seen)  # type: ignore[arg-type]


@pytest.mark.parametrize("precise", [True, False], ids=["double", "single"])
def test_in_c_the_robot_stays_on_its_path_as_well(tmp_path: Path, precise: bool) -> None:
    single = CompiledTracker(planned(), tmp_path, single=not precise)
    car = planned().tracked.vehicle
    truth = replace(car, twist=car.twist * np.array([[0.97, 0.97, 1.04], [0.97, 0.97, 0.98]]))
    result = swim(single, planned(), truth, replace(PROMPT, delay_s=1.0, lost=0.2))
    distance, dwells = result.distance, result.dwells
    double = swim(Tracker(planned()), planned(), truth, replace(PROMPT, delay_s=1.0, lost=0.2)).distance
    assert root_mean_square(distance) == pytest.approx(root_mean_square(double), rel=0.03)
    assert min(dwells[:-1]) >= planned().minimum_dwell * (1 - 1e-6)


@pytest.mark.rest
def test_in_single_precision_the_way_back_is_as_short(tmp_path: Path, compiled: CompiledTracker) -> None:
    """From starts within 4 l: both arrive, and at nearly the same time."""
    single, (x, y, _) = CompiledTracker(planned(), tmp_path, single=True), planned().start
    rng = np.random.default_rng(6)
    for _ in range(6):
        r, angle = 4 * math.sqrt(rng.random()), rng.uniform(0, 2 * math.pi)
        start = x + r * math.cos(angle), y + r * math.sin(angle), rng.uniform(-math.pi, math.pi)
        ends = []
        for tracker in (single, compiled):
            tracker.restart()
            result = swim(tracker, planned(), planned().tracked.vehicle, PROMPT, start=start, longest=20)
            assert result.finished
            assert result.distance[-1] < 0.1
            ends.append(result.times[-1])
        assert ends[0] == pytest.approx(ends[1], rel=0.02)


def test_memory_is_what_the_documentation_says(tmp_path: Path, compiled: CompiledTracker) -> None:
    single = CompiledTracker(planned(), tmp_path, single=True)
    assert single.memory <= 1350
    assert compiled.memory <= 2350
    assert table_bytes(planned()) == 2 * (2 * 33 * 101 * 3 + 2 * 101 * 3) + 12 * len(
        planned().declared.reference.q
    )


def test_the_example_in_the_header_compiles(tmp_path: Path) -> None:
    text = tracker_header(planned(), "test")
    (tmp_path / "tracker.h").write_text(text)
    lines = [line[3:] for line in text.splitlines()[:16] if line.startswith(" *     ")]
    code = "\n".join(line.partition(";")[0] + ";" for line in lines)
    given = "double now = 0, seen = 0; tracker_real x = 0, y = 0, heading = 0;"
    program = f'#include "tracker.h"\nint main(void){{ {given}\n{code}\nreturn advice.direction == 0; }}\n'
    (tmp_path / "main.c").write_text(program)
    compile_c(tmp_path / "main.c", tmp_path / "main")


def test_sixteen_bits_are_enough() -> None:
    """Path and lags as the header has them: the planned flips change by less than a millisecond."""
    exact = plan(circle(2.0), PRESETS["paper-control"])
    one, other = Tracker(exact), Tracker(rounded(exact))
    for _ in range(200):
        assert one.command.flip_at == pytest.approx(other.command.flip_at, abs=4e-4)
        one.update(one.command.flip_at)
        other.update(other.command.flip_at)
