"""Which network belongs to a robot, and how its motion depends on the wrench; `test_lookup.py` has motions."""

from __future__ import annotations

import numpy as np

from sim.model.groups import checked_values
from surrogate.table.wrench_table import motion_sensitivity, network_index
from surrogate.wrench.heads import heads_and_tails
from tests.planner.page.page_core import answers
from tests.planner.page.robots import check_alike, columns_of, random_groups


def test_the_network_of_a_robot() -> None:
    numbers = [1, 2, 3, 4, 8]
    found = answers([("wrench_table.js", "networkIndex", number) for number in numbers])
    assert found == network_index(np.array(numbers)).tolist()


def test_sensitivity_of_the_motion() -> None:
    robots = random_groups(10)
    heads, tails = heads_and_tails(checked_values(columns_of(robots)))
    motion = np.abs(np.random.default_rng(0).normal(size=(10, 5)))
    parts = answers([("heads.js", "headAndTails", robot) for robot in robots])
    found = answers(
        [
            ("wrench_table.js", "motionSensitivity", part["head"], part["tails"], move)
            for part, move in zip(parts, motion, strict=True)
        ]
    )
    wanted = motion_sensitivity(heads, tails, motion).reshape(10, -1)
    check_alike(np.reshape(found, (10, -1)).T, wanted.T)
