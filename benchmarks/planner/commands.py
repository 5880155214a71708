"""Processor time and memory of whole commands: tables of 10⁵ robots, long paths, a goal among obstacles.

Usage: python -m benchmarks commands [REVISION]

With a revision its commands are timed beside, in the same run. Each figure is the least of some runs.

Takes 3 minutes (10 with a revision, whose loops are compiled first).
"""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from benchmarks.common import ROOT, checked_out, heading, row
from sim.model.presets import PRESETS

_ROBOTS = _POINTS = 100_000
_STEADY = 2000  # robots that are simulated
_RUNS = 3
_MEASURED = """
import resource, subprocess, sys
subprocess.run([sys.executable, "-m", "softflagella", *sys.argv[1:]], check=True, stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)
"""


def main(revision: str = "") -> None:
    """Print a line for each command."""
    with TemporaryDirectory() as folder, checked_out(revision) if revision else nullcontext() as before:
        _compare({revision: before, "now": ROOT} if before else {"now": ROOT}, Path(folder))


def _compare(places: dict[str, Path], folder: Path) -> None:
    print(heading("command", *(f"{name}: {what}" for name in places for what in ("processor time", "memory"))))
    for name, words in _commands(folder).items():
        used: dict[str, list[tuple[float, float]]] = {place: [] for place in places}
        for _ in range(_RUNS + 1):  # the first one may compile loops
            for place, root in places.items():
                with TemporaryDirectory() as out:  # a file that is there is taken up where it ended
                    used[place].append(_used(root, [*words, "--out", f"{out}/out"]))
        cells = [text for runs in used.values() for text in (f"{min(runs)[0]:.1f} s", f"{min(runs)[1]:.0f} MB")]
        print(row(name, *cells), flush=True)


def _used(root: Path, words: list[str]) -> tuple[float, float]:
    """Run a command of the project in a folder; return its processor time [s] and its largest memory [MB]."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    words = [sys.executable, "-c", _MEASURED, *words]
    done = subprocess.run(words, cwd=root, env=environment, capture_output=True, text=True, check=True)
    seconds, memory = map(float, done.stdout.split())
    return seconds, memory


def _commands(folder: Path) -> dict[str, list[str]]:
    """Write the inputs of the commands."""
    rng = np.random.default_rng(0)
    robots = pd.DataFrame([PRESETS["paper-control"].group_values()] * _ROBOTS)
    robots["N"], robots["omega_bar"] = rng.integers(2, 6, _ROBOTS), rng.uniform(4, 9, _ROBOTS)
    for name in ("C_t", "C_r", "C_yr", "l_over_R", "L_over_R"):
        robots[name] *= rng.uniform(0.95, 1.05, _ROBOTS)
    robots.to_csv(folder / "robots.csv", index=False)
    robots[:_STEADY].to_csv(folder / "few.csv", index=False)
    angle = 2 * np.pi * np.arange(_POINTS) / _POINTS
    points = np.stack([6 * np.cos(angle) + 1.5 * np.cos(3 * angle), 5 * np.sin(angle) + np.sin(2 * angle)], 1)
    turns = np.linspace(0, 1, 4000)
    spiral = np.stack(
        [turn * (4 + 7.3 * turns) for turn in (np.cos(20 * np.pi * turns), np.sin(20 * np.pi * turns))], 1
    )
    spiral *= 480 / np.hypot(*np.diff(spiral, axis=0).T).sum()
    for name, path in {"points": points, "spiral": spiral}.items():
        pd.DataFrame(path, columns=["x", "y"]).to_csv(folder / f"{name}.csv", index=False)
    regions: list[tuple[float, float, float]] = []
    while len(regions) < 30:
        x, y, size = rng.uniform([3, -8, 0.3], [27, 8, 0.8]).tolist()
        if all(np.hypot(x - a, y - b) > size + r + 0.9 for a, b, r in regions):
            regions.append((x, y, size))
    around = [word for x, y, r in regions for word in ("--keep-out", f"circle:{x:.3f},{y:.3f},{r:.3f}")]
    plans = ["--robot", "paper-control", "--unit", "l"]
    return {
        f"query of {_ROBOTS} robots": ["query", str(folder / "robots.csv")],
        f"steady of {_STEADY} robots": ["steady", str(folder / "few.csv")],
        f"plan of a path with {_POINTS} points": ["plan", str(folder / "points.csv"), *plans],
        "plan of a path of 480 l": ["plan", str(folder / "spiral.csv"), *plans],
        "goal at 30 l among 30 obstacles": ["goal", *plans, "--goal", "30", "0", "0", *around],
    }
