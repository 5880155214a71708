"""Robots for the simulator's tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from sim.balance import Swimmer, assemble
from sim.robot import PRESETS, Groups

CONTROL_VALUES = PRESETS["paper-control"].group_values()


def control(count: int = 1, **changes: object) -> Groups:
    """`count` copies of the paper's control robot with changed columns (numbers or arrays)."""
    values = {**CONTROL_VALUES, **changes}
    return Groups.from_columns({k: np.broadcast_to(np.asarray(v, float), count).copy() for k, v in values.items()})


def held(swimmer: Swimmer) -> Swimmer:
    """The same tails on a disc that nothing moves: the motor alone turns it."""
    resistance = 1e12 * torch.eye(4, 5, dtype=torch.float64).unsqueeze(-1).expand(4, 5, swimmer.robots)
    return replace(swimmer, resistance=resistance)


def single_filament(edges: int, omega_bar: float, l_over_r0: float, offset: float) -> tuple[Swimmer, Groups]:
    """One filament at distance `offset` [l] from the axis, turned at `omega_bar`."""
    groups = control(N=1, omega_bar=omega_bar, l_over_r0=l_over_r0, a_over_R=offset * CONTROL_VALUES["l_over_R"])
    return held(assemble(groups, edges=edges)), groups
