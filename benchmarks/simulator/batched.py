"""What robots gain in a batch over one at a time: by what is computed, and effect by effect.

Robots with local effects share groups, one in each lane of the vector registers (`sim.lanes`). Robots with an
effect that reaches further are solved for one by one in a batch, too.

1. Robots of the sweep, steady motion, growth of perturbations, eight derivatives, response to 25 dwells, and the
   same with memory and rest: processor time a robot.
2. The steady motion with each effect of the catalogue at its typical size.

Usage: python -m benchmarks batched [ROBOTS]

Takes 3 minutes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.markdown import heading, row
from benchmarks.simulator.lanes import TAILS, robots_of, shortest
from sim.effects import catalogue
from sim.model.groups import Groups
from sim.model.slopes import SLOPE_INPUTS
from sim.motion.batches import one_thread
from sim.motion.response import responses
from sim.motion.sensitivity import sensitivities
from sim.motion.steady import orbits, steady

ROBOTS = 64
_FEW = 16  # robots with each effect
_WORK: dict[str, Callable[[Groups], object]] = {
    "steady motion": lambda groups: steady(groups, stability=False),
    "… with growth": steady,
    f"… with {len(SLOPE_INPUTS)} derivatives": lambda groups: sensitivities(groups, SLOPE_INPUTS),
    "… with response": lambda groups: responses(groups, history=False),
    "… with response, memory and rest": responses,
}


def times(work: Callable[[Groups], object], groups: Groups) -> tuple[float, float]:
    """Measure the processor time of a robot, one at a time and in a batch [s]."""
    singles = [groups.select(np.array([i])) for i in range(len(groups))]

    def singly() -> None:
        for robot in singles:
            work(robot)

    return shortest(singly) / len(groups), shortest(lambda: work(groups)) / len(groups)


def line(*words: str, alone: float, together: float) -> str:
    """Return a row of a table, from times in seconds."""
    return row(*words, f"{1e3 * alone:.2f}", f"{1e3 * together:.2f}", f"{alone / together:.1f}")


def main(robots: str = str(ROBOTS)) -> None:
    """Print both tables."""
    columns = "one at a time [ms]", "in a batch [ms]", "ratio"
    with one_thread(), np.errstate(all="ignore"):
        print(f"{robots} robots of the sweep for each of N = 2 to 5, processor time a robot\n")
        print(heading("what", *columns))
        for name, work in _WORK.items():
            found = [times(work, robots_of(tails, int(robots))) for tails in TAILS]
            alone, together = np.mean(found, 0)
            print(line(name, alone=alone, together=together), flush=True)
        print(f"\n{_FEW} robots with N = 3 and one effect, steady motion\n")
        print(heading("effect", "reach", *columns))
        base = robots_of(3, _FEW)
        for name, effect in sorted(catalogue().items()):
            groups = Groups(**{**vars(base), "effects": {name: np.full(len(base), effect.typical)}})
            alone, together = times(orbits, groups)
            print(line(effect.title, effect.reach, alone=alone, together=together), flush=True)
