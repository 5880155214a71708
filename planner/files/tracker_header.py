"""tracker.h: the tracker and the plan's tables as one header for the robot's microcontroller, in C99 and C++11.

The code is that of `planner/c`, which mirrors `planner.planning.line_of_sight`, `planner.tracking.kalman_filter`
and `planner.tracking.tracker`. Numbers that both need come from the Python side. Lags are 16-bit numbers with one
unit for each column; it is 1e-7 l for the paper's robot. The path has nine digits. `rounded` is the plan with
these numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.goal.dubins import ROUNDING
from planner.paths.path import arc_length
from planner.planning import line_of_sight
from planner.planning.planned import Plan
from planner.tracking import clock, displacement, guidance, kalman_filter, tracker, way_back
from planner.tracking.kalman_filter import prior
from planner.vehicle.vehicle import BEFORE_KNOTS, STEP
from sim.arrays import Floats

_CODE = Path(__file__).parents[1] / "c"
_PARTS = (
    "follower.h", "estimate.h", "guidance.h", "way_back.h", "displacement.h", "clock.h", "tracker.h",
)  # fmt: skip
_PER_LINE = 12  # numbers of a table
_LARGEST = 32_767
_FLOAT_EXACT = 3e-6  # rad; in single precision a smaller angle is lost in the rounding
_FLOAT_SLACK = 5e-4  # time units; the same for a time of some thousand units

# Comment of both headers; docs/reference/signs.md defines the signs.
DIRECTIONS = """\
 * Direction +1: the motor turns the tails clockwise relative to the head, seen from behind. The robot then turns
 * left, seen from above. Direction -1: the mirror image. Check it on the bench: +1 for five seconds must turn the
 * robot left. If it turns right, exchange the two wires of the motor, or -1 and +1 in your code."""


def tracker_header(result: Plan, identity: str) -> str:
    """Write tracker.h as text; `identity` names the plan."""
    code = "\n".join(map(c_part, _PARTS))
    return f"{_intro(result, identity)}\n{_numbers(result)}\n{c_part('flash.h')}{_tables(result)}\n{code}#endif\n"


def rounded(result: Plan) -> Plan:
    """Round path and lags of a plan as tracker.h has them."""
    unit = _lag_unit(result)
    lag, rest = (
        np.round(table / unit) * unit for table in (result.tracked.vehicle.lag, result.tracked.vehicle.rest)
    )
    rows = np.array([[float(_nine(value)) for value in row] for row in _path(result)])
    q, heading = rows[:, :2], rows[:, 2]
    guide = replace(result.declared.reference, q=q, heading=heading, arc=arc_length(q))
    tracked = result.tracked._replace(vehicle=replace(result.tracked.vehicle, lag=lag, rest=rest))
    return replace(result, tracked=tracked, declared=replace(result.declared, reference=guide))


def table_bytes(result: Plan) -> int:
    """Return the size of the tables in single precision, in bytes."""
    vehicle = result.tracked.vehicle
    return 2 * (vehicle.lag.size + vehicle.rest.size) + 4 * 3 * len(result.declared.reference.q)


def c_part(name: str) -> str:
    """Return a file of `planner/c`."""
    return (_CODE / name).read_text()


def safe_name(result: Plan) -> str:
    """Return the robot's name without characters that could end a comment in C."""
    return "".join(c for c in result.robot.name if c.isalnum() or c in " -_.")


