"""Cost of tensor time steps by batch size, beside the compiled loops that everything else uses.

Usage: python -m benchmarks tensors

Takes a minute.
"""

from __future__ import annotations

import time

import numpy as np
import torch

from benchmarks.simulator.scaling import step_time
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.reference.balance import tensor_robots
from sim.reference.stepper import at_rest, step

BATCHES = (1, 16, 256, 4096)
EDGES = 16
_STEPS = 20


def robots(count: int) -> Groups:
    """Repeat the paper's control robot `count` times."""
    values = PRESETS["paper-control"].group_values()
    return Groups.from_columns({k: np.full(count, v) for k, v in values.items()})


def robot_step(count: int) -> float:
    """Time one robot's step in a batch, in seconds."""
    batch = tensor_robots(robots(count), edges=EDGES)
    dt = torch.full_like(batch.body.omega, 0.02)
    state = at_rest(batch)
    for _round in range(2):  # the first is for warming up
        begin = time.perf_counter()
        for _ in range(_STEPS):
            state = step(batch, state, batch.body.omega, dt)
        spent = time.perf_counter() - begin
    return spent / _STEPS / count


def main() -> None:
    alone = 1e6 * step_time(2, EDGES)
    print(f"A robot's time step [µs], {EDGES} edges, N = 2; compiled loops, one robot: {alone:.0f}")
    for count in BATCHES:
        print(f"  {count:6d} robots {1e6 * robot_step(count):12.1f}")
