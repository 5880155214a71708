"""A closed loop in simulation: a robot under a tracker's orders, and a camera that sees it.

The robot is simulated in time steps, or moves as the planner's vehicle does, which takes a thousandth of the time.
The camera looks at equal times (`planner.planning.request`). Times in μ0 l⁴/EI and lengths in l are those of the
plan's robot.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.keywords import checks_keywords
from common.units import format_length
from planner.paths.distance import distance_to, farthest
from planner.paths.units import missed_words
from planner.planning.plan import Plan
from planner.planning.request import Camera
from planner.vehicle.vehicle import Vehicle
from sim.mechanics import planar
from sim.mechanics.planar import POSE
from sim.model.robot import Robot
from sim.motion.replay import run_at_rest
from sim.motion.run import SteppedRobot
from sim.robot_rows import OneRobot, one_robot, with_units
from sim.solve.march import YAW, X, Y
from tracking.tracker import Command, Tracker

if TYPE_CHECKING:
    import pandas as pd

SAME = 1e-5  # time units; a flip so soon after another event comes with it
_STRIDE = 4  # time steps between two kept instants
_SHARES = np.array([0.25, 0.5, 0.75, 1.0])  # of the time between two events: the kept instants of a vehicle


class Pilot(Protocol):
    """A `Tracker`, or what is fed like one."""

    @property
    def plan(self) -> Plan: ...

    @property
    def start(self) -> POSE: ...

    def update(self, now: float, pose: POSE | None = None, seen_at: float | None = None) -> Command: ...


@dataclass(frozen=True)
class Swim:
    """What a robot did under a tracker. K instants, M dwells.

    Example:
        >>> from softflagella import check, circle, plan, swim
        >>> result = plan(circle(1.2), "paper-control", objective="flips")
        >>> swum = swim(result)
        >>> swum.finished, check(result, swum.to_frame()).rms < 0.1
        (True, True)
    """

    plan: Plan  # that the tracker follows
    times: Floats  # (K,)
    poses: Floats  # (K, 3) of the head's centre
    direction: Floats  # (K,) of the motor
    distance: Floats  # (K,) of the tracked point from the declared path
    errors: Floats  # (K,) the bound on it that the tracker gave before
    missed: float  # largest distance of a point of the declared path from the track
    dwells: Floats  # (M,) as ordered
    alarms: tuple[float, ...]  # when an alarm began
    fed: int  # poses that came in
    finished: bool  # the path has ended

    def weights(self, begin: float = 0.0, end: float = 1.0) -> Floats:
        """Return the share (K,) of the time that each instant stands for, in a part of the whole time."""
        share = self.times / self.times[-1]
        weight = np.gradient(self.times) * ((share >= begin) & (share <= end))
        return np.asarray(weight / weight.sum())

    def rms(self, begin: float = 0.0, end: float = 1.0) -> float:
        """Compute the root mean square distance over a part of the time."""
        return float(np.sqrt((self.weights(begin, end) * self.distance**2).sum()))

    def within(self, error: float | Floats) -> float:
        """Compute the share of the time within a distance of the path, or within distances (K,)."""
        return float(self.weights() @ (self.distance <= error))

    def to_frame(self) -> pd.DataFrame:
        """Tabulate the track of the head's centre as `softflagella.replay` does; K rows."""
        import pandas as pd

        robot, (x, y, heading) = self.plan.robot, self.poses.T
        cm = 100 * robot.length_scale
        columns = {
            "time_s": self.times * robot.time_scale, "x_cm": x * cm, "y_cm": y * cm,
            "heading_deg": np.degrees(heading), "time_bar": self.times, "x_over_l": x, "y_over_l": y,
            "heading_rad": heading, "direction": self.direction.astype(int),
            "dwell": np.cumsum(np.diff(self.direction, prepend=self.direction[0]) != 0),
            "error_over_l": self.errors, "plan_id": self.plan.identity,
        }  # fmt: skip
        return with_units(pd.DataFrame(columns))

    def __repr__(self) -> str:
        length = self.plan.robot.length_scale
        rms, largest = format_length(self.rms() * length), format_length(float(self.distance.max()) * length)
        feedback = self.plan.feedback_error
        return (
            f"Swim of {self.plan.robot.name!r} under a tracker: {missed_words(self.missed, feedback, length)}"
            f"{len(self.dwells)} dwells, {rms} rms and "
            f"{largest} at most from the declared path, {100 * self.within(feedback):.0f} % of the time within "
            f"{format_length(feedback * length)}; {'finished' if self.finished else 'not finished'}, "
            f"{len(self.alarms)} alarms"
        )


