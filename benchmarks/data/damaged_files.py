"""Damaged files: what every reader does with thousands of mutations of a valid file, in which time and memory.

Each reader must end with a result or with one line that names the file, within 5 s of processor time and 1 GB of
memory more than its process had. A process that dies is counted as broken, and the next case begins in a new one.

Usage: python -m benchmarks damaged_files [CASES [FORMAT …]]     (20,000 cases; default: all formats)

Takes 3 hours.
"""

from __future__ import annotations

import multiprocessing
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from multiprocessing.connection import Connection
from pathlib import Path
from random import Random
from typing import NamedTuple

from joblib import Parallel, delayed

from benchmarks.markdown import heading, row
from sim.motion.batches import available_jobs
from tests.oracles.file_formats import FORMATS, judged

SECONDS, MEMORY = 5.0, 10**9  # a case may take


class Case(NamedTuple):
    """One mutated file."""

    number: int
    outcome: str  # "read", "refused" or the error
    seconds: float  # of processor time
    memory: int  # bytes by which the process has grown so far


def main(cases: str = "20000", *names: str) -> None:
    unknown = sorted(set(names) - set(FORMATS))
    if unknown:
        sys.exit(f"error: no format {unknown[0]!r}; there are {', '.join(FORMATS)}")
    chosen = names or tuple(FORMATS)
    print(heading("file", "cases", "read", "refused", "other ends", "longest [s]", "median [ms]", "memory [MB]"))
    wrong: list[str] = []
    trials = Parallel(n_jobs=available_jobs(), return_as="generator")(
        delayed(tried)(n, int(cases)) for n in chosen
    )
    for name, results in zip(chosen, trials, strict=True):
        counts = Counter(case.outcome for case in results)
        times = sorted(case.seconds for case in results)
        others = [case for case in results if case.outcome not in ("read", "refused")]
        wrong += [f"{name}, case {case.number}: {case.outcome}" for case in others]
        memory = max(case.memory for case in results) / 1e6
        print(row(name, len(results), counts["read"], counts["refused"], len(others), f"{times[-1]:.2f}",
                  f"{1e3 * times[len(times) // 2]:.1f}", f"{memory:.0f}"), flush=True)  # fmt: skip
    print(*wrong[:40], sep="\n")


def tried(name: str, cases: int) -> list[Case]:
    """Try so many mutations of a format, in processes that may die."""
    results: list[Case] = []
    context = multiprocessing.get_context("fork")
    while len(results) < cases:
        receiver, sender = context.Pipe(duplex=False)
        process = context.Process(target=_work, args=(name, len(results), cases, sender))
        process.start()
        sender.close()
        try:
            while len(results) < cases:
                results.append(receiver.recv())
        except EOFError:
            process.join()
            results.append(Case(len(results), f"its process died ({process.exitcode})", SECONDS, 0))
        process.join()
    return results


def _work(name: str, first: int, last: int, sender: Connection) -> None:
    """Send the results of cases; the system ends this process where one takes too long."""
    form = FORMATS[name]
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    with tempfile.TemporaryDirectory() as folder:
        path = form.install(Path(folder))
        assert judged(form, path)  # loads all that is needed
        _limit_memory()
        before = _resident()
        for number in range(first, last):
            path.write_bytes(form.mutated(Random(f"{name} {number}")))
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            began = time.process_time()
            try:
                outcome = "read" if judged(form, path) else "refused"
            except BaseException as error:
                outcome = f"{type(error).__name__}: {str(error)[:200]}"
            seconds = time.process_time() - began
            signal.setitimer(signal.ITIMER_PROF, 0)
            sender.send(Case(number, outcome, seconds, _resident() - before))
    sender.close()


def _limit_memory() -> None:
    """Let this process ask for MEMORY more than it has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _resident() -> int:
    """Return the largest resident memory of this process so far [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
