"""Time that a calibration announces for fitting effects, beside the time that they then take.

Tables and traces published in `tests.oracles.others`, drawn traces with an effect at 20 standard deviations,
tables of robots and swims with a hidden effect. Where the residual is within the noise nothing is announced.

Usage: python -m benchmarks forecasts

Takes 15 minutes.
"""

from __future__ import annotations

import io
import re
import time
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple
from unittest.mock import patch

import softflagella as sf
from benchmarks.calibration.swims import hidden
from benchmarks.common import heading, per_cent, row
from calibration.attribution import effects
from calibration.swimmer.synthetic_table import make_table
from calibration.verdict import explain
from sim.model.presets import PRESETS
from tests.oracles.drawn_swims import drawn_swim
from tests.oracles.drawn_traces import FAMILIES, Design, draw_traces, model_of_traces, size_at
from tests.oracles.others import SETS, calibrated, table_of
from tests.oracles.swims import make_track

_ANNOUNCED = re.compile(r"fit takes? ([\d.]+) (s|min) of processor time")
_LONG = 3.0  # s: what takes less need not be announced
_STRENGTH = 20.0  # λ of an effect in drawn traces
_SWIMS = (31, 32, 33)
_HIDDEN = ({"head_flow": 0.5}, {"end_over_end_drag": 4.0}, {"disc_drag": 1.5})


class Told(NamedTuple):
    """An announcement and what became of it [s]."""

    announced: float
    taken: float  # of processor time, by all fits
    wall: float


class Listener(io.StringIO):
    """Note when a time is announced, and how long the fits then take."""

    def __init__(self) -> None:
        super().__init__()
        self.announced = float("nan")
        self.told: list[Told] = []

    def write(self, words: str) -> int:
        """Read an announcement."""
        if match := _ANNOUNCED.search(words):
            self.announced = float(match[1]) * (60 if match[2] == "min" else 1)
        return len(words)

    def examine(self, *arguments: Any, **keywords: Any) -> Any:
        """Examine effects, and note the time where one was announced."""
        self.announced = float("nan")
        began, began_on_wall = time.process_time(), time.perf_counter()
        result = effects.examine(*arguments, **keywords)
        if self.announced > 0:
            taken, wall = time.process_time() - began, time.perf_counter() - began_on_wall
            self.told.append(Told(self.announced, taken, wall))
        return result


def cases() -> Iterator[tuple[str, Callable[[], Any]]]:
    """Yield what is calibrated, with progress."""
    for name, measured in SETS.items():
        if table_of(measured):
            yield measured.title, partial(calibrated, name, progress=True)
    for number, family in enumerate(FAMILIES.values()):
        for term in (effect.name for effect in family.effects[:2]):
            size: dict[str, Any] = {term: size_at(family, Design(), number, term, _STRENGTH)}
            rows, model = draw_traces(family, Design(), number, **size), model_of_traces(family)
            yield f"traces, {term}", partial(sf.calibrate, rows, model, trace="trace", session="day")
    robot = PRESETS["paper-control"]
    for effect in _HIDDEN:
        table = make_table(replace(robot, effects=effect), seed=1)
        yield f"robot with {next(iter(effect))}", partial(sf.calibrate, table, robot, laws=False)
    for seed in _SWIMS:
        swim = drawn_swim(seed)
        term, truth = hidden(swim, seed)
        track = make_track(truth, swim.plan, seed=seed, **swim.disturbed)
        yield f"swim with {term}", partial(sf.calibrate, track, swim.given, plan=swim.plan, seed=seed)


def main() -> None:
    """Print a line for each announcement, and how many were within a factor of two."""
    near = count = 0
    print(heading("table", "announced, s", "processor time, s", "wall clock, s"))
    for name, work in cases():
        listener = Listener()
        with patch.object(explain, "examine", listener.examine), redirect_stderr(listener):
            work()
        for told in listener.told:
            print(row(name, f"{told.announced:.0f}", f"{told.taken:.1f}", f"{told.wall:.1f}"), flush=True)
            if max(told.announced, told.taken) >= _LONG:
                count += 1
                near += 0.5 <= told.announced / told.taken <= 2
    if count:
        print(f"of {count} of {_LONG:g} s and more within a factor of two: {per_cent(near, count)}")
