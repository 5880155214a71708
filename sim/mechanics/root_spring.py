"""Roots that turn about their clamps as on a spring.

A spring of compliance c between clamp and root is in series with the half cell at the clamp: 1/l_0 in the energy
of joint 0 becomes 1/(l_0 + c). `add_root_spring` adds the difference to the elastic forces of rigidly clamped
tails (`sim.mechanics.rod`). Units: EI = 1, l = 1.
"""

from __future__ import annotations

from sim.arrays import Floats
from sim.jit import compiled
from sim.linear.blocks import add, add_at, vector
from sim.linear.vectors import times
from sim.mechanics.geometry import ROOT_TANGENT, Geometry, inverse_voronoi
from sim.mechanics.rod import clamp_moment
from sim.model.body import Body


@compiled
def add_root_spring(body: Body, geometry: Geometry, m: int, moments: Floats) -> None:
    """Add the spring's forces to edge 0 of tail m, and the clamp's further moment to `moments` (M, 3)."""
    compliance = body.nonlocal_terms.root_compliance
    share = 1 / (1 + inverse_voronoi(0, geometry.length.shape[0]) * compliance) - 1
    slope = share * geometry.joint[0, m, 1]  # change of dE/dc, c = cosine at the joint
    add(geometry.force, 0, m, times(slope, vector(geometry.by_after, 0, m)))
    add_at(moments, m, clamp_moment(ROOT_TANGENT, vector(geometry.tangent, 1, m), slope))
