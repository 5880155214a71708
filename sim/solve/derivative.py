"""How an orbit changes with the numbers of its robot, by the implicit function theorem.

The orbit z(p) satisfies F(z, p) = 0, so dz/dp = −(∂F/∂z)⁻¹ ∂F/∂p. The matrix is that of Newton's method. A
parameter costs one more right-hand side. Finite differences would cost two more solutions.
Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled
from sim.model.body import Body
from sim.solve.linearise import linearise
from sim.solve.newton import new_workspace, solve_linear
from sim.solve.orbit import FIRST_PHASE
from sim.solve.rates import on_orbit

_TOLERANCE = 1e-6  # of GMRES


@compiled
def orbit_slopes(body: Body, r: Floats, t: Floats, x: Floats, u: Floats) -> Floats:
    """Compute du/dp at the orbit x (n, M, 3), u (P, 4), for K parameters, (K, P, 4).

    Args:
        r, t: derivatives of `sim.solve.orbit.residual_on_orbit` in the parameters, (K, n, M, 3) and (K, P, 4).
    """
    count = len(r)
    rates = on_orbit(x.shape[1], FIRST_PHASE)
    work = new_workspace(rates, x, u)
    linearise(body, rates, x, u, work.room, work.equations)
    slopes = np.empty((count, u.shape[0], 4))
    for i in range(count):
        dx, du = -r[i], -t[i]
        solve_linear(body, rates, x, u, work, i == 0, _TOLERANCE, dx, du)
        slopes[i] = du
    return slopes
