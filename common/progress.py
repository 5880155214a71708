"""How far work is, and when it ends: a bar on a terminal, a line every ten seconds in a log."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any

_TICK, _LOGGED = 1.0, 10.0  # s


@contextmanager
def progress_bar(title: str, **options: Any) -> Iterator[Any]:
    """Show a bar of tqdm that ticks while nothing is told to it, so that no work is silent."""
    from tqdm import tqdm

    terminal, ended = sys.stderr.isatty(), Event()
    with (
        open(os.devnull, "w") as nowhere,
        tqdm(desc=title, leave=False, delay=_TICK, file=sys.stderr if terminal else nowhere, **options) as bar,
    ):

        def tick() -> None:
            while not (bar.disable or ended.wait(_TICK if terminal else _LOGGED)):
                if terminal:
                    bar.refresh()
                else:
                    print(bar, file=sys.stderr, flush=True)

        thread = Thread(target=tick, daemon=True)
        thread.start()
        try:
            yield bar
        finally:
            ended.set()
            thread.join()
