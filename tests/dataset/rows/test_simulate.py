"""Rows: a row depends on nothing but itself, what fails says why, and nothing asks for more than a row may."""

from __future__ import annotations

import numpy as np
import pytest

from dataset.rows.design import load_design
from dataset.rows.schema import COST
from dataset.rows.simulate import simulate
from sim.model.presets import PRESETS
from sim.model.slopes import SLOPE_INPUTS

CONTROL = {**PRESETS["paper-control"].group_values(), "history": True}


def some_rows(*changes: dict[str, float]) -> dict[str, np.ndarray]:
    return {
        name: np.array([{**CONTROL, **change}[name] for change in changes]) for name in {**CONTROL, **changes[0]}
    }


def bits(columns: dict[str, np.ndarray], row: int) -> dict[str, object]:
    return {name: values[row].tobytes() for name, values in columns.items() if name != COST}


@pytest.mark.parametrize("rows", [4, pytest.param(24, marks=pytest.mark.rest)])
def test_any_batch_and_any_order_give_the_same_bits(rows: int) -> None:
    """Robots that fall back to time steps used to take their mesh from the fastest robot of their batch."""
    points = load_design().with_rows(rows).points()
    quick = {"C_t": 0.55, "C_r": 0.54, "C_yr": 4.1, "l_over_R": 3.82, "L_over_R": 4.24, "l_over_r0": 16.2,
             "omega_bar": 117.0, "N": 6.0}  # fmt: skip
    points = {name: np.append(values, quick[name]) for name, values in points.items()}
    points["history"] = np.arange(rows + 1) % 8 == 0
    together = simulate(points)
    assert together["reason"][-1]  # it is stepped in time
    order = np.random.default_rng(2).permutation(rows + 1)
    mixed = simulate({name: values[order] for name, values in points.items()})
    for place, row in enumerate(order.tolist()):
        assert bits(mixed, place) == bits(together, row), row
    for row in (0, rows // 3, rows):
        alone = simulate({name: values[row : row + 1] for name, values in points.items()})
        assert bits(alone, 0) == bits(together, row), row


def test_rows_beyond_their_budget_say_so() -> None:
    """C_t = C_r = 1e-9 asked for 24 TiB, ω̄ = 1e-6 for days, ω̄ = 1e9 for 85 GiB."""
    found = simulate(some_rows({"C_t": 1e-9, "C_r": 1e-9}, {"omega_bar": 1e-6}, {"omega_bar": 1e9}, {}))
    assert found["failed"].tolist() == [True, True, True, False]
    assert all(found["reason"][:3])
    assert found["reason"][3] == ""
    assert np.isnan(found["omega_yr_bar"][:3]).all()
    assert np.isnan(found["lag_z"][:3]).all()
    assert found[COST].max() < 60


def test_one_to_eight_tails_other_discs_and_a_reversed_motor() -> None:
    found = simulate(
        some_rows(
            {"N": 1.0, "a_over_R": 1.0}, {"N": 8.0, "a_over_R": 1.0}, {"a_over_R": 0.5},
            {"omega_bar": -10.0, "a_over_R": 1.0}, {"omega_bar": 150.0, "a_over_R": 1.0},
            {"omega_bar": 10.0, "a_over_R": 1.0},
        )
    )  # fmt: skip
    assert found["converged"].all()
    assert found["omega_yr_bar"][3] == pytest.approx(-found["omega_yr_bar"][5], rel=1e-9)
    assert found["net_speed_bar"][3] == pytest.approx(found["net_speed_bar"][5], rel=1e-6)


def test_memory_and_rest_are_simulated_where_asked_for() -> None:
    found = simulate(some_rows({"history": True}, {"history": False}))
    assert np.isfinite(found["memory_psi_rad"][0]).all()
    assert np.isfinite(found["rest_z"][0]).all()
    assert np.isnan(found["memory_psi_rad"][1]).all()
    assert found["lag_z"][0] == pytest.approx(found["lag_z"][1], abs=1e-12)


def test_derivatives_on_request() -> None:
    """Against differences of rows."""
    step = 1e-3
    rows = some_rows(
        {"history": False}, {"history": False, "C_yr": 2.0 - step}, {"history": False, "C_yr": 2.0 + step}
    )
    found = simulate(rows, sensitivities=True)
    place = SLOPE_INPUTS.index("C_yr")
    for name in ("omega_yr_bar", "v_x", "v_z", "R_yr_over_l"):
        slope = (found[name][2] - found[name][1]) / (2 * step)
        assert found[f"d_{name}"][0, place] == pytest.approx(slope, rel=1e-3, abs=1e-5)


def test_odd_effects_make_the_two_directions_differ() -> None:
    found = simulate(some_rows(*({"omega_bar": speed, "left_right_bias": 0.05} for speed in (10.0, -10.0))))
    assert found["converged"].all()
    assert abs(found["omega_yr_bar"].sum() / found["omega_yr_bar"][0]) > 0.01


def test_failed_rows_are_kept_and_flagged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither an orbit nor a time step can be solved."""
    from sim.motion import response, run, settling, steady
    from sim.motion.orbits import Orbits
    from sim.solve.refinement import NO_START

    def lost(rows: np.ndarray, *_: object, **__: object) -> Orbits:
        count, none = len(rows), np.full(len(rows), np.nan)
        means, slopes = np.full((count, 5), np.nan), np.empty((count, 0, 5))
        return Orbits(means, slopes, none, np.full(count, NO_START), none, none)

    monkeypatch.setattr(steady, "solve_orbits", lost)
    monkeypatch.setattr(response, "orbits_with_phases", lambda rows, _, meshes: [[None] * len(rows)] * len(meshes))
    monkeypatch.setattr(settling, "state_on_orbit", lambda *_: None)
    monkeypatch.setattr(run, "advance", lambda *_: False)
    columns = simulate(some_rows({}))
    assert columns["failed"].tolist() == [True]
    assert columns["converged"].tolist() == [False]
    assert np.isnan(columns["omega_yr_bar"]).all()
    assert np.isnan(columns["net_speed_bar"]).all()
    assert columns["reason"][0]
