"""Small perturbations of an orbit, in which every tail may move differently.

With the disc's phase φ as a label, tail j of a perturbed robot is δx_j = e^{σt} q(φ + 2πj/N), and its velocities
change by e^{σt} p(φ); q has the period 2π, p the period 2π/N. Every perturbation is a sum of these: the shift by
one tail and an N-th of a turn has no other eigenvectors, since σ is defined up to whole multiples of i N ω_t. So
q is collocated at the phases of the orbit, and ẋ in Newton's equations changes by ω_t ∂q/∂φ + σ q:

    J q + σ B q = 0,   J = ∂(r, t)/∂(x, u),   B = ∂(r, t)/∂ẋ

The phase of the disc is a label, not an unknown, and the pose does not occur. So there is no neutral direction.
With a shift s, Arnoldi's method is applied to −(J + s B)⁻¹ B, whose eigenvalues are 1/(σ − s). J + s B is the
matrix of `sim.solve.newton` for ẋ = ω_t ∂x/∂φ + s (x − x*), factorised once; each vector costs one solution.
Robots are in lanes (`sim.solve.grouping`).

If M is even, the trigonometric interpolant has a component (−1)^m without a derivative. A perturbation of this
form would neither turn nor decay with its neighbours, and could look unstable. Here it decays at the
rate ω_t M/2. Units: l, μ0 l⁴/EI, EI/l².

Source: Saad, *Numerical Methods for Large Eigenvalue Problems* (2011), ch. 6 for Arnoldi's method.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from common.arrays import Floats
from sim.jit import compiled, inlined
from sim.lanes import choose, lanes, less, somewhere, zeros
from sim.linear.blocks import apply_blocks
from sim.linear.lane_arrays import choose_all, combine, divide, largest_entry, scalar_product, subtract_multiple
from sim.model.body import Body
from sim.solve.grouping import InLanes, group_of, reaches_further
from sim.solve.linearise import linearise
from sim.solve.newton import Workspace, new_unknowns, new_workspace, solve_linear
from sim.solve.rates import Rates, in_transient
from sim.solve.residual import fill_residual

_TOLERANCE = 1e-3  # of GMRES
_CANCELS = 0.1  # smaller parts of a vector are made orthogonal again
_STEP = 1e-6  # finite-difference step of the largest entry, in l


@compiled
def arnoldi(
    robots: InLanes, x: Floats, u: Floats, shifts: Floats, by_phase: Floats, first: Floats, projected: Floats
) -> None:
    """Fill `projected` (G, K + 1, K, W) for orbits x (G, n, M, 3, W), u (G, P, 4, W) with shifts (G, W).

    Args:
        by_phase: d/dφ, (M, M).
        first: a unit vector, (3 n M,).
    """
    shapes, velocities = lanes(x), lanes(u)
    shift, out = lanes(shifts), lanes(projected)
    count = out.shape[2]
    basis = zeros(shapes, (count + 1, first.size))
    image, du = zeros(shapes, shapes[0].shape), zeros(shapes, velocities[0].shape)
    vector_of_image = image.reshape(image.size)
    work = new_workspace(in_transient(shift[0], by_phase, shapes[0]), shapes[0], velocities[0])
    for g in range(len(shapes)):
        (body, where), at_x, at_u, matrix = group_of(robots, g), shapes[g], velocities[g], out[g]
        rates = in_transient(shift[g], by_phase, at_x)
        linearise(body, rates, at_x, at_u, work.scratch, work.equations)
        for k in range(first.size):
            basis[0, k] = 0.0 * shift[g] + first[k]
        for i in range(count):
            _by_rate(body, rates, at_x, at_u, where, work, basis[i], image, du)
            solve_linear(body, rates, at_x, at_u, work, i == 0, _TOLERANCE, where, image, du)
            size = _orthogonalise(basis, i, vector_of_image, matrix)
            matrix[i + 1, i] = size
            divide(basis[i + 1], vector_of_image, size)


@compiled
def _orthogonalise(basis: Floats, i: int, image: Floats, projected: Floats) -> Any:
    """Make an image orthogonal to the first i + 1 vectors, again where digits cancelled; return its length."""
    size = np.sqrt(scalar_product(image, image))
    before = size * np.inf
    going = less(size, _CANCELS * before)
    parts = zeros(image, (i + 1,))
    while somewhere(going):
        for j in range(i + 1):
            parts[j] = choose(going, scalar_product(basis[j], image), 0.0)
        for j in range(i + 1):
            projected[j, i] += parts[j]
            subtract_multiple(image, parts[j], basis[j])
        before = choose(going, size, before)
        size = choose(going, np.sqrt(scalar_product(image, image)), size)
        going = going * less(size, _CANCELS * before)
    return size


@inlined
def _by_rate(
    body: Body, rates: Rates, x: Floats, u: Floats, where: Any, work: Workspace, q: Floats, dx: Floats, du: Floats
) -> None:
    """Compute −B q, (n, M, 3) and (P, 4): the drag on moving nodes, and by differences what else depends on ẋ."""
    du[:] = 0.0
    moving = q.reshape(x.shape)
    apply_blocks(dx, work.equations.resistance, moving)
    further = where * reaches_further(body)
    if not somewhere(further):
        return
    step, start = _STEP / largest_entry(q), zeros(x, x.shape)
    ends = new_unknowns(x, u), new_unknowns(x, u)
    for side in range(2):  # ẋ changes by −(start − x) · shift
        combine(start, 1.0, x, (2 * side - 1) * step, moving)
        moved = Rates(rates.rate, rates.phase, rates.differentiation, start)
        fill_residual(body, moved, x, u, where, work.scratch, ends[side].x, ends[side].u)
    share = 1 / (2 * step * rates.rate)
    combine(start, share, ends[1].x, -share, ends[0].x)
    choose_all(dx, further, start, dx)
    combine(ends[0].u, share, ends[1].u, -share, ends[0].u)
    choose_all(du, further, ends[0].u, du)
