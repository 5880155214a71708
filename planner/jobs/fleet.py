"""fleet(plans, apart): plans of several robots in one tank that keep apart by a distance at all times.

At first nobody gives way. Of two robots that come too near to each other one must give way to the other: it keeps
its path, and begins later or makes waiting circles on its way (`planner.jobs.timetable`). Both choices are tried,
depth first; the later robot of the list gives way first. A robot that gives way is timed among all that go before
it, directly or through others, and so are those that give way to it and now meet one of them. Robots that never
come near each other have no priorities. The search ends where two robots could not keep apart if they were alone.
This is priority-based search, of Ma, Harabor, Stuckey, Li and Koenig, "Searching with consistent prioritization
for multi-agent path finding", AAAI 2019.

Robots that have not begun and robots that have ended count, too. The distance asked for is kept although both
robots are off by their errors in place (`planner.jobs.separation`).

Left out: what the flow of one robot does to another (docs/results.md). Lengths in m, times in s.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import combinations
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from planner.jobs.fleet_plan import FleetPlan
from planner.jobs.separation import Places, Scheduled, TimedMotion, approach, distances, times_at, too_near
from planner.jobs.timetable import Timetable, Timing, Turn, WaitingCircle, circle_reference, with_circles
from planner.paths.obstacles import Footprint
from planner.paths.units import Swimmer, read_length
from planner.planning.conditions import KeptClear
from planner.planning.plan import Plan
from sim.io.errors import InputError
from sim.io.keywords import checks_keywords
from sim.io.units import format_length, number_and_unit

MOST_ROBOTS = 12
MOST_TIMINGS = 300
_STEPS = 800  # of the longest motion
_LEAST_STEP = 0.5  # time units
_PLACES = 20  # of waiting circles on a path
_SPACING = 0.5  # l, least distance between them
_TRIES = 6  # margins for each robot
_MORE = 0.01  # of the body's reach, by which a margin grows at least
_LONGEST = 1e6  # s
M = TypeVar("M")  # a motion


class NoTimingError(InputError):
    """Robots cannot keep apart by waiting."""


@checks_keywords
def fleet(
    plans: Sequence[Plan],
    apart: float | str,
    *,
    names: Sequence[str] | None = None,
    delays_s: Sequence[float] | None = None,
    unit: str | None = None,
    feedback: bool = False,
    progress: Callable[[float], object] | None = None,
) -> FleetPlan:
    """Time plans of several robots in one tank so that their bodies keep apart, open loop or with feedback.

    Each robot keeps its path. Of two robots that would come too near to each other the later one of the list gives
    way: it begins later, or makes waiting circles. If that leads nowhere, the other one does. Robots that rest at
    their start or end count, too.

    Args:
        plans: of two or more robots, in one frame of the tank; where possible, the first ones have priority.
        apart: least distance between bodies, as "10cm"; a number is in tail lengths, if all robots have the same.
            It is kept although both robots are off by their errors in place.
        names: of the robots; default: robot-1, robot-2 and so on.
        unit: of `apart` in words without one.
        delays_s: times before which they do not begin.
        feedback: the poses will be measured (`Tracker`, with `begin` at the robot's start).
        progress: called now and then with the share of what is done.

    Raises:
        InputError: the robots cannot keep apart by waiting; the message says which two, and why.

    Example:
        >>> import softflagella as sf
        >>> right = sf.plan([(0, 0), (3, 0)], "paper-control", objective="time")
        >>> up = sf.plan([(1.5, -2.5), (1.5, 2.5)], "paper-control", objective="time")
        >>> both = sf.fleet([right, up], apart="5cm")
        >>> both.sure_m >= 0.05, both.begin_s[0] == 0 or both.begin_s[1] == 0
        (True, True)
    """
    plans = list(plans)
    names = [f"robot-{k + 1}" for k in range(len(plans))] if names is None else list(names)
    delays = [0.0] * len(plans) if delays_s is None else list(delays_s)
    if not len(plans) == len(names) == len(delays):
        raise InputError(
            f"{len(plans)} plans, {len(names)} names and {len(delays)} delays; give one of each a robot"
        )
    if len(set(names)) < len(names):
        raise InputError("two robots have the same name; give each a name of its own")
    if not plans:
        raise InputError("no robots; a fleet has two or more")
    words = apart if isinstance(apart, str) else f"{apart}l"
    distance = distance_apart(words, unit, [plan.robot for plan in plans])
    if not 2 <= len(plans) <= MOST_ROBOTS:
        raise InputError(f"{len(plans)} robots; a fleet has 2 to {MOST_ROBOTS}")
    for name, delay in zip(names, delays, strict=True):
        if not 0 <= delay < _LONGEST:
            raise InputError(f"{name}: start delay {delay:g} s; give seconds, 0 or more")
    planner = _Fleet(names, plans, delays, distance, feedback)
    planner.check_rest()
    search = Priorities(planner.alone, planner.timed, planner.meet, MOST_TIMINGS, progress)
    resolved = search.resolve()
    if resolved is None:
        raise NoTimingError(planner.refusal(search))
    return FleetPlan(tuple(names), *resolved, distance, feedback)


def distance_apart(words: str | float, unit: str | None, robots: Sequence[Swimmer]) -> float:
    """Read a distance such as 10cm in m.

    Raises:
        InputError: the words are no length above 0 or have no unit, or the robots have different tail lengths.
    """
    text, first = str(words), robots[0]
    relative = (number_and_unit(text)[1] or unit) == "l"
    if relative and any(robot.length_scale != first.length_scale for robot in robots):
        raise InputError(
            f"distance apart {words}: the robots have different tail lengths; say its unit, as in 10cm"
        )
    return read_length(text, unit, first, "distance apart", above_zero=True) * first.length_scale


class _Fleet:
    """The robots, and what is known of them."""

    def __init__(
        self, names: Sequence[str], plans: Sequence[Plan], earliest: Sequence[float], apart: float, feedback: bool
    ):
        self.names, self.apart, self.feedback = names, apart, feedback
        self.motions = [TimedMotion(plan, feedback) for plan in plans]
        self.alone = tuple(map(Scheduled, self.motions, earliest))
        self.timed, self.meet, self._turns = cache(self._timed), cache(self._meet), cache(self._turns_of)

    def _meet(self, first: Scheduled, second: Scheduled) -> float:
        """Find when two robots come too near to each other first."""
        times, _, sure = approach(first, second)
        near = sure < self.apart
        return float(times[near.argmax()]) if near.any() else math.inf

    def _step(self, k: int, others: Sequence[Scheduled]) -> float:
        """Choose the step of time of a table."""
        motions = (self.motions[k], *(other.motion for other in others))
        unit = min(motion.plan.robot.time_scale for motion in motions)
        return max(max(motion.duration for motion in motions) / _STEPS, _LEAST_STEP * unit)

    def _timed(self, k: int, others: tuple[Scheduled, ...]) -> Scheduled | None:
        """Find when a robot begins and where it circles. The margin grows until the exact distances suffice."""
        base, earliest = self.motions[k], self.alone[k].begin
        margin, step = 0.0, self._step(k, others)
        for _ in range(_TRIES):
            table = Timetable(base, others, self.apart + margin, step, earliest)
            timing = table.find() or table.find(self._turns(k, step))
            if timing is None:
                return None
            motion = base
            if timing.circles:
                try:
                    motion = TimedMotion(self._circling(base.plan, timing.circles), self.feedback)
                except InputError:  # no room for a circle
                    return None
                again = Timetable(motion, others, self.apart, step, earliest).find()
                if again is None:
                    ends = [each.error(np.array([each.duration]))[0] for each in (base, motion)]
                    margin += max(float(ends[1] - ends[0]) - margin, _MORE * base.body.reach)
                    continue
                timing = Timing(again.begin, timing.circles)
            candidate = Scheduled(motion, timing.begin, len(timing.circles))
            lacking = self.apart - min(float(approach(candidate, other).sure.min()) for other in others)
            if lacking <= 0:
                return candidate
            margin += max(1.1 * lacking, _MORE * base.body.reach)
        return None

    def _turns_of(self, k: int, step: float) -> list[Turn]:
        """List the waiting circles that a robot may make on its path."""
        plan = self.motions[k].plan
        kept = plan.kept_clear
        reference, robot, a = plan.declared.reference, plan.robot, plan.tracked.vehicle.pivot_distance
        arc = reference.arc
        count = max(1, min(_PLACES, math.floor(float(arc[-1]) / _SPACING)))
        rows = np.searchsorted(arc, np.linspace(0.0, arc[-1], count + 1))
        places = np.unique(rows.clip(max=len(arc) - 1)).tolist()
        try:
            circling = with_circles(plan, [WaitingCircle(places[len(places) // 2], 1)])
        except InputError:
            return []
        duration = (circling.duration - plan.duration) * robot.time_scale
        steps = max(1, round(duration / step))
        begins = times_at(plan, arc[places]) * robot.time_scale
        turns = []
        for place, begin in zip(places, begins.tolist(), strict=True):
            for side in (1, -1):
                around = circle_reference(plan, WaitingCircle(place, side))
                at = np.linspace(0.0, around.arc[-1], steps, endpoint=False)
                x, y, heading = (np.interp(at, around.arc, column) for column in (*around.q.T, around.heading))
                poses = np.stack([x + a * np.cos(heading), y + a * np.sin(heading), heading], 1)
                if kept is not None:
                    room = Footprint.of(robot, 0.0).clearance(poses, kept.free_space).min()
                    if room < max(plan.stated_error, plan.predicted_max):
                        continue
                turns.append(
                    Turn(WaitingCircle(place, side), begin, poses * [robot.length_scale, robot.length_scale, 1.0])
                )
        return turns

    def _circling(self, plan: Plan, circles: Sequence[WaitingCircle]) -> Plan:
        """Plan again with waiting circles, clear of obstacles.

        Raises:
            InputError: there is no room.
        """
        plan = with_circles(plan, circles)
        kept = plan.kept_clear
        if kept is None:
            return plan
        clearance = plan.clearance(kept.free_space)
        needed = plan.feedback_error if self.feedback else plan.stated_error
        if clearance < needed:
            raise InputError("a waiting circle leaves no margin around obstacles")
        return replace(
            plan, kept_clear=KeptClear(kept.free_space, max(kept.margin, needed), clearance, kept.detours)
        )

    def check_rest(self) -> None:
        """Refuse robots that start or end too near to each other.

        Raises:
            NoTimingError: the message names the two robots.
        """
        for first, second in combinations(range(len(self.names)), 2):
            one, two = self.names[first], self.names[second]
            for when, word, remedy in ((0.0, "start", "put them"), (1.0, "end", "end one of them")):
                pair = [self._resting(k, when) for k in (first, second)]
                errors = float(pair[0].error[0] + pair[1].error[0])
                distance = float(distances(*pair)[0])
                if distance - errors >= self.apart:
                    continue
                off = f", less {format_length(errors)} by which they may be off" if errors else ""
                gap = "with bodies that overlap" if distance <= 0 else f"{format_length(distance)} apart"
                raise NoTimingError(
                    f"{one} and {two} {word} {gap}{off}; {format_length(self.apart)} are asked for: {remedy} "
                    "elsewhere, or ask for less"
                )

    def _resting(self, k: int, when: float) -> Places:
        """Return the place of a robot before (0) or after (1) its motion."""
        motion = self.motions[k]
        return motion.places(np.array([when * motion.duration]))

    def refusal(self, search: Priorities[Scheduled]) -> str:
        """Say which robots cannot keep apart, and why."""
        if search.impossible is not None:
            robots, tried = tuple(sorted(search.impossible)), "whichever of them waits"
        else:
            who, above = min(search.refused, key=lambda refused: len(refused[1]))
            for each in tuple(above):  # leave out those that do not matter
                fewer = {other: motion for other, motion in above.items() if other != each}
                if fewer and self.timed(who, tuple(fewer.values())) is None:
                    above = fewer
            robots, tried = (who, *above), f"in {search.tried} timings with others before or after them"
        pairs = [pair for k in robots[1:] for pair in ((k, robots[0]), (robots[0], k))]
        reasons = dict.fromkeys(reason for pair in pairs for reason in self._in_the_way(*pair))
        why = " and ".join(reasons) or "they meet where neither of them has room to wait"
        return (
            f"{' and '.join(self.names[k] for k in robots)} cannot keep {format_length(self.apart)} apart, "
            f"{tried}: {why}; move their paths apart, or ask for less"
        )

    def _in_the_way(self, resting: int, moving: int) -> list[str]:
        """Say whether a robot starts or ends on the way of another one."""
        motion = self.motions[moving]
        along = motion.places(np.arange(0.0, motion.duration, self._step(moving, ())))
        names = self.names[resting], self.names[moving]
        return [
            f"{names[0]} {word} on the way of {names[1]}"
            for when, word in ((0.0, "starts"), (1.0, "ends"))
            if too_near(along, self._resting(resting, when), self.apart).any()
        ]


Pairs = frozenset[tuple[int, int]]  # of robots: the first goes before the second


class Resolved(NamedTuple, Generic[M]):
    """Motions that keep apart."""

    motions: tuple[M, ...]
    order: tuple[int, ...]  # of the robots: each gives way only to some of those before it


@dataclass
class Priorities(Generic[M]):
    """The search.

    Args:
        alone: the motions of robots that give way to nobody.
        timed: times the motion of a robot among others; None if there is no such timing.
        meet: returns when two motions come too near to each other first; infinite if they never do.
        most: timings that are tried.
        progress: called now and then with the share of them that are tried.
    """

    alone: tuple[M, ...]
    timed: Callable[[int, tuple[M, ...]], M | None]
    meet: Callable[[M, M], float]
    most: int
    progress: Callable[[float], object] | None = None
    tried: int = 0
    refused: list[tuple[int, dict[int, M]]] = field(default_factory=list)  # a robot, and those before it
    impossible: tuple[int, int] | None = None  # two robots that cannot keep apart, whichever gives way

    def resolve(self) -> Resolved[M] | None:
        """Change motions until no two meet; None if no priorities are found with which this is possible."""
        return self._resolve(self.alone, frozenset())

    def _resolve(self, motions: tuple[M, ...], before: Pairs) -> Resolved[M] | None:
        pairs = combinations(range(len(motions)), 2)
        time, pair = min((self.meet(motions[i], motions[j]), (i, j)) for i, j in pairs)
        if time == math.inf:
            return Resolved(motions, _order(before, len(motions)))
        for first, second in (pair, pair[::-1]):
            more = before | {(first, second)}
            changed = self._giving_way(motions, more, second)
            found = None if changed is None else self._resolve(changed, more)
            if found is not None:
                return found
        return None

    def _giving_way(self, motions: tuple[M, ...], before: Pairs, who: int) -> tuple[M, ...] | None:
        """Time a robot again that has to give way, and those that give way to it."""
        changed = list(motions)
        for k in _order(before, len(motions)):
            above = {each: changed[each] for each in sorted(_above(before, k))}
            met = who in above and any(self.meet(changed[k], each) < math.inf for each in above.values())
            if k != who and not met:
                continue
            if self.impossible is not None or self.tried >= self.most:
                return None
            if self.progress is not None:
                self.progress(self.tried / self.most)
            self.tried += 1
            timed = self.timed(k, tuple(above.values()))
            if timed is None:
                self.refused.append((k, above))
                self.impossible = next(((k, each) for each in above if not self._can_keep_apart(k, each)), None)
                return None
            changed[k] = timed
        return tuple(changed)

    def _can_keep_apart(self, one: int, two: int) -> bool:
        """Tell whether one of two robots can give way to the other, if they are alone."""
        ways = ((one, two), (two, one))
        return any(self.timed(later, (self.alone[first],)) is not None for later, first in ways)


def _above(before: Pairs, k: int) -> set[int]:
    """Find the robots that go before one, directly or through others."""
    above: set[int] = set()
    new = {k}
    while new:
        new = {first for first, second in before if second in new} - above
        above |= new
    return above


def _order(before: Pairs, count: int) -> tuple[int, ...]:
    """Sort robots so that each comes after those that go before it."""
    return tuple(sorted(range(count), key=lambda k: (len(_above(before, k)), k)))
