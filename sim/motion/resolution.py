"""Mesh and step of time stepping, and the largest work that a run may take.

With 12 edges and 24 steps a revolution the error of ω_yr is 1 % for the control robot. High ω̄ needs more, so the
default grows with ω̄. The unit of work is one node moved by one step, about 0.6 µs. With flow between the parts, a
step of M nodes costs as much as 3 M steps without flow. Contact costs as much as 500 nodes for each tail at each
other one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim.mechanics.flow import has_flow
from sim.mechanics.tail_contact import has_contact
from sim.model.body import Body

MOST_WORK = 1e8  # of one robot in a table: about a minute
MOST_REPLAY_WORK = 3e9  # of one schedule: about half an hour
COARSER = 1.5  # edges and steps over those of a coarser run
_LONGEST_STEP = 0.04  # time units: the tails need about 0.7 to turn over
_FLOW = 3.0  # work for the flow of one node at another, in units of a node's step
_CONTACT = 500.0  # the same for contact of one tail with another


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