class SteppedSwimmer:
    """A robot in time steps, or a vehicle, from rest; it advances at constant motor speed, and flips."""

    def __init__(
        self, truth: Robot | Vehicle, plan: Plan, direction: int, start: Floats, current: tuple[float, float]
    ):
        self._plan, self._direction, self._start = plan, direction, start
        self._current, self._now = np.array([*current, 0.0]), 0.0
        self._pose, self._elapsed = np.zeros(3), 0.0  # of a vehicle: pose at the last flip, time since then
        self._before: float | None = None  # length of its last dwell
        self._run: SteppedRobot | None = None
        self.become(truth)

    def become(self, truth: Robot | Vehicle) -> None:
        """Change into a robot, as it swims."""
        if isinstance(truth, Vehicle):
            self._vehicle = truth
            return
        run = run_at_rest(replace(self._plan.schedule(truth), first_direction=self._direction))
        if self._run is None:
            self._run = run
        else:
            self._run.body, self._run.reverse = run.body, run.reverse
        self._time = truth.time_scale / self._plan.robot.time_scale
        self._length = truth.length_scale / self._plan.robot.length_scale

    def go(self, duration: float) -> tuple[Floats, Floats]:
        """Advance: return times from now (K,) and poses (K, 3)."""
        if self._run is None:
            times, current = _SHARES * duration, np.append(self._vehicle.current, 0.0)
            poses = planar.compose(self._pose, self._moved(self._elapsed + times))
            self._elapsed += duration
        else:
            times, poses = self._run.go(duration / self._time)
            if self._run.failed:
                raise InputError(f"the simulation of the robot failed: {self._run.failed}")
            kept = slice((len(times) - 1) % _STRIDE, None, _STRIDE)
            times, current = times[kept] * self._time, np.zeros(3)
            poses = poses[kept][:, [X, Y, YAW]] * [self._length, self._length, 1.0]
        drift = (self._now + times)[:, None] * (self._current + current)
        self._now += duration
        return times, planar.compose(self._start, poses) + drift

    def flip(self) -> None:
        if self._run is not None:
            self._run.flip()
        else:
            self._pose = planar.compose(self._pose, self._moved(self._elapsed))
            self._before, self._elapsed = self._elapsed, 0.0
        self._direction = -self._direction

    def _moved(self, time: float | Floats) -> Floats:
        return self._vehicle.motion(self._direction, self._before, time)


