"""A tracker on a line-by-line pipe: poses in, orders out. Times in seconds, lengths in tail lengths.

Each line that comes in is one of

    TIME                        no pose
    TIME X Y HEADING            a pose that is true now
    TIME X Y HEADING SEEN       a pose that was true at the time SEEN
    begin TIME X Y HEADING      the robot is at rest in this pose: begin here, now
    finish                      end a path that repeats at the end of this lap

and is answered by one line:

    DIRECTION FLIP_AT ERROR ALARM

with the direction of the motor (1, −1, or 0 at the end), the time of the next flip, the present error bound,
and 1 if the robot is incompatible with the model. The first line is refused if it is neither a header nor has as
many numbers as a line may have: its unit and order would be guessed. A later one that cannot be parsed, or whose
pose has a number of FAR or more, counts as one without a pose. After a flip a line must be sent, so that the next
flip is announced. From a pose where it begins, the tracker plans the way to the path; what it has learned of the
robot is forgotten.

A header names the columns with their units, time first: `time_s x_cm y_cm heading_deg seen_s`. A name without a
unit is in s, tail lengths (`x_over_l` means the same) or rad. The error is then in the unit of x. Numbers are
separated by spaces or commas. A header is answered by that of the answers.

Where the first pose decides where the robot begins, the answers before it are `0 FLIP_AT nan 0`: the motor rests,
and FLIP_AT is WAIT seconds later.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from common.errors import InputError
from common.units import from_si, split, to_si
from planner.paths.units import Scales
from sim.mechanics.planar import POSE
from tracking.tracker import Tracker

BEGIN = "begin"  # the word before a pose where the robot begins
FINISH = "finish"
FAR = 1e6  # l and rad
WAIT = 1.0  # s
_KINDS = {"time": "time", "x": "length", "y": "length", "heading": "angle", "seen": "time"}
_TAILS = "_over_l"
_HEADER = "time_s x_cm y_cm heading_deg"
_COUNTS = (1, 4, 5)  # of the numbers of a plain line


def answers(
    tracker: Tracker | None,
    lines: Iterable[str],
    robot: Scales,
    begin: Callable[[POSE, float], Tracker] | None = None,
) -> Iterator[str]:
    """Answer every line, until the path ends.

    Args:
        tracker: at rest at the plan's start, or where it begins; None: the first pose decides.
        lines: as described above.
        robot: its tail length and unit of time.
        begin: makes a tracker that begins at rest at a pose and a time.
    """
    columns, time_scale, unit = Columns.plain(robot), robot.time_scale, 1.0
    first = True
    last = 0.0  # time of the last line that has one
    for line in lines:
        words = line.replace(",", " ").split()
        command_word = words[:1] in ([BEGIN], [FINISH])
        if first and not command_word and len(_numbers(words)) not in _COUNTS:  # it must name columns
            columns, first = Columns.named(words, robot), False
            unit = from_si(robot.length_scale, columns.length) if columns.length else 1.0
            yield f"direction flip_at_s error_{columns.length or 'over_l'} alarm"
            continue
        first = False
        now, pose, seen = columns.read(words[1:] if words[:1] == [BEGIN] else words)
        if begin and (tracker is None or words[:1] == [BEGIN]) and pose and math.isfinite(now):
            tracker = begin(pose, now)
            command = tracker.command
        elif tracker is None:
            last = now if math.isfinite(now) else last
            yield f"0 {last * time_scale + WAIT:.9f} nan 0"
            continue
        elif words[:1] == [BEGIN]:  # without a pose it counts as nothing
            command = tracker.update(math.nan)
        elif words[:1] == [FINISH]:
            command = tracker.finish_lap()
        else:
            command = tracker.update(now, pose, seen)
        flip_at, error = command.flip_at * time_scale, unit * command.error
        yield f"{command.direction} {flip_at:.9f} {error:.4f} {int(command.alarm)}"
        if command.finished:
            return


@dataclass(frozen=True)
class Columns:
    """Names of the columns, and by what their numbers are multiplied and divided."""

    names: tuple[str, ...]
    factors: tuple[tuple[float, float], ...]
    length: str | None = None  # suffix of the unit of x; None: tail lengths

    @classmethod
    def plain(cls, robot: Scales) -> Columns:
        """Return the columns of lines without a header."""
        return cls.named(list(_KINDS), robot)

    @classmethod
    def named(cls, header: list[str], robot: Scales) -> Columns:
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
            over = robot.time_scale if kind == "time" else robot.length_scale if unit and kind == "length" else 1.0
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
        if not {"x", "y", "heading"} <= set(row) or len(numbers) > len(self.names):
            return row["time"], None, None
        pose = row["x"], row["y"], row["heading"]
        near = all(abs(number) < FAR for number in pose)
        return (row["time"], pose, seen) if near else (row["time"], None, None)


def _numbers(words: list[str]) -> list[float]:
    """Read the numbers of a line; none where one of its words is none."""
    try:
        return [float(word) for word in words]
    except ValueError:
        return []


def _example(name: str) -> str:
    return {"time": "time_s", "seen": "seen_s", "heading": "heading_deg"}.get(name, f"{name}_cm")
