"""Wall-clock and processor time of a call."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

Result = TypeVar("Result")


def timed(work: Callable[[], Result], *, repeats: int = 1) -> tuple[float, Result]:
    """Return the shortest wall-clock time of some runs [s], and the result."""
    best = np.inf
    for _ in range(repeats):
        began = time.perf_counter()
        result = work()
        best = min(best, time.perf_counter() - began)
    return best, result


def processor_time(work: Callable[[], object], *, repeats: int = 1) -> float:
    """Return the processor time of a run [s], the mean of some."""
    began = time.process_time()
    for _ in range(repeats):
        work()
    return (time.process_time() - began) / repeats
