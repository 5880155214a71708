"""The table of one robot: against the simulator, in the planner, and what it refuses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.check import tracking_error
from planner.path import polygon
from planner.plan import plan
from planner.record import plan_record
from sim.io.errors import InputError
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.motion.replay import replay
from sim.motion.switching import switch_response
from surrogate.export import load_table
from surrogate.single import SingleRobot, save_single
from surrogate.tabulate import tabulate

ROBOT = replace(PRESETS["paper-control"], effects={"end_over_end_drag": 5.0})


@pytest.fixture(scope="module")
def table() -> SingleRobot:
    return tabulate(ROBOT)


def test_it_answers_like_the_simulator_between_its_dwells(table: SingleRobot) -> None:
    dwells = np.array([0.47, 1.13, 3.3])
    groups = Groups.from_columns({k: np.full(3, v) for k, v in ROBOT.group_values().items()})
    expected = switch_response(groups, dwells)
    found = table.query({**{k: np.full(3, v) for k, v in ROBOT.group_values().items()}, "dwell_bar": dwells})
    assert found["net_speed_bar"] == pytest.approx(expected.net_speed, rel=2e-3)
    assert found["lag_psi_rad"] == pytest.approx(expected.lag_psi, abs=2e-4)


def test_a_robot_with_an_effect_is_planned_and_stays_within_the_stated_error(
    table: SingleRobot, tmp_path: Path
) -> None:
    save_single(table, tmp_path / "robot.json")
    result = plan(polygon(4, 2.5), ROBOT, lookup=load_table(tmp_path / "robot.json"))
    track = replay([result.schedule()])[0]
    error = tracking_error(plan_record(result), track)
    assert error.largest < error.stated
    assert error.rms < 0.03


def test_another_robot_is_refused(table: SingleRobot) -> None:
    with pytest.raises(InputError, match="end_over_end_drag"):
        plan(polygon(4, 3.0), replace(ROBOT, effects={"end_over_end_drag": 4.0}), lookup=table)
    with pytest.raises(InputError, match="dwell_bar"):
        table.query({"dwell_bar": np.array([20.0])})


def test_turns_that_are_no_mirror_images_are_refused() -> None:
    with pytest.raises(InputError, match="left and right"):
        tabulate(replace(ROBOT, effects={"natural_curvature": 0.1}))


def test_a_file_that_is_no_table_is_refused(tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_text("{")
    with pytest.raises(InputError, match="no table"):
        load_table(tmp_path / "broken.json")
