"""Small perturbations of the orbits of a group of robots, one in each lane; their effects are local.

The method is that of `sim.solve.floquet`. The order of a lane's operations does not depend on the group
(`sim.lanes`). Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled_exactly
from sim.lanes import choose, fma, lanes, less, somewhere, zeros
from sim.solve.floquet import CANCELS, by_rate, damped_differentiation, without_highest
from sim.solve.groups import body_in_lanes
from sim.solve.linearise import linearise
from sim.solve.newton import factor_and_solve, new_workspace, solve_local
from sim.solve.orbit import FIRST_PHASE, mean_motion
from sim.solve.rates import Rates


@compiled_exactly
def arnoldi_of_group(
    numbers: Floats, terms: Any, x: Floats, u: Floats, sense: float, first: Floats, count: int, width: Any
) -> tuple[Floats, Floats]:
    """Project −(J + s B)⁻¹ B on a Krylov space for each robot, with s its mean |ω_t|.

    Args:
        numbers: of the robots, (K, W), in the order of `sim.solve.assembly.numbers`.
        terms: numbers of the non-local effects, all zero.
        x, u: the orbits, (n, M, 3, W) and (P, 4, W).
        sense: sign of the motors' speeds.
        first: first vector of all robots, (n, M, 3).
        count: number of vectors K, fewer than the 3 n M unknowns.
        width: of the group, see `sim.lanes`.

    Returns:
        The Hessenberg matrices as `sim.solve.floquet.arnoldi` returns them, (K + 1, K, W), and the means of ω_t
        and ω_h, (2, W).
    """
    body, u = body_in_lanes(lanes(numbers, width), terms), lanes(u, width)
    x = without_highest(lanes(x, width))
    size = x.size
    means, spins = mean_motion(body, u), np.empty((2, len(width)))
    lanes(spins, width)[:] = means[:2]
    rates = Rates(abs(means[0]), FIRST_PHASE, damped_differentiation(x.shape[1], sense), x)
    work = new_workspace(rates, x, u)
    linearise(body, rates, x, u, work.room, work.equations)
    basis, out = zeros(x, (count + 1, size)), np.zeros((count + 1, count, len(width)))
    projected = lanes(out, width)
    _fill(basis[0], first.reshape(size))
    _normalise(basis[0], basis[0], np.sqrt(_product(basis[0], basis[0])))
    image, parts = zeros(x, x.shape), zeros(x, (count,))
    for i in range(count):
        by_rate(work.equations.resistance, basis[i].reshape(x.shape), image)
        du = zeros(u, u.shape)
        if i == 0:
            factor_and_solve(body, rates, u, work, image, du)
        else:
            solve_local(rates, work, image, du)
        projected[i + 1, i] = _orthogonalise(basis, i, image.reshape(size), parts, projected)
        _normalise(basis[i + 1], image.reshape(size), projected[i + 1, i])
    return out, spins


@compiled_exactly
def _orthogonalise(basis: Floats, i: int, image: Floats, parts: Floats, projected: Floats) -> Any:
    """Make an image orthogonal to the first i + 1 vectors, again where digits cancelled; return its length."""
    size = np.sqrt(_product(image, image))
    before = size * np.inf
    going = less(size, CANCELS * before)
    while somewhere(going):
        for j in range(i + 1):
            parts[j] = choose(going, _product(basis[j], image), 0.0)
        for j in range(i + 1):
            projected[j, i] += parts[j]
            for k in range(len(image)):
                image[k] = fma(-parts[j], basis[j, k], image[k])
        before = choose(going, size, before)
        size = choose(going, np.sqrt(_product(image, image)), size)
        going = going * less(size, CANCELS * before)
    return size


@compiled_exactly
def _product(a: Floats, b: Floats) -> Any:
    """Compute the scalar product of two vectors in each lane, as four sums that are added at the same time."""
    first = second = third = fourth = 0.0 * a[0]
    whole = len(a) - len(a) % 4
    for k in range(0, whole, 4):
        first, second = fma(a[k], b[k], first), fma(a[k + 1], b[k + 1], second)
        third, fourth = fma(a[k + 2], b[k + 2], third), fma(a[k + 3], b[k + 3], fourth)
    for k in range(whole, len(a)):
        first = fma(a[k], b[k], first)
    return (first + second) + (third + fourth)


@compiled_exactly
def _fill(out: Floats, values: Floats) -> None:
    """Set every lane of an array to the same numbers."""
    for k in range(len(out)):
        out[k] = 0.0 * out[k] + values[k]


@compiled_exactly
def _normalise(out: Floats, a: Floats, size: Any) -> None:
    """Set out = a/size."""
    for k in range(len(out)):
        out[k] = a[k] / size
