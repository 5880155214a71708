"""The error of a plan: a guaranteed part, and what the errors of the look-up table add.

Let h = Ω T be the hysteresis and Δ = R′/(1 − κ̄ R′) the look-ahead, with R′ = R cos θ and κ̄ the largest curvature
of the reference. The cross-track error of the pivot and the swing of the heading are bounded. So the distance of
the tracked point from the path is bounded, too, however long the path is:

    |e| ≤ V T [cos θ/(1 − κ̄ R cos θ) + 2 sin θ] = Ω T [R′/(1 − κ̄ R′) + 2 a],

where T is the minimum dwell and a the distance from the pivot to the tracked point. A flip adds its lag: at most
|lag_x, lag_z| + 2 a |lag_ψ| + Δ |lag_ψ|. The sum is the *guaranteed* error: it holds if the look-up table is
exact. The *tube* is the distance that the held-out errors of the table add over the whole schedule without
feedback. It is a 95 % quantile over vehicles drawn at random, so it is no bound. The *stated error* is the sum of
both. Lengths are in l, times in μ0 l⁴/EI. Source: ours; the tests check it on random paths.
"""

from __future__ import annotations

import numpy as np

from planner.schedule import Switches, predict
from planner.vehicle import Vehicle

TUBE_DRAWS = 64
TUBE_LEVEL = 0.95


def look_ahead(vehicle: Vehicle, curvature: float) -> float:
    """Δ = R′/(1 − κ̄ R′)."""
    return vehicle.pivot_radius / (1 - curvature * vehicle.pivot_radius)


def guaranteed(vehicle: Vehicle, pivot_distance: float, curvature: float, dwell: float) -> float:
    """Bound on the distance from the reference [l] for a vehicle without errors; see the module."""
    ahead = look_ahead(vehicle, curvature)
    swing = vehicle.yaw_rate * dwell * (ahead + 2 * pivot_distance)
    lag = vehicle.lag_at(1, np.array(dwell))
    flip = float(np.hypot(lag[0], lag[1]) + (ahead + 2 * pivot_distance) * abs(lag[2]))
    return swing + flip


def tube(vehicle: Vehicle, switches: Switches, offset: float, *, seed: int = 0) -> float:
    """95 % quantile of the largest distance between the predicted track and one with table errors [l]."""
    rng = np.random.default_rng(seed)
    nominal = predict(vehicle, switches, offset)
    worst = []
    for _ in range(TUBE_DRAWS):
        drawn = predict(vehicle.perturbed(rng), switches, offset)
        worst.append(np.linalg.norm(drawn[:, :2] - nominal[:, :2], axis=1).max())
    return float(np.quantile(worst, TUBE_LEVEL))
