"""Build a data set: simulate a design in chunks, on this machine or a cluster, into a folder.

Rows that are stored already are kept and checked; only missing rows are simulated. More rows of the same design
only add chunks. An interruption loses the chunks under way.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from shlex import quote
from typing import Any, cast

from dataset.build import scheduler
from dataset.build.scheduler import Progress
from dataset.build.signals import UnfinishedError, interruptible
from dataset.build.sweep_folder import Stored, SweepFolder, load_sweep
from dataset.rows.design import SweepDesign
from dataset.rows.version import rows_version
from dataset.storage.data_set import MANIFEST
from dataset.storage.lock import locked
from dataset.storage.storage import Storage, open_storage
from dataset.workers.backend import Backend
from dataset.workers.open_backend import check_backend, open_backend
from dataset.workers.tasks import Join, Receipt, Simulate, Task, compile_on_this_host
from sim.io.errors import InputError

_SECONDS = 20.0  # of processor time that a chunk should take
_FEWEST, _MOST = 1024, 4096  # rows of a chunk, unless there are few rows for many workers
_CHUNKS = 4  # a worker, where there are few rows
_STANDARD = "dataset.simulate.simulate"  # in the key of every row and in sweep.json: part of the format
_GUESS = 0.02  # seconds a row, until stored rows tell


def build(
    design: SweepDesign,
    folder: str | Path,
    *,
    jobs: int | None = None,
    backend: str = "loky",
    address: str | None = None,
    title: str = "sweep",
    resume: str = "run the same build again",
    simulate: Simulate | None = None,
    force: bool = False,
) -> dict[str, Any]:
    """Simulate a design into a folder; a build that stopped continues.

    Args:
        design: which robots.
        folder: a folder, or a URL that fsspec knows.
        jobs: processes on this machine; default all processors.
        backend: "loky", "dask" or "ray".
        address: of a dask scheduler or ray cluster.
        title: of the progress line; empty for none.
        resume: what the last line of an interrupted build tells the user to do.
        simulate: makes the rows; default `dataset.rows.simulate.simulate`. Workers must be able to import it.
        force: take over a folder behind a URL that another build has claimed.

    Returns:
        The manifest.

    Raises:
        InputError: the folder holds something else or refuses, another process writes there, no such backend.
        UnfinishedError: some chunks were skipped, or there were no workers.
    """
    check_backend(backend, jobs)
    storage = open_storage(folder)
    message = _Message(storage, resume)
    workers = _Workers(lambda: open_backend(backend, jobs=jobs, address=address), message)
    with interruptible(message.text), locked(storage, force=force):
        return _build(design, storage, simulate, message, workers, title)


def mend(
    folder: str | Path,
    *,
    jobs: int | None = None,
    title: str = "mend",
    simulate: Simulate | None = None,
    force: bool = False,
) -> str:
    """Repair a data set: remove damaged and duplicate shards, simulate missing rows, write the manifest anew.

    Args:
        folder: a folder, or a URL that fsspec knows.
        jobs: processes on this machine; default all processors.
        title: of the progress line; empty for none.
        simulate: made the rows, where it is not `dataset.rows.simulate.simulate`. The folder only has its name,
            and no function is imported because a file names it.
        force: take over a folder behind a URL that another build has claimed.

    Returns:
        One line that says what was done.

    Raises:
        InputError: no data set there, or its rows were made by another version of the code or another function.
        UnfinishedError: as for `build`.
    """
    storage = open_storage(folder)
    if not storage.names():
        raise InputError(f"{storage.address} is no data set; make it with softflagella sweep")
    message = _Message(storage, f"softflagella dataset verify {quote(storage.address)} --mend")
    workers = _Workers(lambda: open_backend("loky", jobs=jobs), message)
    with interruptible(message.text), locked(storage, force=force):
        design, source = load_sweep(storage, same_version=True)
        if source != row_source(simulate):
            raise InputError(
                f"{storage.address}: its rows were made by {source!r}, not by {row_source(simulate)!r}; if you "
                "trust that function, name it: softflagella dataset verify … --mend --rows-by MODULE.FUNCTION"
            )
        before = storage.read(MANIFEST).to_pybytes() if storage.size(MANIFEST) is not None else b""
        manifest = _build(design, storage, simulate, message, workers, title, mending=True)
    progress = message.progress
    simulated_again = f"{progress.simulated} rows simulated again, " if progress else "no row simulated again, "
    same = json.dumps(manifest, indent=1).encode() == before.strip()
    return f"{manifest['rows']} rows are whole: {simulated_again}manifest {'kept' if same else 'written anew'}"


class _Message:
    """The last line of a build that ends early: how far it is, and how to continue."""

    def __init__(self, storage: Storage, resume: str):
        self._storage, self._resume, self.progress = storage, resume, None

    progress: Progress | None

    def text(self, why: str = "stopped") -> str:
        """Write the line."""
        progress, address = self.progress, self._storage.address
        done = f"{progress.rows} of {progress.total} rows are stored in {address}; " if progress else ""
        return f"{why}: {done}go on with: {self._resume}"


class _Workers:
    """The workers of a build; they start when they are first needed."""

    def __init__(self, open_workers: Callable[[], Backend], message: _Message):
        self._open, self._message = open_workers, message
        self._backend: Backend | None = None

    def backend(self) -> Backend:
        """Start the workers, once."""
        if self._backend is None:
            self._backend = self._open()
        return self._backend

    def run(self, tasks: Sequence[Task | Join], progress: Progress) -> Iterator[tuple[Task | Join, Receipt]]:
        """Run tasks; yield each with its receipt as soon as it is done.

        Raises:
            UnfinishedError: some were skipped, or there are no workers.
        """
        try:
            yield from scheduler.run(tasks, self.backend(), progress)
        except (scheduler.NoWorkersError, scheduler.SkippedError) as end:
            raise UnfinishedError(self._message.text(str(end))) from None
        finally:
            progress.close()

    def stop(self) -> None:
        """Release the workers."""
        if self._backend is not None:
            self._backend.stop()


def _build(
    design: SweepDesign,
    storage: Storage,
    simulate: Simulate | None,
    message: _Message,
    workers: _Workers,
    title: str,
    *,
    mending: bool = False,
) -> dict[str, Any]:
    """Simulate the missing rows, join the shards, and write the manifest."""
    folder = SweepFolder(storage, design, rows_version(), row_source(simulate))
    folder.claim(mending=mending)
    rows = max(design.rows, folder.finished_rows())
    stored = folder.check_shards(mending=mending)
    try:
        gaps = folder.missing(stored, rows)
        if gaps:
            if simulate is None:
                compile_on_this_host()
            done = rows - sum(stop - start for start, stop in gaps)
            message.progress = Progress(title, rows, done=done, failed=sum(c.failed for c in stored.values()))
            tasks = [
                Task(storage.address, folder.config, folder.key, folder.code, simulate, start, stop)
                for start, stop in chunks(gaps, workers.backend().slots(), _cost(stored))
            ]
            for task, receipt in workers.run(tasks, message.progress):
                folder.add(stored, task, receipt.contents)
        joins = folder.joins(stored, rows)
        if joins:
            size = sum(join.stop - join.start for join in joins)
            progress = Progress(title and f"{title}: joining files", size, done=0, failed=0)
            for join, receipt in workers.run(joins, progress):
                folder.add(stored, join, receipt.contents)
        return folder.publish(stored, rows)
    finally:
        workers.stop()


def chunks(gaps: Sequence[tuple[int, int]], workers: int, cost: float) -> Iterator[tuple[int, int]]:
    """Cut runs of rows into chunks: _SECONDS of work each, within limits, but a few for every worker.

    Args:
        gaps: runs of rows, ends exclusive.
        workers: how many run at once.
        cost: seconds a row.
    """
    rows = sum(stop - start for start, stop in gaps)
    size = min(max(_FEWEST, int(_SECONDS / cost)), _MOST, -(-rows // (_CHUNKS * max(workers, 1))))
    for start, stop in gaps:
        for first in range(start, stop, size):
            yield first, min(first + size, stop)


def _cost(stored: Stored) -> float:
    """Return the mean seconds a row of the stored rows."""
    rows, cost = sum(shard.stop - shard.start for shard in stored), sum(c.cost_s for c in stored.values())
    return max(cost / rows, 1e-6) if rows else _GUESS


def row_source(simulate: Simulate | None) -> str:
    """Return the name of the function that makes the rows, as in sweep.json."""
    return f"{simulate.__module__}.{simulate.__qualname__}" if simulate else _STANDARD


def imported_function(name: str) -> Simulate:
    """Import a function that the user names, as MODULE.FUNCTION.

    Raises:
        InputError: there is none.
    """
    module, _, function = name.rpartition(".")
    try:
        simulate = getattr(import_module(module), function)
    except (ImportError, AttributeError, ValueError) as missing:
        raise InputError(f"no function {name!r} ({missing}); give MODULE.FUNCTION, importable from here") from None
    if not callable(simulate):
        raise InputError(f"{name} is no function; give MODULE.FUNCTION")
    return cast(Simulate, simulate)
