"""The tracker's clock: it believes times until somewhat after the next flip, and others when they are confirmed.

A caller tells the time at each flip, so a time much later than the announced flip is a fault of the clock. So is
one that goes back by more than EARLY. Such a time is refused. Where CONFIRMED refused times run on together, the
clock was set: the tracker then moves its own times with it. `planner/c/clock.h` does the same in C. Times in
μ0 l⁴/EI.
"""

from __future__ import annotations

import math

SLACK = 1e-6  # time units; a time this close before the announced flip is the flip's own, rounded
LATE = 10.0  # how late a flip may be told
EARLY = 2.0  # how much earlier than the last time a late message may be; it is taken for the last time
CONFIRMED = 3


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
