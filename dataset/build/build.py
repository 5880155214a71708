"""Robots -> rows: simulate a design in chunks, on this machine or a cluster, into a folder.

What is there already is kept and checked; only rows that are missing are simulated. More rows of the same
design only add chunks. An interruption loses the chunks under way.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from dataset.build import scheduler as engine
from dataset.build.signals import interruptible
from dataset.build.sweep_folder import Held, SweepFolder, load_sweep
from dataset.rows.design import Design
from dataset.storage.data_set import MANIFEST, PENDING
from dataset.storage.lock import locked
from dataset.storage.shards import Piece, piece_name
from dataset.storage.storage import Place, place
from dataset.workers.open_backend import Backend, check_backend, open_backend
from dataset.workers.tasks import Joining, Receipt, Simulate, Task, Work, compile_on_this_host, rows_version
from sim.io.errors import InputError

_SECONDS = 20.0  # of processor time that a chunk should take
_FEWEST, _MOST = 1024, 4096  # rows of a chunk, unless there are few rows for many workers
_CHUNKS = 4  # a worker, where there are few rows
_STANDARD = "dataset.simulate.simulate"
_GUESS = 0.02  # seconds a row, until rows are there that tell


class UnfinishedError(RuntimeError):
    """A sweep ended before all rows were there; the message is one line, `status` the exit status."""

    status = 1


def build(
    design: Design,
    folder: str | Path,
    *,
    jobs: int | None = None,
    backend: str = "loky",
    address: str | None = None,
    title: str = "sweep",
    resume: str = "run the same build again",
    simulate: Simulate | None = None,
) -> dict[str, Any]:
    """Simulate a design into a folder; goes on where an earlier build stopped.

    Args:
        design: which robots.
        folder: a folder, or a URL that fsspec knows.
        jobs: processes on this machine; default all processors.
        backend: "loky", "dask" or "ray".
        address: of a dask scheduler or ray cluster.
        title: of the progress line; empty for none.
        resume: what the last line of an interrupted build tells the user to do.
        simulate: makes the rows; default `dataset.rows.simulate.simulate`. Workers must be able to import it.

    Returns:
        The manifest.

    Raises:
        InputError: the folder holds something else or refuses, another process writes there, no such backend.
        UnfinishedError: some chunks were set aside, or there were no workers.
    """
    check_backend(backend, jobs)
    there = place(folder)
    begun = _Begun(there, resume)
    with interruptible(begun.words), locked(there):
        return _build(
            design, there, simulate, begun, lambda: open_backend(backend, jobs=jobs, address=address), title
        )


def mend(folder: str | Path, *, jobs: int | None = None, title: str = "mend") -> str:
    """Repair a data set: remove what is damaged or doubled, simulate what is missing, write the manifest anew.

    Returns:
        One line that says what was done.

    Raises:
        InputError: no data set there, or its rows were made by another version of the code.
        UnfinishedError: as for `build`.
    """
    there = place(folder)
    if not there.names():
        raise InputError(f"{there.address} is no data set; make it with python -m dataset build")
    begun = _Begun(there, f"python -m dataset verify {there.address} --mend")
    with interruptible(begun.words), locked(there):
        design, source = load_sweep(there)
        simulate = None if source == _STANDARD else _imported(source)
        before = there.read(MANIFEST).to_pybytes() if there.size(MANIFEST) is not None else b""
        manifest = _build(
            design, there, simulate, begun, lambda: open_backend("loky", jobs=jobs), title, mending=True
        )
    line = begun.progress
    again = f"{line.simulated} rows simulated again, " if line else "no row simulated again, "
    same = json.dumps(manifest, indent=1).encode() == before.strip()
    return f"{manifest['rows']} rows are whole: {again}manifest {'kept' if same else 'written anew'}"


class _Begun:
    """What an interrupted build can say for itself."""

    def __init__(self, there: Place, resume: str):
        self._there, self._resume, self.progress = there, resume, None

    progress: engine.Progress | None

    def words(self, why: str = "stopped") -> str:
        """One line: what is done and how to go on."""
        line = self.progress
        done = f"{line.rows} of {line.total} rows are stored in {self._there.address}; " if line else ""
        return f"{why}: {done}go on with: {self._resume}"


def _build(
    design: Design,
    there: Place,
    simulate: Simulate | None,
    begun: _Begun,
    opened: Callable[[], Backend],
    title: str,
    *,
    mending: bool = False,
) -> dict[str, Any]:
    code = rows_version()
    source = f"{simulate.__module__}.{simulate.__qualname__}" if simulate else _STANDARD
    folder = SweepFolder(there, design, code, source)
    folder.claim(mending=mending)
    rows = max(design.rows, folder.rows_there())
    held = folder.holds(mending=mending)
    crew = _Crew(opened, begun)
    try:
        return _complete(folder, held, rows, simulate, begun, crew, title)
    finally:
        crew.stop()


def _complete(
    folder: SweepFolder,
    held: Held,
    rows: int,
    simulate: Simulate | None,
    begun: _Begun,
    crew: _Crew,
    title: str,
) -> dict[str, Any]:
    gaps = folder.missing(held, rows)
    if gaps:
        if simulate is None:
            compile_on_this_host()
        done = rows - sum(stop - start for start, stop in gaps)
        begun.progress = engine.Progress(title, rows, done=done, failed=sum(c.failed for c in held.values()))
        workers = crew.workers()
        chosen = folder.design.chosen
        tasks = [
            Task(
                folder.place.address, folder.config, folder.key, folder.code, simulate, start, stop,
                None if chosen is None else chosen[start:stop],
            )
            for start, stop in chunks(gaps, workers.slots(), _cost(held))
        ]  # fmt: skip
        for receipt in crew.run(tasks, begun.progress):
            c = receipt.contents
            held[Piece(piece_name(PENDING, c.start, c.stop), c.start, c.stop)] = c

    def joined(tasks: Sequence[Joining], then: Callable[[Work, Receipt], None]) -> None:
        if not tasks:
            return
        size = sum(task.stop - task.start for task in tasks)
        line = engine.Progress(title and f"{title}: joining files", size, done=0, failed=0)
        crew.run(tasks, line, then)

    return folder.complete(held, rows, joined)


class _Crew:
    """The workers of a build; they start when they are needed."""

    def __init__(self, opened: Callable[[], Backend], begun: _Begun):
        self._opened, self._begun = opened, begun
        self._backend: Backend | None = None

    def workers(self) -> Backend:
        """The workers."""
        if self._backend is None:
            self._backend = self._opened()
        return self._backend

    def run(
        self,
        tasks: Sequence[Work],
        progress: engine.Progress,
        then: Callable[[Work, Receipt], None] = lambda *_: None,
    ) -> list[Receipt]:
        """Run tasks to their end.

        Raises:
            UnfinishedError: some were set aside, or there are no workers.
        """
        try:
            result = engine.run(tasks, self.workers(), progress, then=then) if tasks else engine.Result()
        except engine.NoWorkersError as nobody:
            raise UnfinishedError(self._begun.words(str(nobody))) from None
        finally:
            progress.close()
        if result.set_aside:
            raise UnfinishedError(self._begun.words(_aside(result.set_aside)))
        return result.receipts

    def stop(self) -> None:
        """Let go of the workers."""
        if self._backend is not None:
            self._backend.stop()


def chunks(gaps: Sequence[tuple[int, int]], workers: int, cost: float) -> Iterator[tuple[int, int]]:
    """Cut runs of rows into chunks: _SECONDS of work each, within limits, but a few for every worker.

    Args:
        gaps: runs of rows, ends exclusive.
        workers: that run at once.
        cost: seconds a row.
    """
    rows = sum(stop - start for start, stop in gaps)
    size = min(max(_FEWEST, int(_SECONDS / cost)), _MOST, -(-rows // (_CHUNKS * max(workers, 1))))
    for start, stop in gaps:
        for first in range(start, stop, size):
            yield first, min(first + size, stop)


def _cost(held: Held) -> float:
    """Seconds a row, from the rows that are there."""
    rows, cost = sum(p.stop - p.start for p in held), sum(c.cost_s for c in held.values())
    return max(cost / rows, 1e-6) if rows else _GUESS


def _imported(name: str) -> Simulate:
    module, _, function = name.rpartition(".")
    try:
        found: Simulate = getattr(import_module(module), function)
    except (ImportError, AttributeError):
        raise InputError(f"its rows were made by {name}, which cannot be imported here") from None
    return found


def _aside(chunks: Sequence[tuple[Work, str]]) -> str:
    parts = [f"rows {task.start} to {task.stop - 1} ({reason})" for task, reason in chunks]
    return f"set aside: {', '.join(parts)}"
