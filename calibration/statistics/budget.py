"""Processor time that a search may take: it ends early, with what it has, and lists what it did not try.

Time in which a function of one's own waits, for a solver in another process say, counts as well (`waiting`).

A refit of an effect may crawl along a bent valley, and a table that no effect explains is tried with many pairs.
So a search runs within `limited(seconds)`. Each of its loops asks `skipped` before it tries something, and each
fit asks before a step. A limit inside another one ends with it at the latest. The first Ctrl-C within
`stopped_by_interrupt` ends the search; where none is under way, it interrupts the program as always.
"""

from __future__ import annotations

import math
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass, field
from types import FrameType

_SHARE_OF_ONE = 1 / 3  # of a limit, for one fit
_LEAST_WAIT = 0.02  # s; the machine interrupts any call for less
_waited = 0.0  # s, of all calls
_last_call = 0.0  # s


def clock() -> float:
    """Return the seconds of processor time, all threads of this process, and those of waiting."""
    return time.process_time() + _waited


@contextmanager
def waiting() -> Iterator[None]:
    """Count a call inside by the time that it takes, if for most of it this process has nothing to do."""
    global _waited, _last_call
    wall, processor = time.perf_counter(), time.process_time()
    try:
        yield
    finally:
        used, _last_call = time.process_time() - processor, time.perf_counter() - wall
        idle = _last_call - used
        if idle > max(used, _LEAST_WAIT):
            _waited += idle


@dataclass
class Budget:
    """Processor time of a search, all threads of this process."""

    end: float  # of `clock`
    seconds: float
    not_tried: list[str] = field(default_factory=list)  # in words; shared with the limits inside

    @property
    def left(self) -> float:
        """Seconds that are left."""
        return self.end - clock()


_BUDGETS: ContextVar[tuple[Budget, ...]] = ContextVar("budgets", default=())


@contextmanager
def limited(seconds: float) -> Iterator[Budget]:
    """Limit what runs inside to some seconds of processor time."""
    outer = _BUDGETS.get()
    budget = Budget(clock() + seconds, seconds, outer[0].not_tried if outer else [])
    token = _BUDGETS.set((*outer, budget))
    try:
        yield budget
    finally:
        _BUDGETS.reset(token)


def limited_as_one() -> AbstractContextManager[object]:
    """Limit what runs inside to the share of a search's time that one fit may take, if this is a search."""
    outer = _BUDGETS.get()
    return limited(_SHARE_OF_ONE * outer[-1].seconds) if len(outer) > 1 else nullcontext()


def seconds_left() -> float:
    """Return the processor time that is left; infinite without a limit."""
    return min((budget.left for budget in _BUDGETS.get()), default=math.inf)


def spent() -> bool:
    """Tell whether no processor time is left."""
    return seconds_left() <= 0


def skipped(what: str, calls: int = 0) -> bool:
    """Tell whether no time is left for something, or for so many calls as the last one, and note what it is."""
    if out := seconds_left() <= calls * _last_call:
        not_tried = _BUDGETS.get()[0].not_tried
        if what not in not_tried:
            not_tried.append(what)
    return out


@contextmanager
def stopped_by_interrupt() -> Iterator[None]:
    """End a search at the first Ctrl-C, with what it has; the second one interrupts the program."""

    def stop(number: int, frame: FrameType | None) -> None:
        budgets = _BUDGETS.get()
        if not budgets or spent():
            raise KeyboardInterrupt
        for budget in budgets:
            budget.end = -math.inf
        print("\nthe search ends here; the provisional verdict follows (Ctrl-C once more: none)", file=sys.stderr)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
