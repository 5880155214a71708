"""Run tasks on a dask cluster: at a running scheduler's address, or on workers started on this machine."""

from __future__ import annotations

import logging
import os
import threading
import time
from contextlib import suppress
from typing import Any

import dask
from distributed import Client, Future, KilledWorker, LocalCluster

from dataset.workers.backend import GONE, KILLER, Lost
from dataset.workers.processes import isolated
from dataset.workers.tasks import Join, Outcome, Refusal, Task, run_task
from sim.io.errors import InputError

ADDRESS = "DASK_SCHEDULER_ADDRESS"
_ANSWERS = 10.0  # seconds that a scheduler may take to answer at the start
_LOOKED = 1.0  # seconds between two looks at the workers
_SETTINGS = {
    "distributed.scheduler.allowed-failures": 2,  # of a local cluster: the third death of a worker is the last
    "distributed.comm.timeouts.connect": "10s",
}


class DaskCluster:
    """Workers of a dask scheduler."""

    def __init__(self, address: str | None, count: int):
        address = address or os.environ.get(ADDRESS)
        for name in ("distributed", "distributed.client", "distributed.scheduler", "distributed.nanny", "tornado"):
            logging.getLogger(name).setLevel(logging.CRITICAL)  # this program reports what matters
        self._cluster: Any = None
        try:
            with dask.config.set(_SETTINGS), isolated():
                if address is None:
                    self._cluster = LocalCluster(
                        n_workers=count, threads_per_worker=1, dashboard_address=None, memory_limit=0
                    )
                self._client = Client(self._cluster or address, timeout=_ANSWERS, set_as_default=False)
        except Exception as refusal:  # whatever a connection, or a nanny, can raise
            reason = (str(refusal) or repr(refusal)).splitlines()[0]
            raise InputError(
                f"no dask scheduler answers at {address or 'this machine'} ({reason}); start one with "
                "dask scheduler, or give its address as tcp://host:port"
            ) from None
        self._busy: dict[Future, int] = {}
        self._looked, self._slots = 0.0, 0

    def slots(self) -> int:
        """Count the threads of the workers that the scheduler knows now."""
        if time.monotonic() - self._looked > _LOOKED:
            try:
                threads = self._client.sync(self._client.scheduler.ncores, callback_timeout=2)
                self._slots = sum(threads.values())
            except Exception:  # whatever a connection can raise: no workers
                self._slots = 0
            self._looked = time.monotonic()
        return self._slots

    def submit(self, number: int, task: Task | Join) -> None:
        """Submit a task to the scheduler."""
        self._busy[self._client.submit(run_task, task, pure=False)] = number

    def collect(self, seconds: float) -> list[tuple[int, Outcome | Lost]]:
        """Return the tasks that have ended."""
        deadline = time.monotonic() + seconds
        while not any(future.done() for future in self._busy) and time.monotonic() < deadline:
            time.sleep(0.02)
        ended: list[tuple[int, Outcome | Lost]] = []
        for future in [future for future in self._busy if future.done()]:
            number = self._busy.pop(future)
            ended.append((number, _outcome(future)))
        return ended

    def stop(self) -> None:
        """Cancel the tasks under way and disconnect."""

        def disconnect() -> None:
            with suppress(Exception):  # what does not close in time ends with this process
                self._client.cancel(list(self._busy), force=True)
                self._client.close(timeout=1)
                if self._cluster is not None:
                    self._cluster.close(timeout=1)

        closing = threading.Thread(target=disconnect, daemon=True)  # do not wait for a scheduler that is gone
        closing.start()
        closing.join(timeout=1.5)


def _outcome(future: Future) -> Outcome | Lost:
    if future.status not in ("finished", "error"):  # cancelled or lost with its scheduler
        return GONE
    try:
        return future.result(timeout=_ANSWERS)
    except KilledWorker:
        return KILLER
    except ImportError as missing:
        return Refusal("code", f"a worker cannot load this package ({missing}); install it there", "a dask worker")
    except Exception:  # its worker ended after it had finished
        return GONE
