"""The tasks of a worker: simulate one chunk of rows and store it as a shard, or join shards.

A worker may be another process or another machine. It needs this package and the folder, and returns a receipt, or
the reason why there is none. It never raises: a reason can pass through any backend.
"""

from __future__ import annotations

import fcntl
import os
import socket
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from dataset.rows.design import SweepDesign
from dataset.rows.schema import arrow_table, schema
from dataset.rows.version import rows_version
from dataset.storage.data_set import PENDING, SWEEP
from dataset.storage.shards import Contents, Shard, join, shard_name, write_shard
from dataset.storage.storage import Storage, StorageError, open_storage
from sim.io.errors import InputError

Simulate = Callable[[dict[str, Any]], dict[str, Any]]


class Task(NamedTuple):
    """Rows start … stop − 1 of a design, to be simulated and stored at an address."""

    address: str
    config: dict[str, Any]
    key: str
    code: str
    simulate: Simulate | None  # None: `dataset.rows.simulate.simulate`, which only workers import
    start: int
    stop: int

    def run(self, storage: Storage) -> Contents:
        """Simulate the rows and store them."""
        design = SweepDesign.from_config(self.config, self.stop - self.start)
        columns = _simulated(self, design)
        table = arrow_table(columns, schema(design.effects, design.sensitivities))
        return write_shard(storage, shard_name(PENDING, self.start, self.stop), table, self.key)


class Join(NamedTuple):
    """Consecutive shards, to be joined to one."""

    address: str
    config: dict[str, Any]
    key: str
    code: str
    sources: tuple[Shard, ...]

    @property
    def start(self) -> int:
        """The first row."""
        return self.sources[0].start

    @property
    def stop(self) -> int:
        """The row after the last one."""
        return self.sources[-1].stop

    def run(self, storage: Storage) -> Contents:
        """Write the joined shard beside its sources."""
        design = SweepDesign.from_config(self.config, 1)
        form = schema(design.effects, design.sensitivities)
        return join(storage, self.sources, shard_name(PENDING, self.start, self.stop), form, self.key)


class Receipt(NamedTuple):
    """A shard that has been stored."""

    contents: Contents
    seconds: float  # of its worker's time
    worker: str


class Refusal(NamedTuple):
    """The reason why a shard has not been stored; `kind` is "code", "storage" or "error"."""

    kind: str
    message: str
    worker: str


Outcome = Receipt | Refusal


def worker_name() -> str:
    """Return host and process of this worker."""
    return f"{socket.gethostname()}:{os.getpid()}"


def run_task(task: Task | Join) -> Outcome:
    """Run a task in this process."""
    worker = worker_name()
    if rows_version() != task.code:
        versions = f"worker {worker} has version {rows_version()} of the code, the build has {task.code}"
        return Refusal("code", f"{versions}; install the same version on both", worker)
    try:
        storage = open_storage(task.address)
        if storage.size(SWEEP) is None:
            return Refusal(
                "storage", f"worker {worker} does not see {storage.address}; give a folder that it sees", worker
            )
        began = time.perf_counter()
        contents = task.run(storage)
        return Receipt(contents, time.perf_counter() - began, worker)
    except StorageError as refusal:
        return Refusal("storage", str(refusal), worker)
    except Exception as error:  # a bug, or an unforeseen robot: named, and the other chunks go on
        return Refusal("error", f"{type(error).__name__}: {' '.join(str(error).split())[:300]}", worker)


def _simulated(task: Task, design: SweepDesign) -> dict[str, Any]:
    """Simulate the columns of a task's rows."""
    start, stop = task.start, task.stop
    points: dict[str, Any] = {**design.points(start, stop), "history": design.history(start, stop)}
    if task.simulate is not None:
        columns = task.simulate(points)
    else:
        columns = simulate_in_worker(points, design.sensitivities)
    return {**columns, "row": design.indices(start, stop)}


def simulate_in_worker(points: dict[str, Any], sensitivities: bool) -> dict[str, Any]:
    """Simulate rows with compiled loops on one thread: chunks are the parallelism."""
    compile_on_this_host()
    from dataset.rows.simulate import simulate
    from sim.motion.batches import one_thread

    with one_thread():
        return simulate(points, sensitivities=sensitivities)


def compile_on_this_host() -> None:
    """Compile the simulator's loops unless that has been done; one process of a host does, the others wait.

    Raises:
        InputError: they do not compile.
    """
    from sim.compiling import CACHE, all_compiled

    if all_compiled():
        return
    with open(CACHE / f"{socket.gethostname()}.lock", "a") as lock:  # nobody else can put a link there
        fcntl.flock(lock, fcntl.LOCK_EX)
        from sim.motion.warm import compile_once

        if not compile_once():
            raise InputError("the simulator's loops do not compile; softflagella sim compile says why")
