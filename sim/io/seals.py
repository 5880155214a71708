"""Digests that files carry of their own content, so that a reader notices damage and edits.

plan.json has one as its `id` (`sim.model.schedule`). A text that is made to be edited, such as corrected.toml,
has it as its last line, and a first line that says so: a text without its last line was cut short and is refused.
A text that fits another digest was edited or damaged, and is read with a warning. One without either is read.
"""

from __future__ import annotations

import re
import sys
from functools import cache
from hashlib import sha256

from sim.io.errors import InputError

_FIRST = "# The last line is a digest of the others: a reader notices whether the file is whole.\n"
_LAST = re.compile(r"^# digest: ([0-9a-f]{11})[ \t\r]*$\n?", re.M)


def digest_of(text: str) -> str:
    """Return eleven characters that name a text."""
    return sha256(text.encode()).hexdigest()[:11]


def sealed(text: str) -> str:
    """Return a text with its first line and its digest."""
    return f"{_FIRST}{text}# digest: {_of_lines(_FIRST + text)}\n"


def check_seal(text: str, name: object) -> None:
    """Compare a text with its digest, if it has one; `name` is that of the file.

    Raises:
        InputError: the text was cut short.
    """
    stated = _LAST.search(text)
    if stated is not None:
        if stated[1] != _of_lines(_LAST.sub("", text)):
            _warn(f"{name} was edited or damaged after it was written: its digest is that of another content")
    elif text.startswith(_FIRST.rstrip()):
        raise InputError(f"{name} is cut short: its last line, the digest, is missing; copy the whole file")


def _of_lines(text: str) -> str:
    """Return the digest of lines without spaces at their ends."""
    return digest_of("\n".join(line.rstrip(" \t\r") for line in text.split("\n")).rstrip("\n"))


@cache
def _warn(message: str) -> None:
    """Warn once of a file that is read several times."""
    print(f"warning: {message}", file=sys.stderr)
