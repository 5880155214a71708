"""Groups that no robot has are refused in the same words. `test_lookup.py` has more of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sim.model.groups import checked_values
from tests.planner.page.page_core import answer, refusal_of
from tests.planner.page.robots import random_groups


@pytest.mark.parametrize(
    "change",
    [{"C_t": np.inf}, {"C_yr": np.nan}, {"L_over_R": 0.0}, {"a_over_R": 0.0}, {"a_over_R": -1.0}, {"N": 2.5},
     {"N": 1e9}, {"l_over_r0": 5.0}, {"omega_bar": 0.0}],
    ids=str,
)  # fmt: skip
def test_refusals(change: dict[str, Any]) -> None:
    robot = random_groups(1)[0] | change
    words = {name: {"number": str(value).replace("inf", "Infinity").replace("nan", "NaN")}
             if not np.isfinite(value) else value for name, value in robot.items()}  # fmt: skip
    columns = {name: np.array([value]) for name, value in robot.items()}
    assert str(answer("groups.js", "checkedGroups", words)) == refusal_of(checked_values, columns)


def test_a_robot_that_lacks_a_group_or_has_a_word_for_it() -> None:
    robot: dict[str, Any] = dict(random_groups(1)[0])
    for change in ({"C_t": "much"}, {"C_t": None}):
        found = str(answer("groups.js", "checkedGroups", robot | change))
        assert found == refusal_of(checked_values, {**robot, "C_t": np.array(["much"])})
    del robot["C_r"]
    assert str(answer("groups.js", "checkedGroups", robot)) == refusal_of(checked_values, robot)


def test_the_disc_has_the_size_of_the_head_by_default() -> None:
    robot = {name: value for name, value in random_groups(1)[0].items() if name != "a_over_R"}
    assert answer("groups.js", "checkedGroups", robot) == robot | {"a_over_R": 1.0}
