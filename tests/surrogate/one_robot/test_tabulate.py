"""The table of one robot: against the simulator, in the planner, and what it refuses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.files.tracking_error import tracking_error
from planner.paths.path import polygon
from planner.planning.plan import plan
from sim.io.errors import InputError
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.model.response import DWELLS
from sim.model.robot import Robot
from sim.motion.longer_memory import longer_memory
from sim.motion.replay import replay
from sim.motion.response import responses
from sim.motion.steady import steady
from sim.motion.switching import switch_response
from surrogate.one_robot.robot_table import RobotTable
from surrogate.one_robot.tabulate import tabulate
from surrogate.table.model_file import load_table

ROBOT = replace(PRESETS["paper-control"], effects={"end_over_end_drag": 5.0})


@pytest.fixture(scope="module")
def table() -> RobotTable:
    return tabulate(ROBOT)


def columns(count: int = 1, robot: Robot = ROBOT) -> dict[str, np.ndarray]:
    return {k: np.full(count, v) for k, v in robot.group_values().items()}


def test_it_answers_like_the_simulator(table: RobotTable) -> None:
    """Net speed at equal dwells, against flips in time steps that go on until the motion repeats."""
    at = [7, 13, 22]
    dwells = DWELLS[at]
    expected = switch_response(Groups.from_columns(columns(3)), dwells)
    found = table.response(columns())
    assert found.net_speed[0, at] == pytest.approx(expected.net_speed, rel=1e-2)
    assert found.lag[0, 22, 2] == pytest.approx(expected.lag_psi[2], abs=2e-4)


def test_it_has_both_directions_of_a_robot_that_turns_unequally() -> None:
    robot = replace(ROBOT, effects={"left_right_bias": 0.2})
    table = tabulate(robot)
    both = {k: np.repeat(v, 2) for k, v in columns(1, robot).items()}
    both["omega_bar"] = both["omega_bar"] * [1.0, -1.0]
    motion = steady(Groups.from_columns(both))
    found = table.query(both)
    assert found["omega_yr_bar"] == pytest.approx(motion.omega_yr)
    assert found["v_x"] == pytest.approx(motion.v_x)
    assert abs(found["omega_yr_bar"][0]) > 1.2 * abs(found["omega_yr_bar"][1])
    curves = table.response(both)
    assert np.abs(curves.lag[0] - curves.lag[1]).max() > 1e-5


@pytest.mark.rest
def test_a_robot_that_turns_unequally_is_planned_and_stays_within_the_stated_error() -> None:
    robot = replace(PRESETS["paper-control"], effects={"left_right_bias": 0.2})
    result = plan(polygon(4, 3.0), robot, lookup=tabulate(robot))
    error = tracking_error(result.to_dict(), replay([result.schedule()])[0])
    assert error.largest < error.stated
    assert error.rms < 1.5 * result.predicted_rms + 0.005


def test_a_robot_with_an_effect_is_planned_and_stays_within_the_stated_error(
    table: RobotTable, tmp_path: Path
) -> None:
    table.save(tmp_path / "robot.json")
    result = plan(polygon(4, 2.5), ROBOT, lookup=load_table(tmp_path / "robot.json"))
    track = replay([result.schedule()])[0]
    error = tracking_error(result.to_dict(), track)
    assert error.largest < error.stated
    assert error.rms < 0.03


def test_finer_curves_differ_by_less_than_the_stated_errors(table: RobotTable) -> None:
    """Meshes half as fine again and a quarter of the tolerance, of a robot that the sizes were not found with."""
    groups = Groups.from_columns(columns())
    finer = responses(groups, tolerance=2.5e-5, meshes=(9, 13), extrapolated_memory=True)
    assert not finer.stepped.any()
    missed = np.array(table.lag)[0] + np.array(table.memory)[0] - finer.lag[0] - finer.memory[0]
    stated = np.array(table.error_curves)[:3, :-1]
    sizes = np.sqrt((stated**2).sum(0).mean((0, 1)))
    assert (np.sqrt((missed**2).mean((0, 1))) < 2 * sizes).all()


def test_what_the_dwells_before_the_last_one_change_is_stated(table: RobotTable) -> None:
    longer = longer_memory(Groups.from_columns(columns()))[0]
    modes = table.error_modes(columns())
    lags = modes.lag[:, None] + modes.memory
    alike = [bool(np.allclose(mode, longer, rtol=1e-6, atol=1e-12)) for mode in lags]
    assert sum(alike) == 1


def test_another_robot_is_refused(table: RobotTable) -> None:
    with pytest.raises(InputError, match="end_over_end_drag"):
        plan(polygon(4, 3.0), replace(ROBOT, effects={"end_over_end_drag": 4.0}), lookup=table)
    with pytest.raises(InputError, match="C_t = 9"):
        table.query({**columns(), "C_t": np.array([9.0])})


def test_its_slopes_are_those_of_the_simulator(table: RobotTable) -> None:
    """In every group and in the robot's effect."""
    values = ROBOT.group_values()
    assert set(table.slopes) == set(values) - {"N"}
    for name in ("C_yr", "omega_bar", "l_over_r0", *ROBOT.effects):
        step = 0.01 if name not in ROBOT.effects else 0.01 * ROBOT.effects[name]
        changed = {**values, name: values[name] + step if name in ROBOT.effects else values[name] * np.exp(step)}
        found = steady(Groups.from_columns({k: np.array([v]) for k, v in changed.items()}))
        difference = found.omega_yr[0] - table.steady["omega_yr_bar"][0]
        assert difference == pytest.approx(np.array(table.slopes[name])[0, 2] * step, rel=0.05), name
