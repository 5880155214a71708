"""Domain and intervals: joint support, refusals, coverage."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from dataset.rows.design import load_design
from sim.io.errors import InputError
from surrogate.input_ranges import BOUNDS, DOMAIN, MOST_TAILS, WIDE
from surrogate.table.intervals import Intervals
from surrogate.table.support import Support
from tests.surrogate.small import rows, table


def test_the_support_is_joint() -> None:
    """Two inputs that always move together: one high and one low is outside, though each alone is in range."""
    generator = torch.Generator().manual_seed(1)
    x = torch.randn(4000, 1, generator=generator).double()
    noise = 0.05 * torch.randn(4000, 2, generator=generator).double()
    support = Support.of(torch.cat([x, x], 1) + noise)
    points = torch.tensor([[0.0, 0.0], [1.5, 1.5], [-1.0, -1.05], [1.0, -1.0], [6.0, 6.0]]).double()
    assert (support.remoteness(points.numpy()) <= 1).tolist() == [True, True, True, False, False]


def test_the_sweep_of_the_domain_and_the_bounds_of_the_inverse_are_those_of_the_domain() -> None:
    axes = load_design(Path(__file__).parents[2] / "surrogate/shipped/domain.toml").axes
    assert {name: (axis.low, axis.high) for name, axis in axes.items()} == {**DOMAIN, "N": (1, MOST_TAILS)}
    for name, (low, high) in BOUNDS.items():
        assert WIDE[name][0] <= low <= DOMAIN[name][0]
        assert DOMAIN[name][1] <= high <= WIDE[name][1]


def sampled(count: int, generator: torch.Generator, size: Callable[[Tensor], Tensor]) -> tuple[Tensor, Tensor]:
    """Hints with values from 0 to 1, a fifth of them with one tail, and errors of that size."""
    hints = torch.rand(count, 8, generator=generator).double()
    hints[:, -1] = (hints[:, -1] < 0.2).double()
    return hints, size(hints) * torch.randn(count, generator=generator).double()


def covered(size: Callable[[Tensor], Tensor]) -> tuple[Intervals, Tensor, Tensor]:
    """Intervals learned from such errors, fresh hints, and which of their errors are inside."""
    generator = torch.Generator().manual_seed(2)
    (x, error), (more, other), (test, last) = (sampled(n, generator, size) for n in (3000, 3000, 20000))
    found = Intervals.learned(x, {"v": error}, more, {"v": other})
    inside = last.abs() <= found.half_widths("v", test, torch.ones(len(test)).double())
    return found, test, inside.double()


def test_intervals_cover_as_they_say() -> None:
    """Errors whose size depends on an input: 90 % are covered, on the loud side and on the quiet side."""
    _, test, inside = covered(lambda x: torch.exp(3 * x[:, 0]))
    assert float(inside.mean()) == pytest.approx(0.9, abs=0.02)
    for side in (test[:, 0] < 0.3, test[:, 0] > 0.7):
        assert 0.86 < float(inside[side].mean()) < 0.94


def test_intervals_cover_in_each_part() -> None:
    """Errors that are large in one octant and for one tail only, which the local width cannot follow."""
    found, test, inside = covered(
        lambda x: 1 + 8 * (x[:, [0, 3, 5]] > 0.5).all(1).double() + 20 * (x[:, -1] > 0.5).double()
    )
    part = found.part_of(test)
    assert sorted(set(part.tolist())) == list(range(9))
    for k in range(9):
        assert 0.85 < float(inside[part == k].mean()) < 0.95


def test_a_query_gives_intervals_around_its_answer() -> None:
    robots = rows(256, 13, wide=False).robots
    found = table().query(robots, intervals=True, flag=True)
    for name in ("omega_yr_bar", "v_z", "theta_deg"):
        assert (found[f"{name}_low"] < found[name]).all()
        assert (found[f"{name}_high"] > found[name]).all()
    assert found["outside"].mean() < 0.2


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
