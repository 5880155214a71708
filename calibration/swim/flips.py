"""When the motor of a swim was reversed: as a column of a track tells, or as planned.

A flip lies between the last row of one direction and the first row of the next: half-way, with the standard
deviation of a uniform distribution. In a track of the simulator, the last row of a dwell is its end. Beside the
answers of a tracker on a pipe, which turn the motor, it flips in the first row.

The clock of a plan begins with its motor, that of a camera at any time. The robot turns to the left while the
direction is positive, so the start of the plan is where the turns of the heading fit the directions best: where

    sum over t of (ψ(t + T) − ψ(t)) (D(t + T − start) − D(t − start)),   D(t) = ∫ direction dt,   T = half a dwell,

is largest. This leaves the lag with which a robot follows its motor, a part of a dwell.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.reading import expecting
from common.units import format_time
from sim.model.schedule import PLAN_FILE

_FINE, _MOST = 8, 2**20  # steps in half a dwell, in which a start is searched for; instants
_SAME = 1e-6  # of the whole time, by which rounded times differ
_OTHERS = 0.1  # share of the flips; if more are not where a plan has them, it was not carried out
_LIKE, _WELL = 0.4, 0.7  # correlations of turns with directions: below 0.35 with other plans, 0.85 with the own
_JUMP = 4.0  # median turns; more are jumps of the camera


class Motor(NamedTuple):
    """When a motor was reversed; M dwells."""

    first_direction: int
    flips: Floats  # (M + 1,) [s]: start, M − 1 flips, end of the last dwell
    error: float = 0.0  # standard deviation of the time of a flip [s]
    clock_known: bool = True  # the flips are on the clock of the track
    unseen: Floats = np.empty((0, 2))  # begin and end of times without rows in which it may flip twice [s]

    @property
    def directions(self) -> Floats:
        """Of the dwells (M,)."""
        return self.first_direction * np.where(np.arange(len(self.flips) - 1) % 2, -1.0, 1.0)

    def turned(self, time: Floats) -> Floats:
        """Integrate the direction from the start to times (n,) [s]."""
        steps = self.directions * np.diff(self.flips)
        return np.asarray(np.interp(time, self.flips, np.append(0.0, np.cumsum(steps))))

    def within(self, first: float, last: float) -> Motor:
        """Return the dwells from the one before that of a time on, to that of another one."""
        begin = max(int(np.searchsorted(self.flips, first, side="right")) - 2, 0)
        end = int(np.searchsorted(self.flips, last))
        sense = int(self.directions[begin])
        return self._replace(first_direction=sense, flips=self.flips[begin : end + 1])


def motor_by_rows(time: Floats, direction: Floats, share: float) -> tuple[Motor, list[str]]:
    """Find the flips in the rows of a track, and say where the motor rests meanwhile.

    Args:
        time: (m,), not decreasing [s].
        direction: of the motor (m,): 1, −1, or 0 where it rests.
        share: of the time from one row to the next after which it flips: 0, 1, or 0.5 if it is not known.

    Raises:
        InputError: the motor never turns, or two flips have one time.
    """
    edges = np.flatnonzero(np.diff(direction != 0, prepend=False, append=False))
    parts = edges.reshape(-1, 2)  # first row in which it turns, first in which it rests again
    if not len(parts):
        raise InputError("the motor rests all the time: direction is 0; give 1 and -1 where it turns")
    first, end = parts[np.argmax(time[parts[:, 1] - 1] - time[parts[:, 0]])]
    last = first + np.flatnonzero(np.diff(direction[first:end]))  # rows of a dwell, but of the last dwell
    before, after = time[last], time[last + 1]
    rows = time[max(first - 1, 0) : first + 1], time[end - 1 : end + 1]
    begin, over = ((1 - share) * each[0] + share * each[-1] for each in rows)
    flips = np.array([begin, *((1 - share) * before + share * after), over])
    if (np.diff(flips) <= 0).any():
        again = flips[1:][np.diff(flips) <= 0][0]
        raise InputError(f"direction changes twice at {again:g} s; give the time of each change")
    known = share in (0, 1) or not len(before)
    error = 0.0 if known else float(np.median(after - before)) / math.sqrt(12)
    gaps = first + np.flatnonzero((np.diff(time[first:end]) > np.diff(flips).min()) & (not known))
    said = []
    if len(parts) > 1:
        part = f"{format_time(begin)} to {format_time(over)}"
        said.append(f"the motor rests in between; kept is the longest part, {part}")
    return Motor(int(direction[first]), flips, error, unseen=np.stack([time[gaps], time[gaps + 1]], 1)), said


def planned_motor(plan: Mapping[str, Any], span: float = 0.0) -> Motor:
    """Return the motor of a plan, started at 0; a schedule that repeats is carried out for so long [s].

    Raises:
        InputError: the content is that of no plan.
    """
    with expecting(PLAN_FILE, "the plan", "plan again"):
        dwells, first = np.array(plan["dwell_s"], dtype=float), int(plan["first_direction"])
        laps = max(math.ceil(span / dwells.sum()), 1) if "lap" in plan else 1
    return Motor(first, np.append(0.0, np.cumsum(np.tile(dwells, laps))), clock_known=False)


def as_planned(motor: Motor, plan: Mapping[str, Any]) -> tuple[Motor, list[str]]:
    """Take the flips of a plan instead of those between rows that agree with them; say if they do not.

    Raises:
        InputError: the content is that of no plan.
    """
    (start, *flips, end), row = motor.flips, math.sqrt(12) * motor.error
    planned = planned_motor(plan, end - start)
    after = np.array(flips) - start
    off = after - planned.flips[np.abs(np.subtract.outer(after, planned.flips)).argmin(1)]
    other = int((np.abs(off) > row + _SAME * planned.flips[-1]).sum())
    if other > _OTHERS * len(off) or planned.first_direction != motor.first_direction:
        return motor, [f"{other} of {len(off)} flips are not where the plan has them: a tracker led the robot"]
    if not row:
        return motor, []
    begun = planned.flips + start + np.median(off)
    begun = begun[begun <= end + row]
    whole = begun if begun[-1] >= end - row else np.append(begun, end)  # it was stopped earlier
    return Motor(motor.first_direction, whole, motor.error / math.sqrt(len(off))), []


def motor_by_plan(plan: Mapping[str, Any], time: Floats, heading: Floats) -> tuple[Motor, list[str]]:
    """Find the start of a plan in a track: where the headings turn as its motor does; say if they do so in part.

    Args:
        plan: content of plan.json.
        time: of the headings (n,) [s].
        heading: (n,) [rad].

    Raises:
        InputError: the headings do not turn with the flips of the plan.
    """
    planned = planned_motor(plan, float(np.ptp(time)))
    end = planned.flips[-1]
    step = max(float(np.median(np.diff(planned.flips))) / (2 * _FINE), (np.ptp(time) + end) / _MOST)
    seen = np.interp(np.arange(time[0], time[-1], step), time, np.unwrap(heading))
    turns, wanted = (each[_FINE:] - each[:-_FINE] for each in (seen, planned.turned(np.arange(0.0, end, step))))
    turns[np.abs(turns) > _JUMP * np.median(np.abs(turns))] = 0.0
    size = len(turns) + len(wanted) - 1
    alike = np.fft.irfft(np.fft.rfft(turns, size) * np.fft.rfft(wanted[::-1], size), size)
    late = int(np.argmax(alike)) - len(wanted) + 1  # steps
    turns, wanted = turns[max(late, 0) : late + len(wanted)], wanted[max(-late, 0) : len(turns) - late]
    fit = float(turns @ wanted) / math.sqrt(float(turns @ turns) * float(wanted @ wanted) or math.inf)
    doubt = (
        f"the headings turn with the flips of the plan to {100 * fit:.0f} % alone: was it carried out, without a "
        "tracker? A column 'direction' tells it"
    )
    if fit < _LIKE:
        raise InputError(doubt)
    return planned._replace(flips=time[0] + step * late + planned.flips), [doubt] if fit < _WELL else []
