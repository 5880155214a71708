"""Net speed of robots whose motor flips at equal times: arcs of the steady motion, and lags of the response.

Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.mechanics import planar
from sim.model.response import BEFORE, DWELLS, at_equal_dwells


def twists(surge: Floats, sway: Floats, yaw_rate: Floats, sense: Floats) -> Floats:
    """Compute the steady twists (B, 3), forward, left and yaw rate, seen as for a positive motor.

    Args:
        surge, sway, yaw_rate: v_z, v_x and ω_yr, (B,) each.
        sense: direction of the motor, ±1, (B,).
    """
    return np.stack([surge, sense * sway, sense * yaw_rate], -1)


def net_speeds(twist: Floats, lag: Floats, memory: Floats, before: Floats = BEFORE) -> Floats:
    """Compute the net speed (B, D) of equal dwells of DWELLS.

    Args:
        twist: (B, 3), see `twists`.
        lag, memory: curves (B, D, 3) and (B, K, D, 3), see `sim.model.response`.
        before: lengths of the dwell before, (K,).
    """
    return planar.net_speed(twist[:, None], lag + at_equal_dwells(memory, before), DWELLS)
