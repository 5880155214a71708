"""The head's balance: in both directions, with effects by algebra."""

from __future__ import annotations

import numpy as np
import pytest

from sim.effects import catalogue
from sim.io.errors import InputError
from sim.motion.batches import steady_columns
from surrogate.table.jacobian import numbers_of
from surrogate.table.model_file import load
from surrogate.wrench.heads import heads_and_tails, needs_no_learning, slope_at, unbalanced
from tests.oracles.balance import linear_guess
from tests.surrogate.small import rows, table


@pytest.mark.parametrize("effect", [name for name in catalogue() if needs_no_learning(name)])
def test_effects_on_head_disc_and_motor_need_no_learning(effect: str) -> None:
    """The shipped table is right with the effect, in both directions of the motor."""
    robot = {"C_t": 3.0, "C_r": 2.8, "C_yr": 2.0, "l_over_R": 6.875, "L_over_R": 3.75, "l_over_r0": 34.375,
             "omega_bar": 10.0, "N": 4.0}  # fmt: skip
    both = {name: np.array([value, value]) for name, value in robot.items()}
    both["omega_bar"] = both["omega_bar"] * [1.0, -1.0]
    both[effect] = np.full(2, catalogue()[effect].typical)
    truth, answer = steady_columns(both, title="", jobs=1), load().query(both)
    for name in ("omega_yr_bar", "omega_t_bar", "v_x", "R_yr_over_l"):
        assert answer[name] == pytest.approx(truth[name], rel=0.005), name
    if catalogue()[effect].symmetry == "odd":
        assert abs(truth["omega_yr_bar"].sum()) > 1e-3 * abs(truth["omega_yr_bar"][0])


def test_effects_on_the_tails_are_refused() -> None:
    robots = {name: values[:2] for name, values in rows().robots.items()}
    for effect in ("tail_sag", "tail_interaction", "natural_curvature"):
        with pytest.raises(InputError, match=f"{effect} changes more.*surrogate robot"):
            heads_and_tails({**robots, effect: np.full(2, 0.1)})
        heads_and_tails({**robots, effect: np.zeros(2)})


def test_the_derivative_is_that_of_differences() -> None:
    robots = {name: values[:5] for name, values in rows().robots.items()}
    heads, tails = heads_and_tails(robots)
    network = table().tails.wrench[2]
    assert network is not None
    numbers = numbers_of(network)
    u = linear_guess(heads, tails)
    value = unbalanced(heads, tails, u, numbers)
    slope = slope_at(lambda v: unbalanced(heads, tails, v, numbers), u)
    direction = np.array([0.3, -0.2, 0.5, 0.1]) * u
    moved = unbalanced(heads, tails, u + 1e-6 * direction, numbers)
    wanted = (slope @ direction[..., None])[..., 0]
    assert np.allclose((moved - value) / 1e-6, wanted, rtol=1e-3, atol=1e-4 * np.abs(wanted).max())
