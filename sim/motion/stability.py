"""Whether a steady motion is stable: the growth of small perturbations.

    growth = 2π max Re σ/|ω_t − ω_h|

is the logarithm of the factor by which the perturbation that decays least changes in one revolution of the motor.
The perturbation of each tail is a different one (`sim.solve.floquet`). Below 0 all of them decay.

The growth is computed on the mesh of 8 edges, where decay is up to 3 % slower than in the limit of fine meshes,
and on as many phases as the orbit has. Products of harmonics that these phases do not resolve can be mistaken for
a slow perturbation, and change the growth by up to a fifth if the robot yaws fast. So a growth above DOUBTFUL, and
that of a robot with |ω_yr| > QUICK |ω_t|, is computed again on 12 edges and more than twice as many phases, an odd
number in an N-th of a turn. Robots with contact are left out of that; it would take seconds.

Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import numpy as np

from common.arrays import Complex, Floats
from sim.linear.spectral import differentiation, with_phases
from sim.solve.assembly import CONTACT, are_local, batch
from sim.solve.floquet import arnoldi
from sim.solve.grouping import by_kind, from_groups, in_groups, robots_in_lanes
from sim.solve.orbit import mean_motion, solve_orbits_in_place
from sim.solve.refinement import ROUGH, OrbitOnMeshes, stacked

QUICK = 0.4  # |ω_yr/ω_t| from which a robot yaws fast
DOUBTFUL = -0.05  # growth from which it is computed again
_MORE_VECTORS = 30  # of Arnoldi's method, beyond two for each tail: enough for the leading eigenvalues to converge
_CONVERGED = 1e-3  # relative residual of an eigenvalue up to which it has converged
_SIGN_KNOWN = 1.0  # the same from which not even the sign of its real part is known


def growths(rows: Floats, tails: int, orbits: Sequence[OrbitOnMeshes]) -> Floats:
    """Compute the growth (B,) of robots with N tails; NaN where it cannot be computed.

    Args:
        rows: the robots' numbers (`sim.solve.assembly.numbers`), (B, K).
        tails: N.
        orbits: of the robots, all solved.
    """
    found = np.full(len(rows), np.nan)
    for robots in _alike(range(len(rows)), rows, orbits):
        found[robots] = growths_on_mesh(rows[robots], tails, *stacked([orbits[i] for i in robots], 1))
    means = np.array([orbit.means for orbit in orbits]).reshape(-1, 5)
    doubtful = np.flatnonzero(is_doubtful(means, found) & (rows[:, CONTACT] == 0)).tolist()
    for robots in _alike(doubtful, rows, orbits):
        found[robots] = growths_on_more_phases(rows[robots], tails, [orbits[i] for i in robots])
    return found


def _alike(robots: Iterable[int], rows: Floats, orbits: Sequence[OrbitOnMeshes]) -> list[list[int]]:
    """Sort robots by phases, sense of the motor and reach of their effects."""
    local = are_local(rows)
    return by_kind(robots, lambda i: (len(orbits[i].u[1]), rows[i, 0] < 0, bool(local[i])))


def growths_on_mesh(rows: Floats, tails: int, x: Floats, u: Floats) -> Floats:
    """Compute the growths (B,) on orbits x (B, n, M, 3), u (B, P, 4) of motors with one sense; NaN: unknown."""
    means = mean_motion(batch(rows), u)
    projected = _projected(rows, tails, x, u, np.abs(means[:, 0]), few_vectors(tails))
    return largest_growths(projected, means[:, 0], means[:, 1])


def is_doubtful(means: Floats, value: Any) -> Any:
    """Tell which growths (…) on the second mesh must be computed again, for orbits with `means` (…, 5)."""
    yaws_fast = np.abs(means[..., 2]) > QUICK * np.abs(means[..., 0])
    return yaws_fast | np.isnan(value) | (value > DOUBTFUL)


def growths_on_more_phases(rows: Floats, tails: int, orbits: Sequence[OrbitOnMeshes]) -> Floats:
    """Compute the growths (B,) on the third mesh, from eigenvalues that have converged; NaN: unknown."""
    instants = 2 * len(orbits[0].u[2]) + 1
    x, u = stacked(orbits, 2)
    x, u = with_phases(x, tails * instants), with_phases(u, instants)
    solved = solve_orbits_in_place(rows, x, u, ROUGH) < ROUGH
    rates = np.array([values.real.max(initial=-np.inf) for values in _exponents(rows, tails, x, u)])
    growth = in_motor_revolutions(rates, mean_motion(batch(rows), u))
    return np.where(solved & np.isfinite(growth), growth, np.nan)


def _projected(rows: Floats, tails: int, x: Floats, u: Floats, shifts: Floats, most: int) -> Floats:
    """Project −(J + s B)⁻¹ B on a Krylov space for each of B robots.

    Args:
        rows: the robots' numbers (`sim.solve.assembly.numbers`), (B, K'); all motors have one sense.
        tails: N.
        x, u: the orbits, (B, n, M, 3) and (B, P, 4).
        shifts: s, above 0, (B,).
        most: largest number of vectors K; they are fewer than the 3 n M unknowns.

    Returns:
        The Hessenberg matrices with the parts of their last vectors outside the space, (B, K + 1, K).
    """
    first = first_perturbation(tails, *x.shape[1:3]).ravel()
    count = min(most, first.size - 1)
    by_phase = _damped_differentiation(x.shape[2], float(np.sign(rows[0, 0])))
    shapes = in_groups(_without_highest(x))
    projected = np.zeros((len(shapes), count + 1, count, shapes.shape[-1]))
    arnoldi(robots_in_lanes(rows), shapes, in_groups(u), in_groups(shifts), by_phase, first, projected)
    return from_groups(projected, len(rows))


@cache
def _damped_differentiation(columns: int, sense: float) -> Floats:
    """Differentiate in φ, (M, M); the component (−1)^m decays if the motor turns with `sense`."""
    matrix = differentiation(columns)
    if columns % 2 == 0:
        signs = (-1.0) ** np.arange(columns)
        matrix += 0.5 * sense * signs[:, None] * signs
    return matrix


def _without_highest(x: Floats) -> Floats:
    """Remove the component (−1)^m of x (…, n, M, 3), if M is even."""
    columns = x.shape[-2]
    if columns % 2:
        return x
    signs = (-1.0) ** np.arange(columns)[:, None]
    return np.asarray(x - signs * (signs * x).sum(-2, keepdims=True) / columns)


def largest_growths(projected: Floats, omega_t: Floats, omega_h: Floats) -> Floats:
    """Compute growths (B,) from projections of Arnoldi's method with the shift |ω_t|.

    Eigenvalues near 0 converge last; until then their inverses can have any sign. So where the growth exceeds
    DOUBTFUL, only eigenvalues larger than their residuals count.

    Args:
        projected: Hessenberg matrices, see `_projected`, (B, K + 1, K).
        omega_t, omega_h: mean spins of the orbits, (B,).

    Returns:
        The growths in one motor revolution; NaN where unknown.
    """
    shifts, rates, out = np.abs(omega_t), np.abs(omega_t - omega_h) / (2 * np.pi), np.full(len(projected), np.nan)
    finite = np.flatnonzero(np.isfinite(projected[:, -1, -1]))
    inverses = 1 / np.linalg.eigvals(projected[finite, :-1])
    out[finite] = (shifts[finite] + inverses.real.max(1)) / rates[finite]
    for i in np.flatnonzero(out > DOUBTFUL).tolist():
        known = _exponents_with_residuals_below(_SIGN_KNOWN, projected[i], shifts[i])
        out[i] = max(known.real, default=np.nan) / rates[i]
    return out


def _exponents(rows: Floats, tails: int, x: Floats, u: Floats) -> list[Complex]:
    """Compute the exponents that have converged, for B robots whose motors have one sense; none where unknown."""
    shifts = np.abs(mean_motion(batch(rows), u)[:, 0])
    projected = _projected(rows, tails, x, u, shifts, 2 * tails + _MORE_VECTORS)
    return [
        _exponents_with_residuals_below(_CONVERGED, matrix, shift)
        if np.isfinite(matrix[-1, -1])
        else np.empty(0, complex)
        for matrix, shift in zip(projected, shifts, strict=True)
    ]


def _exponents_with_residuals_below(limit: float, projected: Floats, shift: float) -> Complex:
    """Compute the exponents of a projection (K + 1, K) whose eigenvalues have relative residuals below a limit."""
    values, vectors = np.linalg.eig(projected[:-1])
    values = values[projected[-1, -1] * np.abs(vectors[-1]) < limit * np.abs(values)]
    return np.asarray(shift + 1 / values)


def in_motor_revolutions(exponents: Any, means: Floats) -> Any:
    """Convert growths (…) in a unit of time to those in one motor revolution, for orbits with `means` (…, 5)."""
    return 2 * np.pi * exponents / np.abs(means[..., 0] - means[..., 1])


def few_vectors(tails: int) -> int:
    """Choose the number of vectors of Arnoldi's method for a growth."""
    return max(2 * tails + 8, 14)


@cache
def first_perturbation(tails: int, n: int, columns: int) -> Floats:
    """Draw the perturbation of bent tails that Arnoldi's method starts from, with the same numbers each time.

    Its harmonics in the phase are the N lowest. They contain each perturbation of the tails once.

    Args:
        tails: N.
        n: edges of a tail.
        columns: M, phases of the orbit.

    Returns:
        The displacement of the nodes of one tail at all phases, (n, M, 3), of length 1.
    """
    numbers = np.random.default_rng(0)
    phase = 2 * np.pi * np.arange(columns) / columns
    bend = (np.arange(1, n + 1) / n) ** 2
    vector = np.zeros((n, columns, 3))
    for harmonic in range(tails // 2 + 1):
        for wave in (np.cos(harmonic * phase), np.sin(harmonic * phase)):
            vector += bend[:, None, None] * wave[:, None] * numbers.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))
