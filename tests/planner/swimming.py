"""A vehicle that swims under a tracker's orders, watched by a camera with delays, gaps and wrong poses."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
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
    """Standard deviations of poses [l, rad], time between poses, delay, and shares of gaps and of wrong poses."""

    noise: tuple[float, float] = (0.01, 0.01)
    every: float = 1.0
    delay: float = 0.0
    gaps: float = 0.0
    wrong: float = 0.0
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    def sees(self, pose: np.ndarray) -> Any:
        if self.rng.random() < self.gaps:
            return None
        if self.rng.random() < self.wrong:
            return (float(self.rng.normal(0, 5)), float(self.rng.normal(0, 5)), float(self.rng.uniform(-3, 3)))
        x, y, heading = (pose + self.rng.normal(size=3) * [self.noise[0], self.noise[0], self.noise[1]]).tolist()
        return x, y, (heading + np.pi) % (2 * np.pi) - np.pi


def _moved(car: Vehicle, pose: np.ndarray, sense: int, before: float | None, start: float, time: float) -> Any:
    moved = planar.compose(pose, car.motion(sense, before, time - start))
    return moved + np.append(car.current * (time - start), 0.0)


def swim(tracker: Tracks, plan: Plan, truth: Vehicle, camera: Camera, *, changes_to: Vehicle | None = None,
         most: int = 5000) -> tuple[np.ndarray, list[float]]:  # fmt: skip
    """Swim; return distances from the declared path at many instants, and the dwells that were ordered."""
    pose, last_dwell, start, seen, waiting = np.array(plan.start), None, 0.0, 0.0, []
    command, dwells, track = tracker.update(0.0), [], []
    half = len(plan.dwells) // 2
    while not command.finished and len(dwells) < most:
        sense, known = command.direction, command.flip_at
        car = changes_to if changes_to is not None and len(dwells) > half else truth

        at = partial(_moved, car, pose, sense, last_dwell, start)
        while seen + camera.every <= known or (waiting and waiting[0][0] <= known):
            if waiting and waiting[0][0] <= min(known, seen + camera.every):
                when, measured, taken_at = waiting.pop(0)
                command = tracker.update(when, measured, taken_at)
            else:
                seen += camera.every
                measured = camera.sees(at(seen))
                if measured is not None:
                    waiting.append((seen + camera.delay, measured, seen))
                    waiting.sort(key=lambda item: item[0])
            known = command.flip_at
        track += [at(start + share * (known - start)) for share in np.linspace(0.2, 1, 5)]
        dwells.append(known - start)
        pose, last_dwell, start = at(known), known - start, known
        command = tracker.update(known)
    followed = planar.compose(np.array(track), np.array([plan.tracked.offset, 0.0, 0.0]))
    return distance_to(plan.reference, followed[:, :2]), dwells


def rms(distance: np.ndarray) -> float:
    return float(np.sqrt(np.mean(distance**2)))
