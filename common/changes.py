"""Changes that a command makes to the robots that it reads, as `--set fluid.viscosity_Pa_s=0.7`.

A key is TABLE.KEY of the robot's file, or KEY where the file has no tables; a value is one of TOML, or a text.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from common.errors import InputError
from common.units import split

_asked: dict[str, dict[str, Any]] = {}  # robot, as it was given -> its changes


@contextmanager
def changing(robots: Iterable[object], words: Sequence[str]) -> Iterator[None]:
    """Let robots be read in a block with the changes KEY=VALUE.

    Raises:
        InputError: the words are no change, or there is no robot to change.
    """
    changes = dict(map(_read_change, words))
    named = {str(robot): changes for robot in robots if Path(str(robot)).suffix in ("", ".toml")}
    if changes and not named:
        raise InputError(f"--set {words[0]} changes a robot, and none is given; add --robot ROBOT")
    _asked.update(named if changes else {})
    try:
        yield
    finally:
        _asked.clear()


def changes_of(robot: object) -> Mapping[str, Any]:
    """Return the changes of a robot, by the words that name it."""
    return _asked.get(str(robot), {})


def changed(content: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of a file with other entries, each in place of the same quantity in another unit."""
    result = dict(content)
    for name, value in changes.items():
        table, _, key = name.rpartition(".")
        old, quantity = result.get(table, {}) if table else result, split(key).quantity
        others = {k: v for k, v in old.items() if split(k).quantity != quantity} if isinstance(old, dict) else {}
        result = {**result, table: {**others, key: value}} if table else {**others, key: value}
    return result


def _read_change(words: str) -> tuple[str, Any]:
    key, _, text = words.partition("=")
    if not key.strip() or not text.strip():
        raise InputError(f"--set {words}; write KEY=VALUE, such as --set fluid.viscosity_Pa_s=0.7")
    try:
        return key.strip(), tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return key.strip(), text
