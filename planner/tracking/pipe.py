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
and 1 if the robot is incompatible with the model. The first line is refused if it cannot be parsed; a later one
then counts as one without a pose. After a flip a line must be sent, so that the next flip is announced. From a
pose where it begins, the tracker plans the way to the path; what it has learned of the robot is forgotten.

The first line may be a header with other units, such as `time_s x_cm y_cm heading_deg`
(`planner.tracking.pipe_columns`). The error is then in the unit of x. Numbers are separated by spaces or commas. A
header is answered by that of the answers.

Where the first pose decides where the robot begins, the answers before it are `0 FLIP_AT nan 0`: the motor rests,
and FLIP_AT is WAIT seconds later.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator

from planner.paths.units import Swimmer
from planner.tracking.kalman_filter import POSE
from planner.tracking.pipe_columns import Columns, is_header
from planner.tracking.tracker import Tracker
from sim.io.units import from_si

BEGIN = "begin"  # the word before a pose where the robot begins
FINISH = "finish"
WAIT = 1.0  # s


def answers(
    tracker: Tracker | None,
    lines: Iterable[str],
    robot: Swimmer,
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
        if first and not command_word and is_header(words):
            columns, first = Columns.named(words, robot), False
            unit = from_si(robot.tail_length, columns.length) if columns.length else 1.0
            yield f"direction flip_at_s error_{columns.length or 'over_l'} alarm"
            continue
        first = False
        now, pose, seen = columns.read(words[1:] if words[:1] == [BEGIN] else words)
        if begin is not None and (tracker is None or words[:1] == [BEGIN]) and pose and _finite(now, *pose):
            tracker = begin(pose, now)
            command = tracker.command
        elif tracker is None:
            last = now if _finite(now) else last
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


def _finite(*numbers: float) -> bool:
    return all(map(math.isfinite, numbers))
