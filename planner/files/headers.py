"""schedule.h and tracker.h: plans for the robot's microcontroller, each one header in C99 and C++11.

schedule.h lists dwell times in whole milliseconds as 16-bit integers. The motor flips after each. The rounding
error of a dwell is carried over to the next one, so no flip is more than half a millisecond early or late. A dwell
that does not fit 16 bits is split by entries of 0 ms: two flips at once, so the direction stays. A dwell that
rounds to 0 ms is rejected, because 0 has this other meaning.

tracker.h has the tracker and the plan's tables. Its code is that of `planner/c`, which mirrors
`planner.planning.line_of_sight`, `planner.tracking.kalman_filter` and `planner.tracking.tracker`. Numbers that
both need come from Python. Lags are 16-bit numbers with one unit for each column; it is 1e-7 l for the paper's
robot. The path has nine digits. `rounded` is the plan with these numbers.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.goal.dubins import ROUNDING
from planner.paths.units import in_lab
from planner.planning import errors, line_of_sight
from planner.planning.plan import Plan
from planner.tracking import guidance, kalman_filter, tracker
from planner.tracking.guidance import tracked_reference
from planner.tracking.kalman_filter import prior
from planner.vehicle.vehicle import BEFORE_KNOTS, STEP
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.model.robot import Robot

_CODE = Path(__file__).parents[1] / "c"
_PARTS = (
    "follower.h", "estimate.h", "guidance.h", "way_back.h", "displacement.h", "clock.h", "tracker.h",
)  # fmt: skip
_PER_LINE = 12  # numbers of a table
_LARGEST = 32_767
_MOST_MS = 65_535
_CHECKPOINTS = 32
_FLOAT_EXACT = 3e-6  # rad; in single precision a smaller angle is lost in the rounding
_PLAN = object()  # stands for a number that the plan decides
_FLOAT_SLACK = 5e-4  # time units; the same for a time of some thousand units

# Comment of both headers; docs/reference/signs.md defines the signs.
DIRECTIONS = """\
 * Direction +1: the motor turns the tails clockwise relative to the head, seen from behind. The robot then turns
 * left, seen from above. Direction -1: the mirror image. Check it on the bench: +1 for five seconds must turn the
 * robot left. If it turns right, exchange the two wires of the motor, or -1 and +1 in your code."""


def tracker_header(result: Plan, identity: str) -> str:
    """Write tracker.h as text; `identity` names the plan."""
    parts = {
        "IDENTITY": identity,
        "NAME": safe_name(result),
        "MODEL": result.tracked.model,
        "BYTES": str(table_bytes(result)),
        **_numbers(result),
        **_tables(result),
    }
    return re.sub(r"@(\w+)@", lambda mark: parts[mark[1]], header_template())


def header_template() -> str:
    """Return tracker.h with @NAME@ in place of each part that a plan decides."""
    code = "\n".join(map(c_part, _PARTS))
    return f"{_intro()}\n{_macros()}\n{c_part('flash.h')}{_declarations()}\n{code}#endif\n"


def rounded(result: Plan) -> Plan:
    """Round path and lags of a plan as tracker.h has them."""
    unit = _lag_unit(result)
    lag, rest = (
        np.round(table / unit) * unit for table in (result.tracked.vehicle.lag, result.tracked.vehicle.rest)
    )
    once = replace(result, lap=None)
    rows = np.array([[float(_nine(value)) for value in row] for row in _path(once)])
    q, heading = rows[:, :2], rows[:, 2]
    guide = replace(result.declared.reference, q=q, heading=heading)
    tracked = result.tracked._replace(vehicle=replace(result.tracked.vehicle, lag=lag, rest=rest))
    return replace(result, tracked=tracked, declared=replace(result.declared, reference=guide))


def table_bytes(result: Plan) -> int:
    """Return the size of the tables in single precision, in bytes."""
    vehicle = result.tracked.vehicle
    return 2 * (vehicle.lag.size + vehicle.rest.size) + 4 * 3 * len(tracked_reference(result).q)


def c_part(name: str) -> str:
    """Return a file of `planner/c`."""
    return (_CODE / name).read_text()


def safe_name(result: Plan) -> str:
    """Return the robot's name without characters that could end a comment in C."""
    return "".join(c for c in result.robot.name if c.isalnum() or c in " -_.")


