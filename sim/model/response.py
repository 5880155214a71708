"""The response of a robot to a flip of its motor, as curves over the dwell.

After a flip the tails need about 0.7 time units to turn over, and meanwhile the robot lags the circle of its new
steady motion. With g(T) the pose change in a dwell of length T, in the frame of the pose at the flip,

    g(T) = lag(T) ∘ circle(T),   lag = (Δz, Δx, Δψ)

and the lag stops changing after about two time units. Three things change it:

    memory   after a dwell that was too short for the tails to turn over, this is added to the lag. What came
             before that dwell hardly matters (below 1e-4 l and rad where no dwell is shorter than 0.3)
    rest     the lag of the first dwell of all, from straight tails at rest
    spread   the phase of the disc at the flip is unknown: curves are means over it, and this is the deviation of a
             lag from the mean pose of a turn before the flip to that of a turn after it. How the head wobbles in a
             turn comes and goes; what is left adds up over the flips. A single tail turns the head by so much in a
             turn that where the first one begins matters more; its deviation is that from pose to pose, of all
             dwells together

Equal dwells of T make the net speed v̄ = |p + Rot(Δψ) M p| / 2T with g = (p, Δψ) and M the mirror image. Curves of
a reversed motor are seen as for a positive one. Units: l, μ0 l⁴/EI. `sim.motion.response` simulates these curves;
data set, look-up table and planner share them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from common.arrays import Flags, Floats

DWELLS = np.geomspace(0.2, 4.0, 25)  # T̄ of the curves
BEFORE = np.geomspace(0.2, 1.2, 16)  # T̄ of the dwell before
FORGOTTEN = 1.4  # T̄ of the dwell before from which on the response is that after a long one
LAG_PARTS = ("z", "x", "psi_rad")  # of a lag: forward, to the side of the new turn, heading
LAGS = tuple(f"lag_{part}" for part in LAG_PARTS)  # columns
SETTLED = 2.0  # time units after a flip from which the lag is constant


@dataclass(frozen=True)
class Responses:
    """Response of B robots, over D dwells and K dwells before; lags are (Δz, Δx, Δψ) in l, l, rad; NaN if
    failed. The net speed is NaN for dwells shorter than the first before."""

    lag: Floats  # (B, D, 3)
    memory: Floats  # (B, K, D, 3), added to the lag
    rest: Floats  # (B, D, 3): the lag of a first dwell
    spread: Floats  # (B, D, 3), standard deviation of the lag over the disc's phase at the flip
    net_speed: Floats  # (B, D), of equal dwells
    failed: Flags  # (B,)
    stepped: Flags  # (B,): by time steps
    before: Floats = field(default_factory=BEFORE.copy)  # (K,), T̄ of the dwell before, of `memory`


def at_equal_dwells(memory: Floats, knots: Floats = BEFORE, dwells: Floats = DWELLS) -> Floats:
    """Interpolate memory (..., K, D, 3) where the dwell before is as long as the dwell, (..., D, 3)."""
    return np.stack([memory_after(memory, dwell, knots)[..., i, :] for i, dwell in enumerate(dwells)], -2)


def memory_after(memory: Floats, before: float, knots: Floats = BEFORE) -> Floats:
    """Interpolate memory (..., K, D, 3) to a dwell `before`, (..., D, 3): linear between `knots` and FORGOTTEN."""
    if before >= FORGOTTEN:
        return np.zeros_like(memory[..., 0, :, :])
    k = max(int(np.searchsorted(knots, before, side="right")) - 1, 0)
    if k == len(knots) - 1:
        return (FORGOTTEN - before) / (FORGOTTEN - knots[k]) * memory[..., k, :, :]
    share = (before - knots[k]) / (knots[k + 1] - knots[k])
    return (1 - share) * memory[..., k, :, :] + share * memory[..., k + 1, :, :]
