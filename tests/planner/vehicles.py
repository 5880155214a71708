"""Vehicles for the planner's tests: the control robot's numbers, without model or simulator."""

from __future__ import annotations

import numpy as np

from planner.vehicle import Vehicle
from sim.mechanics import planar

ERRORS = {
    "v_x": 0.003,
    "v_z": 0.001,
    "omega_yr_bar": 0.003,
    "lag_x": 0.001,
    "lag_z": 0.001,
    "lag_psi_rad": 0.001,
}


def vehicle(*, yaw: float = 0.0489, sway: float = 0.0424, surge: float = 0.0179, lag: float = 1.0) -> Vehicle:
    """A mirror-symmetric vehicle; `lag` scales the response to a switch (0: instantaneous circles)."""
    twist = np.array([surge, sway, yaw])
    dwells = np.array([0.0, 0.3, 0.7, 1.0, 4.0])
    table = lag * np.array([0, 1, 1, 1, 1])[:, None] * np.array([-0.0018, -0.0009, 0.0013])
    return Vehicle(
        twist=np.stack([twist, twist * planar.MIRROR]),
        dwells=dwells,
        lag=np.stack([table, table * planar.MIRROR]),
        relative_error=ERRORS,
        tail_gap=2.4,
    )
