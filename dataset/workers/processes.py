"""Run tasks in processes of this machine, by joblib's loky: one executor for each worker.

With one executor for all workers, the death of one worker breaks all of them, and the task that killed it is
unknown. With one executor each, only the dead worker is replaced, and its task is known.

Workers are forked from a process that has loaded the simulator and its machine code (a fork server), so that
another worker costs next to nothing.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from contextlib import contextmanager
from types import ModuleType
from typing import Any, TypeVar, cast

from joblib.externals.loky import ProcessPoolExecutor

from dataset.workers.backend import LOST, Lost
from dataset.workers.tasks import Join, Outcome, Task, run_task
from sim.io.errors import InputError

Result = TypeVar("Result")
_ATTEMPTS, _PAUSE = 5, 0.2  # s


class Processes:
    """Workers on this machine."""

    def __init__(self, count: int):
        self._free: list[Any] = [None] * count  # executors; None: not started yet
        self._count = count
        self._busy: dict[Future[Outcome], tuple[int, Any]] = {}

    def slots(self) -> int:
        """Count the workers; a dead one is replaced."""
        return self._count

    def submit(self, number: int, task: Task | Join) -> None:
        """Submit a task to a free worker."""
        executor, future = _submit(self._free.pop(), run_task, task)
        self._busy[future] = (number, executor)

    def collect(self, seconds: float) -> list[tuple[int, Outcome | Lost]]:
        """Return the tasks that have ended."""
        ended: list[tuple[int, Outcome | Lost]] = []
        for future in wait(self._busy, timeout=seconds, return_when=FIRST_COMPLETED).done:
            number, executor = self._busy.pop(future)
            if future.exception() is None:
                ended.append((number, future.result()))
                self._free.append(executor)
            else:
                ended.append((number, LOST))
                executor.shutdown(wait=False, kill_workers=True)
                self._free.append(None)
        return ended

    def stop(self) -> None:
        """Kill the workers."""
        executors = [executor for _, executor in self._busy.values()] + [e for e in self._free if e is not None]
        for executor in executors:
            for process in list((executor._processes or {}).values()):
                process.kill()
        for executor in executors:  # wait, since a thread that dies with the program leaves semaphores behind
            executor.shutdown(wait=True, kill_workers=True)
        self._busy, self._free = {}, []


def call_in_worker(function: Callable[..., Result], *arguments: Any) -> Result:
    """Call a function in a new worker and return its result.

    A worker has loaded its machine code in the order of `dataset.workers.warm`. Another process may have loaded or
    compiled other loops first, and then its last digits differ (`sim.compiling`).

    Raises:
        InputError: the worker was killed.
    """
    executor, future = _submit(None, function, *arguments)
    try:
        return future.result()
    except BrokenExecutor:
        raise InputError("a worker was killed, perhaps for want of memory; run the command again") from None
    finally:
        executor.shutdown(wait=True, kill_workers=True)


def _submit(executor: Any, function: Callable[..., Result], *arguments: Any) -> tuple[Any, Future[Result]]:
    """Submit work to a worker, or to a new one: where there is none, where it was killed, or its fork server.

    Returns:
        The worker that has taken the work, and its result to come.

    Raises:
        InputError: no worker can be started.
    """
    for _ in range(_ATTEMPTS):
        try:
            with isolated():
                executor = executor or _new_worker()
                return executor, cast("Future[Result]", executor.submit(function, *arguments))
        except (BrokenExecutor, ConnectionError, EOFError):
            if executor is not None:
                executor.shutdown(wait=False, kill_workers=True)
            executor = None
            time.sleep(_PAUSE)  # until the system knows that the fork server has gone
    raise InputError(f"no worker process can be started: {_ATTEMPTS} in a row were killed")


def _new_worker() -> Any:
    """Start an executor of one process, forked from the server that has loaded the machine code."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["dataset.workers.warm"])
    return ProcessPoolExecutor(1, timeout=None, context=context, initializer=_follow_user)


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


def _follow_user() -> None:
    """End this worker when the process that uses it ends, however that happens."""
    user = multiprocessing.parent_process()

    def watch() -> None:
        if user is not None:
            user.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
