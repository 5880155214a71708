"""Data sets: overhead of the engine, bytes a row, speed of reading.

1. Processor time of a row, and of a build beside its rows.
2. A hundred thousand synthetic rows: bytes a row; stored, opened, scanned, read.

Usage: python -m benchmarks data_sets [--rows N]

Takes 5 minutes.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.common import processor_time
from dataset.build import build
from dataset.data_set import batches, read, read_manifest
from tests.dataset import sweeps

ROWS, SYNTHETIC = 2048, 100_000
_ENGINE = """
import sys
from dataset.design import load_design
from dataset.build import build
build(load_design().with_rows(int(sys.argv[1])), sys.argv[2], jobs=int(sys.argv[3]), title="")
"""
_SYNTHETIC = """
import sys
from dataset.build import build
from tests.dataset import sweeps
build(sweeps.design(int(sys.argv[1])), sys.argv[2], title="", simulate=sweeps.invented)
"""


def processor_seconds(code: str, *words: str) -> float:
    """Measure the processor time of a process and its children."""
    with TemporaryDirectory() as folder:
        log = Path(folder, "spent")
        # every process adds its own time to the file when it ends, workers included
        environment = {**os.environ, "SPENT": str(log), "PYTHONPATH": os.pathsep.join([folder, *sys.path])}
        Path(folder, "sitecustomize.py").write_text(_SPENT)
        subprocess.run([sys.executable, "-c", code, *words], env=environment, check=True)
        time.sleep(1.0)
        last: dict[str, float] = {}
        for line in log.read_text().splitlines():
            process, seconds = line.split()
            last[process] = float(seconds)
        return sum(last.values())


# Workers are killed in the end, so each writes what it has used so far, ten times a second.
_SPENT = """
import os, threading, time
def _write():
    while True:
        with open(os.environ["SPENT"], "a") as log:
            log.write(f"{os.getpid()} {time.process_time()}\\n")
        time.sleep(0.1)
def _start():
    threading.Thread(target=_write, daemon=True).start()
_start()
os.register_at_fork(after_in_child=_start)
"""


def overhead(rows: int) -> None:
    """Print processor seconds a row, and those of a build beside its rows."""
    for jobs in (2, 1):
        with TemporaryDirectory() as folder:
            engine = processor_seconds(_ENGINE, str(rows), f"{folder}/out", str(jobs))
            cost = float(read_manifest(f"{folder}/out")["cost_s"])
        print(f"{rows} rows of sweep.toml, workers: {jobs}: {1e3 * cost / rows:.2f} ms a row, "
              f"{engine - cost:.1f} s beside the rows")  # fmt: skip


def reading(rows: int) -> None:
    """Print the times of storing and reading many synthetic rows."""
    with TemporaryDirectory() as folder:
        out = f"{folder}/out"
        spent = processor_seconds(_SYNTHETIC, str(rows), out)
        files = sorted(Path(out, "rows").iterdir())
        size = sum(path.stat().st_size for path in files)
        form = pq.read_schema(files[0])
        plain = [field.name for field in form if not pa.types.is_fixed_size_list(field.type)]
        print(f"\n{rows} synthetic rows with all curves: {len(files)} files, {size / rows:.0f} bytes a row; "
              "processor seconds")  # fmt: skip
        print(f"  made and stored                          {spent:6.1f}")
        print(f"  manifest opened and checked              {processor_time(lambda: read_manifest(out)):6.2f}")
        two = ["omega_bar", "omega_yr_bar"]
        print(f"  two columns scanned, all checked         {processor_time(lambda: _scanned(out, two)):6.2f}")
        print(f"  all columns scanned in batches           {processor_time(lambda: _scanned(out, None)):6.2f}")
        print(f"  all columns but curves read into pandas  {processor_time(lambda: read(out, plain)):6.2f}")
        print(f"  unchanged build                          {processor_time(lambda: _again(rows, out)):6.2f}")


def _again(rows: int, out: str) -> None:
    build(sweeps.design(rows), out, title="", simulate=sweeps.invented)


def _scanned(out: str, columns: list[str] | None) -> None:
    for _ in batches(out, columns):
        pass


def main(*words: str) -> None:
    parser = argparse.ArgumentParser(description="Benchmarks of data sets.")
    parser.add_argument("--rows", type=int, default=ROWS, help=f"rows that are simulated (default: {ROWS})")
    overhead(parser.parse_args(words).rows)
    reading(SYNTHETIC)
