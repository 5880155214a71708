"""Sweeps at scale: dask beside one process, where the time goes, and what a million rows cost on a cluster.

1. Rows of sweep.toml on dask across four processes of this machine, and on one process: rows a second, processor
   time and memory of the head (the process that schedules; with dask the scheduler is in it).
2. Processor time by part, of a build in one process.
3. Synthetic rows, which take no time to simulate: processor time of the head for a file, memory for a row.
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

from benchmarks.common import ROOT, heading, row
from dataset.build import build
from dataset.design import load_design
from sim.threads import available_jobs
from tests.dataset import sweeps

_PROFILED, _SYNTHETIC = 4096, (100_000, 400_000)
_FILE = 1024  # rows
_BUILD = """
import json, re, sys, time
from pathlib import Path
from dataset.build import build
from dataset.design import load_design
from tests.dataset import sweeps
out, backend = sys.argv[1:3]
rows, jobs, synthetic = map(int, sys.argv[3:])
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


def built(rows: int, backend: str, jobs: int, *, synthetic: bool = False) -> Built:
    """Build rows in a new process."""
    with TemporaryDirectory() as folder:
        words = [f"{folder}/out", backend, str(rows), str(jobs), str(int(synthetic))]
        done = subprocess.run(
            [sys.executable, "-c", _BUILD, *words], cwd=ROOT, capture_output=True, text=True, check=True
        )
        return Built(*json.loads(done.stdout.splitlines()[-1]))


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
    small, large = (built(size, "dask", processes, synthetic=True) for size in _SYNTHETIC)
    files, more = large.files - small.files, _SYNTHETIC[1] - _SYNTHETIC[0]
    of_a_file, of_a_row = (large.head - small.head) / files, (large.memory - small.memory) / more
    print(f"\nhead, synthetic rows on dask: {1e3 * of_a_file:.1f} ms of processor time a file of {_FILE} rows, "
          f"{1024 * of_a_row:.2f} KiB a row, {small.memory:.0f} MiB at {_SYNTHETIC[0]} rows")  # fmt: skip
    in_workers = sum(seconds for name, seconds in parts.items() if name not in _HEAD)
    print(f"\n{heading('rows', 'cores', 'core hours', 'wall clock', 'head: busy', 'head: memory')}")
    for size in (10**6, 10**7):
        for cores in (100, 1000):
            # the last chunks end one after another: half a chunk more, on average
            wall = (size + _FILE / 2 * cores) * in_workers / cores
            head = size / _FILE * of_a_file
            memory = small.memory + (size - _SYNTHETIC[0]) * of_a_row
            print(row(f"{size:,}", cores, f"{size * in_workers / 3600:.1f}", f"{max(wall, head) / 60:.1f} min",
                      f"{100 * head / max(wall, head):.0f} %", f"{memory / 1024:.1f} GiB"))  # fmt: skip
