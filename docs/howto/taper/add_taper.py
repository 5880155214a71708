"""Bending of tails whose stiffness changes linearly from the clamp to the tip.

    EI(s) = EI (1 + ε (1 − 2 s/l)),   E_b = Σ ½ EI(s_k) |κ_k|²/l_k

`add_taper` adds the difference to the elastic forces of uniform tails (`sim.mechanics.rod`). s_k is the middle of
the cell of joint k, so that the mean stiffness stays EI. Units: EI = 1, l = 1.
"""

from __future__ import annotations

from common.arrays import Floats
from sim.jit import compiled
from sim.linear.blocks import add, add_at, vector
from sim.linear.vectors import times
from sim.mechanics.geometry import ROOT_TANGENT, Geometry
from sim.mechanics.rod import clamp_moment
from sim.model.body import Body


@compiled
def add_taper(body: Body, geometry: Geometry, m: int, moments: Floats) -> None:
    """Add the forces of the taper to the edges of tail m, and the clamp's further moment to `moments` (M, 3)."""
    n = geometry.length.shape[0]
    taper = body.nonlocal_terms.tail_taper
    for k in range(n):
        middle = 0.25 / n if k == 0 else k / n
        slope = taper * (1 - 2 * middle) * geometry.joint[k, m, 1]  # change of dE/dc, c = cosine at the joint
        add(geometry.force, k, m, times(slope, vector(geometry.by_after, k, m)))
        if k > 0:
            add(geometry.force, k - 1, m, times(slope, vector(geometry.by_before, k, m)))
        else:
            add_at(moments, m, clamp_moment(ROOT_TANGENT, vector(geometry.tangent, 1, m), slope))
