"""A simulated robot under a camera, its motor switched by a tracker or by a schedule.

The camera sees the head's centre at equal times, with noise. A pose may get lost, and it comes late. At half of
the planned time the robot may change into another one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from planner.paths.distance import distance_to
from planner.planning.planned import Plan
from planner.tracking.kalman_filter import POSE
from planner.tracking.tracker import Command
from sim.arrays import Floats
from sim.inputs import check_columns
from sim.mechanics import planar
from sim.model.body import Body
from sim.model.groups import Groups
from sim.model.robot import Robot
from sim.motion.resolution import MOST_REPLAY_WORK, Resolution
from sim.motion.run import Run
from sim.solve.assembly import bodies, reversed_bodies
from sim.solve.march import YAW, X, Y

_SAME = 1e-5  # time units; events this close happen together
_STRIDE = 4  # steps between two kept points


class Pilot(Protocol):
    """`planner.tracking.tracker`, or what is fed like it."""

    def update(self, now: float, pose: POSE | None = None, seen_at: float | None = None) -> Command: ...


class Blind:
    """The schedule as planned, whatever the camera sees."""

    def __init__(self, plan: Plan):
        self._plan = plan
        self._flips = np.cumsum(plan.dwells).tolist()
        self._done = 0

    def update(self, now: float, pose: POSE | None = None, seen_at: float | None = None) -> Command:
        if self._done < len(self._flips) and now >= self._flips[self._done] - _SAME / 2:
            self._done += 1
        if self._done == len(self._flips):
            return Command(0, self._flips[-1], True, False, self._plan.stated_error)
        direction = self._plan.first_direction * (-1) ** self._done
        return Command(direction, self._flips[self._done], False, False, self._plan.stated_error)


@dataclass
class Camera:
    """Standard deviations of poses [l, rad], seconds between poses and to their arrival, share that gets lost."""

    noise: tuple[float, float] = (0.01, 0.01)
    every: float = 1.0
    delay: float = 2.0
    lost: float = 0.2
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    def sees(self, pose: Floats) -> POSE | None:
        if self.rng.random() < self.lost:
            return None
        x, y, heading = (pose + self.rng.normal(size=3) * [self.noise[0], self.noise[0], self.noise[1]]).tolist()
        return x, y, heading


@dataclass(frozen=True)
class Swum:
    """Where the tracked point was, how many poses were fed, and when the alarm began."""

    time: Floats  # (K,)
    track: Floats  # (K, 2)
    distance: Floats  # (K,), from the declared path
    fed: int
    alarms: tuple[float, ...]

    def rms(self, begin: float = 0.0, end: float = 1.0) -> float:
        """Compute the root mean square distance over a part of the time."""
        share = self.time / self.time[-1]
        weight = np.gradient(self.time) * ((share >= begin) & (share <= end))
        return float(np.sqrt((weight * self.distance**2).sum() / weight.sum()))


class Robots:
    """The simulated robot, and the one that it may change into."""

    def __init__(self, robot: Robot, first_direction: int):
        self._sign = first_direction
        body, reverse = self._pair(robot)
        resolution = Resolution.for_tracks(body.omega)
        self._run = Run(body, robot.tails, resolution, reverse=reverse, most_work=MOST_REPLAY_WORK)

    def _pair(self, robot: Robot) -> tuple[Body, Body]:
        columns = {name: np.array([value]) for name, value in robot.group_values().items()}
        groups = Groups.from_columns(check_columns(columns))
        pair = bodies(groups)[0], reversed_bodies(groups)[0]
        return pair if self._sign > 0 else (pair[1], pair[0])

    def go(self, duration: float) -> tuple[Floats, Floats]:
        """Advance: return times from now (K,) and poses from the start (K, 3)."""
        times, poses = self._run.go(duration)
        if self._run.failed:
            raise RuntimeError(self._run.failed)
        return times, poses[:, [X, Y, YAW]]

    def flip(self) -> None:
        self._run.flip()
        self._sign = -self._sign

    def become(self, robot: Robot) -> None:
        self._run.body, self._run.reverse = self._pair(robot)


def swim(
    pilot: Pilot, plan: Plan, robot: Robot, camera: Camera, *, later: Robot | None = None, longest: float = 1.5
) -> Swum:
    """Swim until the pilot says that the path ends, or `longest` times the planned time is over.

    Args:
        pilot: what gives orders.
        plan: the path and the start.
        robot: what swims.
        camera: what sees it.
        later: what it is from half of the planned time on.
        longest: share of the planned time.
    """
    scale = plan.robot.time_scale
    every, delay, limit = camera.every / scale, camera.delay / scale, longest * plan.duration
    swimmer, start = Robots(robot, plan.first_direction), np.array(plan.start)
    now, look, change = 0.0, every, plan.duration / 2 if later else np.inf
    pose = start
    waiting: list[tuple[float, POSE, float]] = []
    times, poses, alarms = [np.zeros(1)], [start[None]], []
    command, rang, fed = pilot.update(0.0), False, 0
    while not command.finished and now < limit:
        until = min(look, change, waiting[0][0] if waiting else np.inf)
        until = command.flip_at if command.flip_at <= until + _SAME else until
        if until > now:
            spent, moved = swimmer.go(until - now)
            moved = planar.compose(start, moved)
            times.append(now + spent[_STRIDE - 1 :: _STRIDE])
            poses.append(moved[_STRIDE - 1 :: _STRIDE])
            now, pose = until, moved[-1]
        if until == command.flip_at:
            command = pilot.update(now)
            if not command.finished:
                swimmer.flip()
        elif until == change and later is not None:
            swimmer.become(later)
            change = np.inf
        elif until == look:
            seen_pose = camera.sees(pose)
            if seen_pose is not None:
                waiting.append((now + delay, seen_pose, now))
            look += every
        else:
            _, seen_pose, seen = waiting.pop(0)
            command = pilot.update(now, seen_pose, seen)
            fed += 1
        if command.alarm and not rang:
            alarms.append(now)
        rang = command.alarm
    track = planar.compose(np.concatenate(poses), np.array([plan.tracked.offset, 0.0, 0.0]))[:, :2]
    return Swum(np.concatenate(times), track, distance_to(plan.reference, track), fed, tuple(alarms))