def _intro() -> str:
    return f"""/* Plan @IDENTITY@.
 * Tracker for robot "@NAME@", look-up table @MODEL@: keeps the robot on its plan
 * with poses from a camera, and learns the robot. It is softflagella.Tracker in C99 and C++11, with the same
 * formulas in the same order. It needs <math.h>, <stdint.h> and <string.h>, and no heap.
 * Tables: @BYTES@ bytes in single precision; on AVR they are in flash.
 *
 *     static tracker keeper;
 *     tracker_real pose[3] = {{x, y, heading}}, start[3] = {{0, 0, 0}};
 *     tracker_begin(&keeper, 0.01, 0.01, now);          noise of a pose, the time at which the motor starts
 *     tracker_begin_at(&keeper, 0.01, 0.01, now, start);                     at rest at any pose
 *     tracker_advice advice = tracker_feed(&keeper, now, 0, 0);              no pose
 *     advice = tracker_feed(&keeper, now, pose, seen);                       a pose that was true at `seen`
 *     advice = tracker_finish_lap(&keeper);                                  ends a path that repeats
 *
 * Turn the motor in advice.direction and flip it at advice.flip_at. Call tracker_feed after each flip, so that the
 * next one is announced. Times are in seconds. x, y and their noise are in tail lengths, the heading and its noise
 * in rad, counter-clockwise from the x axis, seen from above. Before you include this file, define TRACKER_FLOAT
 * for single precision; times stay double. Where double has four bytes (AVR) all is in single precision, and times
 * have seven digits. Include it in one file only, since it holds the tables.
{DIRECTIONS} */
#ifndef TRACKER_H
#define TRACKER_H
#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__SIZEOF_DOUBLE__) && __SIZEOF_DOUBLE__ < 8
#ifndef TRACKER_FLOAT
#define TRACKER_FLOAT
#endif
#define TRACKER_SLACK {_FLOAT_SLACK!r}
#else
#define TRACKER_SLACK {tracker.SLACK!r}
#endif
#ifdef TRACKER_FLOAT
typedef float tracker_real;
#define TRACKER_EXACT ((tracker_real){_FLOAT_EXACT!r})
#define TRACKER_ROUNDING ((tracker_real){_FLOAT_EXACT!r})
#else
typedef double tracker_real;
#define TRACKER_EXACT {line_of_sight.EXACT!r}
#define TRACKER_ROUNDING {ROUNDING!r}
#endif
"""


def _macros() -> str:
    """Write the numbers of the code as macros: counts and times as they are, the rest as tracker_real."""
    counts = {
        "FIRST_DIRECTION": _PLAN, "STATES": kalman_filter.STATES, "POINTS": _PLAN, "LAP": _PLAN,
        "TIMES": _PLAN, "KNOTS": len(BEFORE_KNOTS),
        "HALVINGS": line_of_sight.HALVINGS, "MOST_LOOKS": line_of_sight.MOST_LOOKS,
        "KEPT": errors.KEPT, "LOST": tracker.LOST, "WINDOW": tracker.WINDOW,
        "SEGMENTS": guidance.SEGMENTS, "STRIDE": _PLAN,
        "AGREED": tracker.AGREED, "FLIPS": tracker.FLIPS, "CONFIRMED": tracker.CONFIRMED,
    }  # fmt: skip
    times = {"TIME_SCALE": _PLAN, "LATE": tracker.LATE, "EARLY": tracker.EARLY}
    reals = {
        "TAIL_LENGTH_M": _PLAN,
        "STEP": STEP,
        **dict.fromkeys(
            ("SHORTEST", "AHEAD", "ROD", "OFFSET", "LAP_TURN", "SWING", "PIVOT_RADIUS", "NET_SPEED", "NET_DRIFT"),
            _PLAN,
        ),
        "SHORTEST_ROD": guidance.SHORTEST_ROD,
        "LARGEST_STEP": line_of_sight.LARGEST_STEP,
        "TURNS": line_of_sight.TURNS,
        "MOST_BIAS": line_of_sight.MOST_BIAS,
        "GATE": tracker.GATE,
        "ALARM_AT": tracker.ALARM_AT,
        "SPREADS": tracker.SPREADS,
        "WITHIN_NORMAL": errors.WITHIN[0],
        "WITHIN_UNIFORM": errors.WITHIN[1],
        "BELOW_NORMAL": errors.BELOW[0],
        "BELOW_UNIFORM": errors.BELOW[1],
        **dict.fromkeys(("PIVOT_DISTANCE", "WAY_AHEAD", "LIMIT"), _PLAN),
        "AWAY": guidance.AWAY,
        "STRAIGHT": guidance.STRAIGHT,
        "ROOM": guidance.ROOM,
        "LEFT_OUT": guidance.LEFT_OUT,
        "MODEL": tracker.MODEL_NOISE,
        "LARGEST": tracker.LARGEST_MISFIT,
        "MEAN": tracker.LARGEST_MEAN,
        "WALK": kalman_filter.WALK,
    }

    def text(name: str, value: object) -> str:
        return f"@{name}@" if value is _PLAN else repr(value)

    lines = [f"#define TRACKER_{name} ({text(name, value)})" for name, value in counts.items()]
    lines += [f"#define TRACKER_{name} {text(name, value)}" for name, value in times.items()]
    lines += [f"#define TRACKER_{name} ((tracker_real){text(name, value)})" for name, value in reals.items()]
    return "\n".join(lines) + "\n"


