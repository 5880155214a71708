"""The columns of a tracker's pipe: which number of a line is which, and in which unit.

A header names them, time first: `time_s x_cm y_cm heading_deg seen_s`. A name without a unit is in s, tail lengths
(`x_over_l` means the same) or rad. A first line that is neither a header nor as many numbers as a line may have is
refused: its unit and order would be guessed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from planner.paths.units import Swimmer
from planner.tracking.kalman_filter import POSE
from sim.io.errors import InputError
from sim.io.units import split, to_si

_KINDS = {"time": "time", "x": "length", "y": "length", "heading": "angle", "seen": "time"}
_TAILS = "_over_l"
_HEADER = "time_s x_cm y_cm heading_deg"
_COUNTS = (1, 4, 5)  # of the numbers of a plain line


@dataclass(frozen=True)
class Columns:
    """Names of the columns, and by what their numbers are multiplied and divided."""

    names: tuple[str, ...]
    factors: tuple[tuple[float, float], ...]
    length: str | None = None  # suffix of the unit of x; None: tail lengths

    @classmethod
    def plain(cls, robot: Swimmer) -> Columns:
        """Return the columns of lines without a header."""
        return cls.named(list(_KINDS), robot)

    @classmethod
    def named(cls, header: list[str], robot: Swimmer) -> Columns:
        """Read a header.

        Raises:
            InputError: a column that is not known or twice there, or has a unit of another kind; no pose.
        """
        names, factors, length = [], [], None
        line = f"first line {' '.join(header)!r}"
        for word in header:
            tails = word.endswith(_TAILS)
            name, unit = split(word.removesuffix(_TAILS))
            kind = _KINDS.get(name)
            if kind is None or name in names:
                reason = "is there twice" if name in names else f"is not one of {', '.join(_KINDS)}"
                raise InputError(f"{line}: {word!r} {reason}; give numbers, or a header such as {_HEADER}")
            if unit is not None and (unit.kind != kind or tails):
                raise InputError(f"{line}: {word!r} needs a unit of {kind}, such as {_example(name)}")
            times = to_si(1.0, unit.suffix) if unit is not None else 1.0
            over = robot.time_scale if kind == "time" else robot.tail_length if unit and kind == "length" else 1.0
            names.append(name)
            factors.append((times, over))
            length = unit.suffix if name == "x" and unit is not None else length
        missing = [name for name in ("time", "x", "y", "heading") if name not in names]
        if missing or names[0] != "time":
            raise InputError(f"{line}: give time first, and x, y and heading, such as {_HEADER}")
        return cls(tuple(names), tuple(factors), length)

    def read(self, words: list[str]) -> tuple[float, POSE | None, float | None]:
        """Return time, pose and when it was true; NaN and None for what a line does not have."""
        numbers = _numbers(words)
        given = zip(self.names, self.factors, numbers, strict=False)
        row = {name: number * times / over for name, (times, over), number in given}
        if not row:
            return math.nan, None, None
        seen = row.get("seen")
        complete = {"x", "y", "heading"} <= set(row) and len(numbers) <= len(self.names)
        pose = (row["x"], row["y"], row["heading"]) if complete else None
        return row["time"], pose, seen if complete else None


def is_header(words: list[str]) -> bool:
    """Tell whether the words of the first line must name columns: they are no numbers of a plain line."""
    return len(_numbers(words)) not in _COUNTS


def _numbers(words: list[str]) -> list[float]:
    """Read the numbers of a line; none where one of its words is none."""
    try:
        return [float(word) for word in words]
    except ValueError:
        return []


def _example(name: str) -> str:
    return {"time": "time_s", "seen": "seen_s", "heading": "heading_deg"}.get(name, f"{name}_cm")
