"""Whether a steady motion is stable: the growth of small perturbations.

    growth = 2π max Re σ/|ω_t − ω_h|

is the logarithm of the factor by which the perturbation that decays least changes in one revolution of the motor.
The perturbation of each tail is a different one (`sim.solve.floquet`). Below 0 all of them decay.

The growth is computed on the mesh of 8 edges, where decay is up to 3 % slower than in the limit of fine meshes,
and on as many phases as the orbit has. Products of harmonics that these phases do not resolve can be mistaken for
a slow perturbation, and change the growth by up to a fifth if the robot yaws fast. So a growth above DOUBTFUL, and
that of a robot with |ω_yr| > QUICK |ω_t|, is computed again on 12 edges and more than twice as many phases, an odd
number in an N-th of a turn. Robots with contact are left out of that; it would take ten seconds.

Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from sim.arrays import Complex, Floats
from sim.linear.spectral import with_phases
from sim.mechanics.tail_contact import has_contact
from sim.model.body import Body
from sim.solve.floquet import arnoldi
from sim.solve.orbit import mean_motion, solve_orbit
from sim.solve.refinement import ROUGH, Orbit

QUICK = 0.4  # |ω_yr/ω_t| from which a robot yaws fast
DOUBTFUL = -0.05  # growth from which it is computed again
FEW_VECTORS, MORE_VECTORS = 10, 30  # of Arnoldi's method beside two for each tail: first, and again
_CONVERGED = 1e-3  # relative residual of an eigenvalue up to which it counts


def growth_of_orbit(body: Body, tails: int, orbit: Orbit, value: float | None = None) -> float:
    """Compute the growth on an orbit of a robot with N tails; NaN if it cannot be computed.

    Args:
        value: the growth on the second mesh, if it is known.
    """
    value = growth(body, tails, orbit.x[1], orbit.u[1]) if value is None else value
    yaws_fast = abs(orbit.means[2]) > QUICK * abs(orbit.means[0])
    if (value <= DOUBTFUL and not yaws_fast) or has_contact(body):
        return value
    instants = 2 * len(orbit.u[2]) + 1
    x, u = with_phases(orbit.x[2], tails * instants), with_phases(orbit.u[2][None], instants)[0].copy()
    _, size = solve_orbit(body, x, u, ROUGH)
    return growth(body, tails, x, u, vectors=MORE_VECTORS) if size < ROUGH else np.nan


def growth(body: Body, tails: int, x: Floats, u: Floats, *, vectors: int = FEW_VECTORS) -> float:
    """Compute the growth on an orbit x (n, M, 3), u (P, 4) of N tails.

    Args:
        vectors: of Arnoldi's method, beside two for each tail. If they are more than by default, only eigenvalues
            that have converged count.

    Returns:
        The growth in one motor revolution; NaN if it cannot be computed.
    """
    found = exponents(body, tails, x, u, vectors=vectors, unconverged=vectors == FEW_VECTORS)
    return in_motor_revolutions(found.real.max(), body, u) if len(found) else np.nan


def exponents(
    body: Body, tails: int, x: Floats, u: Floats, *, vectors: int = MORE_VECTORS, unconverged: bool = False
) -> Complex:
    """Compute exponents σ of perturbations e^{σt} of an orbit x (n, M, 3), u (P, 4) of N tails.

    Args:
        vectors: of Arnoldi's method, beside two for each tail.
        unconverged: whether those that have not converged count, too; some of them look unstable.

    Returns:
        The exponents that count, in any order; none if they cannot be computed.
    """
    count = vector_count(tails, x.size, vectors)
    shift = abs(mean_motion(body, u)[0])
    projected = arnoldi(body, x, u, shift, first_perturbation(tails, *x.shape[:2]), count)
    if not np.isfinite(projected[-1, -1]):
        return np.empty(0, complex)
    if unconverged:
        return np.asarray(shift + 1 / np.linalg.eigvals(projected[:count]))
    values, ritz = np.linalg.eig(projected[:count])
    values = values[projected[count, count - 1] * np.abs(ritz[-1]) < _CONVERGED * np.abs(values)]
    return np.asarray(shift + 1 / values)


def in_motor_revolutions(exponent: float, body: Body, u: Floats) -> float:
    """Convert a growth in a unit of time to that in one motor revolution, on an orbit with velocities u (P, 4)."""
    omega_t, omega_h = mean_motion(body, u)[:2]
    return float(2 * np.pi * exponent / abs(omega_t - omega_h))


def vector_count(tails: int, unknowns: int, vectors: int) -> int:
    """Count the vectors of Arnoldi's method: `vectors` beside two for each tail, fewer than the unknowns."""
    return min(2 * tails + vectors, unknowns - 1)


@cache
def first_perturbation(tails: int, n: int, columns: int) -> Floats:
    """Draw the perturbation of bent tails that Arnoldi's method starts from, with the same numbers each time.

    Its harmonics in the phase are the N lowest. They contain each perturbation of the tails once.

    Args:
        tails: N.
        n: edges of a tail.
        columns: M, phases of the orbit.

    Returns:
        The displacement of the nodes of one tail at all phases, (n, M, 3). Only its direction counts.
    """
    numbers = np.random.default_rng(0)
    phase = 2 * np.pi * np.arange(columns) / columns
    bend = (np.arange(1, n + 1) / n) ** 2
    vector = np.zeros((n, columns, 3))
    for harmonic in range(tails // 2 + 1):
        for wave in (np.cos(harmonic * phase), np.sin(harmonic * phase)):
            vector += bend[:, None, None] * wave[:, None] * numbers.normal(size=3)
    return vector
