"""The growth of small perturbations, measured in time steps: the reference for `sim.motion.stability`.

Two robots start on the orbit, one with its tails bent a little, each tail in another way. Their difference at
equal phases of the disc,

    d = x₂ − x₁ − ẋ₁ (φ₂ − φ₁)/ω_t,

grows like the perturbation that decays least, once the others have decayed. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

import math

import numpy as np

from sim.mechanics.balance import tail_spin
from sim.model.body import Body
from sim.motion.run import copied
from sim.motion.shapes import state_on_orbit
from sim.solve.march import PHASE
from sim.solve.orbit import mean_motion
from sim.solve.rates import FIRST_PHASE
from sim.solve.refinement import MESHES, orbit_on_mesh
from tests.sim.robots import advance

_SIZE = 1e-6  # of the first difference, in l
_TOLERANCE = 1e-9  # of Newton's method: errors of the steps stay below the difference
_SAMPLES = 40
_STEPS = 96  # in a motor revolution, or more


def stepped_growth(body: Body, tails: int, revolutions: float, *, edges: int = MESHES[1]) -> float:
    """Measure the logarithm of the growth in one motor revolution, over the second half of the time.

    Args:
        body: a robot with N tails that has an orbit.
        tails: N.
        revolutions: of the motor. The difference should change by a factor of 10³ or so in this time.
        edges: of the mesh.

    Returns:
        The growth; NaN if there is no orbit or a step does not converge.
    """
    straight, (solved, _, u) = state_on_orbit(body, tails, edges, FIRST_PHASE), orbit_on_mesh(body, tails, edges)
    if straight is None or not solved:
        return np.nan
    omega_t, omega_h = mean_motion(body, u)[:2]
    revolution = 2 * np.pi / abs(omega_t - omega_h)
    bent = copied(straight)
    bend = (np.arange(1, edges + 1) / edges)[:, None, None] ** 2
    bent.x[:] += _SIZE * bend * np.random.default_rng(0).normal(size=bent.x.shape)
    count = max(4, math.ceil(_STEPS * revolutions / _SAMPLES))
    part = revolution * revolutions / _SAMPLES
    sizes = []
    for _ in range(_SAMPLES):
        if not all(advance(body, s, part / count, count, _TOLERANCE).solved for s in (straight, bent)):
            return np.nan
        later = (bent.pose[PHASE] - straight.pose[PHASE]) / tail_spin(body, straight.u)
        sizes.append(np.linalg.norm(bent.x - straight.x - straight.x_dot * later))
    at = np.arange(1, _SAMPLES + 1) * revolutions / _SAMPLES
    late = _SAMPLES // 2
    return float(np.polyfit(at[late:], np.log(sizes[late:]), 1)[0])
