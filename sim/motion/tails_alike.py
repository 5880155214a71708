"""Orbits in which the tails move alike, as a curve along an input (`sim.motion.continuation`).

The equations are those of `sim.solve.orbit` on a fixed mesh and a fixed number of phases. With J = ∂F/∂z, the
bordered system is solved by elimination,

    J v = ∂F/∂s,   J w = −F,   ds = (−defect − row·w)/(row_s − row·v),   dz = w − ds v,

with one factorisation. Lengths are scaled by √(nM) and velocities by √P and the motor's speed, so that |dz| is
about the mean displacement of a node.

On 12 edges the yaw rate is up to 1 % off, and so is the input of a fold. Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sim.arrays import Floats
from sim.linear.spectral import with_phases
from sim.mechanics.geometry import turned_edges
from sim.model.body import Body
from sim.motion.revolution import Turn
from sim.solve.assembly import row
from sim.solve.orbit import mean_motion, residuals_on_orbits, solve_at_orbits, turns_forward
from sim.solve.rates import FIRST_PHASE
from sim.solve.refinement import orbit_on_mesh

EDGES = 12
_LEAST_PHASES = 24
_WIDTH = 1e-6  # finite-difference step of s
_ALIKE = 0.02  # largest distance between nodes of tails that move alike, in l
_TURN = 2 * np.pi


def instants(tails: int) -> int:
    """Choose P, the number of instants in an N-th of a turn; an odd one, which exponents need."""
    fewest = -(-_LEAST_PHASES // tails)
    return fewest + 1 - fewest % 2


class TailsAlike:
    """Orbits of a robot with N tails whose numbers depend on s."""

    tolerance = 1e-7

    def __init__(self, body_at: Callable[[float], Body], tails: int, edges: int = EDGES):
        self.body_at, self.tails, self.edges = body_at, tails, edges
        self.instants = instants(tails)
        phases = tails * self.instants
        self._shape = (edges, phases, 3)
        middle = abs(body_at(0.5).omega)
        self._x_scale = np.sqrt(edges * phases)
        self._u_scale = np.sqrt(self.instants) * (1 + middle)

    def pack(self, x: Floats, u: Floats, s: float) -> Floats:
        """Scale x (n, M, 3), u (P, 4) and s to y."""
        return np.concatenate([x.ravel() / self._x_scale, u.ravel() / self._u_scale, [s]])

    def unpack(self, y: Floats) -> tuple[Floats, Floats]:
        """Return x (n, M, 3) and u (P, 4)."""
        nodes = int(np.prod(self._shape))
        return y[:nodes].reshape(self._shape) * self._x_scale, y[nodes:-1].reshape(-1, 4) * self._u_scale

    def start(self, s: float) -> Floats | None:
        """Solve from straight tails; None where Newton's method fails."""
        solved, x, u = orbit_on_mesh(self.body_at(s), self.tails, self.edges)
        return self.resampled(x, u, s) if solved else None

    def resampled(self, x: Floats, u: Floats, s: float) -> Floats:
        """Interpolate an orbit x (n, M', 3), u (P', 4) to the phases of this curve."""
        return self.pack(with_phases(x, self._shape[1]), with_phases(u, self.instants), s)

    def correction(self, y: Floats, row: Floats, defect: float) -> Floats:
        """See `sim.motion.continuation.Equations`."""
        return self._solved(y, row, -self._residual(y, float(y[-1])), -defect)

    def tangent(self, y: Floats, row: Floats) -> Floats:
        """See `sim.motion.continuation.Equations`."""
        return self._solved(y, row, None, 1.0)

    def moved(self, y: Floats, dy: Floats) -> Floats:
        """See `sim.motion.continuation.Equations`; with non-local effects edges are turned, not stretched."""
        x, u = self.unpack(y)
        dx, du = self.unpack(dy)
        s = float(y[-1] + dy[-1])
        body = self.body_at(s)
        x = turned_edges(x, 1.0, dx, body.offset) if any(body.nonlocal_terms) else x + dx
        return self.pack(x, u + du, s)

    def is_valid(self, y: Floats) -> bool:
        """Tell whether the tails turn with the motor at all phases."""
        return bool(turns_forward(self.body_at(float(y[-1])), self.unpack(y)[1]))

    def means(self, y: Floats) -> Floats:
        """Average (ω_t, ω_h, ω_yr, v_x, v_z) of the head's centre, (5,)."""
        return mean_motion(self.body_at(float(y[-1])), self.unpack(y)[1])

    def _numbers(self, s: float) -> Floats:
        """Return the robot's numbers, (1, K')."""
        return row(self.body_at(s))

    def _residual(self, y: Floats, s: float) -> Floats:
        """Compute F at the shape of y, with the robot's numbers at s."""
        x, u = self.unpack(y)
        r, t, _ = residuals_on_orbits(self._numbers(s), x[None], u[None])
        return np.concatenate([r.ravel(), t.ravel()])

    def _solved(self, y: Floats, row: Floats, right: Floats | None, bottom: float) -> Floats:
        """Solve F'(y) dy = right, row·dy = bottom."""
        s = float(y[-1])
        by_s = (self._residual(y, s + _WIDTH) - self._residual(y, s - _WIDTH)) / (2 * _WIDTH)
        sides = np.array([by_s] if right is None else [by_s, right])
        x, u = self.unpack(y)
        nodes = x.size
        r, t = sides[:, :nodes].reshape(1, -1, *x.shape), sides[:, nodes:].reshape(1, -1, *u.shape)
        dx, du = solve_at_orbits(self._numbers(s), x[None], u[None], r, t)
        packed = [self.pack(a, b, 0.0)[:-1] for a, b in zip(dx[0], du[0], strict=True)]
        v = packed[0]
        w = np.zeros_like(v) if right is None else packed[1]
        ds = (bottom - row[:-1] @ w) / (row[-1] - row[:-1] @ v)
        return np.append(w - ds * v, ds)


def orbit_from_turn(turn: Turn, instants: int) -> tuple[Floats, Floats] | None:
    """Return x (n, M, 3) and a guess of u (P, 4) for P instants in an N-th of a turn; None if the tails differ.

    In an orbit, tail j at disc phase φ has the shape of tail 0 at φ + 2πj/N (`sim.solve.orbit`).

    Args:
        turn: one turn of a steady motion, with its shapes.
        instants: P.
    """
    from scipy.interpolate import CubicSpline  # slow to import

    if not (np.diff(turn.phases) * turn.phases[-1] > 0).all():
        return None
    phases, order = np.unique(turn.phases % _TURN, return_index=True)
    ends, shapes = np.append(phases, phases[0] + _TURN), turn.shapes[[*order, order[0]]]
    spline, tails = CubicSpline(ends, shapes, bc_type="periodic"), shapes.shape[2]
    count = tails * instants
    nodes = FIRST_PHASE + _TURN * np.arange(count) / count
    x = spline(nodes)[:, :, 0]
    for tail in range(1, tails):
        if np.abs(spline(nodes - _TURN * tail / tails)[:, :, tail] - x).max() > _ALIKE:
            return None
    u = np.tile(turn.state.u, (instants, 1))
    return np.ascontiguousarray(x.transpose(1, 0, 2)), u
