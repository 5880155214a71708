"""Replays of long schedules in segments, beside those of dwells in order: time, and how far apart they are.

In order each dwell follows the one before, a robot in one lane. For one core the processor time counts; for all
cores the wall clock does. The distance is the largest at the end of a dwell; the error is that which the replay
states of itself.

Usage: python -m benchmarks replays [DWELLS]

Takes 4 minutes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pandas as pd

from benchmarks.common import heading, row
from sim.model.presets import PRESETS
from sim.model.schedule import Schedule
from sim.motion import segments
from sim.motion.replay import replay, replay_error
from sim.threads import available_jobs

_ROBOTS: tuple[dict[str, float], ...] = (
    *({"N": float(tails)} for tails in (1, 2, 3, 4, 5)),
    {"N": 2.0, "omega_bar": 40.0},
    {"N": 3.0, "left_right_bias": 0.3},
    {"N": 3.0, "tail_sag": 0.1},
    {"N": 4.0, "end_over_end_drag": 5.0, "motor_droop": 0.5},
)


def schedule(dwells: int, **changes: float) -> Schedule:
    """Draw dwells that differ, about two values in turn, as in a plan."""
    times = np.where(np.arange(dwells) % 2, 1.2, 1.6) * np.random.default_rng(0).uniform(0.8, 1.25, dwells)
    robot = {**PRESETS["paper-control"].group_values(), **changes}
    return Schedule(robot, 1, times, (0.0, 0.0, 0.0), 1.0)


@contextmanager
def dwells_in_order() -> Iterator[None]:
    """Cut no schedule for a while."""
    fewest, segments._FEWEST = segments._FEWEST, 10**9
    try:
        yield
    finally:
        segments._FEWEST = fewest


def spent(work: Callable[[], pd.DataFrame]) -> tuple[float, float, pd.DataFrame]:
    """Return processor time, wall-clock time and the result of a call."""
    wall, processor = time.perf_counter(), time.process_time()
    result = work()
    return time.process_time() - processor, time.perf_counter() - wall, result


def ends(track: pd.DataFrame) -> np.ndarray:
    return track.groupby("dwell").last()[["x_over_l", "y_over_l"]].to_numpy()


def main(dwells: str = "500") -> None:
    replay(schedule(1))  # compile
    print(f"\n{dwells} dwells; processor time as on one core, wall clock on {available_jobs()}")
    print(heading("robot", "in order [s]", "÷ (one core)", "÷ (all cores)", "apart [l]", "of its error"))
    for changes in _ROBOTS:
        swum = schedule(int(dwells), **changes)
        with dwells_in_order():
            slow, slow_wall, plain = spent(lambda swum=swum: replay(swum))  # type: ignore[misc]
        quick, quick_wall, track = spent(lambda swum=swum: replay(swum))  # type: ignore[misc]
        apart = float(np.hypot(*(ends(plain) - ends(track)).T).max())
        share = apart / replay_error(swum, track)
        words = ", ".join(f"{name} {value:g}" for name, value in changes.items())
        print(row(words, f"{slow:.1f}", f"{slow / quick:.1f}", f"{slow_wall / quick_wall:.1f}", f"{apart:.0e}",
                  f"{share:.1e}"), flush=True)  # fmt: skip
