"""Read files that people bring: texts, TOML and JSON of limited size and depth.

A file is untrusted input. Whatever it holds, a reader ends with its content or with one line that says what is
wrong: it reads no more than a limit, and it refuses what would take a parser minutes or gigabytes.
"""

from __future__ import annotations

import codecs
import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sim.io.errors import InputError
from sim.io.seals import check_seal

MOST_SETTINGS = 2**20  # bytes of a robot or a sweep
MOST_TEXT = 16 * 2**20  # bytes of a drawing
MOST_JSON = 256 * 2**20  # bytes of a plan, a table of one robot or a verdict
_MOST_PARTS = 50  # of a dotted key of TOML; the parser takes a time that grows with their square
_PART = r"""(?:"[^"\n]*"|'[^'\n]*'|(?<![\w-])[\w-]++)"""
_DECIMAL_COMMA = re.compile(r"^[ \t]*+[\w-]++[ \t]*+=[ \t]*+([+-]?\d{1,20}),(\d{1,20})[ \t]*+(?:#.*+)?$", re.M)
_LONG_KEY = re.compile(rf"(?:{_PART}[ \t]*+\.[ \t]*+){{{_MOST_PARTS}}}")


class ContentError(InputError):
    """A file can be read, but its content is not what it should be."""


def read_bytes(path: str | Path, most: int = MOST_TEXT) -> bytes:
    """Read a file.

    Args:
        path: a file, or a pipe.
        most: bytes that it may have.

    Raises:
        InputError: there is no such file, it cannot be read, or it is larger.
    """
    try:
        with open(path, "rb") as file:
            data = file.read(most + 1)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder; give a file") from None
    except (OSError, ValueError) as refusal:
        raise InputError(f"{path} cannot be read: {getattr(refusal, 'strerror', refusal)}") from None
    if len(data) > most:
        raise InputError(f"{path} has more than {most / 2**20:.0f} MiB; such a file is not read")
    return data


def read_text(path: str | Path, most: int = MOST_TEXT) -> str:
    """Read a text in UTF-8, or in UTF-16 with a byte order mark; the mark is left out.

    Raises:
        InputError: the file cannot be read, is larger than `most` bytes, or is no text.
    """
    data = read_bytes(path, most)
    try:
        return decode(data)
    except UnicodeDecodeError as broken:
        raise ContentError(f"{path} is no text in UTF-8 ({broken.reason} at byte {broken.start})") from None


def decode(data: bytes) -> str:
    """Decode UTF-8, or UTF-16 with a byte order mark, without the mark."""
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return data.decode("utf-16" if wide else "utf-8-sig")


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file; where it carries a digest (`sim.io.seals`), the digest is checked.

    Raises:
        InputError: the file cannot be read, was cut short, or is not TOML.
    """
    text = read_text(path, MOST_SETTINGS)
    check_seal(text, path)
    if _LONG_KEY.search(text):
        raise InputError(f"{path} is not TOML that is read here: a key has more than {_MOST_PARTS} parts")
    try:
        return _parsed(path, "TOML", lambda: tomllib.loads(text))
    except ContentError as broken:
        comma = _DECIMAL_COMMA.search(text)
        if comma is None:
            raise
        raise ContentError(f"{broken}; write {comma[1]}.{comma[2]} for {comma[1]},{comma[2]}") from None


def read_json(path: str | Path, **options: Any) -> Any:
    """Read a JSON file; `options` are those of `json.loads`.

    Raises:
        InputError: the file cannot be read; `ContentError` if it is not JSON.
    """
    text = read_text(path, MOST_JSON)
    return _parsed(path, "JSON", lambda: json.loads(text, **options))


def _parsed(path: str | Path, kind: str, parse: Callable[[], Any]) -> Any:
    try:
        return parse()
    except ValueError as broken:
        raise ContentError(f"{path} is not {kind}: {broken}") from None
    except RecursionError:
        raise ContentError(f"{path} is not {kind} that is read here: its tables are nested too deeply") from None
