"""Whether tails that touch keep moving alike.

An orbit is the motion in which all tails move alike. Tails that push against each other may leave it, as a ring of
coins that is pressed from outside buckles. Take the robot at one phase, and let each tail differ a little from the
others: the balance r(x, ẋ, u) = 0, t(x, ẋ, u) = 0 says how the difference δx e^{λt} grows,

    (r_x + λ r_ẋ) δx + r_u δu = 0,   (t_x + λ t_ẋ) δx + t_u δu = 0.

Derivatives are differences of the residual. In the disc frame an orbit's shape changes slowly, so λ is taken as if
it did not change. Left out: growth through that change over a revolution. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.linear.spectral import differentiation
from sim.mechanics.balance import tail_spin
from sim.model.body import Body
from sim.solve.orbit import FIRST_PHASE
from sim.solve.rates import in_stage
from sim.solve.residual import fill_residual, new_room

_RATES = 1e3, 2e3  # 1/τ of two time steps, from which the parts in x and in ẋ are told apart
_STEP = 1e-7  # in l, and of 1 + |ω|


def growth(body: Body, tails: int, x: Floats, u: Floats) -> float:
    """Compute the largest real part of λ over |ω|, on an orbit x (n, M, 3), u (P, 4) of N tails.

    Above 0 the tails leave the motion in which they move alike. The error of the mesh is a few hundredths.
    """
    instants = x.shape[1] // tails
    spin = np.array([tail_spin(body, now) for now in u])
    x_dot = np.einsum("ml,klc->kmc", differentiation(x.shape[1]), x) * np.tile(spin, tails)[:, None]
    shape, rate = (np.ascontiguousarray(a[:, ::instants]) for a in (x, x_dot))
    near, far = (_slopes(body, shape, rate, u[0], k) for k in _RATES)
    by_rate = (far - near) / (_RATES[1] - _RATES[0])
    by_place = near - _RATES[0] * by_rate
    size = shape.size
    through = near[:size, size:] @ np.linalg.inv(near[size:, size:])
    place, speed = (m[:size, :size] - through @ m[size:, :size] for m in (by_place, by_rate))
    return float(np.linalg.eigvals(-np.linalg.solve(speed, place)).real.max() / abs(body.omega))


def _slopes(body: Body, x: Floats, x_dot: Floats, u: Floats, rate: float) -> Floats:
    """Compute the derivatives of (r, t) in (x, u) where ẋ = rate (x − x*), (3 n N + 4, 3 n N + 4)."""
    rates = in_stage(rate, FIRST_PHASE - tail_spin(body, u) / rate, x - x_dot / rate)
    at = np.concatenate([x.reshape(-1), u])
    steps = np.where(np.arange(len(at)) < x.size, _STEP, _STEP * (1 + abs(body.omega)))
    room, r, t = new_room(x, u[None]), np.empty_like(x), np.empty((1, 4))
    jacobian = np.empty((len(at), len(at)))
    for i, step in enumerate(steps):
        ends = []
        for sign in (-1, 1):
            moved = at.copy()
            moved[i] += sign * step
            fill_residual(body, rates, moved[: x.size].reshape(x.shape), moved[None, x.size :], room, r, t)
            ends.append(np.concatenate([r.reshape(-1), t[0]]))
        jacobian[:, i] = (ends[1] - ends[0]) / (2 * step)
    return jacobian
