"""Lines printed by a thread of their own, so that a full pipe or a terminal held up delays nothing else."""

from __future__ import annotations

import os
import threading
from contextlib import suppress
from queue import SimpleQueue
from typing import TextIO

_PATIENCE = 1.0  # s at the end for what is not printed yet


class Printer:
    """Prints lines on a stream, past the buffer of a file: a lock on that would keep the program from ending."""

    def __init__(self, stream: TextIO):
        self._stream, self._file = stream, -1
        with suppress(OSError):  # a notebook's stream is no file
            self._file = stream.fileno()
        self._lines = SimpleQueue[str | None]()
        self._failed: OSError | None = None
        self._thread = threading.Thread(target=self._print, daemon=True)

    def __enter__(self) -> Printer:
        self._thread.start()
        return self

    def __call__(self, line: str) -> None:
        """Print a line soon; raises OSError where nobody reads any more."""
        if self._failed is not None:
            raise self._failed
        self._lines.put(line)

    def __exit__(self, *error: object) -> None:
        self._lines.put(None)
        self._thread.join(_PATIENCE)

    def _print(self) -> None:
        try:
            while (line := self._lines.get()) is not None:
                if self._file < 0:
                    print(line, file=self._stream, flush=True)
                    continue
                left = f"{line}\n".encode(self._stream.encoding, "replace")
                while left:
                    left = left[os.write(self._file, left) :]
        except OSError as failed:
            self._failed = failed
