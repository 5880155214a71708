"""Robots with the changes that a command makes to them, as `--set fluid.viscosity_Pa_s=0.7`.

A key is TABLE.KEY of the robot's file, or KEY where the file has no tables; a value is one of TOML, or a text.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from common.errors import InputError
from common.units import split

RobotSource = str | PathLike[str]  # the path of a robot's file, or the name of a preset; maybe a `ChangedRobot`


@dataclass(frozen=True)
class ChangedRobot(PathLike[str]):
    """A robot's file, or the name of a preset, and what is changed in its content."""

    source: str
    changes: Mapping[str, Any]

    def __fspath__(self) -> str:
        return self.source

    def __str__(self) -> str:
        return self.source


def changed_robots(sources: Mapping[str, str], words: Sequence[str]) -> dict[str, ChangedRobot]:
    """Return those of the sources that are robots, not tables, with the changes KEY=VALUE.

    Raises:
        InputError: the words are no change, or there is no robot to change.
    """
    changes = dict(map(_read_change, words))
    robots = {name: source for name, source in sources.items() if Path(source).suffix in ("", ".toml")}
    if not robots:
        raise InputError(f"--set {words[0]} changes a robot, and none is given; add --robot ROBOT")
    return {name: ChangedRobot(source, changes) for name, source in robots.items()}


def changes_of(source: RobotSource) -> Mapping[str, Any]:
    """Return what is changed in the content of a robot's file."""
    return source.changes if isinstance(source, ChangedRobot) else {}


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
