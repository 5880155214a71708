"""Back ends by name: processes here, or a cluster of dask, a running one or one started on this machine."""

from __future__ import annotations

import logging
import os
import threading
import time
from contextlib import suppress
from importlib.util import find_spec
from typing import Any

from common.errors import InputError
from dataset.shards import Part
from dataset.workers import Backend, Chunk, Ended, Failure, Processes, isolated

# Module that a back end needs, and how it is installed.
_PACKAGES = {
    "local": ("cloudpickle", "cloudpickle"),
    "dask": ("distributed", "dask[distributed]"),
}
_ANSWERS, _LOOKED = 10.0, 1.0  # seconds that a scheduler may take to answer; between two looks at the workers
_DASK = {
    "distributed.scheduler.allowed-failures": 2,  # of a local cluster: the third death of a worker is the last
    "distributed.comm.timeouts.connect": "10s",
}


def check_backend(name: str, jobs: int | None) -> None:
    """Reject an unknown back end, one whose package is missing, and an impossible number of workers."""
    if name not in _PACKAGES:
        raise InputError(f"backend {name!r}; allowed are {', '.join(_PACKAGES)}")
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs = {jobs}; give at least 1, or nothing for all processors")
    module, package = _PACKAGES[name]
    if find_spec(module) is None:
        raise InputError(f"backend {name!r} needs the package {module}; pip install '{package}'")


def open_backend(name: str, jobs: int | None, address: str | None) -> Backend:
    """Open a back end, with `jobs` workers on this machine, by default one a processor, or those at an address.

    Raises:
        InputError: a cluster does not answer.
    """
    from sim.threads import available_jobs

    count = jobs or available_jobs()
    if name == "local":
        return Processes(count)
    return DaskCluster(address, count)


class DaskCluster:
    """Workers of a dask scheduler."""

    def __init__(self, address: str | None, count: int):
        import dask
        from distributed import Client, LocalCluster
        from distributed.comm import get_address_host_port

        address = address or os.environ.get("DASK_SCHEDULER_ADDRESS")
        for name in ("distributed", "distributed.client", "distributed.scheduler", "distributed.nanny", "tornado"):
            logging.getLogger(name).setLevel(logging.CRITICAL)  # this program reports what matters
        local = {"n_workers": count, "threads_per_worker": 1, "dashboard_address": None, "memory_limit": 0}
        try:
            if address is not None:  # a client that cannot read it is 20 s about its own end
                get_address_host_port(address)
            with dask.config.set(_DASK), isolated():
                self._cluster = LocalCluster(**local) if address is None else None
                self._client = Client(self._cluster or address, timeout=_ANSWERS, set_as_default=False)
        except Exception as refusal:  # whatever a connection, or a nanny, can raise
            raise InputError(
                f"no dask scheduler answers at {address or 'this machine'} ({_first_line(refusal)}); start one "
                "with dask scheduler, or give its address as tcp://host:port"
            ) from None
        self._busy: dict[Any, Chunk] = {}
        self._looked, self._slots = 0.0, 0

    def slots(self) -> int:
        """Count the threads of the workers that the scheduler knows now."""
        if time.monotonic() - self._looked > _LOOKED:
            try:
                self._slots = sum(self._client.sync(self._client.scheduler.ncores, callback_timeout=2).values())
            except Exception:  # whatever a connection can raise: no workers
                self._slots = 0
            self._looked = time.monotonic()
        return self._slots

    def submit(self, chunk: Chunk) -> None:
        """Submit a chunk to the scheduler."""
        self._busy[self._client.submit(_run, chunk, pure=False)] = chunk

    def collect(self, seconds: float) -> Ended:
        """Return the chunks that have ended."""
        deadline = time.monotonic() + seconds
        while not any(future.done() for future in self._busy) and time.monotonic() < deadline:
            time.sleep(0.02)
        return [(self._busy.pop(future), _dask_outcome(future)) for future in list(self._busy) if future.done()]

    def stop(self) -> None:
        """Cancel the chunks under way and disconnect."""

        def disconnect() -> None:
            with suppress(Exception):  # what does not close in time ends with this process
                self._client.cancel(list(self._busy), force=True)
                self._client.close(timeout=1)
                if self._cluster is not None:
                    self._cluster.close(timeout=1)

        closing = threading.Thread(target=disconnect, daemon=True)  # do not wait for a scheduler that is gone
        closing.start()
        closing.join(timeout=1.5)


def _dask_outcome(future: Any) -> Part | Failure:
    from distributed import KilledWorker

    if future.status in ("finished", "error"):  # neither cancelled nor lost with its scheduler
        try:
            outcome: Part | Failure = future.result(timeout=_ANSWERS)
            return outcome
        except KilledWorker:  # the scheduler has tried it again already
            return Failure("error", "its worker died 3 times")
        except ImportError as missing:
            return Failure("refused", f"a dask worker cannot load this package ({missing}); install it there")
        except Exception:  # its worker ended after it had finished
            pass
    return Failure("gone")


def _run(chunk: Chunk) -> Part | Failure:
    return chunk.run()


def _first_line(refusal: Exception) -> str:
    return (str(refusal) or repr(refusal)).splitlines()[0]
