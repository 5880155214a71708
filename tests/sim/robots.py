"""Robots for the simulator's tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from sim import direct, orbit
from sim.balance import Swimmer, assemble
from sim.robot import PRESETS, Groups
from sim.tail import body_of

CONTROL_VALUES = PRESETS["paper-control"].group_values()


def control(count: int = 1, **changes: object) -> Groups:
    """`count` copies of the paper's control robot with changed columns (numbers or arrays)."""
    values = {**CONTROL_VALUES, **changes}
    return Groups.from_columns({k: np.broadcast_to(np.asarray(v, float), count).copy() for k, v in values.items()})


def held(swimmer: Swimmer) -> Swimmer:
    """The same tails on a disc that nothing moves: the motor alone turns it."""
    resistance = 1e12 * torch.eye(4, 5, dtype=torch.float64).unsqueeze(-1).expand(4, 5, swimmer.robots)
    return replace(swimmer, resistance=resistance)


def held_loads(
    omega_bar: float, l_over_r0: float, offset: float, *, edges: int, **effects: float
) -> tuple[np.ndarray, np.ndarray]:
    """Mean wrench (F_x, F_z, M_y, M_z) of the fluid on one filament whose disc is held, and its nodes (n, 3)."""
    _, groups = single_filament(2, omega_bar, l_over_r0, offset, **effects)
    body = body_of(direct.bodies(groups)[0])
    body.resistance[:, :4] += 1e9 * np.eye(4)
    x, u = direct._start(body, edges, 2, 1)
    u[:] = 0.0
    matrix = direct.differentiation(2)
    _, size = orbit.newton(body, x, u, matrix, 1e-9, 40)
    assert size < 1e-9
    return orbit.tail_wrench(body, x, u, matrix), x[:, 0]


def extrapolated_loads(omega_bar: float, l_over_r0: float, offset: float, **effects: float) -> np.ndarray:
    """The same at the default resolution: the direct route's meshes, extrapolated."""
    values = [held_loads(omega_bar, l_over_r0, offset, edges=n, **effects)[0] for n in direct.MESHES]
    return direct.extrapolate(np.array(values))


def single_filament(
    edges: int, omega_bar: float, l_over_r0: float, offset: float, **effects: float
) -> tuple[Swimmer, Groups]:
    """One filament at distance `offset` [l] from the axis, turned at `omega_bar`."""
    offset *= CONTROL_VALUES["l_over_R"]
    groups = control(1, N=1, omega_bar=omega_bar, l_over_r0=l_over_r0, a_over_R=offset, **effects)
    return held(assemble(groups, edges=edges)), groups
