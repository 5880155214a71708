"""Torque of a single tail whose head is held: by the simulator's balance, and by linear theory.

With the head held and no flow between tails, a tail turns at the motor's speed with a constant shape, and the
other tails do not matter. Linear theory (`sim.mechanics.linear_theory`) with a tilted clamp:
w'''' = −i S w, w(0) = a,
w'(0) = θ, w''(l) = w'''(l) = 0, and the torque about the axis is S ∫ |w|² ds in EI/l.

Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sim.arrays import Floats
from sim.mechanics.drag import tail_coefficients
from sim.model.groups import Groups
from sim.solve.assembly import bodies
from sim.solve.orbit import mean_motion
from tests.sim.robots import solve_orbit, straight_start

_HELD = 1e7  # resistance of a held head
_EDGES = 32
_TOLERANCE = 1e-8


def held_torque(groups: Groups, S: Floats, *, edges: int = _EDGES) -> Floats:
    """Compute the torque of one tail of a robot at increasing drag numbers S; NaN where it is not solved."""
    zeta_perp = tail_coefficients(groups.l_over_r0)[1]
    torque = np.full(len(S), np.nan)
    x = u = None
    for i, number in enumerate(S):
        body = bodies(replace(groups, omega_bar=number / zeta_perp, N=1))[0]
        held = np.zeros((4, 5))
        np.fill_diagonal(held, _HELD)
        body = body._replace(resistance=held)
        if x is None or u is None:
            x, u = straight_start(body, edges, 1, 1)
            u[:] = 0.0
        size = solve_orbit(body, x, u, _TOLERANCE)
        if not size < _TOLERANCE:
            break
        torque[i] = -_HELD * mean_motion(body, u)[1]
    return torque


def linear_torque(S: float, offset: float, tilt: float) -> float:
    """Compute the torque of a nearly straight tail that starts at `offset` [l] from the axis, tilted by `tilt`."""
    roots = (-1j * S) ** 0.25 * np.array([1, 1j, -1, -1j])
    ends = np.exp(roots)
    rows = [np.ones(4), roots, roots**2 * ends, roots**3 * ends]
    amplitude = np.linalg.solve(np.array(rows), np.array([offset, tilt, 0, 0]))
    arc = np.linspace(0, 1, 2001)
    w = np.exp(np.outer(arc, roots)) @ amplitude
    return float(S * np.trapezoid(np.abs(w) ** 2, arc))
