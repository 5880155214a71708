"""The files of a plan: plan.json, plan.csv, plan.svg; schedule.h and tracker.h for a microcontroller.

They appear together, and each has the identity of the plan, so files of two plans cannot be taken for one.

schedule.h lists dwell times in whole milliseconds as 16-bit integers. The motor flips after each. The rounding
error of a dwell is carried over to the next one, so no flip is more than half a millisecond early or late. A dwell
that does not fit 16 bits is split by entries of 0 ms: two flips at once, so the direction stays. A dwell that
rounds to 0 ms is rejected, because 0 has this other meaning.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.files.plan_picture import plan_svg
from planner.files.tracker_header import DIRECTIONS, c_part, safe_name, tracker_header
from planner.paths.units import in_lab
from planner.planning.plan import KINDS, Plan
from sim.io.errors import InputError
from sim.io.files import files_together, write_numbers, write_text
from sim.io.provenance import code_version
from sim.model.robot import Robot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILES = ("plan.json", "plan.csv", "schedule.h", "tracker.h", "plan.svg")
EXTRA = ("trade_off.svg", *(f"{kind}.{ending}" for kind in KINDS for ending in ("json", "svg")))  # planned before
_MOST_MS = 65_535
_CHECKPOINTS = 32


def write_plan(result: Plan, folder: str | Path, *, pictures: Mapping[str, Figure] | None = None) -> list[Path]:
    """Write the five files of a plan, and {kind}.json and {kind}.svg of its job, all or none; return their paths.

    Args:
        result: the plan.
        folder: it is made if it is missing.
        pictures: more pictures, by the name of their file, one of EXTRA.

    Raises:
        InputError: a dwell is too short for whole milliseconds, or a file cannot be written.

    Example:
        >>> import tempfile
        >>> from softflagella import circle, load_robot, plan, write_plan
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     [path.name for path in write_plan(plan(circle(2.0), load_robot("paper-control")), folder)]
        ['plan.json', 'plan.csv', 'schedule.h', 'tracker.h', 'plan.svg']
    """
    with files_together(folder, (*FILES, *EXTRA)) as temporary:
        names = write_plan_files(result, temporary)
        if pictures:
            from planner.files.pictures import write_svg  # loads matplotlib

            for name, figure in pictures.items():
                write_svg(figure, temporary / name, result.identity)
    return [Path(folder, name) for name in (*names, *(pictures or ()))]


def write_plan_files(result: Plan, folder: Path) -> list[str]:
    """Write the files of a plan into a folder, one after the other, and return their names."""
    identity, names = result.identity, list(FILES)
    write_text(folder / "plan.json", json.dumps({**result.to_dict(), "code_version": code_version()}) + "\n")
    columns = {name: values.tolist() for name, values in result.columns().items()}
    write_numbers({**columns, "plan_id": [identity] * len(result.dwells)}, folder / "plan.csv")
    write_text(folder / "schedule.h", controller_header(result, identity))
    write_text(folder / "tracker.h", tracker_header(result, identity))
    write_text(folder / "plan.svg", plan_svg(result, identity))
    if result.job is not None and result.job.kind:
        from planner.files.pictures import draw_plan, write_svg  # loads matplotlib

        names += [f"{result.job.kind}.json", f"{result.job.kind}.svg"]
        content = {**result.job.to_dict(result), "plan_id": identity}
        write_text(folder / names[-2], json.dumps(content) + "\n")
        write_svg(draw_plan(result), folder / names[-1], identity)
    return names


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


def controller_header(result: Plan, identity: str) -> str:
    """Write schedule.h as text."""
    entries, checkpoints = milliseconds(result.seconds), _checkpoints(result)
    lines = [", ".join(map(str, entries[i : i + 12])) for i in range(0, len(entries), 12)]
    (x, y, heading), cm = result.start, 100 * result.robot.tail_length
    parts = {
        "IDENTITY": identity,
        "NAME": safe_name(result),
        "AFTER": _after(result),
        "MODEL": result.tracked.model,
        "STATED": _stated(result),
        "FIRST_DIRECTION": str(result.first_direction),
        "COUNT": f"{len(entries)}{_repeats(result)}",
        "TOTAL": str(sum(entries)),
        "MOTOR": _motor(result),
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
    """Return schedule.h with @NAME@ in place of each part that a plan decides."""
    return f"""/* Plan @IDENTITY@.
 * Motor schedule for robot "@NAME@": turn in FIRST_DIRECTION for the first entry,
 * flip, turn for the next, and so on. Milliseconds; an entry of 0 flips twice at once, which
 * lengthens the dwell before it. @AFTER@ Look-up table @MODEL@.
@STATED@
{DIRECTIONS}
 * Put the head's centre at START_X_CM, START_Y_CM with heading START_HEADING_DEG, at rest: in cm and degrees,
 * counter-clockwise from the x axis, seen from above. START_X and START_Y are the same in tail lengths,
 * START_HEADING in rad. Checkpoints say where it should be later, in tail lengths and rad.
 * C99 or C++11. Include it in one file only, since it holds the tables. */
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


def _motor(result: Plan[Any]) -> str:
    """Define the motor's speed; a measured vehicle has none."""
    robot = result.robot
    return f"#define SCHEDULE_MOTOR_RPM {robot.motor_speed * 30 / np.pi:.3f}\n" if isinstance(robot, Robot) else ""


def _after(result: Plan) -> str:
    """Say what follows the last entry."""
    return "Stop after the last entry." if result.lap is None else "After the last entry go on with the first."


def _repeats(result: Plan) -> str:
    """Define a macro for a schedule that repeats."""
    return "" if result.lap is None else "\n#define SCHEDULE_REPEATS 1"


def _stated(result: Plan) -> str:
    """Say how far from the path the robot may get."""
    exact = "" if result.tracked.calibrated else ", if its coefficients are exact"
    lines = [f"Of 100 such robots 95 stay within {in_lab(result.stated_error, result.robot)} of the path{exact}."]
    unmeasured = result.unmeasured_error
    if unmeasured is not None:
        lines.append(f"With the coefficients of another robot it is {in_lab(unmeasured, result.robot)}.")
    return "\n".join(f" * {line}" for line in lines)


def _checkpoints(result: Plan) -> list[str]:
    """Write time in ms and predicted pose of some flips and of the end, as C."""
    ends = np.concatenate([[0.0], np.cumsum(result.seconds)])
    places = np.unique(np.linspace(0, len(ends) - 1, min(len(ends), _CHECKPOINTS)).astype(int))
    return [
        f"{{{round(1000 * ends[i])}UL, {', '.join(f'{value:.5f}f' for value in result.poses[i])}}}"
        for i in places.tolist()
    ]
