"""From one turn of all tails to an orbit of tails that move alike.

In an orbit, tail j at disc phase φ has the shape of tail 0 at φ + 2πj/N (`sim.solve.orbit`).
Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.motion.revolution import Turn
from sim.solve.rates import FIRST_PHASE

_ALIKE = 0.02  # largest distance between nodes of tails that move alike, in l
_TURN = 2 * np.pi


def orbit_from_turn(turn: Turn, instants: int) -> tuple[Floats, Floats] | None:
    """Return x (n, M, 3) and a guess of u (P, 4) for P instants in an N-th of a turn; None if the tails differ.

    Args:
        turn: one turn of a steady motion, with its shapes.
        instants: P.
    """
    from scipy.interpolate import CubicSpline  # slow to import

    way = float(np.sign(turn.phases[-1]))
    if not (np.diff(turn.phases) * way > 0).all():
        return None
    phases = np.concatenate([turn.phases[-5:] - way * _TURN, turn.phases, turn.phases[:5] + way * _TURN])
    shapes = np.concatenate([turn.shapes[-5:], turn.shapes, turn.shapes[:5]])
    order = np.argsort(phases)
    keep = np.append(True, np.diff(phases[order]) > 1e-6)
    spline = CubicSpline(phases[order][keep], shapes[order][keep])
    tails = turn.shapes.shape[2]
    count = tails * instants

    def of_tail(tail: int, at: Floats) -> Floats:
        within = way * ((way * at) % _TURN)
        return np.asarray(spline(within)[:, :, tail])

    nodes = FIRST_PHASE + _TURN * np.arange(count) / count
    x = of_tail(0, nodes)
    for tail in range(1, tails):
        if np.abs(of_tail(tail, nodes - _TURN * tail / tails) - x).max() > _ALIKE:
            return None
    u = np.tile(turn.state.u, (instants, 1))
    return np.ascontiguousarray(x.transpose(1, 0, 2)), u
