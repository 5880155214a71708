"""Plans and tables that several tests look at."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import softflagella as sf
from surrogate.tabulate import tabulate
from tests.shared import shared

ROBOT = sf.load_robot("paper-control")
ODD = replace(ROBOT, effects={"left_right_bias": 0.2})  # the shipped table does not know it
START, GOAL = (0, 0, 0), (0.8, 0.2, 0.3)


@shared
def goal() -> sf.Plan[sf.Trip]:
    return sf.to_goal(START, GOAL, ROBOT, keep_out=[sf.Circle(1.2, -1.5, 0.3)])


@shared
def own_table(*, odd: bool = False) -> Any:
    return tabulate(ODD if odd else ROBOT)
