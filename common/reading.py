"""Read files that people bring: bytes, texts, TOML and JSON, up to a limit of size.

Whatever a file holds, a reader ends with its content or with one line that names the file and what is wrong.

Files carry digests of their own content, so that a reader notices damage and edits. plan.json has one as its `id`
(`sim.model.schedule`). A text that is made to be edited, such as corrected.toml, has it as its last line, and a
first line that says so: a text without its last line was cut short and is refused. A text that fits another digest
was edited or damaged, and is read with a warning. One without either is read.
"""

from __future__ import annotations

import codecs
import json
import os
import re
import sys
import textwrap
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

from common.errors import InputError, naming

MOST_BYTES = 256 * 2**20  # of a file
_PIPED = re.compile(r"/dev/stdin|/(?:dev|proc/self)/fd/\d+")  # what a shell hands over: it has an end
_FIRST = "# The last line is a digest of the others: a reader notices whether the file is whole.\n"
_LAST = re.compile(r"^# digest: ([0-9a-f]{11})[ \t\r]*$\n?", re.M)
_DECIMAL_COMMA = re.compile(r"^[ \t]*[\w-]+[ \t]*=[ \t]*([+-]?\d{1,20}),(\d{1,20})[ \t]*(?:#.*)?$", re.M)
T = TypeVar("T")


class ContentError(InputError):
    """A file can be read, but its content is not what it should be."""


@contextmanager
def expecting(kind: str, source: object, remedy: str) -> Iterator[None]:
    """Refuse content that a block cannot read, in one line with the name of its file; name it in other refusals.

    Args:
        kind: what the file should be, such as "a plan.json of the planner".
        source: the path of the file, or a name of the content.
        remedy: what to do.

    Raises:
        InputError: an entry is missing or has another form, or the block refuses it.
    """
    try:
        with naming(source):
            yield
        return
    except ContentError as unreadable:
        reason = str(unreadable).removeprefix(f"{source} ")
    except InputError:
        raise
    except KeyError as missing:
        reason = f"no entry {missing}"
    except (TypeError, AttributeError, IndexError):
        reason = "an entry is missing or has another form"
    except (ValueError, ArithmeticError) as broken:
        reason = textwrap.shorten(str(broken), 150, placeholder=" …")
    raise InputError(f"{source} is not {kind} ({reason}); {remedy}")


def read_bytes(path: str | Path, *, first: int = MOST_BYTES + 1) -> bytes:
    """Read a file, or a pipe of the shell, or its first bytes.

    Raises:
        InputError: it is no file, or a pipe that may never end; it cannot be read, or is larger than MOST_BYTES.
    """
    if os.path.exists(path) and not (os.path.isfile(path) or os.path.isdir(path) or _PIPED.fullmatch(str(path))):
        raise InputError(f"{path} is a pipe or a device, no file; give a file")
    try:
        with open(path, "rb") as file:
            data = file.read(first)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder; give a file") from None
    except (OSError, ValueError) as refusal:
        raise InputError(f"{path} cannot be read: {getattr(refusal, 'strerror', refusal)}") from None
    if len(data) > MOST_BYTES:
        raise InputError(f"{path} has more than {MOST_BYTES / 2**20:.0f} MiB; such a file is not read")
    return data


def refuse_missing(*files: str) -> None:
    """Refuse a file that is missing before anything that takes seconds to load; a pipe is read once, later.

    Raises:
        InputError: there is no such file.
    """
    for file in files:
        if not os.path.exists(file):
            read_bytes(file)


def decode(data: bytes) -> str:
    """Decode UTF-8, or UTF-16 with a byte order mark, without the mark."""
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return data.decode("utf-16" if wide else "utf-8-sig")


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file; where it carries a digest, the digest is checked.

    Raises:
        InputError: the file cannot be read or was cut short; `ContentError` if it is not TOML.
    """

    def parse(text: str) -> dict[str, Any]:
        check_seal(text, path)
        try:
            return tomllib.loads(text)
        except tomllib.TOMLDecodeError as broken:
            comma = _DECIMAL_COMMA.search(text)
            advice = f"; write {comma[1]}.{comma[2]} for {comma[1]},{comma[2]}" if comma else ""
            raise ValueError(f"{broken}{advice}") from None

    return _parsed(path, "TOML", parse)


def read_json(path: str | Path, **options: Any) -> Any:
    """Read a JSON file; `options` are those of `json.loads`.

    Raises:
        InputError: the file cannot be read; `ContentError` if it is not JSON.
    """
    return _parsed(path, "JSON", lambda text: json.loads(text, **options))


def _parsed(path: str | Path, kind: str, parse: Callable[[str], T]) -> T:
    """Parse the text of a file, whose decoder and parser say what is wrong and where."""
    data = read_bytes(path)
    try:
        return parse(decode(data))
    except InputError:
        raise
    except (ValueError, RecursionError) as broken:
        raise ContentError(f"{path} is not {kind}: {broken}") from None


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
