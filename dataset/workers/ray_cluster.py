"""Run tasks on a ray cluster: at a running head's address (RAY_ADDRESS), or on one started on this machine."""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import psutil
import ray
from ray import exceptions

from dataset.workers.backend import GONE, LOST, Lost
from dataset.workers.tasks import Join, Outcome, Refusal, Task, run_task
from sim.io.errors import InputError

ADDRESS = "RAY_ADDRESS"
_LOOKED = 1.0  # seconds between two looks at the workers


class RayCluster:
    """Workers of a ray cluster."""

    def __init__(self, address: str | None, count: int):
        address = address or os.environ.get(ADDRESS)
        self._head = _head(address)
        os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
        if self._head and not self._answers():
            raise InputError(
                f"no ray cluster answers at {address}; start one with ray start --head, or give host:port"
            )
        local: dict[str, Any] = {"address": "local", "num_cpus": count, "include_dashboard": False}
        settings = {"address": address} if address else local
        before = _descendants()
        try:
            with _silent():
                ray.init(**settings, log_to_driver=False, logging_level="CRITICAL")
        except Exception as refusal:  # ray raises even `Exception` itself
            for process in _descendants() - before:
                with suppress(psutil.NoSuchProcess):
                    process.kill()
            reason = (str(refusal) or repr(refusal)).splitlines()[0]
            raise InputError(
                f"no ray cluster at {address or 'this machine'} ({reason}); "
                "where its head asks for a token, set RAY_AUTH_MODE=token and RAY_AUTH_TOKEN_PATH"
            ) from None
        self._watchdog = _watchdog(_descendants() - before)
        self._run = ray.remote(num_cpus=1, max_retries=0)(run_task)
        self._busy: dict[Any, int] = {}
        self._looked, self._slots = 0.0, 0

    def slots(self) -> int:
        """Count the processors of the nodes that are alive."""
        if time.monotonic() - self._looked > _LOOKED:
            alive = not self._head or self._answers()
            self._slots = int(ray.cluster_resources().get("CPU", 0)) if alive else 0
            self._looked = time.monotonic()
        return self._slots

    def submit(self, number: int, task: Task | Join) -> None:
        """Submit a task to the cluster."""
        self._busy[self._run.remote(task)] = number

    def collect(self, seconds: float) -> list[tuple[int, Outcome | Lost]]:
        """Return the tasks that have ended."""
        if self._head and not self._slots:
            time.sleep(seconds)  # ray would wait for a lost head without limit
            return []
        if not self._busy:
            time.sleep(seconds)
            return []
        done, _ = ray.wait(list(self._busy), num_returns=1, timeout=seconds)
        return [(self._busy.pop(reference), _outcome(reference)) for reference in done]

    def stop(self) -> None:
        """Cancel the tasks under way and disconnect."""
        if self._slots:
            for reference in self._busy:
                ray.cancel(reference, force=True)
            ray.shutdown()
            self._watchdog.communicate()

    def _answers(self) -> bool:
        try:
            with socket.create_connection(self._head, timeout=1):  # type: ignore[arg-type]
                return True
        except OSError:
            return False


def _outcome(reference: Any) -> Outcome | Lost:
    try:
        return ray.get(reference)
    except exceptions.WorkerCrashedError:
        return LOST
    except (exceptions.RayTaskError, exceptions.RaySystemError) as error:  # `run_task` itself raises nothing
        reason = str(error).strip().splitlines()[-1]
        return Refusal("code", f"a worker cannot load this package ({reason}); install it there", "a ray worker")
    except exceptions.RayError:
        return GONE


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


def _descendants() -> set[psutil.Process]:
    """Find the processes that this one has started, and theirs."""
    return set(psutil.Process().children(recursive=True))


def _watchdog(processes: set[psutil.Process]) -> subprocess.Popen[bytes]:
    """Start a process that kills others when this one has ended, however that happens.

    Ray's head and raylet end with the process that started them; the raylet's agents wait a minute for the head.
    """
    words = ["sh", "-c", 'cat; kill -9 "$@"', "watchdog", *(str(process.pid) for process in processes)]
    nothing = subprocess.DEVNULL
    return subprocess.Popen(words, stdin=subprocess.PIPE, stdout=nothing, stderr=nothing, start_new_session=True)


def _head(address: str | None) -> tuple[str, int] | None:
    """Split a head's address into host and port; None where ray finds it by itself."""
    host, _, port = (address or "").removeprefix("ray://").rpartition(":")
    return (host, int(port)) if host and port.isdigit() else None
