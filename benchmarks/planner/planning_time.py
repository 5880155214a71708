"""Time and memory of planning: short paths, and how both grow with the length of a path.

Every path is planned in a process of its own, after the look-up table has been loaded and a circle planned. Times
are processor times of one thread, for short paths the mean of three. The last column compares plans of one run,
so it does not depend on the machine: where it stays at 1, time is linear in the length.

Usage: python -m benchmarks planning_time [LONGEST]     [l], default 10000

Takes three minutes.
"""

from __future__ import annotations

import math
import resource
import subprocess
import sys

from threadpoolctl import threadpool_limits

from benchmarks.markdown import heading, row
from benchmarks.timing import processor_time
from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import plan
from planner.vehicle.from_table import default_table
from sim.model.presets import PRESETS

ROBOT = "paper-control"
SHORT = {
    "circle, radius 3 l": circle(3.0),
    "square, side 3 l": polygon(4, 3.0),
    "triangle, side 3 l": polygon(3, 3.0),
}
LENGTHS = (100.0, 300.0, 1000.0, 3000.0, 10_000.0)


def measured(path: Path2D, *, repeats: int) -> tuple[float, int, float, float]:
    """Plan in this process: seconds, dwells, memory before and at most [MB]."""
    lookup, robot = default_table(), PRESETS[ROBOT]
    plan(circle(1.5), robot, lookup=lookup)
    before, counts = _most_memory(), []
    seconds = processor_time(lambda: counts.append(len(plan(path, robot, lookup=lookup).dwells)), repeats=repeats)
    return seconds, counts[0], before, _most_memory()


def _most_memory() -> float:
    """Return the largest memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000


def _apart(*words: str) -> tuple[float, ...]:
    """Run this module in another process and read what it measured."""
    command = [sys.executable, "-m", "benchmarks", "planning_time", *words]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return tuple(float(value) for value in output.split())


def main(*words: str) -> None:
    threadpool_limits(1)
    if words[:1] == ("--short",):
        print(*measured(SHORT[words[1]], repeats=3))
        return
    if words[:1] == ("--long",):
        print(*measured(circle(float(words[1]) / (2 * math.pi)), repeats=1))
        return
    print(heading("path", "dwells", "s", "ms a dwell"))
    for name in SHORT:
        seconds, dwells, *_ = _apart("--short", name)
        print(row(name, f"{dwells:.0f}", f"{seconds:.2f}", f"{1000 * seconds / dwells:.2f}"))
    print()
    print(heading("circle of length / l", "dwells", "s", "ms a dwell", "memory / MB", "of that the plan",
                  "kB a dwell", "s/l over that of the first"))  # fmt: skip
    first = 0.0
    for length in LENGTHS:
        if length > float(words[0] if words else LENGTHS[-1]):
            break
        seconds, dwells, before, after = _apart("--long", str(length))
        first = first or seconds / length
        own = after - before
        print(row(f"{length:g}", f"{dwells:.0f}", f"{seconds:.1f}", f"{1000 * seconds / dwells:.3f}",
                  f"{after:.0f}", f"{own:.0f}", f"{1000 * own / dwells:.2f}",
                  f"{seconds / length / first:.2f}"))  # fmt: skip