def _numbers(result: Plan) -> dict[str, str]:
    """Write the numbers that the plan decides, by the name of their macro."""
    vehicle, straight = result.tracked.vehicle, result.straight
    numbers = {
        "FIRST_DIRECTION": result.first_direction,
        "POINTS": len(tracked_reference(result).q),
        "LAP": guidance.lap_points(result),
        "TIMES": vehicle.rest.shape[1],
        "STRIDE": guidance.stride(result),
        "TIME_SCALE": result.robot.time_scale,
        "TAIL_LENGTH_M": result.robot.length_scale,
        "SHORTEST": result.minimum_dwell,
        "AHEAD": result.guidance.ahead,
        "ROD": result.tracked.rod,
        "OFFSET": result.tracked.offset,
        "LAP_TURN": result.declared.reference.turn if result.lap else 0.0,
        "SWING": result.guidance.swing,
        "PIVOT_RADIUS": vehicle.pivot_radius,
        "NET_SPEED": float(straight.speed),
        "NET_DRIFT": float(straight.drift),
        "PIVOT_DISTANCE": vehicle.pivot_distance,
        "WAY_AHEAD": guidance.way_ahead(result),
        "LIMIT": guidance.limit(result),
    }
    return {name: repr(value) for name, value in numbers.items()}


def _declarations() -> str:
    """Declare the tables."""
    real, short = "static const tracker_real tracker_", "static const int16_t tracker_"
    return "\n".join(
        [
            f"{real}start[3] = @start@;",
            f"{real}twist[2][3] = @twist@;",
            f"{real}current[2] = @current@;",
            f"{real}changes[4] = {_row(kalman_filter.CHANGES)};",
            f"{real}most[TRACKER_STATES - 3] = @most@;",
            f"{real}lag_unit[3] = @lag_unit@;",
            f"{real}prior[TRACKER_STATES * TRACKER_STATES] TRACKER_FLASH = @prior@;",
            f"{real}knots[TRACKER_KNOTS] TRACKER_FLASH = {_table(BEFORE_KNOTS)};",
            f"{real}path_x[TRACKER_POINTS] TRACKER_FLASH = @path_x@;",
            f"{real}path_y[TRACKER_POINTS] TRACKER_FLASH = @path_y@;",
            f"{real}path_heading[TRACKER_POINTS] TRACKER_FLASH = @path_heading@;",
            f"{short}rest[2 * TRACKER_TIMES * 3] TRACKER_FLASH = @rest@;",
            f"{short}lag_left[TRACKER_KNOTS * TRACKER_TIMES * 3] TRACKER_FLASH = @lag_left@;",
            f"{short}lag_right[TRACKER_KNOTS * TRACKER_TIMES * 3] TRACKER_FLASH = @lag_right@;\n",
        ]
    )


def _tables(result: Plan) -> dict[str, str]:
    """Write the tables that the plan decides, by their names."""
    vehicle, unit = result.tracked.vehicle, _lag_unit(result)
    lag, rest = (np.round(table / unit).astype(int) for table in (vehicle.lag, vehicle.rest))
    x, y, heading = (_table(column, _nine) for column in _path(result).T)
    return {
        "start": _row(result.start),
        "twist": f"{{{', '.join(_row(twist) for twist in vehicle.twist.tolist())}}}",
        "current": _row(vehicle.current.tolist()),
        "most": _row(kalman_filter.most(result)),
        "lag_unit": _row(unit.tolist()),
        "prior": _table(np.array(prior(result))),
        "path_x": x,
        "path_y": y,
        "path_heading": heading,
        "rest": _table(rest),
        "lag_left": _table(lag[0]),
        "lag_right": _table(lag[1]),
    }


def _lag_unit(result: Plan) -> Floats:
    vehicle = result.tracked.vehicle
    largest = np.maximum(np.abs(vehicle.lag).max((0, 1, 2)), np.abs(vehicle.rest).max((0, 1)))
    return np.asarray(np.maximum(largest, 1e-12) / _LARGEST)


def _path(result: Plan) -> Floats:
    """Return the reference of the pivot as rows of place and heading, (m, 3)."""
    reference = tracked_reference(result)
    return np.column_stack([reference.q, reference.heading])


def _nine(value: float) -> str:
    return f"{value:.9g}"


def _row(values: Iterable[float]) -> str:
    return "{" + ", ".join(map(repr, values)) + "}"


def _table(values: np.ndarray, write: Callable[[float], str] = repr) -> str:
    """Write all values of an array as one row in C, over several lines."""
    numbers = [write(value) for value in values.ravel().tolist()]
    lines = [", ".join(numbers[i : i + _PER_LINE]) for i in range(0, len(numbers), _PER_LINE)]
    return "{\n" + ",\n".join(lines) + "}"


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
