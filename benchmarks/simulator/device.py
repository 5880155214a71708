"""Cost of tensor time steps by batch size, on the processor and on a CUDA device if there is one.

The same code runs on both (`sim.reference`); on the processor the compiled loops of `sim.solve.march` are
the ones that everything else uses, and stand beside it.

Usage: python -m benchmarks device

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
from sim.reference.stepper import TensorState, at_rest, step

BATCHES = (1, 16, 256, 4096)
EDGES = 16
_STEPS = 20


def robots(count: int) -> Groups:
    """Repeat the paper's control robot `count` times."""
    values = PRESETS["paper-control"].group_values()
    return Groups.from_columns({k: np.full(count, v) for k, v in values.items()})


def robot_step(count: int, device: str) -> tuple[float, TensorState]:
    """Time one robot's step in a batch, in seconds; return where the batch is after 2 × 20 steps, too."""
    batch = tensor_robots(robots(count), edges=EDGES, device=device)
    dt = torch.full_like(batch.body.omega, 0.02)
    state = at_rest(batch)
    for _round in range(2):  # the first is for warming up
        if device == "cuda":
            torch.cuda.synchronize()
        begin = time.perf_counter()
        for _ in range(_STEPS):
            state = step(batch, state, batch.body.omega, dt)
        if device == "cuda":
            torch.cuda.synchronize()
        spent = time.perf_counter() - begin
    return spent / _STEPS / count, state


def main() -> None:
    devices = ["cpu"] + (["cuda"] if torch.cuda.is_available() else [])
    alone = 1e6 * step_time(2, EDGES)
    print(f"A robot's time step [µs], {EDGES} edges, N = 2; compiled loops, one robot: {alone:.0f}")
    print("  robots " + "".join(f"{d:>12}" for d in devices))
    for count in BATCHES:
        steps = [robot_step(count, device) for device in devices]
        print(f"  {count:6d} " + "".join(f"{1e6 * t:12.1f}" for t, _ in steps))
        if len(steps) == 2:
            away = (steps[1][1].pose.cpu() - steps[0][1].pose).abs().max()
            print(f"         the two differ by {float(away):.0e}")
    if len(devices) == 1:
        print("No CUDA device here: only the processor was timed.")
