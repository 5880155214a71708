"""Where the tasks of a sweep run: processes of this machine, a dask cluster, a ray cluster.

Each backend is a file with a class that has the four methods of `Backend`. A backend loses no task in silence:
what it was given comes back by `collect` as a receipt, a refusal, or one of the constants below.
"""

from __future__ import annotations

import os
from importlib.util import find_spec
from typing import TYPE_CHECKING, Literal, Protocol

from sim.io.errors import InputError

if TYPE_CHECKING:
    from dataset.workers.tasks import Outcome, Work

BACKENDS = ("loky", "dask", "ray")
Lost = Literal["lost", "killer", "gone"]
LOST: Lost = "lost"  # its worker died; counted
KILLER: Lost = "killer"  # the backend has counted already: it will not try again
GONE: Lost = "gone"  # through no fault of the task: submitted again


class Backend(Protocol):
    """The contract of a backend."""

    def slots(self) -> int:
        """Tasks that can run at once; 0 while there are no workers."""

    def submit(self, number: int, task: Work) -> None:
        """Hand over a task; at most `slots` are under way."""

    def collect(self, seconds: float) -> list[tuple[int, Outcome | Lost]]:
        """What has ended, after at most about so many seconds."""

    def stop(self) -> None:
        """End the work under way and let go of the workers, at once."""


def processors() -> int:
    """The processors that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_backend(name: str, jobs: int | None) -> None:
    """Refuse an unknown backend, one whose package is missing, and an impossible number of workers."""
    if name not in BACKENDS:
        raise InputError(f"backend {name!r}; allowed are {', '.join(BACKENDS)}")
    package = {"dask": "distributed", "ray": "ray"}.get(name)
    if package and find_spec(package) is None:
        raise InputError(
            f"backend {name!r} needs the package {package}; pip install 'softflagella[{name}]', or use loky"
        )
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs = {jobs}; give at least 1, or nothing for all processors")


def open_backend(name: str, *, jobs: int | None = None, address: str | None = None) -> Backend:
    """The backend of a name.

    Args:
        name: "loky", "dask" or "ray".
        jobs: workers on this machine; default all processors.
        address: of a running dask scheduler or ray cluster; default: workers on this machine.

    Raises:
        InputError: as for `check_backend`, or a cluster that does not answer.
    """
    check_backend(name, jobs)
    count = jobs or processors()
    if name == "loky":
        from dataset.workers.processes import Processes

        return Processes(count)
    if name == "dask":
        from dataset.workers.dask_cluster import DaskCluster

        return DaskCluster(address, count)
    from dataset.workers.ray_cluster import RayCluster

    return RayCluster(address, count)
