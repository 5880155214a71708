"""fleet(members, apart): plans of several robots in one tank that keep apart by a distance at all times.

The robots get a priority. The first one moves as planned. Each later one keeps its path, and gives way to those
before it: it begins later, or makes waiting circles on its way (`planner.jobs.timetable`). Robots that have not
begun and robots that have ended count, too. The distance asked for is kept although both robots are off by their
errors in place (`planner.jobs.timed_motion`). If a robot finds no timing, other orders of priority are tried.
This is prioritized planning, of Erdmann and Lozano-Pérez (1987), Algorithmica 2.

Left out: what the flow of one robot does to another (`benchmarks flow_between_robots`). Lengths in m, times in s.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, islice, permutations

import numpy as np

from planner.goal.goal_plan import GoalPlan, Pose
from planner.jobs.coverage_plan import CoveragePlan
from planner.jobs.error_in_place import times_at
from planner.jobs.fleet_plan import FleetPlan
from planner.jobs.separation import Places, Scheduled, distances, instants, too_near
from planner.jobs.timed_motion import TimedMotion
from planner.jobs.timetable import Timetable, Timing, Turn
from planner.jobs.tour_plan import TourPlan
from planner.jobs.waiting_circles import WaitingCircle, circle_reference, with_circles
from planner.paths.obstacles import Footprint, FreeSpace
from planner.planning.kept_clear import KeptClear
from planner.planning.planned import Plan
from planner.vehicle.rollout import predicted_poses
from sim.io.errors import InputError
from sim.io.units import format_length

MOST_ROBOTS = 12
MOST_ORDERS = 24
_STEPS = 800  # of the longest motion
_LEAST_STEP = 0.5  # time units
_PLACES = 20  # of waiting circles on a path
_SPACING = 0.5  # l, least distance between them
_TRIES = 6  # margins for each robot
_MORE = 0.01  # of the body's reach, by which a margin grows at least
_LONGEST = 1e6  # s


class NoTimingError(InputError):
    """Robots cannot keep apart by waiting."""


@dataclass(frozen=True)
class Member:
    """A robot of a fleet."""

    name: str
    plan: Plan
    goal: Pose | None = None  # the pose at which the plan ends, if it ends at one
    free_space: FreeSpace = field(default_factory=FreeSpace)  # what waiting circles must keep clear of
    earliest: float = 0.0  # time before which it does not begin

    @staticmethod
    def of(name: str, planned: Plan | GoalPlan | TourPlan | CoveragePlan, earliest: float = 0.0) -> Member:
        """Take any plan."""
        plan = planned if isinstance(planned, Plan) else planned.plan
        if isinstance(planned, GoalPlan):
            return Member(name, plan, planned.goal, planned.free_space, earliest)
        space = FreeSpace() if plan.kept_clear is None else plan.kept_clear.free_space
        return Member(name, plan, None, space, earliest)


def fleet(
    members: Sequence[Member],
    apart: float,
    *,
    feedback: bool = False,
    progress: Callable[[float], object] | None = None,
) -> FleetPlan:
    """Time plans so that the bodies of the robots keep apart.

    Args:
        members: the robots with their plans, in order of priority.
        apart: least distance between bodies [m].
        feedback: poses will be measured every 20 flips, so the errors in place are those with feedback.
        progress: called now and then with the share of what is done.

    Raises:
        NoTimingError: some robots cannot keep apart; the message names them and says why.
        InputError: there are fewer than two robots or too many, or a number is not allowed.
    """
    _check(members, apart)
    planner = _Fleet(members, apart, feedback)
    planner.check_rest()
    orders = list(islice(permutations(range(len(members))), MOST_ORDERS))
    refusals: list[_HinderedError] = []
    for tried, order in enumerate(orders):
        if any(refusal.applies(order) for refusal in refusals):
            continue
        if progress is not None:
            progress(tried / len(orders))
        try:
            scheduled = planner.in_order(order)
        except _HinderedError as hindered:
            refusals.append(hindered)
            continue
        motions = tuple(scheduled[k] for k in range(len(members)))
        return FleetPlan(tuple(each.name for each in members), motions, order, apart, feedback)
    raise NoTimingError(planner.refusal(refusals, len(orders)))


def _check(members: Sequence[Member], apart: float) -> None:
    """Check what the user gave."""
    if not 2 <= len(members) <= MOST_ROBOTS:
        raise InputError(f"{len(members)} robots; a fleet has 2 to {MOST_ROBOTS}")
    if not (math.isfinite(apart) and apart >= 0):
        raise InputError(f"distance {apart:g} m; give a distance of 0 or more, such as 10cm")
    for member in members:
        if not 0 <= member.earliest < _LONGEST:
            raise InputError(f"{member.name}: start delay {member.earliest:g} s; give seconds, 0 or more")


class _HinderedError(Exception):
    """A robot finds no timing among others."""

    def __init__(self, who: int, others: tuple[int, ...]):
        super().__init__()
        self.who, self.others = who, others

    def applies(self, order: tuple[int, ...]) -> bool:
        """Tell whether an order gives the same robot the same robots before it, in the same order."""
        return order[: len(self.others) + 1] == (*self.others, self.who)


class _Fleet:
    """The robots, and what is known of them."""

    def __init__(self, members: Sequence[Member], apart: float, feedback: bool):
        self.members, self.apart, self.feedback = members, apart, feedback
        self.motions = [TimedMotion(member.plan, feedback) for member in members]
        longest = max(motion.duration for motion in self.motions)
        unit = min(member.plan.robot.time_scale for member in members)
        self.step = max(longest / _STEPS, _LEAST_STEP * unit)
        self._turns: dict[int, list[Turn]] = {}

    def in_order(self, order: tuple[int, ...]) -> dict[int, Scheduled]:
        """Time the motions, each among those before it.

        Raises:
            _HinderedError: a robot finds no timing.
        """
        scheduled: dict[int, Scheduled] = {}
        for place, k in enumerate(order):
            timed = self._timed(k, list(scheduled.values()))
            if timed is None:
                raise _HinderedError(k, order[:place])
            scheduled[k] = timed
        return scheduled

    def _timed(self, k: int, others: list[Scheduled]) -> Scheduled | None:
        """Find when a robot begins and where it circles. The margin grows until the exact distances suffice."""
        member, base = self.members[k], self.motions[k]
        margin = 0.0
        for _ in range(_TRIES):
            timing = self._find(k, base, others, margin)
            if timing is None:
                return None
            motion = base
            if timing.circles:
                try:
                    motion = TimedMotion(self._circling(member, timing.circles), self.feedback)
                except InputError:  # no room for a circle
                    return None
                again = Timetable(motion, others, self.apart, self.step, member.earliest).find()
                if again is None:
                    ends = [each.error(np.array([each.duration]))[0] for each in (base, motion)]
                    margin += max(float(ends[1] - ends[0]) - margin, _MORE * base.body.reach)
                    continue
                timing = Timing(again.begin, timing.circles)
            candidate = Scheduled(motion, timing.begin, timing.circles)
            lacking = self.apart - self._least(candidate, others)
            if lacking <= 0:
                return candidate
            margin += max(1.1 * lacking, _MORE * base.body.reach)
        return None

    def _find(self, k: int, motion: TimedMotion, others: list[Scheduled], margin: float) -> Timing | None:
        """Find a timing, without circles if there is one."""
        table = Timetable(motion, others, self.apart + margin, self.step, self.members[k].earliest)
        timing = table.find()
        if timing is not None or not others:
            return timing
        if k not in self._turns:
            self._turns[k] = _turns(self.members[k], motion, self.step)
        return table.find(self._turns[k])

    def _circling(self, member: Member, circles: Sequence[WaitingCircle]) -> Plan:
        """Plan again with waiting circles, clear of obstacles.

        Raises:
            InputError: there is no room.
        """
        plan = with_circles(member.plan, circles, member.goal)
        if member.free_space.empty:
            return plan
        poses = predicted_poses(plan.tracked.vehicle, plan.switches)
        clearance = float(Footprint.of(plan.robot, 0.0).clearance(poses, member.free_space).min())
        needed = plan.feedback_error if self.feedback else plan.stated_error
        if clearance < needed:
            raise InputError("a waiting circle leaves no margin around obstacles")
        if plan.kept_clear is None:
            return plan
        kept = plan.kept_clear
        return replace(
            plan, kept_clear=KeptClear(kept.free_space, max(kept.margin, needed), clearance, kept.detours)
        )

    def _least(self, candidate: Scheduled, others: list[Scheduled]) -> float:
        """Compute the least distance from others, less the errors in place of both."""
        times = instants([candidate, *others])
        own, least = candidate.places(times), math.inf
        for other in others:
            places = other.places(times)
            least = min(least, float((distances(own, places) - own.error - places.error).min()))
        return least

    def check_rest(self) -> None:
        """Refuse robots that start or end too near to each other.

        Raises:
            NoTimingError: the message names the two robots.
        """
        for first, second in combinations(range(len(self.members)), 2):
            one, two = self.members[first].name, self.members[second].name
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
        times = np.array([when * motion.duration])
        return Places(motion.body, motion.poses(times), motion.error(times))

    def refusal(self, refusals: list[_HinderedError], orders: int) -> str:
        """Say which robots cannot keep apart, and why."""
        for first, second in combinations(range(len(self.members)), 2):
            ways = ((first, second), (second, first))
            if any(self._timed(after, [self._alone(before)]) is not None for before, after in ways):
                continue
            one, two = self.members[first].name, self.members[second].name
            reasons = [reason for before, after in ways for reason in self._in_the_way(before, after)]
            why = " and ".join(reasons) or "they meet where neither of them has room to wait"
            return (
                f"{one} and {two} cannot keep {format_length(self.apart)} apart, whichever of them waits: {why}; "
                "move their paths apart, or ask for less"
            )
        worst = max(refusals, key=lambda refusal: len(refusal.others))
        others = ", ".join(self.members[k].name for k in worst.others)
        return (
            f"{self.members[worst.who].name} cannot keep {format_length(self.apart)} apart from {others} by "
            f"waiting, in none of {orders} orders of priority; move paths apart, or ask for less"
        )

    def _alone(self, k: int) -> Scheduled:
        return Scheduled(self.motions[k], self.members[k].earliest)

    def _in_the_way(self, resting: int, moving: int) -> list[str]:
        """Say whether a robot starts or ends on the way of another one."""
        motion = self.motions[moving]
        times = np.arange(0.0, motion.duration, self.step)
        along = Places(motion.body, motion.poses(times), motion.error(times))
        names = self.members[resting].name, self.members[moving].name
        return [
            f"{names[0]} {word} on the way of {names[1]}"
            for when, word in ((0.0, "starts"), (1.0, "ends"))
            if too_near(along, self._resting(resting, when), self.apart).any()
        ]


def _turns(member: Member, motion: TimedMotion, step: float) -> list[Turn]:
    """List the waiting circles that a robot may make on its path."""
    plan = member.plan
    reference, robot, a = plan.declared.reference, plan.robot, plan.tracked.vehicle.pivot_distance
    arc = reference.arc
    count = max(1, min(_PLACES, math.floor(float(arc[-1]) / _SPACING)))
    places = np.unique(np.searchsorted(arc, np.linspace(0.0, arc[-1], count + 1)).clip(max=len(arc) - 1)).tolist()
    try:
        circling = with_circles(plan, [WaitingCircle(places[len(places) // 2], 1)], member.goal)
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
            if not member.free_space.empty:
                room = Footprint.of(robot, 0.0).clearance(poses, member.free_space).min()
                if room < max(plan.stated_error, plan.predicted_max):
                    continue
            turns.append(
                Turn(WaitingCircle(place, side), begin, poses * [robot.tail_length, robot.tail_length, 1.0])
            )
    return turns
