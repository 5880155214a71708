"""How far a plan can stray from its reference.

With hysteresis h = Ω T and line of sight Δ = R′/(1 − κ̄ R′) (R′ = R cos θ, κ̄ the reference's largest
curvature) the pivot's cross-track error and the heading's swing bound the tracked point's distance from
the path, uniformly in the path's length:

    |e| ≤ V T [cos θ/(1 − κ̄ R cos θ) + 2 sin θ] = Ω T [R′/(1 − κ̄ R′) + 2 a],

where T is the minimum dwell. A flip adds its lag: at most |lag_x, lag_z| + 2 a |lag_ψ| + Δ |lag_ψ|. This is
the *guaranteed* error if the look-up table were exact; `tube` is the extra distance that the table's
own held-out errors cause over the whole open-loop schedule, by drawing vehicles at random.
Source: ours; checked against random paths in the tests.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planner.schedule import predict
from planner.vehicle import Vehicle

TUBE_DRAWS = 64
TUBE_LEVEL = 0.95


def look_ahead(vehicle: Vehicle, curvature: float) -> float:
    """Δ = R′/(1 − κ̄ R′)."""
    return vehicle.pivot_radius / (1 - curvature * vehicle.pivot_radius)


def guaranteed(vehicle: Vehicle, rod: float, curvature: float, dwell: float) -> float:
    """Bound on the distance from the reference [l], for the exact vehicle; see the module."""
    ahead = look_ahead(vehicle, curvature)
    swing = vehicle.yaw_rate * dwell * (ahead + 2 * rod)
    lag = vehicle.lag_at(1, np.array(dwell))
    flip = float(np.hypot(lag[0], lag[1]) + (ahead + 2 * rod) * abs(lag[2]))
    return swing + flip


def tube(
    vehicle: Vehicle,
    first_direction: int,
    dwells: NDArray[np.float64],
    start: NDArray[np.float64],
    offset: float,
    *,
    seed: int = 0,
) -> float:
    """95 % quantile of the largest distance between the predicted track and one with table errors [l]."""
    rng = np.random.default_rng(seed)
    nominal = predict(vehicle, first_direction, dwells, start, offset)
    worst = []
    for _ in range(TUBE_DRAWS):
        drawn = predict(vehicle.perturbed(rng), first_direction, dwells, start, offset)
        worst.append(np.linalg.norm(drawn[:, :2] - nominal[:, :2], axis=1).max())
    return float(np.quantile(worst, TUBE_LEVEL))
