"""How a long command ends: its result, or one line and an exit status."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from typing import TypeVar

from dataset.build.signals import Interrupted

T = TypeVar("T")


def ended(work: Callable[[], T]) -> T:
    """The result of long work; where it ends early, one line and its exit status."""
    try:
        from dataset.build.build import UnfinishedError

        return work()
    except Interrupted as stop:  # its line has been printed
        emergency = threading.Timer(1.0, os._exit, (stop.status,))  # for libraries that wait at an ordinary exit
        emergency.daemon = True
        emergency.start()
        sys.exit(stop.status)
    except KeyboardInterrupt:
        print("\nstopped before it began", file=sys.stderr)
        sys.exit(130)
    except UnfinishedError as ended:
        print(f"unfinished: {ended}", file=sys.stderr)
        sys.exit(ended.status)
