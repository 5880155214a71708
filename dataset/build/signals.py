"""Turn interruptions of a long command into one line and an exit status.

Ctrl-C and SIGTERM raise `Interrupted` in the main thread, once. A second signal ends the process at once, as it
would without this module: what is stored stays stored, and workers end with their user.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TypeVar

T = TypeVar("T")
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupted(KeyboardInterrupt):
    """The user, or the system, ends the run."""

    def __init__(self, number: int):
        self.status = 128 + number
        super().__init__(signal.Signals(number).name)


class UnfinishedError(RuntimeError):
    """A sweep ended before all rows were stored; the message is one line, `status` the exit status."""

    status = 1


@contextmanager
def interruptible(last_words: Callable[[], str]) -> Iterator[None]:
    """Turn the first SIGINT or SIGTERM inside into `Interrupted`, and print `last_words`.

    Outside the main thread, where Python handles no signals, this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []

    def handle(number: int, _: FrameType | None) -> None:
        received.append(number)
        for each in _SIGNALS:
            signal.signal(each, signal.SIG_DFL)
        raise Interrupted(number)

    before = {each: signal.signal(each, handle) for each in _SIGNALS}
    try:
        yield
    except BaseException:
        if not received:
            raise
        print(f"\n{last_words()}", file=sys.stderr, flush=True)
        raise Interrupted(received[0]) from None  # whatever libraries have made of the first one on its way
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def run_long_command(work: Callable[[], T]) -> T:
    """Return the result of long work; where it ends early, print one line and exit with its status."""
    try:
        return work()
    except Interrupted as stop:  # its line has been printed
        emergency = threading.Timer(1.0, os._exit, (stop.status,))  # for libraries that wait at an ordinary exit
        emergency.daemon = True
        emergency.start()
        sys.exit(stop.status)
    except KeyboardInterrupt:
        print("\nstopped before the build began", file=sys.stderr)
        sys.exit(130)
    except UnfinishedError as unfinished:
        print(f"unfinished: {unfinished}", file=sys.stderr)
        sys.exit(unfinished.status)
