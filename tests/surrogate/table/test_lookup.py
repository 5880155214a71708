"""A trained table: mirror images, derivatives, certificates, response curves."""

from __future__ import annotations

import numpy as np
import pytest

from sim.io.errors import InputError
from sim.model.response import DWELLS, SETTLED
from surrogate.table.certify import certified_error
from surrogate.table.response_table import between_dwells
from tests.surrogate.small import robots_inside, table


def test_a_reversed_motor_mirrors_the_answer() -> None:
    robots = robots_inside()
    forward = table().query(robots)
    backward = table().query({**robots, "omega_bar": -robots["omega_bar"]})
    for name in ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x"):
        assert np.allclose(backward[name], -forward[name])
    for name in ("v_z", "R_yr_over_l", "theta_deg", "tail_gap"):
        assert np.allclose(backward[name], forward[name])
    robots["dwell_bar"] = np.full(len(robots["N"]), 1.0)
    other = {**robots, "omega_bar": -robots["omega_bar"]}
    assert np.allclose(table().query(robots)["net_speed_bar"], table().query(other)["net_speed_bar"])


def test_the_jacobian_is_that_of_differences() -> None:
    robots = robots_inside()
    slopes = table().jacobian(robots, ["C_t", "omega_bar", "end_over_end_drag"])
    for name in ("C_t", "omega_bar"):
        width = 1e-4 * robots[name]
        high, low = (table().query({**robots, name: robots[name] + s * width}) for s in (1, -1))
        for output in ("omega_yr_bar", "v_z", "theta_deg", "tail_gap"):
            wanted = (high[output] - low[output]) / (2 * width)
            assert np.allclose(slopes[output][name], wanted, rtol=1e-3, atol=1e-6 * np.abs(wanted).max())
    drag = table().query({**robots, "end_over_end_drag": np.full(len(robots["N"]), 1e-4)})
    wanted = (drag["omega_yr_bar"] - table().query(robots)["omega_yr_bar"]) / 1e-4
    assert np.allclose(slopes["omega_yr_bar"]["end_over_end_drag"], wanted, rtol=1e-2)


def test_a_certified_error_is_the_difference_from_the_simulator() -> None:
    robots = robots_inside(3)
    answer = table().query(robots, certify=True)
    assert (answer["certified_error"] < 0.3).all()
    wrong = {**answer, "omega_yr_bar": 1.5 * answer["omega_yr_bar"]}
    assert (certified_error(robots, wrong) > 0.4).all()


def test_responses_are_curves_that_end_constant() -> None:
    robots = robots_inside()
    found = table().response(robots)
    late = DWELLS >= SETTLED
    assert late.sum() >= 2
    assert np.allclose(np.diff(found.lag[:, late], axis=1), 0, atol=1e-12)
    assert (found.spread >= 0).all()
    assert np.isfinite(found.net_speed).all()
    assert found.lag.shape == (len(robots["N"]), len(DWELLS), 3)


def test_between_the_dwells_of_a_table_lags_are_smooth() -> None:
    curve = np.stack([np.exp(-DWELLS), np.sin(DWELLS), np.log(DWELLS)], -1)[None]
    times = np.geomspace(0.2, 2.0, 200)
    found = between_dwells(np.repeat(curve, 200, 0), times)
    assert np.allclose(found, np.stack([np.exp(-times), np.sin(times), np.log(times)], -1), atol=2e-3)
    assert np.allclose(between_dwells(curve, np.array([50.0])), curve[:, -1])


def test_odd_effects_and_single_tails_have_no_learned_response() -> None:
    robots = robots_inside(1)
    with pytest.raises(InputError, match="left and right turns differ"):
        table().response({**robots, "left_right_bias": np.array([0.1])})
    with pytest.raises(InputError, match="dwell_bar = 0"):
        table().query({**robots, "dwell_bar": np.array([0.01])})
