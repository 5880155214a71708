"""Rows: a row depends on nothing but itself, what fails says why, and nothing asks for more than a row may."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dataset.schema import COST
from dataset.simulate import simulate
from sim.model.presets import PRESETS
from sim.model.sweepable import SLOPE_INPUTS
from sim.motion import response, run, settling, steady
from sim.solve.march import Steps
from sim.solve.refinement import LOST, NO_START, Orbit

CONTROL = {**PRESETS["paper-control"].group_values(), "history": True}


def some_rows(*changes: dict[str, float]) -> dict[str, np.ndarray]:
    """Return columns of rows of the control robot with changes."""
    names = {name for change in changes for name in change} - set(CONTROL)
    base = {**CONTROL, **dict.fromkeys(names, 0.0), "a_over_R": 1.0}
    return {name: np.array([{**base, **change}[name] for change in changes]) for name in base}


def test_a_row_does_not_depend_on_its_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor does one that falls back to time steps, whose mesh is that of its own speed."""

    def lose_slow_and_fast(rows: np.ndarray, *words: Any) -> list[Orbit]:
        orbits = zip(np.abs(rows[:, 0]), refined_orbits(rows, *words), strict=True)
        return [lost(orbit) if speed < 9 or speed > 29 else orbit for speed, orbit in orbits]

    def lost(orbit: Orbit) -> Orbit:
        return orbit._replace(status=LOST, means=np.full(5, np.nan))

    refined_orbits = steady.refined_orbits
    monkeypatch.setattr(steady, "refined_orbits", lose_slow_and_fast)
    speeds = (8.0, 30.0, 10.0, 15.0, 20.0)
    points = some_rows(*({"omega_bar": speed, "history": speed == 15.0} for speed in speeds), {"N": 3.0})
    together = simulate(points)
    assert [bool(reason) for reason in together["reason"]] == [True, True, False, False, False, False]
    order = np.random.default_rng(2).permutation(6)
    mixed = [simulate({name: values[some] for name, values in points.items()}) for some in np.split(order, [2])]
    for name, values in together.items():
        if name != COST:
            assert np.concatenate([part[name] for part in mixed]).tobytes() == values[order].tobytes(), name


def test_rows_beyond_their_budget_say_so() -> None:
    """C_t = C_r = 1e-9 asked for 24 TiB, ω̄ = 1e-6 for days, ω̄ = 1e9 for 85 GiB."""
    found = simulate(some_rows({"C_t": 1e-9, "C_r": 1e-9}, {"omega_bar": 1e-6}, {"omega_bar": 1e9}, {}))
    assert found["failed"].tolist() == [True, True, True, False]
    assert all(found["reason"][:3])
    assert found["reason"][3] == ""
    assert np.isnan(found["omega_yr_bar"][:3]).all()
    assert np.isnan(found["lag_z"][:3]).all()
    assert found[COST].max() < 60


def test_one_to_eight_tails_other_discs_a_reversed_motor_and_memory_where_asked_for() -> None:
    found = simulate(
        some_rows(
            {"N": 1.0}, {"N": 8.0, "history": False}, {"a_over_R": 0.5}, {"omega_bar": 150.0},
            {"omega_bar": -10.0, "history": False}, {}, {"left_right_bias": 0.05},
            {"omega_bar": -10.0, "left_right_bias": 0.05},
        )
    )  # fmt: skip
    assert found["converged"].all()
    yaw, net = found["omega_yr_bar"], found["net_speed_bar"]
    assert yaw[4] == pytest.approx(-yaw[5], rel=1e-9)
    assert abs(yaw[6] + yaw[7]) > 0.01 * abs(yaw[6])
    known = np.isfinite(net[4])
    assert net[4][known] == pytest.approx(net[5][known], rel=1e-6)
    for name in ("memory_psi_rad", "rest_z"):
        assert np.isfinite(found[name]).all(1).tolist() == [True, False, True, True, False, True, True, True]
    assert found["lag_z"][4] == pytest.approx(found["lag_z"][5], abs=1e-9)


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


def test_failed_rows_are_kept_and_flagged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither an orbit nor a time step can be solved."""

    none = (np.full((6, 2, 3), np.nan),) * 3
    lost = Orbit(NO_START, np.nan, np.full(5, np.nan), none, none)
    monkeypatch.setattr(steady, "refined_orbits", lambda rows, *_: [lost] * len(rows))
    monkeypatch.setattr(response, "orbits_with_phases", lambda rows, _, meshes: [[None] * len(rows)] * len(meshes))
    monkeypatch.setattr(settling, "state_on_orbit", lambda *_: None)
    monkeypatch.setattr(run, "advance", lambda *_, shapes: Steps(False, np.empty((0, 6)), np.empty(shapes)))
    columns = simulate(some_rows({}))
    assert columns["failed"].tolist() == [True]
    assert columns["converged"].tolist() == [False]
    assert np.isnan(columns["omega_yr_bar"]).all()
    assert np.isnan(columns["net_speed_bar"]).all()
    assert columns["reason"][0]
