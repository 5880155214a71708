"""Mutations of files: what a disk, an editor, another program or a prankster may make of a valid file.

`mutated` changes bytes and knows the format only by its tokens. `changed_content` changes entries of nested
content (JSON), so that a file which is protected by a hash can be sealed again and is read to its end.

A mutation depends on the random state alone: the same seed gives the same file.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Sequence
from random import Random
from typing import Any

MOST = 2**19  # bytes of a mutated file; larger ones are cut
_NUMBER = re.compile(rb"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
_WORD, _LINE = re.compile(rb"[A-Za-z_]\w*"), re.compile(rb"[^\n]+\n?")
NUMBERS = (
    b"0", b"-0", b"-1", b"1", b"2", b"0.5", b"nan", b"-nan", b"NaN", b"inf", b"-inf", b"Infinity", b"1e999",
    b"-1e999", b"1e308", b"-1e308", b"1e200", b"1e-320", b"1e9", b"1e5", b"65536", b"2147483648",
    b"9223372036854775808", b"9" * 30, b"1" * 5000, b"0x10", b"1_000", b"1,5", b"1.5.2", b"1e", b"--1",
    b"1979-05-27", b"true", b"null", b'""', b"''", b"[]", b"{}", "٣".encode(), "½".encode(), "−1".encode(),
)  # fmt: skip
_COMMON = (
    b"\0", b"\n", b"\r\n", b"\r", b" ", b"\t", b'"', b"'", b"\\", b"#", b"%", b"\xef\xbb\xbf", b"\xff\xfe",
    b"\x1a", b"\xc3\x28", "é".encode(), "\u2028".encode(), "\ud800".encode(errors="surrogatepass"),
    b"../../etc/passwd", b"$\\frac$", b"=1+1", b"A" * 10_000,
)  # fmt: skip
_PAIRS = (
    (b"[", b"]"), (b"{", b"}"), (b"(", b")"), (b"<g>", b"</g>"), (b'{"a":', b"}"), (b'"', b'"'), (b"a.", b""),
)  # fmt: skip
_ENCODINGS = ("utf-16", "utf-16-le", "utf-8-sig", "utf-32", "latin-1", "utf-7", "cp500")


def mutated(data: bytes, tokens: Sequence[bytes], random: Random) -> bytes:
    """Mutate a file one to five times, with the words and signs that matter to its format."""
    for _ in range(random.choice((1, 1, 1, 2, 3, 5))):
        start, end = _part(data, random)
        data = (data[:start] + _in_place_of(data[start:end], data, tokens, random) + data[end:])[:MOST]
        if random.random() < 0.1:
            data = data.decode("utf-8", errors="replace").encode(random.choice(_ENCODINGS), errors="replace")
    return data


def _part(data: bytes, random: Random) -> tuple[int, int]:
    """Choose a number, a word, a line, or any slice: short ones more often than long ones, or all to the end."""
    places = [place.span() for place in random.choice((_NUMBER, _NUMBER, _WORD, _LINE)).finditer(data)]
    if places and random.random() < 0.6:
        return random.choice(places)
    start = random.randrange(len(data) + 1)
    length = random.choice((0, int(len(data) ** random.random()), len(data)))
    return start, min(start + length, len(data))


def _in_place_of(part: bytes, data: bytes, tokens: Sequence[bytes], random: Random) -> bytes:
    """Write nothing, a strange number, a token, another part, noise, or the part repeated or in brackets."""
    kinds = (*3 * ("number", "token"), *2 * ("nothing", "other"), "noise", "repeated", "nested")
    kind = random.choice(kinds)
    if kind == "nothing":
        return b""
    if kind == "number":
        return random.choice(NUMBERS)
    if kind == "token":
        return random.choice((*tokens, *_COMMON))
    if kind == "other":
        return data[slice(*_part(data, random))]
    if kind == "noise":
        return random.randbytes(random.choice((1, 1, 4, 100, 10_000)))
    if kind == "repeated":
        return part * min(random.choice((2, 2, 100, 20_000)), MOST // max(len(part), 1))
    left, right = random.choice(_PAIRS)
    times = min(random.choice((1, 3, 60, 1000, 100_000)), MOST // len(left))
    return left * times + part + right * random.choice((times, times, 0))


VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2, 0.5, -0.0, 1e-320, 1e308, -1e308, 1e9, 2**31, 2**63, 10**400, float("nan"),
    float("inf"), float("-inf"), "", "x", "0", "nan", "../x", "A" * 1000, "\0", "\ud800", "two\nlines", [], {},
    [[]], [0.0], [0.0, 0.0], [None], [1, [2, [3]]], {"a": 1}, {"": {}}, [1.0] * 5000,
)  # fmt: skip


def changed_content(content: Any, random: Random) -> Any:
    """Change one to three entries of nested dictionaries and lists."""
    content = copy.deepcopy(content)
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        places = _places(content, random)
        if not places:
            return random.choice(VALUES)
        parent, key = random.choice(places)
        kind = random.choice(("value", "value", "value", "delete", "swap", "scale", "nest", "add"))
        if kind == "delete":
            del parent[key]
        elif kind == "swap":
            other, name = random.choice(places)
            parent[key], other[name] = copy.deepcopy(other[name]), copy.deepcopy(parent[key])  # no circles
        elif kind == "scale" and isinstance(parent[key], int | float):
            parent[key] = parent[key] * random.choice((-1, 0, 1.5, 10, 1000, 1e12))
        elif kind == "nest":
            for _ in range(random.choice((1, 2, 100))):
                parent[key] = [parent[key]]
        elif kind == "add" and isinstance(parent, list):
            parent.insert(key, random.choice((copy.deepcopy(parent[key]), *VALUES)))
        elif kind == "add":
            parent[random.choice(("x", "format", "names", f"{key}s", ""))] = random.choice(VALUES)
        else:
            parent[key] = copy.deepcopy(random.choice(VALUES))
    return content


def _places(content: Any, random: Random) -> list[tuple[Any, Any]]:
    """List entries as pairs of what they are in and their key; of long lists a few."""
    places: list[tuple[Any, Any]] = []
    open_parts = [content]
    while open_parts:
        part = open_parts.pop()
        keys = list(part) if isinstance(part, dict) else list(range(len(part))) if isinstance(part, list) else []
        for key in keys if len(keys) < 40 else random.sample(keys, 6):
            places.append((part, key))
            open_parts.append(part[key])
    return places
