"""What is left unbalanced on a robot at one instant, in compiled loops: all that its balance holds.

Beside local drag and the elastic forces of straight tails (`sim.tail`) that is what `sim.coefficients` calls
BEYOND: `sim.frames` (forces inside a tail), `sim.flow` (the fluid as the others move it) and the friction of the
contact line, F = −F_0 v/√(v² + v_s²) on the head's centre against its motion v in the plane, which hardly depends
on speed above v_s = SLOW: the edge of the wetted surface creeps along the head (Joanny and de Gennes 1984).

The Newton matrices of `sim.orbit` and `sim.march` leave out what lies beyond; GMRES (`sim.krylov`), preconditioned
by those matrices, takes it into account.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.compiling import compiled
from sim.flow import add_flow
from sim.frames import add_frames
from sim.tail import (
    Body,
    Geometry,
    clamp_balance,
    entry,
    motion_at,
    node_balance,
    put,
    vector,
    wrench_of,
)
from sim.vectors import cross, minus, plus

Array = NDArray[np.float64]

SLOW = 1e-3  # l EI/(μ0 l⁴): motion slower than this the contact line resists like a liquid


class Surroundings(NamedTuple):
    """Zero where a robot has nothing of the kind."""

    flow: Array  # of the fluid at nodes 0..n, (n + 1, M, 3)
    moment: Array  # further moment of each clamp on the disc, (M, 3)
    wrench: Array  # on the robot about J, (4,)


@compiled
def still(n: int, lanes: int) -> Surroundings:
    """Nothing of the kind."""
    return Surroundings(np.zeros((n + 1, lanes, 3)), np.zeros((lanes, 3)), np.zeros(4))


@compiled
def _surround(
    body: Body, geometry: Geometry, x: Array, x_dot: Array, u: Array, phase: float, first: int, tails: int,
    around: Surroundings,
) -> None:  # fmt: skip
    """Fill `around`, and add to the edges' forces in `geometry`."""
    for j in range(tails):
        m = first + j * (x.shape[1] // tails)
        motion = motion_at(body, u, phase + 2 * np.pi * j / tails)
        add_frames(body, geometry, motion, m, x_dot, around.moment)
    around.wrench[:] = 0.0
    beyond = body.beyond
    if beyond.tail_flow != 0 or beyond.head_flow != 0 or beyond.surface_flow != 0:
        add_flow(body, geometry, x, u, phase, first, tails, around.flow, around.wrench)
    if beyond.contact_line != 0:
        lever = beyond.head_length / 2
        sway, surge = u[0] + u[2] * lever, u[1]
        share = beyond.contact_line / np.sqrt(sway * sway + surge * surge + SLOW * SLOW)
        around.wrench[0] -= share * sway
        around.wrench[1] -= share * surge
        around.wrench[2] -= share * sway * lever


@compiled
def unbalanced(
    body: Body, geometry: Geometry, x: Array, x_dot: Array, u: Array, phase: float, first: int, tails: int,
    around: Surroundings, r: Array, t: Array,
) -> None:  # fmt: skip
    """What is left unbalanced on the nodes and the robot.

    Args:
        geometry: of x; what lies beyond adds to the forces of its edges.
        x, x_dot: free nodes and their velocity in the disc frame, (n, M, 3); tail j is the lane first + j M/N, at
            phase φ + 2πj/N.
        u: (v_x, v_z, ω_yr, ω_h), (4,).
        phase: φ.
        around: room to work in, from `still`.
        r: (n, M, 3), filled in the robot's lanes.
        t: (4,), filled: F_x, F_z, M_y, M_z about J.
    """
    if not body.beyond.none:
        _surround(body, geometry, x, x_dot, u, phase, first, tails, around)
    omega_t = body.omega + body.gain * u[3]
    for a in range(4):
        load = body.resistance[a, 4] * omega_t
        for c in range(4):
            load += body.resistance[a, c] * u[c]
        t[a] = around.wrench[a] - load
    for j in range(tails):
        m = first + j * (x.shape[1] // tails)
        motion = motion_at(body, u, phase + 2 * np.pi * j / tails)
        for k in range(x.shape[0]):
            velocity = plus(plus(motion.linear, cross(motion.spin, vector(x, k, m))), vector(x_dot, k, m))
            velocity = minus(velocity, vector(around.flow, k + 1, m))
            put(r, k, m, node_balance(geometry, body, motion, k, m, velocity)[0])
        clamp = clamp_balance(geometry, body, m, motion, vector(around.flow, 0, m), entry(around.moment, m))
        wrench = wrench_of(motion, clamp.force, clamp.moment)
        for a in range(4):
            t[a] += wrench[a]
