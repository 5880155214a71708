"""Where the work of a sweep runs: processes of this machine, or what dask or ray offer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from sim.io.errors import InputError

BACKENDS = ("loky", "dask", "ray")


@contextmanager
def backend(name: str) -> Iterator[None]:
    """Parallel work inside the block runs on the named backend of joblib.

    Raises:
        InputError: an unknown backend, or one whose package is missing.
    """
    if name not in BACKENDS:
        raise InputError(f"backend {name!r}; allowed are {', '.join(BACKENDS)}")
    if name == "loky":
        yield
        return
    import joblib

    try:
        if name == "dask":
            from distributed import Client

            with Client(processes=True, threads_per_worker=1), joblib.parallel_config("dask"):
                yield
        else:
            from ray.util.joblib import register_ray

            register_ray()
            with joblib.parallel_config("ray"):
                yield
    except ImportError:
        package = "dask[distributed]" if name == "dask" else "ray"
        raise InputError(f"backend {name!r} needs the package {package}; install it or use loky") from None
