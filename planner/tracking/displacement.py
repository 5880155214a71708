"""Rejected poses that agree: a robot that somebody has moved, or another robot.

Poses that the filter rejects are compared with each other: a second pose is kept that moves with every dwell as
this robot would move. A rejected pose that agrees with it counts for it, another one against it. Where AGREED more
count for it than against, over FLIPS flips or more, the robot is there: it has been moved. Another robot flips at
other times, so its poses do not agree. `planner/c/displacement.h` does the same in C.
"""

from __future__ import annotations

from collections.abc import Sequence

from planner.tracking.kalman_filter import POSE, Dwell, Estimate

AGREED = 6
FLIPS = 4
LARGEST = 21.1  # squared size of a residual above which a pose does not agree: χ² with three degrees of freedom
MODEL = 0.005  # standard deviation of what the model adds to a pose in some dwells [l, rad]
MEAN = 5.0  # mean squared size above which the poses are not those of this robot


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
        variance = [2 * noise + MODEL * MODEL for noise in estimate.noise]
        if self._agreed > 0:
            residual = estimate.residual(pose, when, now, past, self.pose)
            if residual is None:
                return False
            size = sum(part * part / spread for part, spread in zip(residual, variance, strict=True))
            if size <= LARGEST:
                self._agreed, self._seen, self._score = self._agreed + 1, self._seen + 1, self._score + size
                x, y, heading = (old + part / self._seen for old, part in zip(self.pose, residual, strict=True))
                self.pose = x, y, heading
            else:
                self._agreed -= 1
        if self._agreed == 0:
            self._begin(estimate, pose, when, now, past)
        if self._agreed < AGREED or self._flips < FLIPS:
            return False
        if self._score <= MEAN * self._seen:
            return True
        self._begin(estimate, pose, when, now, past)
        return False

    def _begin(self, estimate: Estimate, pose: POSE, when: float, now: Dwell, past: Sequence[Dwell]) -> None:
        """Begin with one rejected pose: that at the last flip from which the robot would be seen there."""
        self.forget()
        begun = estimate.turned_back(pose, when, now, past)
        if begun is not None:
            self.pose, self._agreed, self._seen = begun, 1, 1
