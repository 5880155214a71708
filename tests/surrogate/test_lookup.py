"""A trained table: mirror images, derivatives, the table backwards, response curves, training."""

from __future__ import annotations

import numpy as np
import pytest

import surrogate.training.train as training
from sim.io.errors import InputError
from sim.model.response import DWELLS, SETTLED
from surrogate.table.certify import certified_error
from surrogate.table.errors import summary
from surrogate.table.inverse import design, inverse
from surrogate.table.response_table import between_dwells
from surrogate.training.simulated import draw_robots, simulate_robots
from tests.surrogate.small import CURVES, TAILS, flips, rows, table


def inside(count: int = 6) -> dict[str, np.ndarray]:
    """Robots inside the small table's domain."""
    robots = rows(256, 13, wide=False).robots
    good = np.flatnonzero(~table().query(robots, flag=True)["outside"])[:count]
    return {name: values[good] for name, values in robots.items()}


def test_a_reversed_motor_mirrors_the_answer() -> None:
    robots = inside()
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
    robots = inside()
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


def test_inverse_finds_the_coefficients() -> None:
    robots = inside(3)
    found = table().query(robots)
    targets = {name: found[name] for name in ("omega_t_bar", "omega_yr_bar", "v_z")}
    bounds = {"C_t": (0.5, 8.0), "C_r": (0.5, 6.0), "C_yr": (0.2, 12.0)}
    solved = inverse(table(), robots, targets, bounds)
    for target in range(3):
        own = solved.target == target
        distance = [np.abs(solved.inputs[name][own] / robots[name][target] - 1) for name in bounds]
        assert np.max(distance, axis=0).min() < 1e-3
    with pytest.raises(InputError, match="1 targets for 3 free inputs"):
        inverse(table(), robots, {"v_z": found["v_z"]}, bounds)


def test_design_keeps_its_limits() -> None:
    robot = {"C_t": 3.0, "C_r": 2.8, "C_yr": 2.0, "L_over_R": 3.75, "l_over_r0": 34.375, "N": 3.0, "l_over_R": 6.9}
    bounds = {"omega_bar": (3.0, 30.0), "a_over_R": (0.8, 1.1)}
    best = design(table(), robot, bounds, best="v_z", limits={"tail_gap": (2.0, np.inf)})
    assert best["tail_gap"] >= 2
    grid = np.linspace(3.0, 30.0, 25)
    columns = {name: np.full(25, value) for name, value in {**robot, "a_over_R": best["a_over_R"]}.items()}
    found = table().query({**columns, "omega_bar": grid}, flag=True)
    allowed = (found["tail_gap"] >= 2) & ~found["outside"]
    assert best["v_z"] >= 0.999 * found["v_z"][allowed].max()
    with pytest.raises(InputError, match="keeps the limits"):
        design(table(), robot, bounds, best="v_z", limits={"tail_gap": (1e6, np.inf)})


def test_a_certified_error_is_the_difference_from_the_simulator() -> None:
    robots = inside(3)
    answer = table().query(robots, certify=True)
    assert (answer["certified_error"] < 0.3).all()
    wrong = {**answer, "omega_yr_bar": 1.5 * answer["omega_yr_bar"]}
    assert (certified_error(robots, wrong) > 0.4).all()


def test_responses_are_curves_that_end_constant() -> None:
    robots = inside()
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
    robots = inside(1)
    with pytest.raises(InputError, match="left and right turns differ"):
        table().response({**robots, "left_right_bias": np.array([0.1])})
    with pytest.raises(InputError, match="dwell_bar = 0"):
        table().query({**robots, "dwell_bar": np.array([0.01])})


def test_training_is_repeatable_and_reads_a_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    some = simulate_robots(draw_robots(256, 11, wide=False) | {"N": np.full(256, 3.0)})
    monkeypatch.setattr(training, "read_robots", lambda folder: (some, np.arange(len(some))))
    monkeypatch.setattr(
        training, "read_manifest", lambda folder: {"config_hash": "h", "code_version": "c", "config": {}}
    )
    monkeypatch.setattr(training, "simulate_robots", lambda robots, **kind: flips())
    first, again = (training.train("folder", TAILS, CURVES, title="") for _ in range(2))
    assert first.identity == again.identity
    counts = first.provenance["rows"]
    assert counts["train"] + counts["widths"] + counts["held_out"] == len(some)
    few = some.at(np.arange(40))
    monkeypatch.setattr(training, "read_robots", lambda folder: (few, np.arange(40)))
    with pytest.raises(InputError, match="training needs 64"):
        training.train("folder", TAILS, CURVES, title="")


def test_the_split_is_fixed_and_disjoint() -> None:
    parts = training.split(np.arange(10_000))
    assert np.array_equal(parts[:500], training.split(np.arange(500)))
    assert np.bincount(parts) / 10_000 == pytest.approx([0.8, 0.1, 0.1], abs=0.02)


def test_figures_of_errors() -> None:
    figures = summary({"v": np.array([0.1, -0.2, 5.0])}, np.array([True, True, False]))["v"]
    assert figures["rms"] == pytest.approx(np.sqrt(0.025))
    assert figures["largest"] == pytest.approx(0.2)
    assert figures["rms_with_touching"] > 2
