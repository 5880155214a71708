"""The table that ships: near the independent solver, honest about its errors, and the commands that use it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from common.errors import InputError, run_command
from dataset.design import load_design
from sim.model.presets import INDEPENDENT
from surrogate.__main__ import main
from surrogate.domain import BOUNDS, DOMAIN, MOST_TAILS, WIDE
from surrogate.held_out import coverage, relative_errors
from surrogate.inverse import inverse
from surrogate.table_file import SHIPPED, load
from surrogate.training.simulated import draw_as_users, draw_robots, reached_columns
from surrogate.training.train import with_radius
from tests.processes import LIMIT
from tests.reference.cases import STEADY_INPUTS, STEADY_POINTS
from tests.sim.robots import CONTROL_VALUES

pytestmark = pytest.mark.slow

NEW_PROCESS = """
from sim.inputs import group_columns, load_robot
from surrogate.table_file import load
load().query(group_columns([load_robot("paper-control")]))
from surrogate.motions import motions_of
print(sum(motions_of.kernel.stats.cache_misses.values()))
"""
counts = pytest.mark.parametrize("count", [128, pytest.param(512, marks=pytest.mark.rates)])


def input_columns(points: tuple[tuple[float, ...], ...]) -> dict[str, np.ndarray]:
    return dict(zip(STEADY_INPUTS, np.array(points).T, strict=True))


def test_the_shipped_table_matches_the_independent_solver_and_states_its_errors() -> None:
    table = load()
    found = table.query(input_columns(tuple(p[0] for p in STEADY_POINTS)))
    truth = np.array([p[1] for p in STEADY_POINTS]).T
    names = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l")
    for name, values in zip(names, truth, strict=False):
        assert found[name] == pytest.approx(values, rel=0.01), name
    assert found["theta_deg"] == pytest.approx(truth[6], abs=0.25)
    one = table.query({k: np.array([v]) for k, v in CONTROL_VALUES.items()})
    for name in ("omega_t_bar", "omega_yr_bar", "v_x", "R_yr_over_l"):
        assert one[name][0] == pytest.approx(INDEPENDENT[name], rel=0.005)
    # It states its errors.
    assert SHIPPED.stat().st_size < 3e6
    assert table.provenance["rows"]["held_out"] > 500
    for name in ("omega_t_bar", "omega_yr_bar", "R_yr_over_l", "v_x"):
        assert 0 < table.errors[name]["median"] <= table.errors[name]["rms"]
        assert table.errors[name]["median"] < 0.001


def answered(robots: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], np.ndarray]:
    """Return the table's answers, the simulator's (NaN outside the domain), and which robots both know."""
    answer = load().query(robots, intervals=True, flag=True)
    good = ~answer["outside"]
    simulated = reached_columns({name: values[good] for name, values in robots.items()})
    truth = {}
    for name in ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "tail_gap"):
        truth[name] = np.full(len(good), np.nan)
        truth[name][good] = simulated[name]
    good[good] = simulated["converged"]
    return answer, with_radius(truth), good


def test_fresh_robots_are_near_the_simulator_and_inside_their_intervals() -> None:
    """Robots of the whole domain with two tails and more; what the table states holds for them."""
    robots = draw_robots(256, 77, wide=False)
    robots = {name: values[robots["N"] > 1] for name, values in robots.items()}
    answer, truth, good = answered(robots)
    assert good.mean() > 0.95
    errors = relative_errors(answer, truth)
    for name, limit in (("omega_t_bar", 2e-4), ("omega_yr_bar", 1e-3), ("R_yr_over_l", 1e-3), ("v_z", 5e-4)):
        assert np.median(np.abs(errors[name][good])) < limit, name
    covered = coverage({n: v[good] for n, v in answer.items()}, {n: v[good] for n, v in truth.items()})
    assert 0.82 < np.mean([*covered.values()]) < 0.98


@pytest.mark.parametrize("count", [6144, pytest.param(32768, marks=pytest.mark.rates)])
def test_intervals_hold_for_each_number_of_tails_and_third_of_the_speeds(count: int) -> None:
    """Robots drawn as users draw them; with one width for all N radii with two tails were inside in 54 %."""
    drawn = draw_as_users(count, 91)
    kept = (drawn["N"] >= 2) & (drawn["N"] <= 5) & (drawn["surface_couple"] == 0)
    robots = {name: values[kept] for name, values in drawn.items()}
    answer, truth, good = answered(robots)
    third = np.searchsorted(np.quantile(robots["omega_bar"], [1 / 3, 2 / 3]), robots["omega_bar"])
    for tails in (2, 3, 4, 5):
        groups = [good & (robots["N"] == tails)]
        groups += [groups[0] & (third == k) for k in range(3)]
        for group, slack in zip(groups, (0.05, 0.09, 0.09, 0.09), strict=True):
            covered = coverage({n: v[group] for n, v in answer.items()}, {n: v[group] for n, v in truth.items()})
            assert np.abs(np.array([*covered.values()]) - 0.9).max() < slack, (tails, covered)


@counts
def test_one_tail_has_one_motion(count: int) -> None:
    """None of these robots gets another motion than the simulator's."""
    drawn = draw_robots(10 * count, 4711, wide=False)
    answer, truth, good = answered({name: values[drawn["N"] == 1] for name, values in drawn.items()})
    assert good.mean() > 0.97
    error = np.abs(relative_errors(answer, truth)["v_z"])[good]
    assert error.max() < 0.03
    of_itself = np.abs(answer["v_z"] / truth["v_z"] - 1)[good]
    assert np.median(of_itself) < 6e-4
    assert np.quantile(of_itself, 0.95) < 0.02


