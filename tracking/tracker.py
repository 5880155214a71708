"""Tracker: keeps a robot on its plan with poses from a camera, and learns the robot while it swims.

    tracker = Tracker(plan)
    command = tracker.update(now)                              # no pose
    command = tracker.update(now, (x, y, heading), seen_at)    # a pose, and when it was true

Every call returns the direction of the motor and the time of the next flip. At most one flip can have happened
since the last call: the one that was announced. A call at its time or later, also one with a pose, counts as this
flip, so the motor must turn in the returned direction. The tracker estimates thirteen numbers of the robot
(`tracking.kalman_filter`). A pose may be late: it is compared with the predicted pose at its own time.
Implausible poses, and values that are not finite, are ignored. Long gaps between poses only increase the error.
From afar the tracker plans a way back (`tracking.guidance`). A plan that repeats is followed lap after
lap, until `finish_lap` is called.

*Clock.* A caller tells the time at each flip, so a time much later than the announced flip is a fault of the
clock. So is one that goes back by more than EARLY. Such a time is refused. Where CONFIRMED refused times run on
together, the clock was set: the tracker then moves its own times with it.

*Displacement.* Poses that the filter rejects are compared with each other: a second pose is kept that moves with
every dwell as this robot would move. A rejected pose that agrees with it counts for it, another one against it.
Where AGREED more count for it than against, over FLIPS flips or more, the robot is there: it has been moved.
Another robot flips at other times, so its poses do not agree.

The alarm means that the robot is incompatible with the model. It compares WINDOW accepted poses with the predicted
ones: for a robot of the model the sum of their squared residuals is below a limit with probability 1 −
FALSE_ALARM. It is also raised when LOST poses in a row were rejected.

The next flip is the root of the same equation as in planning (`planner.guidance.line_of_sight`), from the
estimated pose and with the estimated robot. It is never before the shortest dwell, whatever the input.

Poses are those of the head's centre in l and rad; times in μ0 l⁴/EI. `tracking.pipe` has seconds.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from common.errors import InputError
from common.notebook import Shown
from common.units import format_time
from planner.guidance.law import REST
from planner.paths.units import heading_in_degrees, in_lab
from planner.planning.plan import Plan
from planner.planning.stated_error import KEPT, bound
from sim.mechanics.planar import POSE
from tracking.guidance import TrackerGuidance
from tracking.kalman_filter import NAMES, Dwell, Estimate, difference

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FALSE_ALARM = 1e-3  # probability of an alarm per WINDOW poses, for a robot of the model
WINDOW = 40
ALARM_AT = 173.6174364561601  # quantile 1 − FALSE_ALARM of χ² with 3 × WINDOW degrees of freedom
GATE = 21.107513466160444  # quantile 0.9999 of χ² with 3 degrees of freedom
LOST = 10  # consecutive rejected poses after which there is an alarm
SPREADS = 0.5  # of the filter's standard deviation, which allows for changes (docs/results.md)
SLACK = 1e-6  # time units; a time this close before the announced flip is the flip's own, rounded
LATE = 10.0  # how late a flip may be told
EARLY = 2.0  # how much earlier than the last time a late message may be; it is taken for the last time
CONFIRMED = 3
AGREED = 6
FLIPS = 4
LARGEST_MISFIT = 21.1  # squared size of a residual above which a pose disagrees: χ² of three degrees of freedom
MODEL_NOISE = 0.005  # standard deviation of what the model adds to a pose in some dwells [l, rad]
LARGEST_MEAN = 5.0  # mean squared size above which the poses are not those of this robot


class Command(NamedTuple):
    """What the motor does now, and when it must flip next.

    Example:
        >>> from softflagella import Tracker, circle, plan
        >>> Tracker(plan(circle(2.0), "paper-control")).update(0.0).direction
        1
    """

    direction: int  # +1 or −1; 0 at the end
    flip_at: float  # time of the next flip, or of the end
    finished: bool  # the path has ended
    alarm: bool  # the robot is incompatible with the model: calibrate again
    error: float  # the robot stays this close to the path until the next flip, in 95 % of the time [l]


class Tracker(Shown):
    """See the module.

    Args:
        plan: the plan.
        noise: standard deviations of a pose: of x and y [l], of the heading [rad].
        latency: time from when a pose is true to when it is fed, if `seen_at` is not given.
        begin: time at which the motor starts.
        start: pose of the head's centre at rest, if it is not the plan's start; the tracker plans the way from
            there to the path.

    Example:
        >>> from softflagella import Tracker, circle, load_robot, plan
        >>> tracker = Tracker(plan(circle(2.0), load_robot("paper-control")))
        >>> command = tracker.update(0.0)
        >>> command.direction, command.flip_at > 0.2
        (1, True)
    """

    def __init__(
        self,
        plan: Plan,
        *,
        noise: tuple[float, float] = (0.01, 0.01),
        latency: float = 0.0,
        begin: float = 0.0,
        start: POSE | None = None,
    ):
        self.shortest = plan.minimum_dwell
        self.start = plan.start if start is None else start
        self._plan = plan
        self._law = TrackerGuidance(plan)
        self._estimate = Estimate(plan, self._law, noise, start)
        self._latency = latency
        self._clock = Clock(begin)
        self._displacement = Displacement()
        self._dwell = Dwell(begin, plan.first_direction, REST, 0.0)
        self._past: deque[Dwell] = deque(maxlen=KEPT)
        self._finished = False
        self._rejected = 0
        self._score, self._scored = 0.0, 0
        self.alarm = False
        self._flip_at, self._ends = begin, False
        self._plan_flip()
        turn = self._law.first_turn
        if turn == -self._dwell.sense:
            self._dwell = self._dwell._replace(sense=turn)
            self._plan_flip()

    def update(self, now: float, pose: POSE | None = None, seen_at: float | None = None) -> Command:
        """Advance to time `now`, and fuse a pose measurement if there is one.

        Args:
            now: the time. One that is not finite, goes back, or is later than the next flip can be told is taken
                for the last one; three of them that agree are a clock that was set, which is followed.
            pose: x, y [l] and heading [rad] of the head's centre.
            seen_at: when the pose was true; default: `latency` ago.
        """
        shift = self._clock.tell(now, self._flip_at)
        if shift:
            self._shift(shift)
        if not self._finished and self._now >= self._flip_at - SLACK:
            self._flip()
        if pose is not None and not self._finished and self._clock.believed:
            when = self._now - self._latency if seen_at is None else seen_at
            finite = all(math.isfinite(4 * number) for number in (*pose, when))  # differences of two, too
            possible = len(pose) == 3 and finite and when <= self._now
            if possible and self._see(pose, when):
                self._plan_flip()
        return self.command

    def finish_lap(self) -> Command:
        """End a path that repeats at the end of this lap."""
        self._law.finish_lap()
        if not self._finished:
            self._plan_flip()
        return self.command

    @property
    def command(self) -> Command:
        """Return the present command again."""
        return Command(
            0 if self._finished else self._dwell.sense, self._flip_at, self._finished, self.alarm, self._error()
        )

    def __repr__(self) -> str:
        command, robot = self.command, self._plan.robot
        when, flip = (format_time(time * robot.time_scale) for time in (self._now, command.flip_at))
        if command.finished:
            motor = "the path has ended"
        else:
            motor = f"motor {command.direction:+d} until {flip} ({command.flip_at:.4g} time units)"
        x, y, heading = self.pose
        cm = 100 * robot.length_scale
        forward, left, angle = self._estimate.state[10:]
        return "\n".join(
            [
                f"Tracker of {robot.name!r} at {when} ({self._now:.4g} time units): {motor}",
                f"  estimated pose: x = {x * cm:.4g} cm, y = {y * cm:.4g} cm, heading "
                f"{heading_in_degrees(heading)}; within {in_lab(command.error, robot)} of the path (95 %)",
                f"  estimated marker: {forward * cm:.2g} cm forward and {left * cm:.2g} cm left of the "
                f"head's centre, turned by {math.degrees(angle):.2g} degrees",
                f"  alarm: {'calibrate again, the robot is not as the model says' if command.alarm else 'none'}",
            ]
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the plan and the estimated pose at the last flip, on axes in cm.

        Args:
            ax: default: axes of a new figure.
        """
        ax = self._plan.plot(ax)
        cm = 100 * self._plan.robot.length_scale
        x, y, heading = self.pose
        ahead = x + 0.3 * math.cos(heading), y + 0.3 * math.sin(heading)
        ax.plot(cm * x, cm * y, "^", color="black", label="estimated")
        ax.plot([cm * x, cm * ahead[0]], [cm * y, cm * ahead[1]], color="black", lw=1)
        return ax

    @property
    def plan(self) -> Plan:
        """The plan that is followed."""
        return self._plan

    @property
    def pose(self) -> POSE:
        """Estimated x, y [l] and heading [rad] of the head's centre at the last flip."""
        return self._estimate.pose

    def to_dict(self) -> dict[str, Any]:
        """Return command, pose and estimates as plain content."""
        return {**self.command._asdict(), "pose": list(self.pose), "learned": self.learned}

    @property
    def learned(self) -> dict[str, float]:
        """Estimates by name, see `tracking.kalman_filter.NAMES`."""
        return dict(zip(NAMES, self._estimate.state, strict=True))

    @property
    def _now(self) -> float:
        return self._clock.now

    def _shift(self, shift: float) -> None:
        """Move all times with a clock that was set."""
        self._flip_at += shift
        self._dwell = self._dwell._replace(start=self._dwell.start + shift)
        self._past = deque((dwell._replace(start=dwell.start + shift) for dwell in self._past), KEPT)

    def _flip(self) -> None:
        """Carry out the announced flip, or end the path."""
        if self._ends:
            self._finished = True
            return
        done = self._dwell._replace(length=self._flip_at - self._dwell.start)
        self._approach(done.length)
        self._displacement.advance(self._estimate, done)
        self._estimate.advance(done)
        self._estimate.apply()
        self._law.integrate(self._estimate.pose, done.sense)
        self._past.append(done)
        self._dwell = Dwell(self._flip_at, -done.sense, done.length, 0.0)
        self._plan_flip()
        self._finished = self._ends and self._flip_at <= self._now + SLACK  # the path ends at the flip

    def _plan_flip(self) -> None:
        """Compute the time of the next flip, and whether the path ends there."""
        self._estimate.apply()
        law, pose, dwell = self._law, self._estimate.pose, self._dwell
        elapsed = max(self._now - dwell.start, 0.0)
        state = law.state
        present = law.pose_after(pose, dwell.sense, dwell.before, elapsed) if elapsed else pose
        self._approach(elapsed)
        if law.is_off(present):
            law.plan_way(present)
            state = law.state
        law.state = state
        try:
            length, self._ends = law.next_dwell(pose, dwell.sense, dwell.before, elapsed)
        except InputError:  # the robot turns in circles: swim on
            length, self._ends = self.shortest, False
        law.state = state
        start = self._dwell.start
        self._flip_at = max(start + length, self._now, start + (0.0 if self._ends else self.shortest))

    def _approach(self, time: float) -> None:
        """Move the guidance's place with the robot, nearly until `time` after the last flip."""
        dwell = self._dwell
        self._law.approach(self._estimate.pose, dwell.sense, dwell.before, time)

    def _error(self) -> float:
        """Bound the distance of the tracked point from the path until the next flip."""
        law, dwell, offset = self._law, self._dwell, self._plan.tracked.offset
        state, ends, spread = law.state, [], 0.0
        for when in (max(self._now, dwell.start), max(self._flip_at, dwell.start)):
            prediction = self._estimate.pose_at(when, dwell, ())
            assert prediction is not None
            pose, D = prediction
            self._approach(when - dwell.start)
            distance, direction = law.distance(pose)
            law.state = state
            ends.append(distance)
            spread = self._estimate.spread(D, direction, offset * math.sin(direction - pose[2]))
        return bound(ends[0], ends[1], SPREADS * spread)

    def _see(self, pose: POSE, when: float) -> bool:
        """Update the estimate with a pose; return false if the pose was rejected."""
        prediction = self._estimate.seen_from(when, self._dwell, self._past)
        if prediction is None:
            return False
        expected, H = prediction
        size = self._estimate.update(difference(pose, expected), H, GATE)
        if size <= GATE:
            self._rejected = 0
            self._displacement.forget()
            self._judge(size)
            return True
        self._rejected += 1
        self.alarm |= self._rejected >= LOST
        if self._displacement.see(self._estimate, pose, when, self._dwell, self._past):
            self._estimate.relocate(self._displacement.pose)
            self._displacement.forget()
            self._rejected, self._score, self._scored = 0, 0.0, 0
            return True
        return False

    def _judge(self, size: float) -> None:
        """Compare the sum over WINDOW poses with its limit for a robot of the model."""
        self._score += size
        self._scored += 1
        if self._scored == WINDOW:
            self.alarm = self._score > ALARM_AT
            self._score, self._scored = 0.0, 0


