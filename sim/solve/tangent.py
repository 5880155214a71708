"""Solutions of the equations that are linearised at an orbit, for given right-hand sides.

A curve of orbits z(λ) has the tangent −J⁻¹ ∂F/∂λ, and a correction along it needs −J⁻¹ F, with J = ∂F/∂z. Both
come from one factorisation of the matrix of Newton's method. `sim.solve.derivative` does the same for the robot's
velocities alone.
Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from sim.arrays import Floats
from sim.compiling import compiled
from sim.model.body import Body
from sim.solve.linearise import linearise
from sim.solve.newton import new_workspace, solve_linear
from sim.solve.orbit import FIRST_PHASE
from sim.solve.rates import on_orbit

_TOLERANCE = 1e-6  # of GMRES


@compiled
def solve_at_orbit(body: Body, x: Floats, u: Floats, r: Floats, t: Floats) -> tuple[Floats, Floats]:
    """Solve with the derivative of `sim.solve.orbit.residual_on_orbit` at x (n, M, 3), u (P, 4).

    Args:
        r, t: K right-hand sides, (K, n, M, 3) and (K, P, 4).

    Returns:
        The solutions, of the same shapes.
    """
    rates = on_orbit(x.shape[1], FIRST_PHASE)
    work = new_workspace(rates, x, u)
    linearise(body, rates, x, u, work.room, work.equations)
    dx, du = r.copy(), t.copy()
    for i in range(len(r)):
        solve_linear(body, rates, x, u, work, i == 0, _TOLERANCE, dx[i], du[i])
    return dx, du
