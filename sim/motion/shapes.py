"""The tails of a steadily swimming robot over one revolution of the disc, for pictures and for starting values.

Positions in l, in the body frame: origin J at the disc's centre, e_x sideways, e_y up, e_z forward along the axis.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.io.errors import InputError
from sim.linear.spectral import differentiation, interpolation
from sim.mechanics.balance import tail_spin
from sim.model.body import Body
from sim.model.robot import Robot
from sim.solve.assembly import bodies
from sim.solve.march import PHASE, State
from sim.solve.orbit import FIRST_PHASE
from sim.solve.refinement import FEW, REASONS, SOLVED, orbit_on_mesh, refined_orbit


def tails_over_a_revolution(robot: Robot, frames: int) -> tuple[Floats, Floats]:
    """Return disc phases (F,) and tails (F, N, n + 1, 3), clamp to tip, with the motor in its positive direction.

    Raises:
        InputError: the robot has no steady motion in which its tails move alike.
    """
    groups = robot.groups()
    body = bodies(groups)[0]
    orbit = refined_orbit(body, groups.N, FEW)
    if orbit.ended != SOLVED:
        raise InputError(f"{robot.name} has no shape to draw: {REASONS[orbit.ended]}")
    x = orbit.x[2]
    phases = 2 * np.pi * np.arange(frames) / frames
    root = np.zeros((1, x.shape[1], 3))
    root[:, :, 0] = body.offset
    nodes = np.concatenate([root, x])
    tails = np.empty((frames, groups.N, len(nodes), 3))
    for j in range(groups.N):
        turn = phases + 2 * np.pi * j / groups.N  # tail j moves like tail 0, at the phase 2πj/N later
        shape = at_phases(nodes, turn)
        cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
        tails[:, j, :, 0] = cos * shape[..., 0] - sin * shape[..., 1]
        tails[:, j, :, 1] = sin * shape[..., 0] + cos * shape[..., 1]
        tails[:, j, :, 2] = shape[..., 2]
    return phases, tails


def at_phases(periodic: Floats, at: Floats) -> Floats:
    """Interpolate a function on the orbit's phases, (K, M, c), at disc phases `at` (F,), (F, K, c)."""
    return np.einsum("fm,kmc->fkc", interpolation(periodic.shape[1], at - FIRST_PHASE), periodic)


def state_on_orbit(body: Body, tails: int, edges: int, phase: float) -> State | None:
    """Return the state of a steadily swimming robot at a disc phase; None where there is no orbit."""
    solved, x, u = orbit_on_mesh(body, tails, edges)
    if not solved:
        return None
    each = phase + 2 * np.pi * np.arange(tails) / tails
    slope = np.einsum("ml,klc->kmc", differentiation(x.shape[1]), x)
    velocity = _in_one_period(u, phase, tails)
    pose = np.zeros(6)
    pose[PHASE] = phase
    shape, rate = (np.ascontiguousarray(at_phases(a, each).transpose(1, 0, 2)) for a in (x, slope))
    return State(shape, rate * tail_spin(body, velocity), pose, velocity)


def _in_one_period(u: Floats, phase: float, tails: int) -> Floats:
    """Interpolate velocities (P, 4) of period 2π/N at a disc phase, (4,)."""
    return at_phases(np.tile(u, (tails, 1))[None], np.array([phase]))[0, 0]
