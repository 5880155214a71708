"""Processor time of the response to a flip, alone and in a batch, and of one dwell by time steps.

Usage: python -m benchmarks response [ROBOTS].

Takes 3 minutes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.common import processor_time
from dataset.design import load_design
from sim.inputs import check_columns
from sim.model.groups import Groups
from sim.motion.batches import one_thread, split
from sim.motion.response import responses
from sim.motion.steady import steady
from sim.motion.warm import compile_once
from tests.oracles.switching import switch_response


def main(count: str = "128") -> None:
    robots = int(count)
    columns = check_columns(load_design().with_rows(robots).points())
    parts = [Groups.from_columns({n: c[rows] for n, c in columns.items()}) for rows in split(columns["N"], robots)]
    with one_thread():
        costs(parts, robots)


def costs(parts: list[Groups], robots: int) -> None:
    """Print milliseconds of processor time a robot, one at a time and in a batch."""
    singles = [part.select(np.array([i])) for part in parts for i in range(len(part))]
    rng = np.random.default_rng(0)
    ways: dict[str, Callable[[Groups], object]] = {
        "steady motion": lambda groups: steady(groups, stability=False),
        "… with the growth of perturbations": steady,
        "… and the whole curve, 25 dwells": lambda groups: responses(groups, history=False),
        "… and memory of the dwell before, and rest": responses,
    }
    compile_once()
    print(f"\n{robots} robots of the sweep, processor time a robot [ms]: one at a time, in a batch")
    for name, work in ways.items():
        for groups in parts:
            work(groups)  # load the machine code
        times = [1e3 * processor_time(partial(_each, work, some)) / robots for some in (singles, parts)]
        print(f"  {name:45s} {times[0]:7.2f} {times[1]:7.2f}", flush=True)
    dwells = [np.exp(rng.uniform(np.log(0.3), np.log(4.0), len(part))) for part in parts]
    stepped = processor_time(lambda: [switch_response(p, T) for p, T in zip(parts, dwells, strict=True)])
    print(f"  {'one dwell by time steps':45s} {1e3 * stepped / robots:15.2f}")


def _each(work: Callable[[Groups], object], some: list[Groups]) -> None:
    for groups in some:
        work(groups)
