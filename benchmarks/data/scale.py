"""Sweeps at scale: dask beside one process, where the time goes, and what a million rows cost on a cluster.

1. Rows of sweep.toml on dask across four processes of this machine, and on one process: rows a second, processor
   time and memory of the head (the process that schedules; with dask the scheduler is in it).
2. Processor time by part, of a build in one process.
3. Synthetic rows, which take no time to simulate, in files of 1,024 and of 4,096: processor time and memory of the
   head for a file, and for a row.
4. Cost of 10⁶ and 10⁷ rows on 100 and 1,000 cores, from these figures.

Usage: python -m benchmarks scale [ROWS] [DASK_WORKERS]

Takes 20 minutes with 100,000 rows on two cores.
"""

from __future__ import annotations

import cProfile
import json
import pstats
import subprocess
import sys
from tempfile import TemporaryDirectory
from typing import NamedTuple
from unittest.mock import patch

import numpy as np

from benchmarks.common import ROOT, heading, row
from common.arrays import Floats
from dataset.build import build, chunk_rows
from dataset.design import load_design
from sim.threads import available_jobs
from tests.dataset import sweeps

_PROFILED, _SYNTHETIC = 4096, (100_000, 400_000)
_SHORT, _LONG = 1024, 4096  # rows of a file
_BUILD = """
import json, re, sys, time
from pathlib import Path
import dataset.build
from dataset.build import build
from dataset.design import load_design
from tests.dataset import sweeps
out, backend = sys.argv[1:3]
rows, jobs, synthetic = map(int, sys.argv[3:])
if synthetic:
    dataset.build._MAX_ROWS = synthetic
began, spent = time.perf_counter(), time.process_time()
if synthetic:
    made = build(sweeps.design(rows), out, backend=backend, jobs=jobs, title="", simulate=sweeps.invented)
else:
    made = build(load_design().with_rows(rows), out, backend=backend, jobs=jobs, title="")
status = Path("/proc/self/status").read_text()  # getrusage begins with the peak of the parent
peak = int(re.search(r"VmHWM:\\s+(\\d+)", status)[1]) / 1024
took = time.perf_counter() - began, time.process_time() - spent
print(json.dumps([*took, peak, made["cost_s"], len(made["parts"])]))
"""
_PARTS = {
    "simulate": ("simulate_here",),
    "points of the design": ("points", "history"),
    "pack: Parquet": ("arrow_table", "packed"),
    "write": ("write",),
    "check": ("checked_part",),
    "manifest, card": ("_publish",),
}
_HEAD = ("manifest, card",)


class Built(NamedTuple):
    """What a build took."""

    seconds: float  # wall-clock
    head: float  # s of processor time
    memory: float  # MiB, the largest of the head
    simulated: float  # s of the workers
    files: int


def built(rows: int, backend: str, jobs: int, *, synthetic: int = 0) -> Built:
    """Build rows in a new process; synthetic ones in files of so many, unless 0."""
    with TemporaryDirectory() as folder:
        words = [f"{folder}/out", backend, str(rows), str(jobs), str(synthetic)]
        done = subprocess.run(
            [sys.executable, "-c", _BUILD, *words], cwd=ROOT, capture_output=True, text=True, check=True
        )
        return Built(*json.loads(done.stdout.splitlines()[-1]))


class Head(NamedTuple):
    """Processor time [s] and memory [MiB] of the head, each (2,)."""

    at_all: Floats
    a_file: Floats
    a_row: Floats

    @classmethod
    def measured(cls, processes: int) -> Head:
        """Measure it with few rows, and with many in many and in few files."""
        few, many = _SYNTHETIC
        runs = [built(rows, "dask", processes, synthetic=file)
                for rows, file in ((few, _SHORT), (many, _SHORT), (many, _LONG))]  # fmt: skip
        parts = [[1.0, run.files, rows] for run, rows in zip(runs, (few, many, many), strict=True)]
        return cls(*np.linalg.solve(parts, [[run.head, run.memory] for run in runs]))

    def of(self, rows: int, files: int) -> tuple[float, float]:
        """Compute both for a data set."""
        seconds, memory = self.at_all + files * self.a_file + rows * self.a_row
        return float(seconds), float(memory)


def by_part(rows: int) -> dict[str, float]:
    """Return the processor time of a row by part [s], of a build in this process."""
    profile = cProfile.Profile()
    with TemporaryDirectory() as folder, patch("dataset.build.open_backend", lambda *_: sweeps.InThisProcess()):
        build(load_design().with_rows(8), f"{folder}/first", title="")
        profile.runcall(build, load_design().with_rows(rows), f"{folder}/out", title="")
    spent = dict.fromkeys(_PARTS, 0.0)
    for (file, _, name), (_, _, _, cumulative, _) in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        for part, names in _PARTS.items():
            if name in names and "/dataset/" in file:
                spent[part] += cumulative / rows
    return spent


def main(rows: str = "100000", workers: str = "4") -> None:
    count, processes = int(rows), int(workers)
    print(f"{count} rows of sweep.toml on {available_jobs()} cores\n")
    print(heading("back end", "processes", "rows a second", "ms a row in workers", "head, s", "head, MiB"))
    for backend, jobs in (("local", 1), ("local", processes), ("dask", processes)):
        of = built(count, backend, jobs)
        print(row(backend, jobs, f"{count / of.seconds:.0f}", f"{1e3 * of.simulated / count:.2f}",
                  f"{of.head:.1f}", f"{of.memory:.0f}"), flush=True)  # fmt: skip
    parts = by_part(_PROFILED)
    print(f"\n{heading('part', 'µs a row')}")
    for name, seconds in parts.items():
        print(row(name, f"{1e6 * seconds:.0f}"))
    head = Head.measured(processes)
    print(
        f"\nhead, synthetic rows on dask: {1e3 * head.a_file[0]:.1f} ms of processor time and "
        f"{1024 * head.a_file[1]:.0f} KiB a file, {1e6 * head.a_row[0]:.1f} µs and "
        f"{1024 * head.a_row[1]:.2f} KiB a row, beside {head.at_all[0]:.1f} s and {head.at_all[1]:.0f} MiB"
    )
    in_workers = sum(seconds for name, seconds in parts.items() if name not in _HEAD)
    print(
        "\n" + heading("rows", "cores", "rows of a file", "core hours", "wall clock", "head: busy", "head: memory")
    )
    for size in (10**6, 10**7):
        for cores in (100, 1000):
            for of_a_file in dict.fromkeys((_SHORT, chunk_rows(size, size, cores))):
                # the last chunks end one after another: half a chunk more, on average
                wall = (size + of_a_file / 2 * cores) * in_workers / cores
                busy, memory = head.of(size, size // of_a_file)
                print(row(f"{size:,}", cores, of_a_file, f"{size * in_workers / 3600:.1f}",
                          f"{max(wall, busy) / 60:.1f} min", f"{100 * busy / max(wall, busy):.0f} %",
                          f"{memory / 1024:.1f} GiB"))  # fmt: skip
