"""Small perturbations of an orbit, in which every tail may move differently.

With the disc's phase φ as a label, tail j of a perturbed robot is δx_j = e^{σt} q(φ + 2πj/N), and its velocities
change by e^{σt} p(φ); q has the period 2π, p the period 2π/N. Every perturbation is a sum of these: the shift by
one tail and an N-th of a turn has no other eigenvectors, since σ is defined up to whole multiples of i N ω_t. So
q is collocated at the phases of the orbit, and ẋ in Newton's equations changes by ω_t ∂q/∂φ + σ q:

    J q + σ B q = 0,   J = ∂(r, t)/∂(x, u),   B = ∂(r, t)/∂ẋ

The phase of the disc is a label, not an unknown, and the pose does not occur. So there is no neutral direction.
With a shift s, Arnoldi's method is applied to −(J + s B)⁻¹ B, whose eigenvalues are 1/(σ − s). J + s B is the
matrix of `sim.solve.newton` for ẋ = ω_t ∂x/∂φ + s (x − x*), factorised once; each vector costs one solution.

If M is even, the trigonometric interpolant has a component (−1)^m without a derivative. A perturbation of this
form would neither turn nor decay with its neighbours, and could look unstable. Here it decays at the
rate ω_t M/2. Units: l, μ0 l⁴/EI, EI/l².

Source: Saad, *Numerical Methods for Large Eigenvalue Problems* (2011), ch. 6 for Arnoldi's method.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled, compiled_exactly
from sim.lanes import zeros
from sim.linear.blocks import block, put, vector
from sim.linear.spectral import differentiation
from sim.linear.vectors import applied
from sim.model.body import Body
from sim.solve.linearise import linearise
from sim.solve.newton import Workspace, new_workspace, solve_linear
from sim.solve.orbit import FIRST_PHASE
from sim.solve.rates import Rates
from sim.solve.residual import fill_residual, is_local

_TOLERANCE = 1e-3  # of GMRES
CANCELS = 0.1  # smaller parts of a vector are made orthogonal again
_STEP = 1e-6  # finite-difference step of the largest entry, in l


@compiled
def arnoldi(body: Body, x: Floats, u: Floats, shift: float, first: Floats, count: int) -> Floats:
    """Project −(J + s B)⁻¹ B on a Krylov space.

    Args:
        x, u: the orbit, (n, M, 3) and (P, 4).
        shift: s, above 0.
        first: first vector, (n, M, 3).
        count: number of vectors K, fewer than the 3 n M unknowns.

    Returns:
        The Hessenberg matrix with the part of its last vector outside the space, (K + 1, K).
    """
    x, matrix = without_highest(x), damped_differentiation(x.shape[1], np.sign(body.omega))
    rates = Rates(shift, FIRST_PHASE, matrix, x)
    work = new_workspace(rates, x, u)
    linearise(body, rates, x, u, work.room, work.equations)
    basis, projected = np.zeros((count + 1, x.size)), np.zeros((count + 1, count))
    basis[0] = first.copy().reshape(x.size) / np.sqrt(np.sum(first * first))
    dx, du = np.empty_like(x), np.empty_like(u)
    for i in range(count):
        _by_rate(body, rates, x, u, work, basis[i].reshape(x.shape), dx, du)
        solve_linear(body, rates, x, u, work, i == 0, _TOLERANCE, dx, du)
        image = dx.reshape(x.size)
        before, size = np.inf, np.sqrt(np.dot(image, image))
        while size < CANCELS * before:  # Gram-Schmidt, again where digits cancelled
            parts = np.dot(basis[: i + 1], image)
            projected[: i + 1, i] += parts
            image -= np.dot(parts, basis[: i + 1])
            before, size = size, np.sqrt(np.dot(image, image))
        projected[i + 1, i] = size
        basis[i + 1] = image / size
    return projected


@compiled_exactly
def damped_differentiation(columns: int, sense: float) -> Floats:
    """Differentiate in φ, (M, M); the component (−1)^m decays if the motor turns with `sense`."""
    matrix = differentiation(columns)
    if columns % 2 == 0:
        for i in range(columns):
            for j in range(columns):
                matrix[i, j] += 0.5 * sense * (-1.0) ** (i - j)
    return matrix


@compiled_exactly
def without_highest(x: Floats) -> Floats:
    """Remove the component (−1)^m of x (n, M, 3), if M is even."""
    n, columns, _ = x.shape
    smooth = zeros(x, x.shape)
    smooth[:] = x
    if columns % 2 == 0:
        for k in range(n):
            for c in range(3):
                total = 0.0 * x[k, 0, c]
                for m in range(columns):
                    total += (-1.0) ** m * x[k, m, c]
                for m in range(columns):
                    smooth[k, m, c] -= (-1.0) ** m * total / columns
    return smooth


@compiled_exactly
def by_rate(resistance: Floats, q: Floats, out: Floats) -> None:
    """Compute −B q of robots with local effects: the drag on moving nodes, (n, M, 3)."""
    for k in range(q.shape[0]):
        for m in range(q.shape[1]):
            put(out, k, m, applied(block(resistance, k, m), vector(q, k, m)))


@compiled
def _by_rate(
    body: Body, rates: Rates, x: Floats, u: Floats, work: Workspace, q: Floats, dx: Floats, du: Floats
) -> None:
    """Compute −B q, (n, M, 3) and (P, 4): the drag on moving nodes, and by differences what else depends on ẋ."""
    du[:] = 0.0
    if is_local(body):
        by_rate(work.equations.resistance, q, dx)
        return
    step = _STEP / np.max(np.abs(q))
    r, t = np.empty_like(x), np.empty_like(u)
    dx[:] = 0.0
    for sign in (-1.0, 1.0):  # ẋ changes by −sign · step · shift · q
        moved = Rates(rates.rate, rates.phase, rates.differentiation, x + sign * step * q)
        fill_residual(body, moved, x, u, work.room, r, t)
        dx += sign / (2 * step * rates.rate) * r
        du += sign / (2 * step * rates.rate) * t