@checks_keywords
def swim(
    pilot: Plan | Pilot,
    truth: OneRobot | Vehicle | None = None,
    camera: Camera | None = None,
    *,
    start: POSE | None = None,
    current_cm_s: tuple[float, float] = (0.0, 0.0),
    later: Robot | Vehicle | None = None,
    longest: float = 3.0,
) -> Swim:
    """Simulate a robot under a tracker's orders, seen by a camera: a closed loop.

    Args:
        pilot: a tracker that has not begun, or a plan, which gets a tracker that knows the camera's noise.
        truth: what swims: a robot that is simulated, or a vehicle; default: the one that the plan was made for. A
            measured vehicle moves as planned.
        camera: what sees it; default: that of the plan.
        start: pose of the head's centre at rest [l, rad]; default: where the tracker believes it.
        current_cm_s: of the fluid, in x and y [cm/s], which the tracker does not know; a vehicle has its own, too.
        later: what swims from half of the planned time on.
        longest: times the planned duration after which the swim ends in any case.

    Returns:
        Times, poses, distances from the declared path, the tracker's bounds on them, and dwells as ordered.

    Raises:
        InputError: the robot cannot be simulated.

    Example:
        >>> import softflagella as sf
        >>> result = sf.plan(sf.circle(1.2), "paper-control", objective="flips")
        >>> track = sf.swim(result, camera=sf.Camera(delay_s=0.5))
        >>> track.finished, track.rms() < 0.1
        (True, True)
    """
    plan = pilot if isinstance(pilot, Plan) else pilot.plan
    camera = camera or plan.request.camera
    pilot = Tracker(plan, noise=camera.noise) if isinstance(pilot, Plan) else pilot
    if not isinstance(truth, Vehicle):
        robot = plan.robot if truth is None else one_robot(truth)
        truth = robot if isinstance(robot, Robot) else plan.tracked.vehicle
    scale, rng = plan.robot.time_scale, np.random.default_rng(camera.seed)
    begin, limit = np.array(pilot.start if start is None else start), longest * plan.duration
    x, y = (scale * each / (100 * plan.robot.length_scale) for each in current_cm_s)
    command = pilot.update(0.0)
    swimmer = SteppedSwimmer(truth, plan, command.direction, begin, (x, y))
    now, look, change = 0.0, camera.every_s / scale, plan.duration / 2 if later else np.inf
    waiting: list[tuple[float, POSE, float]] = []  # poses on their way from the camera
    track = _Record(begin, command)
    # From event to event: a flip, another robot, a look of the camera, a pose that reaches the tracker.
    while not command.finished and now < limit:
        until = min(look, change, waiting[0][0] if waiting else np.inf)
        until = command.flip_at if command.flip_at <= until + SAME else until
        if until > now:
            track.add(now, *swimmer.go(until - now))
            now = until
        if until == command.flip_at:
            command = pilot.update(now)
        elif until == change and later is not None:
            swimmer.become(later)
            change = np.inf
        elif until == look:
            seen = camera.sees(track.pose, now, rng)
            if seen is not None:
                waiting.append((now + camera.delay_s / scale, seen, now))
            look += camera.every_s / scale
        else:
            command = pilot.update(now, *waiting.pop(0)[1:])
            track.fed += 1
        if track.obey(now, command):
            swimmer.flip()
    return track.swim(plan, command.finished)


class _Record:
    """What happens as a robot swims: its track, and the commands that it obeys."""

    def __init__(self, begin: Floats, command: Command):
        self._command = command  # the last one
        self._stretches = [(np.zeros(1), begin[None], command)]  # times, poses, and the command that held
        self._flipped = 0.0  # when the motor turned over last
        self._dwells: list[float] = []
        self._alarms: list[float] = []
        self.fed = 0  # poses that reached the tracker

    @property
    def pose(self) -> POSE:
        """The last pose of the head's centre."""
        x, y, heading = self._stretches[-1][1][-1].tolist()
        return x, y, heading

    def add(self, now: float, times: Floats, poses: Floats) -> None:
        """Add times from now (K,), and poses (K, 3)."""
        self._stretches.append((now + times, poses, self._command))

    def obey(self, now: float, command: Command) -> bool:
        """Note a command; return whether the motor flips."""
        last, self._command = self._command, command
        if command.alarm and not last.alarm:
            self._alarms.append(now)
        if command.direction == last.direction:
            return False
        self._dwells.append(now - self._flipped)
        self._flipped = now
        return True

    def swim(self, plan: Plan, finished: bool) -> Swim:
        """Compare the whole track with the declared path of a plan."""
        times, stretches, commands = zip(*self._stretches, strict=True)
        counts, poses = [len(each) for each in times], np.concatenate(stretches)
        followed = planar.compose(poses, np.array([plan.tracked.offset, 0.0, 0.0]))[:, :2]
        return Swim(
            plan,
            np.concatenate(times),
            poses,
            np.repeat([float(each.direction) for each in commands], counts),
            distance_to(plan.reference, followed),
            np.repeat([each.error for each in commands], counts),
            farthest(plan.reference, followed),
            np.array(self._dwells),
            tuple(self._alarms),
            self.fed,
            finished,
        )
