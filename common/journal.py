"""A journal of a long computation: what is done is kept, however the process ends, and the same command goes on.

Its first line is the key of the inputs. Each other line has the number of a part, what was found, and a digest of
both: a line that was cut short does not count. The journal is removed when the result is written.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from common.errors import InputError
from common.files import make_folder, open_no_link, refusals
from common.reading import digest_of


class Journal:
    """The parts that are done, by number, as plain lists and dictionaries."""

    def __init__(self, path: Path, descriptor: int, done: dict[int, Any]):
        self._path, self._descriptor, self.done = path, descriptor, done

    def add(self, part: int, content: Any) -> None:
        """Keep what was found for a part."""
        text = json.dumps([part, content])
        with refusals(self._path):
            os.write(self._descriptor, f"{digest_of(text)} {text}\n".encode())


@contextmanager
def journal(path: Path, key: str) -> Iterator[Journal]:
    """Open a journal, and remove it when the block succeeds, or ends with no part done.

    Args:
        path: of the journal.
        key: digest of everything that decides the parts.

    Raises:
        InputError: it cannot be written, belongs to other inputs, or another process writes it.
    """
    make_folder(path.parent)
    with refusals(path):
        if not path.exists():
            os.close(open_no_link(path, new=True))
        descriptor = open_no_link(path, new=False)
        opened = os.fdopen(descriptor, "r+b")
    with opened as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"{path} is being written by another process; wait until it ends") from None
        first, *lines = file.read().split(b"\n")
        if first != key.encode() if lines else not key.encode().startswith(first):
            raise InputError(
                f"{path} is of other robots, options or code; give these again, give another --out, or remove it"
            )
        done, end = {}, len(key) + 1
        for line in lines[:-1]:
            stated, _, text = line.partition(b" ")
            if stated.decode(errors="replace") != digest_of(text.decode(errors="replace")):
                break
            part, content = json.loads(text)
            done[part], end = content, end + len(line) + 1
        file.truncate(end if lines else 0)
        file.seek(0, os.SEEK_END)
        if not lines:
            os.write(descriptor, f"{key}\n".encode())
        finished = False
        try:
            yield Journal(path, descriptor, done)
            finished = True
        finally:
            if finished or os.fstat(descriptor).st_size <= len(key) + 1:
                path.unlink(missing_ok=True)
