"""What benchmarks share: tables in Markdown, proportions, cases on all processors, records on disk, times."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import numpy as np
from joblib import Parallel, delayed
from scipy.stats import binomtest

from sim.threads import available_jobs

ROOT = Path(__file__).parents[1]
Result = TypeVar("Result")


def heading(*columns: str) -> str:
    """Return the first two lines of a table in Markdown."""
    return f"{row(*columns)}\n|{'---|' * len(columns)}"


def row(*cells: object) -> str:
    """Return one line of a table in Markdown."""
    return f"| {' | '.join(map(str, cells))} |"


def per_cent(hits: int, count: int) -> str:
    """Write a proportion with its 95 % Wilson interval."""
    interval = binomtest(int(hits), count).proportion_ci(method="wilson")
    return f"{100 * hits / count:.1f} % ({100 * interval.low:.0f} to {100 * interval.high:.0f})"


def two_quantiles(values: Sequence[float]) -> str:
    """Write the median and the 95 % quantile."""
    return f"{np.median(values):.3f} / {np.quantile(values, 0.95):.3f}"


def in_parallel(
    work: Callable[..., Result], cases: Iterable[tuple[Any, ...]], *, quiet: bool = False
) -> list[Result]:
    """Call `work` with the arguments of each case; return the results in order, with progress on stderr."""
    calls = (delayed(work)(*case) for case in cases)
    return list(Parallel(n_jobs=available_jobs(), verbose=0 if quiet else 1)(calls))


def as_they_end(work: Callable[..., Result], cases: Iterable[tuple[Any, ...]]) -> Iterator[Result]:
    """Call `work` with the arguments of each case, and yield each result when it is there."""
    calls = (delayed(work)(*case) for case in cases)
    return iter(Parallel(n_jobs=available_jobs(), return_as="generator_unordered")(calls))


class Records:
    """Records of a long benchmark by `key`, one JSON object a line of a file; without a file, kept in memory."""

    def __init__(self, file: str = "", *, key: str = "seed"):
        self.file, self.key = Path(file) if file else None, key
        lines = self.file.read_text().splitlines() if self.file and self.file.exists() else []
        self.all: list[dict[str, Any]] = [json.loads(line) for line in lines]

    def __contains__(self, value: Hashable) -> bool:
        return any(record[self.key] == value for record in self.all)

    def add(self, record: dict[str, Any]) -> None:
        """Append a record."""
        self.all.append(record)
        if self.file:
            with self.file.open("a") as lines:
                lines.write(json.dumps(record) + "\n")


@contextmanager
def checked_out(revision: str) -> Iterator[Path]:
    """Check a revision of the project out into a temporary folder, with loops of its own, and yield the folder."""
    worktree = ["git", "-C", str(ROOT), "worktree"]
    with TemporaryDirectory() as folder:
        place = Path(folder, "checked-out")
        subprocess.run([*worktree, "add", "--detach", str(place), revision], check=True)
        try:
            yield place
        finally:
            subprocess.run([*worktree, "remove", "--force", str(place)], check=True)


def timed(work: Callable[[], Result], *, repeats: int = 1) -> tuple[float, Result]:
    """Return the shortest wall-clock time of some runs [s], and the result."""
    best = np.inf
    for _ in range(repeats):
        began = time.perf_counter()
        result = work()
        best = min(best, time.perf_counter() - began)
    return best, result


def processor_time(work: Callable[[], object], *, repeats: int = 1) -> float:
    """Return the processor time of a run [s], the mean of some."""
    began = time.process_time()
    for _ in range(repeats):
        work()
    return (time.process_time() - began) / repeats


def interpreter_time(*words: str) -> tuple[float, str]:
    """Run the interpreter with arguments; return its processor time in s, and what it printed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout
