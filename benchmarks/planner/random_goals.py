"""Plans from pose to pose for many random tasks of the paper's control robot."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from planner.goal.goal_plan import GoalPlan
from planner.goal.route import NoWayError
from planner.goal.to_goal import to_goal
from sim.model.presets import PRESETS
from surrogate.table.model_file import load


class Trip(NamedTuple):
    """One planned case."""

    seed: int
    goal_plan: GoalPlan
    seconds: float  # of processor time


def planned(case: Callable[[np.random.Generator], dict[str, Any]], seeds: range, heads: str) -> Iterator[Trip]:
    """Plan random cases, and print a line for each that has no way.

    Args:
        case: makes the arguments of `planner.goal.to_goal.to_goal` from a random generator.
        seeds: of the generators, one for each case.
        heads: of the columns that the caller prints.
    """
    threadpool_limits(1)
    robot, lookup = PRESETS["paper-control"], load()
    print(f" seed{heads}")
    for seed in seeds:
        began = time.process_time()
        try:
            goal_plan = to_goal(robot=robot, lookup=lookup, **case(np.random.default_rng(seed)))
        except NoWayError as none:
            print(f"{seed:5d} {none} ({time.process_time() - began:.1f} s)")
            continue
        yield Trip(seed, goal_plan, time.process_time() - began)
