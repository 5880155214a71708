"""What a worker does: simulate one chunk of rows and store it as a piece, or join pieces.

A worker may be another process or another machine. It needs this package and the folder, and gives back a
receipt, or the reason why it has none. It never raises: a reason travels through any backend.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import gettempdir
from typing import Any, NamedTuple

from dataset.rows.design import Design
from dataset.rows.schema import schema, table_of
from dataset.storage.data_set import PENDING, SWEEP
from dataset.storage.shards import Contents, Piece, join, piece_name, write_piece
from dataset.storage.storage import Place, StorageError, place
from sim.io.errors import InputError
from sim.io.provenance import code_version

Simulate = Callable[[dict[str, Any]], dict[str, Any]]
_PACKAGE = Path(__file__).parents[1]
_OURS = ("rows/design.py", "rows/schema.py", "rows/simulate.py")  # beside sim/, what a row depends on


class Task(NamedTuple):
    """Rows start … stop − 1 of a design, and where to store them."""

    address: str
    config: dict[str, Any]
    key: str
    code: str
    simulate: Simulate | None  # None: `dataset.rows.simulate.simulate`, which only workers import
    start: int
    stop: int
    chosen: tuple[int, ...] | None = None  # points of the sequence that these rows are, where they were chosen

    def done(self, there: Place) -> Contents:
        """Simulate the rows and store them."""
        design = Design.from_config(self.config, self.stop - self.start, self.chosen)
        columns = _simulated(self, design, *((0, None) if self.chosen else (self.start, self.stop)))
        table = table_of(columns, schema(design.effects, design.sensitivities))
        return write_piece(there, piece_name(PENDING, self.start, self.stop), table, self.key)


class Joining(NamedTuple):
    """Pieces that follow each other, to be joined to one."""

    address: str
    config: dict[str, Any]
    key: str
    code: str
    sources: tuple[Piece, ...]

    @property
    def start(self) -> int:
        """The first row."""
        return self.sources[0].start

    @property
    def stop(self) -> int:
        """The row after the last one."""
        return self.sources[-1].stop

    def done(self, there: Place) -> Contents:
        """Write the joined piece, beside its sources."""
        design = Design.from_config(self.config, 1)
        form = schema(design.effects, design.sensitivities)
        return join(there, self.sources, piece_name(PENDING, self.start, self.stop), form, self.key)


Work = Task | Joining


class Receipt(NamedTuple):
    """A piece that is stored."""

    contents: Contents
    seconds: float  # of its worker's time
    worker: str


class Refusal(NamedTuple):
    """A piece that is not: `kind` is "code", "storage" or "error"."""

    kind: str
    message: str
    worker: str


Outcome = Receipt | Refusal


@cache
def rows_version() -> str:
    """Version of all code that a row depends on, e.g. "0.1.0+1a2b3c4d.5e6f7a8b"."""
    digest = hashlib.sha256(b"".join((_PACKAGE / name).read_bytes() for name in _OURS))
    return f"{code_version()}.{digest.hexdigest()[:8]}"


def worker_name() -> str:
    """Host and process."""
    return f"{socket.gethostname()}:{os.getpid()}"


def run_task(task: Work) -> Outcome:
    """Do a task."""
    here = worker_name()
    if rows_version() != task.code:
        words = f"worker {here} has version {rows_version()} of the code, the build has {task.code}"
        return Refusal("code", f"{words}; install the same version on both", here)
    try:
        there = place(task.address)
        if there.size(SWEEP) is None:
            return Refusal(
                "storage", f"worker {here} does not see {there.address}; give a folder that it sees", here
            )
        began = time.perf_counter()
        contents = task.done(there)
        return Receipt(contents, time.perf_counter() - began, here)
    except StorageError as refusal:
        return Refusal("storage", str(refusal), here)
    except Exception as error:  # a bug, or a robot that nothing foresaw: named, and the other chunks go on
        return Refusal("error", f"{type(error).__name__}: {' '.join(str(error).split())[:300]}", here)


def _simulated(task: Task, design: Design, start: int, stop: int | None) -> dict[str, Any]:
    points: dict[str, Any] = {**design.points(start, stop), "history": design.history(start, stop)}
    if task.simulate is not None:
        columns = task.simulate(points)
    else:
        with _loops():
            from dataset.rows.simulate import simulate

            columns = simulate(points, sensitivities=design.sensitivities)
    return {**columns, "row": design.indices(start, stop)}


@contextmanager
def _loops() -> Iterator[None]:
    """The simulator's loops, compiled, on one thread: chunks are the parallelism."""
    from sim.motion.batches import one_thread

    compile_on_this_host()
    with one_thread():
        yield


def compile_on_this_host() -> None:
    """Compile the simulator's loops unless that has been done; one process of a host does, the others wait.

    Raises:
        InputError: they do not compile.
    """
    from sim.compiling import CACHE, all_compiled

    if all_compiled():
        return
    with open(Path(gettempdir(), f"softflagella-{CACHE.name}-{os.getuid()}.lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        from sim.motion.warm import compile_once

        if not compile_once():
            raise InputError("the simulator's loops do not compile; python -m sim compile says why")
