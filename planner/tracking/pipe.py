"""A tracker on a line-by-line pipe: poses in, orders out. Lengths in tail lengths, times in seconds.

Each line that comes in is one of

    TIME                        no pose
    TIME X Y HEADING            a pose that is true now
    TIME X Y HEADING SEEN       a pose that was true at the time SEEN

and is answered by one line:

    DIRECTION FLIP_AT ERROR ALARM

with the direction of the motor (1, −1, or 0 at the end), the time of the next flip, the present error bound [l],
and 1 if the robot is incompatible with the model. A line that cannot be parsed counts as one without a pose. After
a flip a line must be sent, so that the next flip is announced.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from planner.tracking.tracker import Tracker


def answers(tracker: Tracker, lines: Iterable[str], time_scale: float) -> Iterator[str]:
    """Answer every line, until the path ends.

    Args:
        tracker: at rest at the plan's start.
        lines: as described above.
        time_scale: seconds in a time unit.
    """
    for line in lines:
        numbers = _numbers(line)
        now = numbers[0] / time_scale if numbers else math.nan
        pose = (numbers[1], numbers[2], numbers[3]) if len(numbers) in (4, 5) else None
        seen = numbers[4] / time_scale if len(numbers) == 5 else None
        command = tracker.update(now, pose, seen)
        yield f"{command.direction} {command.flip_at * time_scale:.9f} {command.error:.4f} {int(command.alarm)}"
        if command.finished:
            return


def _numbers(line: str) -> list[float]:
    try:
        return [float(word) for word in line.split()]
    except ValueError:
        return []
