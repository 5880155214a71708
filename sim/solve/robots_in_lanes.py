"""The numbers of a group of robots as one `Body` with a robot in each lane (`sim.lanes`), and of one lane."""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled_exactly
from sim.lanes import lane, less, named_like, zeros
from sim.linear.lane_arrays import take_lane
from sim.model.body import Body

_LOCAL = 33  # numbers before those of the non-local effects


@compiled_exactly
def body_in_lanes(numbers: Floats, names: Any) -> Body:
    """Return the robots of a group as one.

    Args:
        numbers: in the order of `sim.solve.assembly.numbers`, (K,).
        names: numbers of the non-local effects of any robot; only their names matter.
    """
    v = numbers
    resistance = zeros(v, (4, 5))
    for a in range(4):
        for c in range(5):
            resistance[a, c] = v[9 + 5 * a + c]
    terms = named_like(names, v[_LOCAL:])
    return Body(
        v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8], resistance, v[29], (v[30], v[31], v[32]), terms
    )


@compiled_exactly
def body_of_lane(body: Body, i: int) -> Body:
    """Return the robot in lane i, with plain numbers."""
    resistance, terms = np.empty((4, 5)), np.empty(len(body.nonlocal_terms))
    take_lane(resistance, body.resistance, i)
    for j in range(len(terms)):
        terms[j] = lane(body.nonlocal_terms[j], i)
    x, y, z = body.tail_load
    return Body(
        lane(body.omega, i),
        lane(body.offset, i),
        lane(body.head_radius, i),
        lane(body.head_length, i),
        lane(body.tail_radius, i),
        lane(body.axial_stiffness, i),
        lane(body.viscosity, i),
        lane(body.zeta_parallel, i),
        lane(body.zeta_perp, i),
        resistance,
        lane(body.droop, i),
        (lane(x, i), lane(y, i), lane(z, i)),
        named_like(body.nonlocal_terms, terms),
    )


@compiled_exactly
def reaches_further(body: Body) -> Any:
    """Tell where an effect reaches further than one node, as 1 or 0."""
    total = 0.0 * body.omega
    for value in body.nonlocal_terms:
        total += abs(value)
    return less(0.0, total)
