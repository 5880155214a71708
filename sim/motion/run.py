"""One robot stepped in time: advance at constant motor speed, flip the motor, read the pose."""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.mechanics.balance import tail_spin
from sim.model.body import Body
from sim.motion.resolution import MOST_WORK, Resolution, steps_in, time_step
from sim.solve.march import TOLERANCE, YAW, State, X, Y, advance, new_state

BROKE_DOWN = "Newton's method did not converge in a time step"
TOO_MUCH = "it would take more time steps than a row may ask for"
_GRADES = (1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2)  # parts of a step, two of each, after a jump of the motor's speed
REVERSED = np.array([-1.0, 1.0, -1.0, -1.0])  # signs of (v_x, v_z, ω_yr, ω_h) after a flip


class Run:
    """A robot stepped in time. `failed` says why it cannot go on: BROKE_DOWN, TOO_MUCH, or empty."""

    def __init__(
        self,
        body: Body,
        tails: int,
        resolution: Resolution,
        state: State | None = None,
        *,
        reverse: Body | None = None,
        most_work: float | None = None,
    ):
        """Start from `state` (changed in place) or from rest; `most_work`: see `sim.motion.resolution`.

        `reverse` is the robot with its motor reversed. By default ω̄ changes its sign, and nothing else: that is
        right without odd effects (`sim.model.groups.Groups.reversed`).
        """
        self.body = body
        self.reverse = body._replace(omega=-body.omega) if reverse is None else reverse
        self.state = new_state(tails, resolution.edges, body.offset) if state is None else state
        self.time_step = time_step(body.omega, resolution)
        self.failed = ""
        self.jumped = state is None  # velocities are not yet those of the motor's speed
        self._work_of_a_step = resolution.work_of_a_step(body, tails)
        self._work_left = MOST_WORK if most_work is None else most_work

    def copy(self) -> Run:
        """Return an independent copy of this run."""
        duplicate = object.__new__(Run)
        duplicate.__dict__ |= vars(self)
        duplicate.state = copied(self.state)
        return duplicate

    def can_afford(self, duration: float, *, flips: float = 0) -> bool:
        """Tell whether the work that is left is enough for this time and these flips; sets `failed` if not."""
        steps = steps_in(duration, self.time_step) + flips * 2 * len(_GRADES)
        if not self.failed and not steps * self._work_of_a_step <= self._work_left:
            self.failed = TOO_MUCH
        return not self.failed

    def go(self, duration: float) -> tuple[Floats, Floats]:
        """Advance at constant speed: times from now (count,) and the poses then, (count, 6); none if it fails.

        Steps are equal, except for some short ones after a jump of the motor's speed. There all modes of the tails
        start anew, and equal steps would converge at first order only.
        """
        if not self.can_afford(duration, flips=1):
            return np.empty(0), np.empty((0, 6))
        parts = []
        if self.jumped:
            share = min(self.time_step, duration / 2 / (2 * sum(_GRADES)))
            parts = [(2, 2 * share * grade) for grade in _GRADES]
        remaining = duration - sum(part for _, part in parts)
        parts.append((int(steps_in(remaining, self.time_step)), remaining))
        times, poses, now = [], [], 0.0
        for count, part in parts:
            times.append(now + part * np.arange(1, count + 1) / count)
            poses.append(self.steps(count, part)[0])
            now += part
        self.jumped = False
        times[-1][-1] = duration
        return np.concatenate(times), np.concatenate(poses)

    def steps(self, count: int, duration: float, *, shapes: int = 0) -> tuple[Floats, Floats]:
        """Advance in `count` equal steps: poses (count, 6) and the last `shapes` shapes (K, n, N, 3)."""
        work = count * self._work_of_a_step
        if not self.failed and work > self._work_left:
            self.failed = TOO_MUCH
        if self.failed:
            return np.empty((0, 6)), np.empty((0, *self.state.x.shape))
        self._work_left -= work
        steps = advance(self.body, self.state, duration / count, count, TOLERANCE, shapes=shapes)
        self.failed = "" if steps.solved else BROKE_DOWN
        return steps.poses, steps.shapes

    def flip(self) -> None:
        """Reverse the motor: the shape stays, velocities become their mirror image."""
        self.body, self.reverse = self.reverse, self.body
        self.state.u[:] *= REVERSED
        self.state.x_dot[:] = 0.0
        self.jumped = True

    @property
    def pose(self) -> Floats:
        """(x, y, ψ) of the head's centre."""
        return self.state.pose[[X, Y, YAW]]

    @property
    def omega_t(self) -> float:
        """Spin of the tails."""
        return float(tail_spin(self.body, self.state.u))


def copied(state: State) -> State:
    """Return an independent copy of a state, which time steps change in place."""
    return State(*(array.copy() for array in state))
