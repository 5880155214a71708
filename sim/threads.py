"""Threads: how many, and compiled loops in them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def available_jobs() -> int:
    """Count the threads to use by default: the processors that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_threads(work: Callable[[Item], Result], items: Sequence[Item], jobs: int | None = None) -> Iterable[Result]:
    """Apply compiled loops, which do not hold the interpreter's lock, to each item; results in their order."""
    count = min(jobs or available_jobs(), len(items))
    if count == 1:
        return map(work, items)
    from joblib import Parallel, delayed  # slow to import, and one thread needs none of it

    results: Iterable[Result] = Parallel(n_jobs=count, prefer="threads", return_as="generator")(
        map(delayed(work), items)
    )
    return results
