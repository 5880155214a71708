"""How far a plan can stray from its reference: what is guaranteed, and what the look-up table's errors add.

With hysteresis h = Ω T and look-ahead Δ = R′/(1 − κ̄ R′) (R′ = R cos θ, κ̄ the reference's largest curvature) the
pivot's cross-track error and the heading's swing limit the tracked point's distance from the path, uniformly in
the path's length:

    |e| ≤ V T [cos θ/(1 − κ̄ R cos θ) + 2 sin θ] = Ω T [R′/(1 − κ̄ R′) + 2 a],

where T is the minimum dwell and a the distance from the pivot to the tracked point. A flip adds its lag: at most
|lag_x, lag_z| + 2 a |lag_ψ| + Δ |lag_ψ|. This is the *guaranteed* error if the look-up table were exact. The
*tube* is the extra distance that the table's own held-out errors cause over the whole open-loop schedule: a
95 % quantile over vehicles drawn at random, so no guarantee. The *stated error* is their sum.
Source: ours; checked against random paths in the tests.
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
    """Largest distance from the reference [l] of the exact vehicle; see the module."""
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
