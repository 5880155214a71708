"""The tails of a steadily swimming robot over one revolution of the disc, for pictures and for starting values.

Positions in l, in the body frame: origin J at the disc's centre, e_x sideways, e_y up, e_z forward along the axis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim import direct
from sim.balance import assemble
from sim.errors import InputError
from sim.orbit import FIRST_PHASE
from sim.robot import Robot

Floats = NDArray[np.float64]


def tails_over_a_revolution(robot: Robot, frames: int) -> tuple[Floats, Floats]:
    """Disc phases (F,) and tails (F, N, n + 1, 3), clamp to tip, with the motor in its positive direction.

    Raises:
        InputError: the robot has no steady motion on which its tails move alike.
    """
    groups = robot.groups()
    row = direct.bodies(assemble(groups, edges=2), groups)[0]
    ended, _, _, x, _ = direct.solve(row, groups.N)
    if ended != direct.SOLVED:
        raise InputError(f"{robot.name} has no shape to draw: {direct.REASONS[ended]}")
    phases = 2 * np.pi * np.arange(frames) / frames
    root = np.zeros((1, x.shape[1], 3))
    root[:, :, 0] = float(groups.a_over_R / groups.l_over_R)
    nodes = np.concatenate([root, x])
    tails = np.empty((frames, groups.N, len(nodes), 3))
    for j in range(groups.N):
        turn = phases + 2 * np.pi * j / groups.N  # tail j is tail 0 a j-th part of a turn later
        shape = np.einsum("fm,kmc->fkc", _interpolation(turn - FIRST_PHASE, x.shape[1]), nodes)
        cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
        tails[:, j, :, 0] = cos * shape[..., 0] - sin * shape[..., 1]
        tails[:, j, :, 1] = sin * shape[..., 0] + cos * shape[..., 1]
        tails[:, j, :, 2] = shape[..., 2]
    return phases, tails


def _interpolation(at: Floats, phases: int) -> Floats:
    """Values of the trigonometric interpolant on M equal phases from 0 at phases `at`, (F, M)."""
    away = at[:, None] - 2 * np.pi * np.arange(phases) / phases
    total = np.ones_like(away)
    for k in range(1, (phases + 1) // 2):
        total += 2 * np.cos(k * away)
    if phases % 2 == 0:
        total += np.cos(phases // 2 * away)
    return np.asarray(total / phases)
