"""What a worker does: simulate one chunk of rows and store it as a piece.

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

import numpy as np

from dataset.design import Design
from dataset.pieces import Contents, piece_name, write_piece
from dataset.places import StorageError, place
from dataset.schema import schema, table_of
from dataset.store import PENDING, SWEEP
from sim.io.provenance import code_version

Simulate = Callable[[dict[str, Any]], dict[str, Any]]
_OURS = ("design.py", "schema.py", "simulate.py")  # beside sim/, what a row depends on


class Task(NamedTuple):
    """Rows start … stop − 1 of a design, and where to store them."""

    address: str
    config: dict[str, Any]
    key: str
    code: str
    simulate: Simulate | None  # None: `dataset.simulate.simulate`, which only workers import
    start: int
    stop: int


class Receipt(NamedTuple):
    """A chunk that is stored."""

    contents: Contents
    seconds: float  # of its worker's time
    worker: str


class Refusal(NamedTuple):
    """A chunk that is not: `kind` is "code", "storage" or "error"."""

    kind: str
    message: str
    worker: str


Outcome = Receipt | Refusal


@cache
def rows_version() -> str:
    """Version of all code that a row depends on, e.g. "0.1.0+1a2b3c4d.5e6f7a8b"."""
    digest = hashlib.sha256(b"".join(Path(__file__).with_name(name).read_bytes() for name in _OURS))
    return f"{code_version()}.{digest.hexdigest()[:8]}"


def worker_name() -> str:
    """Host and process."""
    return f"{socket.gethostname()}:{os.getpid()}"


def run_task(task: Task) -> Outcome:
    """Simulate the rows of a task and store them."""
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
        columns = _simulate(task)
        effects = Design.from_config(task.config, 1).effects
        name = piece_name(PENDING, task.start, task.stop)
        contents = write_piece(there, name, table_of(columns, schema(effects)), task.key)
        return Receipt(contents, time.perf_counter() - began, here)
    except StorageError as refusal:
        return Refusal("storage", str(refusal), here)
    except Exception as error:  # a bug, or a robot that nothing foresaw: named, and the other chunks go on
        return Refusal("error", f"{type(error).__name__}: {' '.join(str(error).split())[:300]}", here)


def _simulate(task: Task) -> dict[str, Any]:
    points = Design.from_config(task.config, task.stop).points(task.start, task.stop)
    if task.simulate is not None:
        columns = task.simulate(points)
    else:
        with _loops():
            from dataset.simulate import simulate

            columns = simulate(points)
    return {**columns, "row": np.arange(task.start, task.stop)}


@contextmanager
def _loops() -> Iterator[None]:
    """The simulator's loops, compiled, on one thread: chunks are the parallelism."""
    from sim.motion.batches import one_thread

    compile_on_this_host()
    with one_thread():
        yield


def compile_on_this_host() -> None:
    """Compile the simulator's loops unless that has been done; one process of a host does, the others wait."""
    from sim.compiling import CACHE, all_compiled

    if all_compiled():
        return
    with open(Path(gettempdir(), f"softflagella-{CACHE.name}-{os.getuid()}.lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        from sim.motion.warm import compile_once

        compile_once()
