"""One robot alone, against the commit that had loops for one robot only: processor time, run by turns.

1. A steady motion, with and without the growth of perturbations, for 4, 2 and 1 tails.
2. A replay of 20 dwells, for 4 tails and 1.

Usage: python -m benchmarks one_robot [COMMIT]

Takes 8 minutes.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from benchmarks.common import ROOT, checked_out, heading, row

SCALAR = "f244bafa"
TURNS = 3

# Both versions run this: names that they share, and the few that have moved.
_MEASURE = """
import json, sys, time
from dataclasses import replace
import numpy as np
from sim.model.presets import PRESETS
from sim.model.schedule import Schedule
from sim.motion.replay import replay
from sim.motion.steady import steady

def time_of(work, repeats):
    work()
    spent = []
    for _ in range(repeats):
        began = time.process_time()
        work()
        spent.append(time.process_time() - began)
    return min(spent)

robot, found = PRESETS["paper-control"], {}
for tails in (4, 2, 1):
    groups = replace(robot.groups(), N=tails)
    found[f"steady, N = {tails}"] = time_of(lambda: steady(groups), 40)
    found[f"steady without growth, N = {tails}"] = time_of(lambda: steady(groups, stability=False), 40)
for tails in (4, 1):
    dwells = np.linspace(0.3, 1.0, 20)
    schedule = Schedule({**robot.group_values(), "N": tails}, 1, dwells, (0.0, 0.0, 0.0), robot.time_scale)
    given = schedule if sys.argv[1] == "new" else [schedule]
    found[f"replay of 20 dwells, N = {tails}"] = time_of(lambda: replay(given), 3)
print(json.dumps(found))
"""


def measured(folder: Path, version: str) -> dict[str, float]:
    code = f"import sys; sys.path.insert(0, {str(folder)!r}){_MEASURE}"
    command = [sys.executable, "-c", code, version]
    done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True, check=True)
    return dict(json.loads(done.stdout))


def main(commit: str = SCALAR) -> None:
    with checked_out(commit) as old:
        turns = [(measured(old, "old"), measured(ROOT, "new")) for _ in range(TURNS)]
    print(heading("one robot alone", f"{commit} [ms]", "this version [ms]", "ratio"))
    for name in turns[0][0]:
        before, now = (1e3 * min(turn[i][name] for turn in turns) for i in range(2))
        ratio = np.median([new[name] / past[name] for past, new in turns])
        print(row(name, f"{before:.2f}", f"{now:.2f}", f"{ratio:.2f}"))
