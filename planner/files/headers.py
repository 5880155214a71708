"""schedule.h: a plan for the robot's microcontroller, one header in C99 and C++11.

It lists dwell times in whole milliseconds as 16-bit integers. The motor flips after each. The rounding error of a
dwell is carried over to the next one, so no flip is more than half a millisecond early or late. A dwell that does
not fit 16 bits is split by entries of 0 ms: two flips at once, so the direction stays. A dwell that rounds to 0 ms
is rejected, because 0 has this other meaning.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from common.errors import InputError
from planner.paths.units import in_lab
from planner.planning.plan import Plan
from sim.model.robot import Robot

_CODE = Path(__file__).parents[1] / "c"
_MOST_MS = 65_535
_CHECKPOINTS = 32


def c_part(name: str) -> str:
    """Return a file of `planner/c`."""
    return (_CODE / name).read_text()


def safe_name(result: Plan) -> str:
    """Return the robot's name without characters that could end a comment in C."""
    return "".join(c for c in result.robot.name if c.isalnum() or c in " -_.")


def milliseconds(seconds: np.ndarray) -> list[int]:
    """Round dwells to whole ms, carry rounding errors over, and split long dwells by zeros.

    Raises:
        InputError: a dwell rounds to 0 ms.
    """
    edges = np.round(1000 * np.cumsum(seconds)).astype(np.int64)
    entries: list[int] = []
    for index, count in enumerate(np.diff(edges, prepend=0).tolist()):
        if count < 1:
            raise InputError(
                f"dwell {index + 1} is {1000 * seconds[index]:.3g} ms; the header counts whole milliseconds: "
                "use a longer minimum dwell"
            )
        while count > _MOST_MS:
            entries += [_MOST_MS, 0]
            count -= _MOST_MS
        entries.append(count)
    return entries


def schedule_header(result: Plan, identity: str) -> str:
    """Write schedule.h as text."""
    entries, checkpoints = milliseconds(result.seconds), _checkpoints(result)
    lines = [", ".join(map(str, entries[i : i + 12])) for i in range(0, len(entries), 12)]
    (x, y, heading), robot, once = result.start, result.robot, result.lap is None
    cm = 100 * robot.length_scale
    rpm = robot.motor_speed * 30 / np.pi if isinstance(robot, Robot) else None  # a measured vehicle has none
    parts = {
        "IDENTITY": identity,
        "NAME": safe_name(result),
        "AFTER": "Stop after the last entry." if once else "After the last entry go on with the first.",
        "MODEL": result.tracked.model,
        "STATED": _stated(result),
        "FIRST_DIRECTION": str(result.first_direction),
        "COUNT": f"{len(entries)}" + ("" if once else "\n#define SCHEDULE_REPEATS 1"),
        "TOTAL": str(sum(entries)),
        "MOTOR": "" if rpm is None else f"#define SCHEDULE_MOTOR_RPM {rpm:.3f}\n",
        "X_CM": f"{cm * x:.4f}",
        "Y_CM": f"{cm * y:.4f}",
        "DEGREES": f"{np.degrees(heading):.3f}",
        "X": f"{x:.6f}",
        "Y": f"{y:.6f}",
        "HEADING": f"{heading:.6f}",
        "CHECKPOINTS": str(len(checkpoints)),
        "entries": ",\n    ".join(lines),
        "places": ",\n    ".join(checkpoints),
    }
    return re.sub(r"@(\w+)@", lambda mark: parts[mark[1]], schedule_template())


def schedule_template() -> str:
    """Return schedule.h with @NAME@ in place of each part that a plan decides; signs.md defines the signs."""
    return f"""/* Plan @IDENTITY@.
 * Motor schedule for robot "@NAME@": turn in FIRST_DIRECTION for the first entry,
 * flip, turn for the next, and so on. Milliseconds; an entry of 0 flips twice at once, which
 * lengthens the dwell before it. @AFTER@ Look-up table @MODEL@.
@STATED@
 * Direction +1: the motor turns the tails clockwise relative to the head, seen from behind. The robot then turns
 * left, seen from above. Direction -1: the mirror image. Check it on the bench: +1 for five seconds must turn the
 * robot left. If it turns right, exchange the two wires of the motor, or -1 and +1 in your code.
 * Put the head's centre at START_X_CM, START_Y_CM with heading START_HEADING_DEG, at rest: in cm and degrees,
 * counter-clockwise from the x axis, seen from above. START_X and START_Y are the same in tail lengths,
 * START_HEADING in rad.
 * Checkpoints say where it should be later, in tail lengths and rad. C99 or C++11.
 * Include it in one file only, since it holds the tables. */
#ifndef SCHEDULE_H
#define SCHEDULE_H
#include <stdint.h>
#define SCHEDULE_FIRST_DIRECTION (@FIRST_DIRECTION@)
#define SCHEDULE_COUNT @COUNT@
#define SCHEDULE_TOTAL_MS @TOTAL@UL
@MOTOR@#define SCHEDULE_START_X_CM @X_CM@
#define SCHEDULE_START_Y_CM @Y_CM@
#define SCHEDULE_START_HEADING_DEG @DEGREES@
#define SCHEDULE_START_X @X@
#define SCHEDULE_START_Y @Y@
#define SCHEDULE_START_HEADING @HEADING@
#define SCHEDULE_CHECKPOINTS @CHECKPOINTS@

{c_part("schedule_flash.h")}
static const uint16_t SCHEDULE_TABLE(schedule_ms)[SCHEDULE_COUNT] SCHEDULE_FLASH = {{
    @entries@
}};
typedef struct {{ uint32_t ms; float x, y, heading; }} schedule_checkpoint;
static const schedule_checkpoint SCHEDULE_TABLE(schedule_checkpoints)[SCHEDULE_CHECKPOINTS] SCHEDULE_FLASH = {{
    @places@
}};
{c_part("schedule.h")}#endif
"""


def _stated(result: Plan) -> str:
    """Say how far from the path the robot may get."""
    exact = "" if result.tracked.calibrated else ", if its coefficients are exact"
    lines = [f"Of 100 such robots 95 stay within {in_lab(result.stated_error, result.robot)} of the path{exact}."]
    if words := result.unmeasured_words:
        lines.append(f"{words[0].upper()}{words[1:]}.")
    return "\n".join(f" * {line}" for line in lines)


def _checkpoints(result: Plan) -> list[str]:
    """Write time in ms and predicted pose of some flips and of the end, as C."""
    ends = np.concatenate([[0.0], np.cumsum(result.seconds)])
    places = np.unique(np.linspace(0, len(ends) - 1, min(len(ends), _CHECKPOINTS)).astype(int))
    return [
        f"{{{round(1000 * ends[i])}UL, {', '.join(f'{value:.5f}f' for value in result.poses[i])}}}"
        for i in places.tolist()
    ]
