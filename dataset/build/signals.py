"""Ctrl-C and SIGTERM: a long run ends within two seconds, with one line.

Python runs its own handlers between two operations; one operation of a library may take longer. So a thread
waits for the signal, too, and ends the process if the handler does not get its turn.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

_GRACE = 1.3  # seconds for an orderly end
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupted(KeyboardInterrupt):
    """The user, or the system, ends the run."""

    def __init__(self, number: int):
        self.status = 128 + number
        super().__init__(signal.Signals(number).name)


@contextmanager
def interruptible(last_words: Callable[[], str]) -> Iterator[None]:
    """Ctrl-C and SIGTERM inside raise `Interrupted`, once; `last_words` are printed, here or in the emergency.

    Outside the main thread, where Python handles no signals, this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    said, received = threading.Event(), list[int]()

    def say(number: int) -> None:
        if not said.is_set():
            said.set()
            print(f"\n{last_words()}", file=sys.stderr, flush=True)

    def handle(number: int, _: FrameType | None) -> None:
        for each in _SIGNALS:
            signal.signal(each, signal.SIG_IGN)
        received.append(number)
        raise Interrupted(number)

    heard, wakes = os.pipe()
    os.set_blocking(wakes, False)
    over = threading.Event()

    def watch() -> None:
        while data := os.read(heard, 1):
            if data[0] in _SIGNALS and not over.wait(_GRACE):
                say(data[0])
                os._exit(128 + data[0])

    before = {each: signal.signal(each, handle) for each in _SIGNALS}
    awake = signal.set_wakeup_fd(wakes, warn_on_full_buffer=False)
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    except BaseException:
        if not received:
            raise
        say(received[0])  # whatever libraries have made of `Interrupted` on its way
        raise Interrupted(received[0]) from None
    finally:
        over.set()
        signal.set_wakeup_fd(awake)
        for each, handler in before.items():
            signal.signal(each, handler)
        os.close(wakes)
        watcher.join(timeout=1)
        os.close(heard)
