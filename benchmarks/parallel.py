"""Independent cases on all processors."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from joblib import Parallel, delayed

from sim.motion.batches import available_jobs

Result = TypeVar("Result")


def in_parallel(
    work: Callable[..., Result], cases: Iterable[tuple[Any, ...]], *, quiet: bool = False
) -> list[Result]:
    """Call `work` with the arguments of each case; return the results in order, with progress on stderr."""
    calls = (delayed(work)(*case) for case in cases)
    return list(Parallel(n_jobs=available_jobs(), verbose=0 if quiet else 1)(calls))
