"""One robot in time: go on at constant motor speed, flip the motor, look where it is."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim.march import TOLERANCE, YAW, State, X, Y, advance, new_state
from sim.resolution import Resolution, time_step
from sim.tail import HEAD_LENGTH, body_of

Floats = NDArray[np.float64]

_GRADES = (1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2)  # of a step, twice each, after a jump of the motor's speed
_REVERSED = np.array([-1.0, 1.0, -1.0, -1.0])  # of (v_x, v_z, ω_yr, ω_h), by a flip


class Run:
    """A robot (a row of `sim.direct.bodies`) stepped in time; `failed` once a step did not converge."""

    def __init__(self, row: Floats, tails: int, resolution: Resolution, state: State | None = None):
        """From `state`, which is changed in place, or from rest with straight tails."""
        self.body = body_of(row)
        self.state = new_state(tails, resolution.edges, self.body.offset) if state is None else state
        self.time_step = time_step(row[0], resolution)
        self.failed = False
        self._jumped = state is None
        self._head_length = float(row[HEAD_LENGTH])

    def copy(self) -> Run:
        """A run that goes its own way from here."""
        other = object.__new__(Run)
        other.__dict__ |= vars(self)
        other.state = State(*(array.copy() for array in self.state))
        return other

    def go(self, duration: float) -> tuple[Floats, Floats]:
        """Advance at constant speed: times since now (count,) and the poses then, (count, 6).

        Steps are equal, but for some short ones where the motor's speed has jumped: there every mode of the tails
        starts anew, and equal steps would converge at first order only.
        """
        parts = []
        if self._jumped:
            share = min(self.time_step, duration / 2 / (2 * sum(_GRADES)))
            parts = [(2, 2 * share * grade) for grade in _GRADES]
        left = duration - sum(part for _, part in parts)
        parts.append((max(1, math.ceil(left / self.time_step - 1e-9)), left))
        times, poses, now = [], [], 0.0
        for count, part in parts:
            times.append(now + part * np.arange(1, count + 1) / count)
            poses.append(self.steps(count, part)[0])
            now += part
        self._jumped = False
        times[-1][-1] = duration
        return np.concatenate(times), np.concatenate(poses)

    def steps(self, count: int, duration: float, *, shapes: int = 0) -> tuple[Floats, Floats]:
        """Advance in `count` equal steps: poses (count, 6) and the last `shapes` shapes (K, n, N, 3)."""
        poses, seen = np.full((count, 6), np.nan), np.empty((shapes, *self.state.x.shape))
        going = advance(self.body, self._head_length, self.state, duration / count, count, TOLERANCE, poses, seen)
        self.failed = self.failed or not going
        return poses, seen

    def flip(self) -> None:
        """Reverse the motor: the shape goes on, velocities start from their mirror image."""
        self.body = self.body._replace(omega=-self.body.omega)
        self.state.u[:] *= _REVERSED
        self.state.x_dot[:] = 0.0
        self._jumped = True

    @property
    def pose(self) -> Floats:
        """(x, y, ψ) of the head's centre."""
        return self.state.pose[[X, Y, YAW]]

    @property
    def omega_t(self) -> float:
        """Spin of the tails."""
        return float(self.body.omega + self.body.gain * self.state.u[3])
