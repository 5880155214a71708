"""A vehicle that swims under a tracker's orders, watched by a camera with delays, gaps and wrong poses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from planner.paths.distance import distance_to
from planner.planning.planned import Plan
from planner.tracking.tracker import Command
from planner.vehicle.vehicle import Vehicle
from sim.mechanics import planar


class Tracks(Protocol):
    """`softflagella.Tracker`, or what is fed like it."""

    def update(
        self, now: float, pose: tuple[float, float, float] | None = None, seen_at: float | None = None
    ) -> Command: ...


@dataclass
class Camera:
    """What a camera does to the true poses.

    Standard deviations of poses [l, rad], time between poses, delay, shares of gaps and of wrong poses, the place
    of the marker in the robot (forward, left), and what another robot does that is taken for this one.
    """

    noise: tuple[float, float] = (0.01, 0.01)
    every: float = 1.0
    delay: float = 0.0
    gaps: float = 0.0
    wrong: float = 0.0
    marker: tuple[float, float] = (0.0, 0.0)
    other: Callable[[float], Any] | None = None  # pose of another robot at a time
    swapped: Callable[[float], bool] = lambda time: False  # whether it is taken for this one
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    def sees(self, pose: np.ndarray, when: float) -> Any:
        if self.rng.random() < self.gaps:
            return None
        if self.rng.random() < self.wrong:
            return (float(self.rng.normal(0, 5)), float(self.rng.normal(0, 5)), float(self.rng.uniform(-3, 3)))
        if self.other is not None and self.swapped(when):
            pose = self.other(when)
        pose = planar.compose(pose, np.array([*self.marker, 0.0]))
        x, y, heading = (pose + self.rng.normal(size=3) * [self.noise[0], self.noise[0], self.noise[1]]).tolist()
        return x, y, (heading + np.pi) % (2 * np.pi) - np.pi


@dataclass(frozen=True)
class Swum:
    """Where the robot was at many instants, what was ordered, and what the tracker said."""

    times: np.ndarray  # (K,)
    poses: np.ndarray  # (K, 3) of the head's centre
    distance: np.ndarray  # (K,) of the tracked point from the declared path
    errors: np.ndarray  # (K,) the last bound that the tracker gave before
    dwells: list[float]
    alarms: list[float]  # when an alarm began
    finished: bool


class _Swimmer:
    """A vehicle under a tracker's orders, and what is kept of its motion."""

    def __init__(self, tracker: Tracks, truth: Vehicle, start: Any):
        self.tracker, self.car, self.pose = tracker, truth, np.array(start)
        self.before: float | None = None  # length of the last dwell
        self.began = self.kept = 0.0
        self.command = tracker.update(0.0)
        self.dwells: list[float] = []
        self.alarms: list[float] = []
        self.times: list[float] = []
        self.poses: list[np.ndarray] = []
        self.errors: list[float] = []

    def at(self, time: float) -> np.ndarray:
        """Return the pose at a time of the present dwell."""
        time -= self.began
        pose = planar.compose(self.pose, self.car.motion(self.command.direction, self.before, time))
        return np.asarray(pose + np.append(self.car.current * time, 0.0))

    def update(self, now: float, *seen: Any) -> None:
        """Tell the tracker the time, and a pose if there is one; the motor turns as it orders."""
        self.keep(now)
        last, pose = self.command, self.at(now)
        self.command = self.tracker.update(now, *seen)
        self.alarms += [now] if self.command.alarm and not last.alarm else []
        if self.command.direction != last.direction:
            self.dwells.append(now - self.began)
            self.pose, self.before, self.began = pose, now - self.began, now

    def keep(self, until: float) -> None:
        """Keep some instants up to a time, with the bound that holds there."""
        for share in (0.25, 0.5, 0.75, 1.0) if until > self.kept else ():
            self.times.append(self.kept + share * (until - self.kept))
            self.poses.append(self.at(self.times[-1]))
            self.errors.append(self.command.error)
        self.kept = max(self.kept, until)


def swum(tracker: Tracks, plan: Plan, truth: Vehicle, camera: Camera, *, changes_to: Vehicle | None = None,
         start: Any = None, most: int = 5000) -> Swum:  # fmt: skip
    """Swim from `start`, by default the plan's, and return all that can be told of it."""
    swimmer = _Swimmer(tracker, truth, plan.start if start is None else start)
    seen = 0.0
    waiting: list[tuple[float, Any, float]] = []
    half = len(plan.dwells) // 2
    while not swimmer.command.finished and len(swimmer.dwells) < most:
        if changes_to is not None and len(swimmer.dwells) > half:
            swimmer.car = changes_to
        look, arrival = seen + camera.every, waiting[0][0] if waiting else np.inf
        if arrival <= min(swimmer.command.flip_at, look):
            swimmer.update(*waiting.pop(0))
        elif look <= swimmer.command.flip_at:
            seen = look
            measured = camera.sees(swimmer.at(seen), seen)
            if measured is not None:
                waiting.append((seen + camera.delay, measured, seen))
                waiting.sort(key=lambda item: item[0])
        else:
            swimmer.update(swimmer.command.flip_at)  # the flip
    poses = np.array(swimmer.poses)
    followed = planar.compose(poses, np.array([plan.tracked.offset, 0.0, 0.0]))
    distance, errors = distance_to(plan.reference, followed[:, :2]), np.array(swimmer.errors)
    finished = swimmer.command.finished
    return Swum(np.array(swimmer.times), poses, distance, errors, swimmer.dwells, swimmer.alarms, finished)


def swim(tracker: Tracks, plan: Plan, truth: Vehicle, camera: Camera, *, changes_to: Vehicle | None = None,
         most: int = 5000) -> tuple[np.ndarray, list[float]]:  # fmt: skip
    """Swim; return distances from the declared path at many instants, and the dwells that were ordered."""
    result = swum(tracker, plan, truth, camera, changes_to=changes_to, most=most)
    return result.distance, result.dwells


def rms(distance: np.ndarray) -> float:
    return float(np.sqrt(np.mean(distance**2)))
