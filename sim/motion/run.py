"""One robot stepped in time: mesh and step, the largest work that a run may take, flips of the motor, the pose.

With 12 edges and 24 steps a revolution the error of ω_yr is 1 % for the control robot. High ω̄ needs more, so the
default grows with ω̄. The unit of work is one node moved by one step, about 0.6 µs. With flow between the parts, a
step of M nodes costs as much as 3 M steps without flow. Contact costs as much as 500 nodes for each tail at each
other one.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass

import numpy as np

from common.arrays import Floats
from sim.mechanics.balance import tail_spin
from sim.mechanics.flow import has_flow
from sim.mechanics.tail_contact import has_contact
from sim.model.body import Body
from sim.solve.march import (
    REVERSED,
    YAW,
    Marched,
    Marcher,
    State,
    Steps,
    X,
    Y,
    equal_steps,
    joined,
    new_state,
    side_by_side,
)

MOST_WORK = 1e8  # of one robot in a table: about a minute
MOST_REPLAY_WORK = 3e9  # of one schedule: about half an hour
COARSER = 1.5  # edges and steps over those of a coarser run
_LONGEST_STEP = 0.04  # time units: the tails need about 0.7 to turn over
_FLOW = 3.0  # work for the flow of one node at another, in units of a node's step
_CONTACT = 500.0  # the same for contact of one tail with another
BROKE_DOWN = "Newton's method did not converge in a time step"
TOO_MUCH = "it would take more time steps than a row may ask for"
_GRADES = (1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2)  # parts of a step, two of each, after a jump of the motor's speed


@dataclass(frozen=True)
class Resolution:
    """Number of edges in a tail and of time steps in a motor revolution."""

    edges: int
    steps: int

    @staticmethod
    def fitting(omega_bar: float) -> Resolution:
        """Choose the default for a motor speed: within 1 % of the limit up to ω̄ = 110."""
        speed = abs(omega_bar)
        if speed < 20:
            return Resolution(16, 24)
        if speed < 60:
            return Resolution(16, 36)
        return Resolution(20, 48)

    @staticmethod
    def for_settling(omega_bar: float) -> Resolution:
        """Choose the default for steady motion reached in time steps: the error of its yaw rate is about 0.2 %."""
        plain = Resolution.fitting(omega_bar)
        return Resolution(plain.edges + 8, 2 * plain.steps)

    @staticmethod
    def for_tracks(omega_bar: float) -> Resolution:
        """Choose the default for tracks, where an error of the yaw rate accumulates: its error is about 0.05 %."""
        plain = Resolution.fitting(omega_bar)
        return Resolution(plain.edges + 32, 2 * plain.steps)

    def refined(self) -> Resolution:
        """Return the same mesh with half the step."""
        return Resolution(self.edges, 2 * self.steps)

    def finer(self, factor: int) -> Resolution:
        """Multiply edges and steps by `factor`."""
        return Resolution(factor * self.edges, factor * self.steps)

    def coarser(self) -> Resolution:
        """Return two thirds of the edges and of the steps, at least three of each."""
        return Resolution(max(3, round(self.edges / COARSER)), max(3, round(self.steps / COARSER)))

    def work_of_a_step(self, body: Body, tails: int) -> float:
        """Estimate the work of one step, with the work for flow and contact."""
        nodes = self.edges * tails
        work = nodes * (1 + _FLOW * nodes) if has_flow(body) else float(nodes)
        return work + _CONTACT * tails * (tails - 1) if has_contact(body) else work


def time_step(omega_bar: float, resolution: Resolution) -> float:
    """Choose dt for a motor speed: a part of a motor revolution, at most _LONGEST_STEP."""
    with np.errstate(over="ignore"):
        return min(float(2 * math.pi / (resolution.steps * np.float64(abs(omega_bar)))), _LONGEST_STEP)


def steps_in(duration: float, dt: float) -> float:
    """Count steps of at most dt in a duration; a float, since the number may be too large for an integer type."""
    with np.errstate(over="ignore", divide="ignore"):
        return max(1.0, float(np.ceil(np.float64(duration) / dt - 1e-9)))


def steps_for(duration: float, dt: float, jumped: bool) -> Steps:
    """Choose the steps of some time at constant speed.

    They are equal and at most dt long, except for some short ones after a jump of the motor's speed. There all
    modes of the tails start anew, and equal steps would converge at first order only.
    """
    parts = []
    if jumped:
        share = min(dt, duration / 2 / (2 * sum(_GRADES)))
        parts = [(2 * share * grade, 2) for grade in _GRADES]
    remaining = duration - sum(part for part, _ in parts)
    return joined(
        [equal_steps(part, count) for part, count in (*parts, (remaining, int(steps_in(remaining, dt))))]
    )


def times_of(steps: Steps, duration: float) -> Floats:
    """Return the times of steps that take some time together, from their start."""
    return np.append(np.cumsum(steps.lengths)[:-1], duration)


class SteppedRobot:
    """A robot stepped in time. `failed` says why it cannot go on: BROKE_DOWN, TOO_MUCH, or empty."""

    def __init__(
        self,
        body: Body,
        tails: int,
        resolution: Resolution,
        state: State | None = None,
        *,
        reverse: Body | None = None,
        most_work: float = MOST_WORK,
    ):
        """Start from `state` (changed in place) or from rest; `most_work` is the most that it may take.

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
        self._work_left = most_work

    def copy(self) -> SteppedRobot:
        """Return an independent copy of this run."""
        duplicate = copy(self)
        duplicate.state = copied(self.state)
        return duplicate

    def can_afford(self, duration: float, *, flips: float = 0) -> bool:
        """Tell whether the work that is left is enough for this time and these flips; sets `failed` if not."""
        steps = steps_in(duration, self.time_step) + flips * 2 * len(_GRADES)
        if not self.failed and not steps * self._work_of_a_step <= self._work_left:
            self.failed = TOO_MUCH
        return not self.failed

    def go(self, duration: float) -> tuple[Floats, Floats]:
        """Advance at constant speed: times from now (count,) and the poses then, (count, 6); none if it fails."""
        if not self.can_afford(duration, flips=1):
            return np.empty(0), np.empty((0, 6))
        steps = steps_for(duration, self.time_step, self.jumped)
        self.jumped = False
        return times_of(steps, duration), self._make(steps).poses

    def steps(self, count: int, duration: float, *, shapes: int = 0) -> tuple[Floats, Floats]:
        """Advance in `count` equal steps: poses (count, 6) and the last `shapes` shapes (K, n, N, 3)."""
        swum = self._make(equal_steps(duration, count)._replace(kept=np.arange(count) >= count - shapes))
        return swum.poses, swum.kept.x

    def _make(self, steps: Steps) -> Marched:
        """Make time steps; none if it has failed, or they are too many."""
        work = len(steps.lengths) * self._work_of_a_step
        if not self.failed and work > self._work_left:
            self.failed = TOO_MUCH
        if self.failed:
            return Marched(0, np.empty((0, 6)), State(*(part[None][:0] for part in self.state)))
        self._work_left -= work
        (swum,) = side_by_side([Marcher(self.body, self.reverse, self.state, steps)])
        self.failed = "" if swum.done == len(steps.lengths) else BROKE_DOWN
        return swum

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
