"""Work that a search may do: it ends early, with what it has, and lists what it did not try.

A refit of an effect may crawl along a bent valley, and a table that no effect explains is tried with many pairs.
So a search runs within `limited(work)`. Work is counted in predictions of one run, so that every machine comes to
the same verdict, however fast or busy it is. A limit of processor time can be set as well, for models that take
long. Time in which a function of one's own waits, for a solver in another process say, counts in it (`waiting`).

Each model says how many runs it predicts (`count_predictions`). Each loop of a search asks `skipped` before it
tries something, and each fit asks before a step. A limit inside another one ends with it at the latest. The first
Ctrl-C within `stopped_by_interrupt` ends the search; where none is under way, it interrupts the program as always.
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
_PREDICTED: ContextVar[int] = ContextVar("predicted", default=0)  # runs; a thread counts its own


@dataclass(frozen=True)
class Work:
    """Work that was done, or that may be; by default any."""

    predictions: float = math.inf  # of one run
    seconds: float = math.inf  # of processor time, all threads of this process, and of waiting

    def __add__(self, other: Work) -> Work:
        return Work(self.predictions + other.predictions, self.seconds + other.seconds)

    def __sub__(self, other: Work) -> Work:
        return Work(self.predictions - other.predictions, self.seconds - other.seconds)

    def __rmul__(self, share: float) -> Work:
        return Work(share * self.predictions, share * self.seconds)


def clock() -> float:
    """Return the seconds of processor time, all threads of this process, and those of waiting."""
    return time.process_time() + _waited


def work_done() -> Work:
    """Return the predictions of this thread up to now, and the time of `clock`."""
    return Work(_PREDICTED.get(), clock())


def count_predictions(runs: int) -> None:
    """Count the predictions of so many runs."""
    _PREDICTED.set(_PREDICTED.get() + runs)


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
    """Work that a search may do."""

    limit: Work  # of which the search has a share
    began: Work
    end: Work
    allowed: Work  # at the beginning
    # What, in words -> when the search had ended, in words; shared with the limits inside.
    not_tried: dict[str, str] = field(default_factory=dict)

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C has ended the search."""
        return self.end.predictions == -math.inf


_BUDGETS: ContextVar[tuple[Budget, ...]] = ContextVar("budgets", default=())


@contextmanager
def limited(limit: Work, share: float = 1.0, began: Work | None = None) -> Iterator[Budget]:
    """Limit what runs inside to a share of some work, which began before or begins here."""
    outer, now = _BUDGETS.get(), work_done()
    began = began or now
    end = began + share * limit
    token = _BUDGETS.set((*outer, Budget(limit, began, end, end - now, outer[0].not_tried if outer else {})))
    try:
        yield _BUDGETS.get()[-1]
    finally:
        _BUDGETS.reset(token)


def limited_as_one() -> AbstractContextManager[object]:
    """Limit what runs inside to the share of a search's work that one fit may do, if this is a search."""
    outer = _BUDGETS.get()
    return limited(outer[-1].allowed, _SHARE_OF_ONE) if len(outer) > 1 else nullcontext()


def beginning() -> Work:
    """Return where the outermost limit began; without one, where the work is now."""
    outer = _BUDGETS.get()
    return outer[0].began if outer else work_done()


def work_left() -> Work:
    """Return the work that may still be done; infinite without a limit."""
    ends = [budget.end for budget in _BUDGETS.get()]
    predictions = min((end.predictions for end in ends), default=math.inf)
    seconds = min((end.seconds for end in ends), default=math.inf)
    # To read the processor's clock may take a millisecond.
    return Work(predictions - _PREDICTED.get(), seconds - clock() if seconds < math.inf else seconds)


def seconds_left(since: Work) -> float:
    """Estimate the processor time that is left, at the pace since some work was done; infinite without a limit."""
    done, left = work_done() - since, work_left()
    return min(left.seconds, left.predictions * done.seconds / max(done.predictions, 1))


def spent() -> bool:
    """Tell whether nothing more may be done."""
    return _ended(0) != ""


def skipped(what: str, calls: int = 0) -> bool:
    """Tell whether nothing more may be done, or not so many calls as the last one, and note what was to do."""
    if ended := _ended(calls):
        _BUDGETS.get()[0].not_tried.setdefault(what, ended)
    return ended != ""


def _ended(calls: int) -> str:
    """Say in words where the search ended, before some calls as long as the last one; empty if it goes on."""
    outer, left = _BUDGETS.get(), work_left()
    if any(budget.interrupted for budget in outer):
        return "at Ctrl-C"
    if left.predictions <= 0:
        return f"after {outer[0].limit.predictions:,.0f} predictions of a run"
    return f"after {outer[0].limit.seconds:,.0f} s of processor time" if left.seconds <= calls * _last_call else ""


@contextmanager
def stopped_by_interrupt() -> Iterator[None]:
    """End a search at the first Ctrl-C, with what it has; the second one interrupts the program."""

    def stop(number: int, frame: FrameType | None) -> None:
        budgets = _BUDGETS.get()
        if not budgets or spent():
            raise KeyboardInterrupt
        for budget in budgets:
            budget.end = Work(-math.inf, -math.inf)
        print("\nthe search ends here; the provisional verdict follows (Ctrl-C once more: none)", file=sys.stderr)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
