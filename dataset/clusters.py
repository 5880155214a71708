"""Back ends by name: processes here, or a cluster of dask or ray, a running one or one started on this machine."""

from __future__ import annotations

import logging
import os
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from typing import Any

from dataset.shards import Part
from dataset.workers import Backend, Chunk, Ended, Failure, Processes, isolated
from sim.io.errors import InputError

# Module that a back end needs, and how it is installed.
_PACKAGES = {
    "local": ("cloudpickle", "cloudpickle"),
    "dask": ("distributed", "dask[distributed]"),
    "ray": ("ray", "ray"),
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
    from sim.motion.batches import available_jobs

    count = jobs or available_jobs()
    if name == "local":
        return Processes(count)
    return (DaskCluster if name == "dask" else RayCluster)(address, count)


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


class RayCluster:
    """Workers of a ray cluster."""

    def __init__(self, address: str | None, count: int):
        if os.path.exists(os.path.expanduser("~/.ray/auth_token")):
            os.environ.setdefault("RAY_AUTH_MODE", "token")  # as `ray start` does
        os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
        import psutil
        import ray

        address = address or os.environ.get("RAY_ADDRESS")
        host, _, port = (address or "").removeprefix("ray://").rpartition(":")
        self._head = (host, int(port)) if host and port.isdigit() else None  # None: ray finds it by itself
        if not self._answers():
            raise InputError(
                f"no ray cluster answers at {address}; start one with ray start --head, or give host:port"
            )
        local: dict[str, Any] = {"address": "local", "num_cpus": count, "include_dashboard": False}
        before = _descendants()
        try:
            with _silent():
                ray.init(
                    **({"address": address} if address else local), log_to_driver=False, logging_level="CRITICAL"
                )
        except Exception as refusal:  # ray raises even `Exception` itself
            for process in _descendants() - before:
                with suppress(psutil.NoSuchProcess):
                    process.kill()
            raise InputError(
                f"no ray cluster at {address or 'this machine'} ({_first_line(refusal)}); "
                "where its head asks for a token, set RAY_AUTH_MODE=token and RAY_AUTH_TOKEN_PATH"
            ) from None
        # Head and raylet end with the process that started them, but the raylet's agents wait a minute for the
        # head. So one more process kills them all when this one has ended, however that happens.
        started = [str(process.pid) for process in _descendants() - before]
        self._watchdog = subprocess.Popen(
            ["sh", "-c", 'cat; kill -9 "$@"', "watchdog", *started],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        self._ray, self._run = ray, ray.remote(num_cpus=1, max_retries=0)(_run)
        self._busy: dict[Any, Chunk] = {}
        self._looked, self._slots = 0.0, 0

    def slots(self) -> int:
        """Count the processors of the nodes that are alive."""
        if time.monotonic() - self._looked > _LOOKED:
            self._slots = int(self._ray.cluster_resources().get("CPU", 0)) if self._answers() else 0
            self._looked = time.monotonic()
        return self._slots

    def submit(self, chunk: Chunk) -> None:
        """Submit a chunk to the cluster."""
        self._busy[self._run.remote(chunk)] = chunk

    def collect(self, seconds: float) -> Ended:
        """Return the chunks that have ended."""
        if not self._busy or not self._slots:
            time.sleep(seconds)  # ray would wait for a lost head without limit
            return []
        done, _ = self._ray.wait(list(self._busy), num_returns=1, timeout=seconds)
        return [(self._busy.pop(reference), self._outcome(reference)) for reference in done]

    def stop(self) -> None:
        """Cancel the chunks under way and disconnect."""
        if self._slots:
            for reference in self._busy:
                self._ray.cancel(reference, force=True)
            self._ray.shutdown()
            self._watchdog.communicate()

    def _answers(self) -> bool:
        """Whether the head is there, as far as its address is known."""
        with suppress(OSError):
            if self._head is not None:
                socket.create_connection(self._head, timeout=1).close()
            return True
        return False

    def _outcome(self, reference: Any) -> Part | Failure:
        errors = self._ray.exceptions
        try:
            outcome: Part | Failure = self._ray.get(reference)
            return outcome
        except errors.WorkerCrashedError:
            return Failure("died")
        except (errors.RayTaskError, errors.RaySystemError) as error:  # a chunk itself raises nothing
            reason = str(error).strip().splitlines()[-1]
            return Failure("refused", f"a ray worker cannot load this package ({reason}); install it there")
        except errors.RayError:
            return Failure("gone")


def _run(chunk: Chunk) -> Part | Failure:
    return chunk.run()


def _first_line(refusal: Exception) -> str:
    return (str(refusal) or repr(refusal)).splitlines()[0]


@contextmanager
def _silent() -> Iterator[None]:
    """Discard what ray's compiled code writes to stderr: it complains of each of 20 attempts to connect."""
    stderr = os.dup(2)
    with open(os.devnull, "wb") as nothing:
        os.dup2(nothing.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)


def _descendants() -> set[Any]:
    """Find the processes that this one has started, and theirs."""
    import psutil

    return set(psutil.Process().children(recursive=True))
