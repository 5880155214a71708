"""A rod that is turned about its axis at one end in a viscous fluid: when it begins to whirl.

The fluid's torque ξ_r ω per length twists the rod. Its forces are those of `sim.mechanics.frames`, differentiated
by differences. Units: EI = l = μ0 = 1.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from common.arrays import Floats
from sim.mechanics.balance import motion_at
from sim.mechanics.frames import add_frames
from sim.mechanics.geometry import measure, new_geometry
from sim.model.body import Body
from tests.sim.robots import control, first_body

_WIDTH = 1e-5


def whirling(edges: int) -> tuple[float, float]:
    """Find the critical spin, ω ξ_r l²/EI, and the frequency of whirling there, χ ζ⊥ l⁴/EI."""
    body = first_body(control(N=1, tail_spin_drag=1.0))
    drag = body.nonlocal_terms.tail_spin_drag

    def growth(torque: float) -> complex:
        """Return the rate of growth, times ζ⊥, of the bend that grows fastest at ω ξ_r l²/EI = torque."""
        rates = np.linalg.eigvals(bending_rates(body._replace(omega=torque / drag), edges))
        return complex(rates[np.argmax(rates.real)])

    critical = float(brentq(lambda torque: growth(torque).real, 7, 11, xtol=1e-6))
    return critical, abs(growth(critical).imag)


def bending_rates(body: Body, edges: int) -> Floats:
    """Differentiate ζ⊥ times the velocities of the nodes across a straight tail, seen from the lab, (2n, 2n)."""
    straight = np.zeros((edges, 3))
    straight[:, 2] = -np.arange(1, edges + 1) / edges
    straight[:, 0] = body.offset
    cells = np.full(edges, 1 / edges)
    cells[-1] /= 2
    columns = []
    for k in range(edges):
        for c in range(2):
            moved = np.zeros_like(straight)
            moved[k, c] = _WIDTH
            ahead, behind = (across(body, straight + sign * moved) for sign in (1, -1))
            columns.append(((ahead - behind) / (2 * _WIDTH) / cells[:, None]).ravel())
    return np.array(columns).T


def across(body: Body, x: Floats) -> Floats:
    """Compute the elastic forces on the free nodes x (n, 3), across the axis, (n, 2)."""
    n = len(x)
    geometry, moments = new_geometry(np.empty(0), n, 1), np.zeros((1, 3))
    measure(geometry, x[:, None], body.offset, body.axial_stiffness)
    add_frames(body, geometry, motion_at(body, np.zeros(4), 0.0), 0, np.zeros((n, 1, 3)), moments)
    force = geometry.force[:, 0]
    return np.asarray(np.concatenate([force[1:], np.zeros((1, 3))]) - force)[:, :2]