def _intro(result: Plan, identity: str) -> str:
    name, model = safe_name(result), result.tracked.model
    return f"""/* Plan {identity}.
 * Tracker for robot "{name}", look-up table {model}: keeps the robot on its plan
 * with poses from a camera, and learns the robot. It is softflagella.Tracker in C99 and C++11, with the same
 * formulas in the same order. It needs <math.h>, <stdint.h> and <string.h>, and no heap.
 * Tables: {table_bytes(result)} bytes in single precision; on AVR they are in flash.
 *
 *     static tracker keeper;
 *     tracker_real pose[3] = {{x, y, heading}}, start[3] = {{0, 0, 0}};
 *     tracker_begin(&keeper, 0.01, 0.01, now);          noise of a pose, the time at which the motor starts
 *     tracker_begin_at(&keeper, 0.01, 0.01, now, start);                     at rest at any pose
 *     tracker_advice advice = tracker_feed(&keeper, now, 0, 0);              no pose
 *     advice = tracker_feed(&keeper, now, pose, seen);                       a pose that was true at `seen`
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
#define TRACKER_SLACK {clock.SLACK!r}
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


def _numbers(result: Plan) -> str:
    """Write the numbers of the code as macros: counts and times as they are, the rest as tracker_real."""
    counts = {
        "FIRST_DIRECTION": result.first_direction, "STATES": kalman_filter.STATES,
        "POINTS": len(result.declared.reference.q),
        "TIMES": result.tracked.vehicle.rest.shape[1], "KNOTS": len(BEFORE_KNOTS),
        "HALVINGS": line_of_sight.HALVINGS, "MOST_LOOKS": line_of_sight.MOST_LOOKS,
        "KEPT": tracker.KEPT, "LOST": tracker.LOST, "WINDOW": tracker.WINDOW,
        "SEGMENTS": way_back.SEGMENTS, "STRIDE": guidance.stride(result),
        "AGREED": displacement.AGREED, "FLIPS": displacement.FLIPS, "CONFIRMED": clock.CONFIRMED,
    }  # fmt: skip
    times = {"TIME_SCALE": result.robot.time_scale, "LATE": clock.LATE, "EARLY": clock.EARLY}
    reals = {
        "TAIL_LENGTH_M": result.robot.tail_length,
        "STEP": STEP,
        "SHORTEST": result.minimum_dwell,
        "AHEAD": result.guidance.ahead,
        "ROD": result.tracked.rod,
        "OFFSET": result.tracked.offset,
        "SWING": result.guidance.swing,
        "PIVOT_RADIUS": result.tracked.vehicle.pivot_radius,
        "NET_SPEED": float(result.straight.speed),
        "NET_DRIFT": float(result.straight.drift),
        "SHORTEST_ROD": guidance.SHORTEST_ROD,
        "LARGEST_STEP": line_of_sight.LARGEST_STEP,
        "TURNS": line_of_sight.TURNS,
        "MOST_BIAS": line_of_sight.MOST_BIAS,
        "GATE": tracker.GATE,
        "ALARM_AT": tracker.ALARM_AT,
        "SPREADS": tracker.SPREADS,
        "PIVOT_DISTANCE": result.tracked.vehicle.pivot_distance,
        "WAY_AHEAD": guidance.way_ahead(result),
        "LIMIT": guidance.limit(result),
        "AWAY": guidance.AWAY,
        "STRAIGHT": guidance.STRAIGHT,
        "ROOM": way_back.ROOM,
        "LEFT_OUT": way_back.LEFT_OUT,
        "MODEL": displacement.MODEL,
        "LARGEST": displacement.LARGEST,
        "MEAN": displacement.MEAN,
        "WALK": kalman_filter.WALK,
    }
    lines = [f"#define TRACKER_{name} ({value})" for name, value in counts.items()]
    lines += [f"#define TRACKER_{name} {value!r}" for name, value in times.items()]
    lines += [f"#define TRACKER_{name} ((tracker_real){value!r})" for name, value in reals.items()]
    return "\n".join(lines) + "\n"


def _tables(result: Plan) -> str:
    vehicle, unit = result.tracked.vehicle, _lag_unit(result)
    most = kalman_filter.most(result)
    lag, rest = (np.round(table / unit).astype(int) for table in (vehicle.lag, vehicle.rest))
    real, short = "static const tracker_real tracker_", "static const int16_t tracker_"
    x, y, heading = (_table(column, _nine) for column in _path(result).T)
    return "\n".join(
        [
            f"{real}start[3] = {_row(result.start)};",
            f"{real}twist[2][3] = {{{', '.join(_row(twist) for twist in vehicle.twist.tolist())}}};",
            f"{real}current[2] = {_row(vehicle.current.tolist())};",
            f"{real}changes[4] = {_row(kalman_filter.CHANGES)};",
            f"{real}most[TRACKER_STATES - 3] = {_row(most)};",
            f"{real}lag_unit[3] = {_row(unit.tolist())};",
            f"{real}prior[TRACKER_STATES * TRACKER_STATES] TRACKER_FLASH = {_table(np.array(prior(result)))};",
            f"{real}knots[TRACKER_KNOTS] TRACKER_FLASH = {_table(BEFORE_KNOTS)};",
            f"{real}path_x[TRACKER_POINTS] TRACKER_FLASH = {x};",
            f"{real}path_y[TRACKER_POINTS] TRACKER_FLASH = {y};",
            f"{real}path_heading[TRACKER_POINTS] TRACKER_FLASH = {heading};",
            f"{short}rest[2 * TRACKER_TIMES * 3] TRACKER_FLASH = {_table(rest)};",
            f"{short}lag_left[TRACKER_KNOTS * TRACKER_TIMES * 3] TRACKER_FLASH = {_table(lag[0])};",
            f"{short}lag_right[TRACKER_KNOTS * TRACKER_TIMES * 3] TRACKER_FLASH = {_table(lag[1])};\n",
        ]
    )


def _lag_unit(result: Plan) -> Floats:
    vehicle = result.tracked.vehicle
    largest = np.maximum(np.abs(vehicle.lag).max((0, 1, 2)), np.abs(vehicle.rest).max((0, 1)))
    return np.asarray(np.maximum(largest, 1e-12) / _LARGEST)


def _path(result: Plan) -> Floats:
    """Return the reference of the pivot as rows of place and heading, (m, 3)."""
    return np.column_stack([result.declared.reference.q, result.declared.reference.heading])


def _nine(value: float) -> str:
    return f"{value:.9g}"


def _row(values: Iterable[float]) -> str:
    return "{" + ", ".join(map(repr, values)) + "}"


def _table(values: np.ndarray, write: Callable[[float], str] = repr) -> str:
    """Write all values of an array as one row in C, over several lines."""
    numbers = [write(value) for value in values.ravel().tolist()]
    lines = [", ".join(numbers[i : i + _PER_LINE]) for i in range(0, len(numbers), _PER_LINE)]
    return "{\n" + ",\n".join(lines) + "}"
