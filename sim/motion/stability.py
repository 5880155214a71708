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
from typing import Any

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
_MORE_VECTORS = 30  # of Arnoldi's method, beyond two for each tail: enough for the leading eigenvalues to converge
_CONVERGED = 1e-3  # relative residual of an eigenvalue up to which it has converged
_SIGN_KNOWN = 1.0  # the same from which not even the sign of its real part is known


def growth_of_orbit(body: Body, tails: int, orbit: Orbit) -> float:
    """Compute the growth on an orbit of a robot with N tails; NaN if it cannot be computed."""
    value = growth(body, tails, orbit.x[1], orbit.u[1])
    again = is_doubtful(orbit.means, value) and not has_contact(body)
    return growth_on_more_phases(body, tails, orbit) if again else value


def is_doubtful(means: Floats, value: Any) -> Any:
    """Tell which growths (…) on the second mesh must be computed again, for orbits with `means` (…, 5)."""
    yaws_fast = np.abs(means[..., 2]) > QUICK * np.abs(means[..., 0])
    return yaws_fast | np.isnan(value) | (value > DOUBTFUL)


def growth_on_more_phases(body: Body, tails: int, orbit: Orbit) -> float:
    """Compute the growth on the third mesh, from eigenvalues that have converged; NaN if it cannot be computed."""
    instants = 2 * len(orbit.u[2]) + 1
    x, u = with_phases(orbit.x[2], tails * instants), with_phases(orbit.u[2][None], instants)[0].copy()
    _, size = solve_orbit(body, x, u, ROUGH)
    values = exponents(body, tails, x, u) if size < ROUGH else np.empty(0)
    return in_motor_revolutions(values.real.max(), body, u) if len(values) else np.nan


def growth(body: Body, tails: int, x: Floats, u: Floats) -> float:
    """Compute the growth on an orbit x (n, M, 3), u (P, 4) of N tails; NaN if it cannot be computed."""
    means = mean_motion(body, u)
    projected = _projected(body, tails, x, u, abs(means[0]), few_vectors(tails))
    return float(largest_growths(projected[None], means[:1], means[1:2])[0])


def _projected(body: Body, tails: int, x: Floats, u: Floats, shift: float, count: int) -> Floats:
    """Project with at most `count` vectors, see `sim.solve.floquet.arnoldi`."""
    first = first_perturbation(tails, *x.shape[:2])
    return arnoldi(body, x, u, shift, first, min(count, x.size - 1))


def largest_growths(projected: Floats, omega_t: Floats, omega_h: Floats) -> Floats:
    """Compute growths (B,) from projections of Arnoldi's method with the shift |ω_t|.

    Eigenvalues near 0 converge last; until then their inverses can have any sign. So where the growth exceeds
    DOUBTFUL, only eigenvalues larger than their residuals count.

    Args:
        projected: Hessenberg matrices, see `sim.solve.floquet.arnoldi`, (B, K + 1, K).
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


def exponents(body: Body, tails: int, x: Floats, u: Floats) -> Complex:
    """Compute exponents σ of perturbations e^{σt} of an orbit x (n, M, 3), u (P, 4) of N tails.

    Returns:
        Those that have converged, in any order; none if they cannot be computed.
    """
    shift = abs(mean_motion(body, u)[0])
    projected = _projected(body, tails, x, u, shift, 2 * tails + _MORE_VECTORS)
    if not np.isfinite(projected[-1, -1]):
        return np.empty(0, complex)
    return _exponents_with_residuals_below(_CONVERGED, projected, shift)


def _exponents_with_residuals_below(limit: float, projected: Floats, shift: float) -> Complex:
    """Compute the exponents of a projection (K + 1, K) whose eigenvalues have relative residuals below a limit."""
    values, vectors = np.linalg.eig(projected[:-1])
    values = values[projected[-1, -1] * np.abs(vectors[-1]) < limit * np.abs(values)]
    return np.asarray(shift + 1 / values)


def in_motor_revolutions(exponent: float, body: Body, u: Floats) -> float:
    """Convert a growth in a unit of time to that in one motor revolution, on an orbit with velocities u (P, 4)."""
    omega_t, omega_h = mean_motion(body, u)[:2]
    return float(2 * np.pi * exponent / abs(omega_t - omega_h))


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
