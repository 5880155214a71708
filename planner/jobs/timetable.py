"""When a robot must begin, and where it must circle, so that it keeps apart from robots whose motions are fixed.

Along its path the robot has a state (i, n): step i of its own motion at step n of the time of all. From there it
goes to (i + 1, n + 1). At its start it may wait. At some places it may make a waiting circle of L steps, which
leads to (i, n + L). States in which another robot may be too near are left out. At the end it rests for ever.
Among all ways through this table the one with the fewest circles is taken, and among those the one that ends
first. Such tables for robots on given paths are those of O'Donnell and Lozano-Pérez (1989), Proc. IEEE Int. Conf.
Robotics and Automation. Lengths in m, times in s.

A waiting circle is a whole turn of the pivot, after which it is where it was, with the same course. It becomes a
part of the declared path, so the guidance leads the robot around it and back, open loop as well as with a
tracker, and the stated error includes it. A time of arrival that was asked for is not kept. The circle is wider
than the robot's narrowest one, by 1/ROOM.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from planner.goal.dubins import DubinsPaths
from planner.goal.last_dwells import Ending
from planner.jobs.separation import Places, Scheduled, TimedMotion, too_near
from planner.paths.tractrix import Reference
from planner.planning.line_of_sight import Start
from planner.planning.plan import J, Plan
from planner.planning.solve import Setting, follow_declared
from sim.arrays import Flags, Floats

MOST_CIRCLES = 6
ROOM = 0.7  # radius of the narrowest circle over that of a waiting circle
_SPACING = 0.02  # l, of the reference's points


class WaitingCircle(NamedTuple):
    """A whole turn at a place of the path."""

    place: int  # index of a point of the reference
    side: int  # +1: to the left, −1: to the right


class Turn(NamedTuple):
    """A waiting circle that may be made."""

    circle: WaitingCircle
    time: float  # of the robot's own motion, at which it begins
    poses: Floats  # (L, 3) of the head's centre, at equal steps of time, until just before its end


class Timing(NamedTuple):
    """When to begin, and which circles to make."""

    begin: float
    circles: tuple[WaitingCircle, ...]


@dataclass
class Timetable:
    """The table of a motion.

    Args:
        motion: of the robot that has to keep apart.
        others: the motions that are fixed.
        apart: distance to keep, besides the errors in place.
        step: of time.
        earliest: time before which the robot does not begin.
    """

    motion: TimedMotion  # that is carried out
    others: Sequence[Scheduled]
    apart: float
    step: float
    earliest: float = 0.0

    def __post_init__(self) -> None:
        self._own = np.minimum(self.step * np.arange(math.ceil(self.motion.duration / self.step) + 1),
                               self.motion.duration)  # fmt: skip
        last = max([self.earliest, *(other.end for other in self.others)])
        self._steps = math.ceil(last / self.step) + len(self._own) + 2
        self._free = self._unhindered(self.motion.places(self._own))

    def find(self, turns: Sequence[Turn] = ()) -> Timing | None:
        """Find the timing with the fewest circles; None if there is none with MOST_CIRCLES or fewer."""
        free = self._free
        waits = np.logical_and.accumulate(free[0])
        waits &= self.step * np.arange(self._steps) >= self.earliest
        rests = np.logical_and.accumulate(free[-1][::-1])[::-1]
        entries: list[dict[int, Flags]] = [{0: waits}]
        layers = [self._reached(entries[0])]
        possible = None
        while not (layers[-1][-1] & rests).any():
            if possible is None:
                possible = [self._turn_possible(turn) for turn in turns]
            entries.append(self._after_turns(layers[-1], turns, possible))
            if len(layers) > MOST_CIRCLES or not any(entry.any() for entry in entries[-1].values()):
                return None
            layers.append(self._reached(entries[-1]))
        last = int((layers[-1][-1] & rests).argmax())
        return self._traced(last, layers, entries, turns, possible or [])

    def _unhindered(self, own: Places) -> Flags:
        """Tell at which steps of time (K, H) the others are apart from poses (K,) of this robot."""
        free = np.ones((len(own.poses), self._steps), dtype=bool)
        for other in self.others:
            first, last = math.floor(other.begin / self.step), math.ceil(other.end / self.step)
            places = other.places(np.asarray(self.step * np.arange(first, last + 1), dtype=float))
            near = too_near(own, places, self.apart)
            free &= ~near[:, np.clip(np.arange(self._steps) - first, 0, last - first)]
        return free

    def _turn_possible(self, turn: Turn) -> Flags:
        """Tell at which steps of time (H,) a circle may begin."""
        error = np.full(len(turn.poses), float(self.motion.error(np.array([turn.time]))[0]))
        free = self._unhindered(Places(self.motion.body, turn.poses, error))
        possible = np.ones(self._steps, dtype=bool)
        for k, row in enumerate(free):
            possible[: self._steps - k] &= row[k:]
        possible[self._steps - len(free) :] = False
        return possible

    def _reached(self, entries: dict[int, Flags]) -> Flags:
        """Find the states (I, H) that are reached without circles from those that are entered at some rows."""
        reached = np.zeros_like(self._free)
        for i, free in enumerate(self._free):
            if i:
                reached[i, 1:] = reached[i - 1, :-1] & free[1:]
            if i in entries:
                reached[i] |= entries[i] & free
        return reached

    def _after_turns(self, reached: Flags, turns: Sequence[Turn], possible: list[Flags]) -> dict[int, Flags]:
        """Find the states that are entered by one circle more."""
        entries: dict[int, Flags] = {}
        for turn, allowed in zip(turns, possible, strict=True):
            row = self._row(turn)
            entry = entries.setdefault(row, np.zeros(self._steps, dtype=bool))
            entry |= self._later(reached[row] & allowed, turn)
        return entries

    def _traced(
        self, step: int, layers: list[Flags], entries: list[dict[int, Flags]], turns: Sequence[Turn],
        possible: list[Flags],
    ) -> Timing:  # fmt: skip
        """Follow the table back from the end of the motion at a step of time."""
        row, circles = len(self._own) - 1, []
        for layer in range(len(layers) - 1, 0, -1):
            while not (row in entries[layer] and entries[layer][row][step] and self._free[row, step]):
                row, step = row - 1, step - 1
            turn = next(
                turn
                for turn, allowed in zip(turns, possible, strict=True)
                if self._row(turn) == row and self._later(layers[layer - 1][row] & allowed, turn)[step]
            )
            circles.append(turn.circle)
            step -= len(turn.poses)
        return Timing(self.step * (step - row), tuple(reversed(circles)))

    def _row(self, turn: Turn) -> int:
        return min(round(turn.time / self.step), len(self._own) - 1)

    def _later(self, entry: Flags, turn: Turn) -> Flags:
        """Shift states (H,) by the length of a circle."""
        later = np.zeros_like(entry)
        later[len(turn.poses) :] = entry[: -len(turn.poses)]
        return later


def circle_reference(plan: Plan, circle: WaitingCircle) -> Reference:
    """Make the reference of a waiting circle; it begins and ends at the place, and ends a whole turn further."""
    reference, drift, radius = plan.declared.reference, plan.drift, plan.tracked.vehicle.pivot_radius / ROOM
    (begin,) = reference.part(circle.place, circle.place + 1).courses(drift)
    turn = DubinsPaths.circles(begin, circle.side, 1, radius)
    heading = float(reference.heading[circle.place])
    return Reference.of_pivot(turn.sampled(_SPACING), plan.tracked.rod, drift, heading)


def with_circles(plan: Plan[J], circles: Sequence[WaitingCircle]) -> Plan[J]:
    """Plan again with waiting circles.

    Args:
        plan: the plan without them.
        circles: where to wait; those at the same place follow each other.

    Raises:
        InputError: the robot has no room for a circle.
    """
    if not circles:
        return plan
    goal, setting = plan.ends_at, Setting(plan.tracked, plan.minimum_dwell, plan.straight, plan.drift)
    declared = plan.declared.moved(_inserted(plan, circles), plan.drawn)
    if goal is None:
        circling = follow_declared(declared, setting, plan.request, drawn=plan.drawn)
    else:
        circling = follow_declared(
            declared, setting, plan.request, drawn=plan.drawn, guidance=plan.guidance,
            start=Start(plan.start, plan.first_direction), ending=Ending(goal, plan.minimum_dwell),
        )  # fmt: skip
    return replace(plan, declared=circling.declared, guidance=circling.guidance, switches=circling.switches,
                   errors=circling.errors)  # fmt: skip


def _inserted(plan: Plan, circles: Sequence[WaitingCircle]) -> Reference:
    """Insert circles into the reference of a plan."""
    reference = plan.declared.reference
    parts, begin = [], 0
    for circle in sorted(circles):
        parts += [reference.part(begin, circle.place), circle_reference(plan, circle).part(0, -1)]
        begin = circle.place
    return Reference.joined(*parts, reference.part(begin), closed=reference.closed)
