"""Workers: what they do with a chunk of rows, and the processes of this machine that do it.

A back end has the four methods of `Backend`. `Processes` starts a process for each chunk, forked from a server
that has loaded the simulator and its machine code, so that one more costs a few hundredths of a second; its end
says which chunk has killed it. `dataset.clusters` has that of dask.
"""

from __future__ import annotations

import fcntl
import json
import multiprocessing
import os
import pickle
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import wait
from types import ModuleType
from typing import Any, Literal, NamedTuple, Protocol

from common.errors import InputError
from dataset.data_set import SWEEP
from dataset.design import SweepDesign
from dataset.folder import Folder, StorageError
from dataset.schema import arrow_table, rows_version, schema
from dataset.shards import BadFileError, Part, checked_part, file_name, packed

Simulate = Callable[[dict[str, Any]], dict[str, Any]]
_ATTEMPTS, _PAUSE = 5, 0.2  # s


class Failure(NamedTuple):
    """The reason why the rows of a chunk have not been stored.

    died: its worker did; gone: by no fault of the chunk; error: its rows cannot be made; refused: no chunk can be
    stored.
    """

    kind: Literal["died", "gone", "error", "refused"]
    message: str = ""


class Chunk(NamedTuple):
    """Rows start … stop − 1 of a design, to be simulated and stored at an address."""

    address: str
    config: dict[str, Any]
    key: str
    code: str
    grid: list[int]  # of the build, as in sweep.json: rows of a chunk, and of the data set
    simulate: Simulate | None  # None: `dataset.simulate.simulate`, which only workers import
    start: int
    stop: int

    def run(self) -> Part | Failure:
        """Simulate the rows and store them. It never raises: a reason passes through any back end."""
        try:
            worker, folder = f"worker {socket.gethostname()}:{os.getpid()}", Folder(self.address)
            if rows_version() != self.code:
                versions = f"{worker} has version {rows_version()} of the code, the build has {self.code}"
                return Failure("refused", f"{versions}; install the same version on both")
            if SWEEP not in folder.names():
                return Failure("refused", f"{worker} does not see {self.address}; give a folder that it sees")
            design = SweepDesign.from_config(self.config, self.stop - self.start)
            form, name = schema(design.effects, design.sensitivities), file_name(self.start, self.stop)
            points: dict[str, Any] = {**design.points(self.start, self.stop)}
            points["history"] = design.history(self.start, self.stop)
            columns = self.simulate(points) if self.simulate else simulate_here(points, design.sensitivities)
            table = arrow_table({**columns, "row": design.indices(self.start, self.stop)}, form)
            if json.loads(folder.read(SWEEP)).get("grid") != self.grid:
                return Failure("refused", f"another build has begun in {self.address}")
            with suppress(StorageError, BadFileError):  # a worker that was given up may have come to its end
                return checked_part(folder.read(name), self.start, self.stop, form, self.key)
            data = packed(table, self.key)
            folder.write(name, data)
            return checked_part(data, self.start, self.stop, form, self.key)
        except StorageError as refusal:
            return Failure("refused", str(refusal))
        except Exception as error:  # a bug, or an unforeseen robot: named, and the other chunks go on
            return Failure("error", f"{type(error).__name__}: {' '.join(str(error).split())[:300]}")


Ended = list[tuple[Chunk, Part | Failure]]


class Backend(Protocol):
    """Workers that run chunks. None is lost silently: what is submitted comes back from `collect`."""

    def slots(self) -> int:
        """Return how many chunks can run at once; 0 while there are no workers."""

    def submit(self, chunk: Chunk) -> None:
        """Start a chunk; at most `slots` are under way."""

    def collect(self, seconds: float) -> Ended:
        """Return the chunks that have ended, after at most about so many seconds."""

    def stop(self) -> None:
        """Abort the chunks under way and release the workers, at once."""


class Processes:
    """A process of this machine for each chunk."""

    def __init__(self, count: int):
        self._count = count
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(["dataset.warm"])
        self._busy: dict[Any, tuple[Any, Chunk]] = {}

    def slots(self) -> int:
        """Count the processes."""
        return self._count

    def submit(self, chunk: Chunk) -> None:
        """Start a process; and the fork server anew, where it was killed."""
        import cloudpickle  # it takes functions of the user's script along

        content = cloudpickle.dumps(chunk)
        for _ in range(_ATTEMPTS):
            receiver, sender = self._context.Pipe(duplex=False)
            process = self._context.Process(target=_work, args=(content, sender))
            try:
                with sender, isolated():
                    process.start()
                self._busy[receiver] = process, chunk
                return
            except (ConnectionError, EOFError, FileNotFoundError):
                time.sleep(_PAUSE)  # until the system knows that the fork server has gone
        raise InputError(f"no worker process can be started: {_ATTEMPTS} in a row were killed")

    def collect(self, seconds: float) -> Ended:
        """Return the chunks that have ended. It waits for their pipes: a process sends before it ends."""
        ended: Ended = []
        receivers: list[Any] = wait(list(self._busy), seconds)
        for receiver in receivers:
            process, chunk = self._busy.pop(receiver)
            try:
                ended.append((chunk, receiver.recv()))
            except (EOFError, ConnectionError):
                ended.append((chunk, Failure("died")))
            process.join()
        return ended

    def stop(self) -> None:
        """Kill the processes."""
        for process, _ in self._busy.values():
            process.kill()
            process.join()
        self._busy = {}


def _work(content: bytes, sender: Any) -> None:
    """Run a chunk and send what became of it; end when the process that asks for it ends, however that happens."""
    user: Any = multiprocessing.parent_process()
    threading.Thread(target=lambda: (user.join(), os._exit(1)), daemon=True).start()
    sender.send(pickle.loads(content).run())


@contextmanager
def isolated() -> Iterator[None]:
    """Keep processes that start inside from running the user's script again, and from receiving Ctrl-C."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    script, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def simulate_here(points: dict[str, Any], sensitivities: bool) -> dict[str, Any]:
    """Simulate rows with compiled loops on one thread: chunks are the parallelism."""
    compile_on_this_host()
    from dataset.simulate import simulate
    from sim.motion.batches import one_thread

    with one_thread():
        return simulate(points, sensitivities=sensitivities)


def compile_on_this_host() -> None:
    """Compile the simulator's loops unless that has been done; one process of a host does, the others wait."""
    from sim.jit import CACHE
    from sim.motion.warm import all_compiled, compile_once

    if all_compiled():
        return
    with open(CACHE / f"{socket.gethostname()}.lock", "a") as lock:  # nobody else can put a link there
        fcntl.flock(lock, fcntl.LOCK_EX)
        compile_once()
