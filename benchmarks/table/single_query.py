"""Time of the look-up table's answers: one robot, the first one in a new process, and each of a batch.

Usage: python -m benchmarks single_query [REPEATS]

One robot is the mean of REPEATS queries (default: 2000), the least of five such means. The first answer is the
processor time from the start of the interpreter, of numpy alone and of all imports, the table and one query, the
least of five processes. The batch has 4096 robots of the domain.

Takes 30 seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from benchmarks.common import interpreter_time, processor_time
from common.arrays import Floats
from sim.inputs import group_columns, load_robot
from sim.model.groups import DWELL
from surrogate.table import NeuralTable
from surrogate.table_file import load
from surrogate.training.simulated import draw_robots

BATCH, RUNS = 4096, 5
_QUERY = """
import numpy as np
from sim.inputs import load_robot
from surrogate.table_file import load_table
groups = load_robot("paper-control").group_values()
load_table().query({name: np.array([value]) for name, value in groups.items()})
"""


def main(*words: str) -> None:
    repeats = int(words[0]) if words else 2000
    lookup, robot = load(), group_columns([load_robot("paper-control")])
    flipped = {**robot, DWELL: np.array([2.0])}
    print("one robot [µs of processor time]")
    for name, columns, intervals in (
        ("steady motion", robot, False),
        ("with intervals", robot, True),
        ("with a dwell", flipped, False),
        ("with a dwell and intervals", flipped, True),
    ):

        def query(columns: Mapping[str, Floats] = columns, intervals: bool = intervals) -> object:
            return lookup.query(columns, intervals=intervals)

        print(f"  {name:28}{1e6 * _least(query, repeats):6.0f}")
    print("\nfirst answer in a new process [s of processor time]")
    for name, code in (("numpy alone", "import numpy"), ("imports, table and query", _QUERY)):
        print(f"  {name:28}{min(interpreter_time('-c', code)[0] for _ in range(RUNS)):6.2f}")
    print(f"\neach of a batch of {BATCH} [µs of processor time]")
    drawn = draw_robots(BATCH, 0, wide=False)
    several = drawn | {"N": np.maximum(drawn["N"], 2.0)}
    for name, columns in (
        ("one tail and more", drawn),
        ("one tail", drawn | {"N": np.ones(BATCH)}),
        ("two tails and more", several),
        ("with a dwell", several | {DWELL: np.full(BATCH, 2.0)}),
    ):
        plain, widths = (_each(lookup, columns, intervals=intervals) for intervals in (False, True))
        print(f"  {name:28}{plain:6.1f}, with intervals{widths:6.1f}")


def _each(lookup: NeuralTable, columns: Mapping[str, Floats], *, intervals: bool) -> float:
    """Return the time of each robot of a batch [µs]."""
    return 1e6 * _least(lambda: lookup.query(columns, flag=True, intervals=intervals), 1) / BATCH


def _least(work: Callable[[], object], repeats: int) -> float:
    """Return the least mean time of a call in several runs [s]."""
    work()
    return min(processor_time(work, repeats=repeats) for _ in range(RUNS))
