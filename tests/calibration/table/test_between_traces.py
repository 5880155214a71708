"""What repeated traces say without a model: each fault is named, and nothing is where there is none."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calibration.findings.record import _difference
from calibration.report.report import sections
from calibration.statistics.study import LEVEL
from calibration.table.between_repeats import Difference
from calibration.table.between_traces import differences_of_traces
from calibration.table.runs import Runs
from calibration.words.render import next_steps, sentence
from common.arrays import Floats
from tests.calibration.words.test_all_combinations import with_flags

READINGS = 60
TIME = 30.0 * np.arange(1, READINGS + 1)
ALONG = (TIME - TIME[0]) / (TIME[-1] - TIME[0])
FALL = 333 * np.exp(-4 * ALONG)  # in standard deviations of the noise: 0.3 % of its range


def traces(y: Floats, *, repeats: int = 100, time: Floats = TIME) -> Runs:
    """Make runs of traces y (traces, T) of which so many in order are repeats."""
    count, readings = y.shape
    of, setting = np.repeat(np.arange(count), readings), np.arange(count) // repeats
    conditions = (setting[:, None] * readings + np.arange(readings)).ravel()
    days, cups = (tuple(f"{of} {'ABCDEFGHIJKL'[i]}" for i in range(count)) for of in ("day", "cup"))
    inputs = np.column_stack([setting[of], np.tile(time, count)])
    return Runs(
        ("T",), y.reshape(-1, 1), conditions, of, days, inputs, ("cup", "t_s"), np.arange(1, y.size + 1), (), (),
        trace=of, trace_names=cups, time=np.tile(time, count), time_name="t_s", output_scales={"T": (1.0, "°C")},
    )  # fmt: skip


def noise(seed: int, count: int, neighbours: float = 0.0) -> Floats:
    """Draw autoregressive noise (count, T) of standard deviation 1, with the correlation of `neighbours`."""
    white = np.random.default_rng(seed).standard_normal((count, READINGS))
    white[:, 1:] *= np.sqrt(1 - neighbours**2)
    for i in range(1, READINGS):
        white[:, i] += neighbours * white[:, i - 1]
    return white


def found(y: Floats, **how: int) -> list[tuple[str, str]]:
    return [(d.column, d.kind) for d in differences_of_traces(traces(y, **how), level=LEVEL)]


@pytest.mark.parametrize("neighbours", [0.0, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("repeats", [2, 3, 6])
def test_nothing_is_found_in_noise(neighbours: float, repeats: int):
    """Each trace has its own start, so that its curve falls from elsewhere."""
    named = 0
    for seed in range(8):
        starts = 1 + 0.05 * np.random.default_rng(seed).standard_normal((6, 1))
        named += bool(found(starts * FALL + 20 + noise(seed, 6, neighbours), repeats=repeats))
    assert named <= 1


def test_traces_without_repeats_say_nothing():
    assert found(noise(0, 4) + 9 * ALONG * np.arange(4)[:, None], repeats=1) == []


def faulty(kind: str, seed: int, count: int = 6, neighbours: float = 0.0) -> Floats:
    """Draw traces of which the second has a fault."""
    y = noise(seed, count, neighbours) + (0.0 if kind == "drift" else FALL)
    if kind == "drift":
        y[1] += 5 * ALONG
    elif kind == "clock":
        y[1] += 333 * np.exp(-4 * ALONG / 1.03) - FALL
    elif kind == "step":
        y[1, 30:] += 5
    else:
        y[1, -10:] = y[1, -10]
    return y


@pytest.mark.parametrize("kind", ["drift", "clock", "step", "saturation"])
def test_each_fault_is_named(kind: str):
    named = [found(faulty(kind, seed)) for seed in range(5)]
    assert sum(each == [("cup B", kind)] for each in named) >= 3
    assert all({column for column, _ in each} <= {"cup B"} for each in named)


@pytest.mark.parametrize("kind", ["step", "saturation"])
@pytest.mark.parametrize("count", [3, 12])
def test_sudden_faults_are_found_in_slow_noise(kind: str, count: int):
    named = [found(faulty(kind, seed, count, 0.9)) for seed in range(5)]
    assert sum(each == [("cup B", kind)] for each in named) >= 4


def test_sizes_are_those_of_the_fault():
    by_kind = {k: differences_of_traces(traces(faulty(k, 3)), level=LEVEL)[0] for k in ("drift", "clock", "step")}
    assert by_kind["drift"].size == pytest.approx(5, abs=1)
    assert by_kind["clock"].size == pytest.approx(0.03, abs=0.01)
    assert by_kind["step"].size == pytest.approx(5, abs=1)
    assert by_kind["step"].where == "at 930 s"


@pytest.mark.parametrize(("size", "named"), [(0, []), (4, [("cup D", "step")])])
def test_readings_that_are_missing_or_at_other_times_are_no_fault(size: float, named: list[tuple[str, str]]):
    """One trace begins four readings late; each reading is a little before or after those of the other traces."""
    for seed in range(6):
        times = TIME + np.random.default_rng(seed).uniform(-9, 9, (6, READINGS))
        y = 333 * np.exp(-4 * (times - TIME[0]) / (TIME[-1] - TIME[0])) + noise(seed, 6)
        y[3, 30:] += size
        runs = replace(traces(y), time=times.ravel())
        rows = np.flatnonzero((runs.trace != 2) | (np.arange(len(runs)) % READINGS > 3))
        assert [(d.column, d.kind) for d in differences_of_traces(runs.subset(rows), level=LEVEL)] == named


def test_two_readings_at_one_time_count_once():
    y, time = np.repeat(faulty("step", 1), 2, axis=1), np.repeat(TIME, 2)
    assert [d.kind for d in differences_of_traces(traces(y, time=time), level=LEVEL)] == ["step"]


def test_coarse_readings_are_no_saturation():
    """What flips between two steps of the scale in one trace may stay within one in another."""
    y = np.round(10 * np.exp(-9 * ALONG) + 0.2 * noise(5, 6))
    y[:, -20:] = np.random.default_rng(1).integers(0, 2, (6, 20))
    y[1, -20:] = 0
    assert "saturation" not in [kind for _, kind in found(y)]


def test_long_traces_are_averaged():
    y = np.repeat(faulty("step", 4), 20, axis=1) + np.random.default_rng(0).normal(size=(6, 20 * READINGS))
    time = np.linspace(0, 1800, 20 * READINGS)
    assert [d.kind for d in differences_of_traces(traces(y, time=time), level=LEVEL)] == ["step"]


def record_of(
    kind: str, *, against: str = "", size: float = 3.1, where: str = "", **changes: Any
) -> dict[str, Any]:
    d = Difference("T", "cup B", where, size, 6.8, 0.001, against, kind=kind, **changes)
    return _difference(d, traces(np.zeros((2, READINGS))))


def words_of(kind: str, **changes: Any) -> str:
    return str(record_of(kind, **changes)["words"])


def test_faults_in_words():
    whole = "from its beginning to its end"
    assert words_of("drift", where=whole) == (
        "trace cup B drifts away from its repeats by 3.1 °C from its beginning to its end (6.8 σ)"
    )
    assert words_of("drift", where=whole, against="cup A").startswith(
        "trace cup B drifts away from its repeat cup A by 3.1 °C"
    )
    assert words_of("clock", size=0.03) == "the clock of trace cup B runs 3 % fast (6.8 σ)"
    assert words_of("clock", size=-0.02, against="cup A", instead=("drift",)) == (
        "the clock of trace cup B runs 2 % slow against its repeat cup A, or it drifts (6.8 σ)"
    )
    assert (
        words_of("step", where="at 300 s")
        == "trace cup B steps by +3.1 °C at 300 s, and its repeats do not (6.8 σ)"
    )
    assert words_of("saturation", where="from 300 s on", size=-4.0) == (
        "trace cup B stays at one value from 300 s on, while its repeats change by 4 °C (6.8 σ)"
    )


def test_a_verdict_says_it_first_asks_to_check_it_and_lists_it():
    differences = [record_of("clock", size=0.03, where="all the time", instead=("drift",))]
    record = with_flags("none", {"differences": differences})
    said, seen = sentence(record), sections(record, {})
    assert "Without any model: the clock of trace cup B runs 3 % fast, or it drifts (6.8 σ)." in said
    assert "This trace is fitted as it was read." in said
    assert "number of the fit" not in said
    assert next_steps(record)[0].startswith(
        "Check how trace cup B came about: the clock of trace cup B runs 3 % fast"
    )
    assert "<td>trace cup B</td>\n<td>clock or drift, all the time</td>\n<td>3.0 %</td>" in seen
