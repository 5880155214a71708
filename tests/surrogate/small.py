"""A small table for tests: real robots with three and four tails, simulated and learned in seconds."""

from __future__ import annotations

from functools import cache

import numpy as np

from surrogate.networks.training_loop import Settings
from surrogate.table.lookup import NeuralTable
from surrogate.training.simulated import SimulatedRobots, draw_robots, simulate_robots
from surrogate.training.train import learn

TAILS = Settings(width=20, depth=2, members=2, epochs=40, iterations=60)
CURVES = Settings(width=16, depth=1, members=1, epochs=30, iterations=20)


@cache
def rows(count: int = 512, seed: int = 11, *, wide: bool = True) -> SimulatedRobots:
    """Simulate robots with three or four tails."""
    robots = draw_robots(count, seed, wide=wide)
    return simulate_robots(robots | {"N": 3.0 + robots["N"] % 2})


@cache
def flips() -> SimulatedRobots:
    """Simulate robots with response curves."""
    robots = draw_robots(32, 12, wide=False)
    return simulate_robots(robots | {"N": np.full(32, 3.0)}, curves=True)


@cache
def table() -> NeuralTable:
    """Train a table on them; its errors are some per cent."""
    held = rows(256, 13, wide=False)
    return learn(rows(), held.at(np.arange(len(held)) % 2 == 0), held, flips(), TAILS, CURVES)


def robots_inside(count: int = 6) -> dict[str, np.ndarray]:
    """Draw robots inside the small table's domain."""
    robots = rows(256, 13, wide=False).robots
    inside = np.flatnonzero(~table().query(robots, flag=True)["outside"])[:count]
    return {name: values[inside] for name, values in robots.items()}
