"""Certify answers of the look-up table with the simulator: the actual error of an answer, not the expected one.

    certified error = largest relative difference between table and simulator + the simulator's own error

of the spins, the yaw rate and the velocities (these relative to the speed). The simulator takes about a
millisecond a robot, and longer for one and two tails.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from sim.arrays import Floats

RATES = ("omega_t_bar", "omega_h_bar", "omega_yr_bar")
_VELOCITIES = ("v_x", "v_z")
CERTIFIED_OUTPUTS = (*RATES, *_VELOCITIES)


def certified_error(robots: Mapping[str, Floats], answer: Mapping[str, Any]) -> Floats:
    """Certify the relative error of each robot's answer, (M,); NaN where the simulator finds no steady motion."""
    from sim.motion.batches import steady_columns  # a query that is not certified needs no simulator

    simulated = steady_columns(robots, stability=False, title="certify")
    speed = np.hypot(simulated["v_x"], simulated["v_z"])
    apart = [np.abs(answer[name] / simulated[name] - 1) for name in RATES]
    apart += [np.abs(answer[name] - simulated[name]) / speed for name in _VELOCITIES]
    error = np.max(apart, axis=0) + simulated["error"]
    return np.where(simulated["converged"], error, np.nan)