@counts
@pytest.mark.parametrize("single", [False, True])
def test_intervals_hold_with_effects_on_head_and_motor(single: bool, count: int) -> None:
    """Drag, disc, couples and droop, as strong as they were learned; with and without couples."""
    robots = draw_robots(count, 79, wide=False, effects=True)
    robots["N"] = np.ones(count) if single else np.maximum(robots["N"], 2.0)
    answer, truth, good = answered(robots)
    assert good.mean() > 0.7
    couples = robots["surface_couple"] != 0
    for group in (good & couples, good & ~couples):
        covered = coverage({n: v[group] for n, v in answer.items()}, {n: v[group] for n, v in truth.items()})
        assert 0.82 < np.mean([*covered.values()]) < 0.98


@counts
def test_a_single_tail_that_a_couple_turns_to_either_side(count: int) -> None:
    robots = draw_robots(count, 83, wide=False)
    couple = np.random.default_rng(6).uniform(-1.5, 1.5, count)
    answer, truth, good = answered(robots | {"N": np.ones(count), "surface_couple": couple})
    assert good.mean() > 0.95
    error = np.abs(relative_errors(answer, truth)["omega_yr_bar"])
    for side in (truth["omega_yr_bar"] > 0, truth["omega_yr_bar"] < 0):
        kind = good & side
        assert kind.sum() > count // 5
        assert np.median(error[kind]) < 0.004
        assert np.quantile(error[kind], 0.95) < 0.1
        covered = coverage({n: v[kind] for n, v in answer.items()}, {n: v[kind] for n, v in truth.items()})
        assert np.mean([*covered.values()]) > 0.74


@pytest.mark.parametrize(
    ("tails", "count"), [(2.0, 128), *(pytest.param(tails, 512, marks=pytest.mark.rates) for tails in (1.0, 4.0))]
)
def test_a_drag_number_that_was_not_learned_is_outside(tails: float, count: int) -> None:
    """Inertia raises the drag of thick, fast tails up to twentyfold, at a motor speed that is in its range."""
    robots = draw_robots(count, 80, wide=False)
    robots |= {"N": np.full(count, tails), "inertia": np.random.default_rng(5).uniform(0, 0.3, count)}
    answer, truth, good = answered(robots)
    assert 0.5 < good.mean() < 0.95
    assert np.quantile(np.abs(relative_errors(answer, truth)["omega_yr_bar"])[good], 0.99) < 0.02


