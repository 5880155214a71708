"""Mesh and step of time stepping, and the most work that a run may ask for.

At the control robot 12 edges and 24 steps a revolution miss ω_yr by 1 %; high ω̄ needs more, so the default follows
ω̄. Work is counted in nodes moved by one step each; a node takes about 0.6 µs. Flow from part to part makes a step
of M nodes cost as much as 3 M steps without.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim.mechanics.flow import has_flow
from sim.model.body import Body

MOST_WORK = 1e8  # of one robot in a table: about a minute
MOST_REPLAY_WORK = 3e9  # of one schedule: about half an hour
_LONGEST_STEP = 0.04  # time units: the tails' memory is about 0.7
_FLOW = 3.0  # steps' worth of work for each node that a node's flow reaches


@dataclass(frozen=True)
class Resolution:
    """Edges a tail and time steps a motor revolution."""

    edges: int
    steps: int

    @staticmethod
    def fitting(omega_bar: float) -> Resolution:
        """The default for a motor speed: within 1 % of the limit up to ω̄ = 110."""
        speed = abs(omega_bar)
        if speed < 20:
            return Resolution(16, 24)
        if speed < 60:
            return Resolution(16, 36)
        return Resolution(20, 48)

    @staticmethod
    def for_tracks(omega_bar: float) -> Resolution:
        """The default where an error of the yaw rate adds up: about 0.2 % in it."""
        plain = Resolution.fitting(omega_bar)
        return Resolution(plain.edges + 8, 2 * plain.steps)

    def refined(self) -> Resolution:
        """The same mesh with half the step."""
        return Resolution(self.edges, 2 * self.steps)

    def finer(self, factor: int) -> Resolution:
        """Edges and steps `factor` times as many."""
        return Resolution(factor * self.edges, factor * self.steps)

    def work_of_a_step(self, body: Body, tails: int) -> float:
        """Nodes moved by one step, flow counted in."""
        nodes = self.edges * tails
        return nodes * (1 + _FLOW * nodes) if has_flow(body) else float(nodes)


def time_step(omega_bar: float, resolution: Resolution) -> float:
    """dt for a motor speed: a share of a motor revolution, but never longer than a part of the tails' memory."""
    with np.errstate(over="ignore"):
        return min(float(2 * math.pi / (resolution.steps * np.float64(abs(omega_bar)))), _LONGEST_STEP)


def steps_in(duration: float, dt: float) -> float:
    """Steps of at most dt in a duration; a float, since there may be more than any integer type holds."""
    with np.errstate(over="ignore", divide="ignore"):
        return max(1.0, float(np.ceil(np.float64(duration) / dt - 1e-9)))
