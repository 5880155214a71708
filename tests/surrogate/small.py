"""A small table for tests: real robots with three and four tails, learned in seconds; refusals of files."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from common.errors import InputError
from sim.model.presets import PRESETS
from surrogate.robot_table import RobotTable
from surrogate.table import NeuralTable
from surrogate.table_file import load
from surrogate.tabulate import tabulate
from surrogate.training import fits
from surrogate.training.networks import Settings
from surrogate.training.simulated import SimulatedRobots, draw_robots, simulate_robots
from surrogate.training.train import learn
from tests.shared import shared

NO_PYTHON = re.compile(r"Error|Exception|Traceback|object|__|<class")
TAILS = Settings(width=20, depth=2, members=2, epochs=40, iterations=60)
CURVES = Settings(width=16, depth=1, members=1, epochs=30, iterations=20)


@shared
def rows(count: int = 512, seed: int = 11, *, wide: bool = True) -> SimulatedRobots:
    """Simulate robots with three or four tails."""
    robots = draw_robots(count, seed, wide=wide)
    return simulate_robots(robots | {"N": 3.0 + robots["N"] % 2})


@shared
def flips() -> SimulatedRobots:
    """Simulate robots with response curves."""
    robots = draw_robots(32, 12, wide=False)
    return simulate_robots(robots | {"N": np.full(32, 3.0)}, curves=True)


@shared
def table() -> NeuralTable:
    """Train a table on them; its errors are some per cent."""
    held = rows(256, 13, wide=False)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fits, "_GAP", CURVES)
        return learn(rows(), held.at(np.arange(len(held)) % 2 == 0), held, flips(), TAILS, CURVES)


@shared
def robot_table(effect: float = 0.0) -> RobotTable:
    """Tabulate the paper's control robot, with an effect."""
    return tabulate(replace(PRESETS["paper-control"], effects={"end_over_end_drag": effect} if effect else {}))


def robots_inside(count: int = 6) -> dict[str, np.ndarray]:
    """Draw robots inside the small table's domain."""
    robots = rows(256, 13, wide=False).robots
    inside = np.flatnonzero(~table().query(robots, flag=True)["outside"])[:count]
    return {name: values[inside] for name, values in robots.items()}


def refusal(path: Path, read: Callable[[Path], Any] = load) -> str:
    """Return the one plain line with which a file is refused."""
    with pytest.raises(InputError) as caught:
        read(path)
    words = str(caught.value)
    assert len(words.splitlines()) == 1
    assert words.startswith(str(path))
    assert not NO_PYTHON.search(words.removeprefix(str(path))), words
    return words
