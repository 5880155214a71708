"""Open a backend by its name: processes of this machine (loky), a dask cluster, or a ray cluster."""

from __future__ import annotations

import os
from importlib.util import find_spec

from dataset.workers import BACKENDS
from dataset.workers.backend import Backend
from sim.io.errors import InputError

# Module that a backend needs, and how it is installed.
_PACKAGES = {"dask": ("distributed", "dask[distributed]"), "ray": ("ray", "ray")}


def processors() -> int:
    """Count the processors that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_backend(name: str, jobs: int | None) -> None:
    """Reject an unknown backend, one whose package is missing, and an impossible number of workers."""
    if name not in BACKENDS:
        raise InputError(f"backend {name!r}; allowed are {', '.join(BACKENDS)}")
    module, package = _PACKAGES.get(name, ("", ""))
    if module and find_spec(module) is None:
        raise InputError(f"backend {name!r} needs the package {module}; pip install '{package}', or use loky")
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs = {jobs}; give at least 1, or nothing for all processors")


def open_backend(name: str, *, jobs: int | None = None, address: str | None = None) -> Backend:
    """Open a backend; its module, and the library behind it, are loaded only now.

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
    if os.path.exists(os.path.expanduser("~/.ray/auth_token")):
        os.environ.setdefault("RAY_AUTH_MODE", "token")  # as `ray start` does; ray reads it when it is imported
    from dataset.workers.ray_cluster import RayCluster

    return RayCluster(address, count)
