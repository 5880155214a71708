"""Mesh and step of time stepping.

At the control robot 12 edges and 24 steps a revolution miss ω_yr by 1 %; high ω̄ needs more, so the default
follows ω̄.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

_LONGEST_STEP = 0.04  # time units: the tails' memory is about 0.7


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


def time_step(omega_bar: float, resolution: Resolution) -> float:
    """dt for a motor speed: a share of a motor revolution, but never longer than a part of the tails' memory."""
    return min(2 * math.pi / (resolution.steps * abs(omega_bar)), _LONGEST_STEP)
