"""Processor time from the shell to the answer of `plan`, `steady`, `query` and `calibrate`, and its parts.

Usage: python -m benchmarks startup [RUNS]

The first column is the whole command. The others are parts of a process that does the same from Python: start of
the interpreter and imports; reading the look-up table and compiled loops, that is the first answer less a second
one; a second answer. `calibrate` is that of a model of one's own, of which only the command writes a report. The
least of RUNS runs each (default: 5).

Takes 45 seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from tempfile import TemporaryDirectory

from benchmarks.common import interpreter_time

_MARKED = """
import time
{imports}
marks = [time.process_time()]
for _ in range(2):
    {answer}
    marks.append(time.process_time())
print(*marks)
"""
_PLAN = (
    """
import sys
from planner.files.plan_files import write_plan
from planner.paths.path import circle
from planner.jobs.plan import plan
from sim.model.presets import PRESETS
""",
    "write_plan(plan(circle(1.5), PRESETS['paper-control']), sys.argv[1])",
)
_STEADY = (
    """
from sim.inputs import group_columns, load_robot
from sim.motion.batches import steady_columns
from sim.motion.steady_motion import describe_motion
""",
    "describe_motion(load_robot('paper-control'), steady_columns(group_columns([load_robot('paper-control')])))",
)
_QUERY = (
    """
from functools import cache
from sim.inputs import group_columns, load_robot
from surrogate.answers import answer_with_error
from surrogate.table_file import load_table
read = cache(load_table)
""",
    "answer_with_error(read(), group_columns([load_robot('paper-control')]))",
)
_MODEL, _RUNS = "docs/models/tower.py", "docs/models/data/tower.csv"
_CALIBRATE = (
    f"""
from calibration.own_model.model_file import load_model
from softflagella.closed_loop import calibrate
model, table = load_model({_MODEL!r}, {_RUNS!r})
""",
    "calibrate(table, model, session='ball_kg_m3', progress=False)",
)


def main(*words: str) -> None:
    runs = int(words[0]) if words else 5
    print(f"{'processor time [s]':20}{'command':>9}{'imports':>9}{'loading':>9}{'answer':>9}")
    with TemporaryDirectory() as folder:
        commands = {
            "plan circle:1.5l": (["plan", "circle:1.5l", "--robot", "paper-control", "--out", folder], _PLAN),
            "steady": (["steady", "paper-control"], _STEADY),
            "query": (["query", "paper-control"], _QUERY),
            "calibrate": (
                ["calibrate", _RUNS, "--model", _MODEL, "--session", "ball_kg_m3", "--out", f"{folder}/out"],
                _CALIBRATE,
            ),
        }
        for name, (command, (imports, answer)) in commands.items():
            whole = min(interpreter_time("-m", "softflagella", *command)[0] for _ in range(runs))
            code = _MARKED.format(imports=imports, answer=answer)
            marks = [interpreter_time("-c", code, folder)[1].split()[-3:] for _ in range(runs)]
            parts = [_parts([float(mark) for mark in run]) for run in marks]
            print(f"{name:20}{whole:9.2f}" + "".join(f"{min(part):9.3f}" for part in zip(*parts, strict=True)))


def _parts(marks: Sequence[float]) -> tuple[float, float, float]:
    """Return imports, loading and answer from the times after imports, first and second answer."""
    imported, first, second = marks
    return imported, (first - imported) - (second - first), second - first