class Clock:
    """The present time, and the times that were refused."""

    def __init__(self, now: float):
        self.now = now
        self.believed = True  # whether the last time was
        self._first = self._last = 0.0  # of those that were refused and run on together
        self._count = 0
        self.set_by = 0.0  # what was added to the tracker's times in all

    def tell(self, now: float, flip_at: float) -> float:
        """Hear the time.

        Args:
            now: the time.
            flip_at: of the announced flip.

        Returns:
            What must be added to all times since the clock was set; 0 if it was not.
        """
        if not math.isfinite(now):
            self.believed = False
            return 0.0
        self.believed = self.now - EARLY <= now <= flip_at + LATE
        if self.believed:
            self.now, self._count = max(self.now, now), 0
            return 0.0
        if self._count > 0 and self._last < now <= self._last + LATE:
            self._count, self._last = self._count + 1, now
        else:
            self._count, self._first, self._last = 1, now, now
        if self._count < CONFIRMED:
            return 0.0
        shift = self._first - self.now  # as if the first had come at once: no flip comes too early
        self.now, self.believed, self._count = now, True, 0
        self.set_by += shift
        return shift


class Displacement:
    """The second pose, at the last flip, and what counts for it."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Forget all rejected poses."""
        self.pose: POSE = (0.0, 0.0, 0.0)
        self._agreed = self._flips = self._seen = 0
        self._score = 0.0

    def advance(self, estimate: Estimate, dwell: Dwell) -> None:
        """Advance to the flip at the end of a dwell."""
        if self._agreed > 0:
            self.pose = estimate.moved(self.pose, dwell)
            self._flips += 1

    def see(self, estimate: Estimate, pose: POSE, when: float, now: Dwell, past: Sequence[Dwell]) -> bool:
        """Compare a rejected pose with the others; tell whether the robot has been moved to `self.pose`."""
        variance = [2 * noise + MODEL_NOISE * MODEL_NOISE for noise in estimate.noise]
        if self._agreed > 0:
            residual = estimate.residual(pose, when, now, past, self.pose)
            if residual is None:
                return False
            size = sum(part * part / spread for part, spread in zip(residual, variance, strict=True))
            if size <= LARGEST_MISFIT:
                self._agreed, self._seen, self._score = self._agreed + 1, self._seen + 1, self._score + size
                x, y, heading = (old + part / self._seen for old, part in zip(self.pose, residual, strict=True))
                self.pose = x, y, heading
            else:
                self._agreed -= 1
        if self._agreed == 0:
            self._begin(estimate, pose, when, now, past)
        if self._agreed < AGREED or self._flips < FLIPS:
            return False
        if self._score <= LARGEST_MEAN * self._seen:
            return True
        self._begin(estimate, pose, when, now, past)
        return False

    def _begin(self, estimate: Estimate, pose: POSE, when: float, now: Dwell, past: Sequence[Dwell]) -> None:
        """Begin with one rejected pose: that at the last flip from which the robot would be seen there."""
        self.forget()
        begun = estimate.turned_back(pose, when, now, past)
        if begun is not None:
            self.pose, self._agreed, self._seen = begun, 1, 1
