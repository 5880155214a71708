"""A straight rod clamped at one end, from the formulas of `sim.mechanics.rod` and `sim.mechanics.drag` in NumPy.

Shapes that balance a load, loads at which the rod buckles, and rates at which small bends grow in a viscous fluid.
Derivatives are exact: the forces are analytic, so a complex step differentiates them. The rod hangs from the
origin along −e_z; bends are in the plane of e_y and e_z. Units: EI = l = μ0 = 1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.linear.vectors import Vector
from sim.mechanics import rod
from sim.mechanics.drag import node_resistance, tail_coefficients

DOWN = np.array([0.0, 0.0, -1.0])
_STEP = 1e-30  # of complex differentiation
Load = Callable[[Any], Any]  # unit tangents of the free nodes (n, 3, K) -> force per length there


@dataclass(frozen=True)
class ClampedRod:
    """A rod of n edges; free nodes are arrays (n, 3) or, for K shapes, (n, 3, K)."""

    edges: int
    slenderness: float = 500.0  # l/r0

    @property
    def axial_stiffness(self) -> float:
        """EA = 4 (l/r0)²."""
        return 4 * self.slenderness**2

    def straight(self) -> Any:
        """Return the free nodes of the straight rod."""
        return np.arange(1, self.edges + 1)[:, None] / self.edges * DOWN

    def measured(self, x: Any) -> tuple[Vector, Vector, Any, Any, Any]:
        """Compute tangents before and after each joint, lengths before and after, and 1/l_k of the joints."""
        edge = np.concatenate([x[:1], np.diff(x, axis=0)])
        length = np.sqrt((edge * edge).sum(1, keepdims=True))
        down = np.broadcast_to(DOWN.reshape(3, *[1] * (x.ndim - 2)), x.shape[1:])
        tangent = np.concatenate([down[None], edge / length])
        weight = np.full((self.edges, *[1] * (x.ndim - 2)), float(self.edges))
        weight[0] *= 2
        ones = np.ones((1, *x.shape[2:]))
        return (
            _split(tangent[:-1]),
            _split(tangent[1:]),
            np.concatenate([ones, length[:-1, 0]]),
            length[:, 0],
            weight,
        )

    def energy(self, x: Any) -> Any:
        """Compute the elastic energy, (K,)."""
        before, after, _, length, weight = self.measured(x)
        cosine = sum(a * b for a, b in zip(before, after, strict=True))
        stretched = 0.5 * self.axial_stiffness * (length * self.edges - 1) ** 2 / self.edges
        bent = 2 * weight * (1 - cosine) / (1 + cosine)
        return (stretched + bent).sum(0)

    def forces(self, x: Any, load: Load) -> Any:
        """Compute the elastic force and the load on each free node."""
        before, after, length_before, length, weight = self.measured(x)
        _, first, _, by_after, by_before = rod.bend(before, after, length_before, length, weight)
        first_next, *by_next = (_next(a) for a in (first, *by_before))
        carried = np.stack(
            rod.edge_force(
                after, length, self.edges, self.axial_stiffness, first, by_after, first_next, tuple(by_next)
            ),
            1,
        )
        cells = np.full(self.edges, 1 / self.edges)
        cells[-1] /= 2
        cells = cells.reshape(-1, *[1] * (x.ndim - 1))
        return _next(carried) - carried + cells * load(self.tangents(x))

    def tangents(self, x: Any) -> Any:
        """Compute the unit tangents of the free nodes: the mean of the edges beside each."""
        tangent = np.stack(self.measured(x)[1], 1)
        total = np.concatenate([tangent[:-1] + tangent[1:], tangent[-1:]])
        return total / np.sqrt((total * total).sum(1, keepdims=True))

    def slope(self, x: Any, load: Load) -> Any:
        """Differentiate the forces in the positions, (3n, 3n)."""
        steps = x[..., None] + 1j * _STEP * np.eye(x.size).reshape(*x.shape, x.size)
        return self.forces(steps, load).imag.reshape(x.size, -1) / _STEP

    def balanced(self, load: Load, shares: Sequence[float] = (1.0,), *, axial: bool = False) -> Any:
        """Solve for the shape under a load that grows to its whole in shares; `axial`: the rod stays straight.

        Raises:
            ArithmeticError: Newton's method does not converge.
        """
        x = self.straight()
        for share in shares:
            for _ in range(200):

                def part(tangents: Any, share: float = share) -> Any:
                    return share * load(tangents)

                free = np.arange(x.size)[2 if axial else 0 :: 3 if axial else 1]
                step = np.zeros(x.size)
                step[free] = np.linalg.solve(
                    self.slope(x, part)[np.ix_(free, free)], -self.forces(x, part).flat[free]
                )
                x = x + step.reshape(x.shape) * min(1.0, 0.02 / np.abs(step).max())
                if np.abs(step).max() < 1e-9:
                    break
            else:
                raise ArithmeticError(f"no balance at {share:g} of the load")
        return x

    def across(self, matrix: Any) -> Any:
        """Return the part of a matrix (3n, 3n) that bends along e_y."""
        return matrix.reshape(self.edges, 3, self.edges, 3)[:, 1, :, 1]

    def least_stiffness(self, load: Load) -> float:
        """Compute the smallest eigenvalue of the stiffness against bends under a load along the rod."""
        return float(np.linalg.eigvals(-self.across(self.slope(self.balanced(load, axial=True), load))).real.min())

    def growths(self, load: Load) -> Any:
        """Compute the rates of growth of small bends in a fluid, complex, (n,)."""
        x = self.balanced(load, axial=True)
        parallel, perp = tail_coefficients(self.slenderness)
        cells = np.full(self.edges, 1 / self.edges)
        cells[-1] /= 2
        drag: Any = np.array(node_resistance(_split(self.tangents(x)), cells * perp, cells * (parallel - perp)))
        return np.linalg.eigvals(self.across(self.slope(x, load)) / drag[1, 1][:, None])


def dead_load(x: float, y: float, z: float) -> Load:
    """Return a load, force per length, that keeps its direction."""
    return lambda tangents: 0 * tangents + np.reshape([x, y, z], (3, *[1] * (tangents.ndim - 2)))


def _split(a: Any) -> Vector:
    return a[:, 0], a[:, 1], a[:, 2]


def _next(a: Any) -> Any:
    return np.concatenate([a[1:], 0 * a[:1]])