REFUSED: list[tuple[dict[str, float], str]] = [
    ({"omega_bar": 3000.0}, "omega_bar = 3000"), ({"colour": 1.0}, "unknown column"),
    ({"law_tail_sag_speed100_length0_tails0": 0.1}, "law_tail_sag_speed100_length0_tails0 changes more than head"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "expected"), REFUSED)
def test_the_command_refuses_and_writes_nothing(
    change: dict[str, float], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    values = {k: v[0] for k, v in input_columns(tuple(p[0] for p in STEADY_POINTS)).items()} | change
    pd.DataFrame([values]).to_csv(tmp_path / "p.csv", index=False)
    assert run_command(main, ["query", str(tmp_path / "p.csv"), "--out", str(tmp_path / "o.csv")]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert len(error.splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["p.csv"]


def test_query_and_inverse_commands(tmp_path: Path) -> None:
    """What `query` answers, `inverse` leads back to the coefficients."""
    robots = pd.DataFrame(input_columns(tuple(p[0] for p in STEADY_POINTS[:2])))
    robots.to_csv(tmp_path / "p.csv", index=False)
    assert run_command(main, ["query", str(tmp_path / "p.csv"), "--out", str(tmp_path / "o.csv")]) == 0
    found = pd.read_csv(tmp_path / "o.csv")
    assert {"omega_yr_bar", "omega_yr_bar_low", "theta_deg_high"} <= set(found)
    targets = robots.drop(columns=["C_t", "C_r", "C_yr"]).join(found[["omega_t_bar", "omega_yr_bar", "v_z"]])
    targets.to_csv(tmp_path / "t.csv", index=False)
    assert run_command(main, ["inverse", str(tmp_path / "t.csv"), "--out", str(tmp_path / "i.csv")]) == 0
    solved = pd.read_csv(tmp_path / "i.csv")
    one = input_columns((STEADY_POINTS[0][0],))
    bounds = {name: BOUNDS[name] for name in ("C_t", "C_r", "C_yr")}
    with pytest.raises(InputError, match="1 targets for 3 free inputs"):
        inverse(load(), one, {"v_z": found["v_z"].to_numpy()[:1]}, bounds)
    for i in range(len(robots)):
        own = solved[solved["target"] == i + 1]
        assert (own["C_t"] / robots["C_t"][i] - 1).abs().min() < 1e-3
        assert (own["C_yr"] / robots["C_yr"][i] - 1).abs().min() < 1e-3


def test_training_refuses_what_is_no_data_set(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(main, ["train", str(tmp_path), "--out", str(tmp_path / "m.safetensors")]) == 2
    assert "no finished data set" in capsys.readouterr().err
    assert not (tmp_path / "m.safetensors").exists()


def test_the_sweep_of_the_domain_and_the_bounds_of_the_inverse_are_those_of_the_domain() -> None:
    axes = load_design(SHIPPED.parent / "domain.toml").axes
    assert {name: (axis.low, axis.high) for name, axis in axes.items()} == {**DOMAIN, "N": (1, MOST_TAILS)}
    for name, (low, high) in BOUNDS.items():
        assert WIDE[name][0] <= low <= DOMAIN[name][0]
        assert DOMAIN[name][1] <= high <= WIDE[name][1]


def test_a_new_process_reads_the_loops_that_another_has_compiled() -> None:
    load().query(draw_robots(4, 0, wide=False), flag=True)
    done = subprocess.run([sys.executable, "-c", NEW_PROCESS], capture_output=True, text=True, timeout=LIMIT)
    assert (done.stdout, done.stderr) == ("0\n", "")
