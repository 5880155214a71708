"""The domain of a table: joint support, refusals and flags."""

from __future__ import annotations

import numpy as np
import pytest

from sim.io.errors import InputError
from surrogate.table.support import Support
from tests.surrogate.small import table


def test_the_support_is_joint() -> None:
    """Two inputs that always move together: one high and one low is outside, though each alone is in range."""
    random = np.random.default_rng(1)
    x, noise = random.standard_normal((4000, 1)), 0.05 * random.standard_normal((4000, 2))
    support = Support.learned(np.concatenate([x, x], 1) + noise)
    points = np.array([[0.0, 0.0], [1.5, 1.5], [-1.0, -1.05], [1.0, -1.0], [6.0, 6.0]])
    assert (support.novelty(points) <= 1).tolist() == [True, True, True, False, False]


@pytest.mark.parametrize("size", [7, 13])
def test_each_input_must_be_in_its_range(size: int) -> None:
    """Along one input alone the joint measure grows slowly: a tenth beyond the range it is below its limit."""
    x = np.random.default_rng(3).uniform(-1, 1, (4000, size))
    support = Support.learned(x)
    points = np.zeros((2, size))
    points[:, 2] = [0.99, 1.1]
    inside, beyond = support.novelty(points)
    assert inside < 1
    assert beyond == pytest.approx((1.1 - support.shift[2]) / support.scale[2])


def one_robot(**changes: float) -> dict[str, np.ndarray]:
    robot = {"C_t": 3.0, "C_r": 2.8, "C_yr": 2.0, "l_over_R": 6.875, "L_over_R": 3.75, "l_over_r0": 34.375,
             "omega_bar": 10.0, "N": 3.0, "a_over_R": 1.0}  # fmt: skip
    return {name: np.array([value]) for name, value in (robot | changes).items()}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"omega_bar": 2000.0}, "row 1 is outside the look-up table.*omega_bar = 2000, learned were"),
        ({"l_over_r0": 500.0}, "l_over_r0 = 500"),
        ({"N": 2.0}, "none with as many tails"),
        ({"C_yr": 900.0, "C_t": 0.01}, "outside the look-up table"),
    ],
)
def test_robots_outside_are_refused_or_flagged(changes: dict[str, float], message: str) -> None:
    robot = one_robot(**changes)
    with pytest.raises(InputError, match=message):
        table().query(robot)
    assert table().query(robot, flag=True)["outside"].tolist() == [True]


def test_a_robot_inside_is_answered() -> None:
    assert table().query(one_robot(), flag=True)["outside"].tolist() == [False]
