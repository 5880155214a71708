"""What a calibration knows: read from the robot's file, and used in the plan."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.paths.path import Path2D, circle, smoothed
from planner.planning.plan import plan
from planner.vehicle.calibration_table import (
    COEFFICIENTS,
    NUMBERS,
    CalibrationKnowledge,
    knowledge_toml,
    read_knowledge,
)
from planner.vehicle.from_table import table_vehicle
from sim.inputs import load_robot, robot_toml
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from surrogate.table.model_file import load

CONTROL = PRESETS["paper-control"]
TABLE = """
[calibration]
names = ["C_t", "C_r", "C_yr"]
covariance = [[1e-4, 0.0, 0.0], [0.0, 1e-4, 5e-5], [0.0, 5e-5, 1e-4]]
current_m_s = [2e-5, 0.0]
"""


def test_the_table_is_read_from_the_robots_file(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(robot_toml(CONTROL) + TABLE)
    found = read_knowledge(tmp_path / "robot.toml")
    assert found.names == COEFFICIENTS
    assert found.covariance[1, 2] == 5e-5
    assert found.current == (2e-5, 0.0)
    assert load_robot(tmp_path / "robot.toml") == load_robot(CONTROL.name)
    assert read_knowledge("paper-control").names == ()


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ('names = ["C_q"]\ncovariance = [[1.0]]', "unknown name"),
        ('names = ["C_t"]\ncovariance = [[1.0, 2.0]]', "cannot be read"),
        ('names = ["C_t", "C_r"]\ncovariance = [[1.0, 2.0], [2.0, 1.0]]', "negative eigenvalue"),
        ("current_m_s = [1.0]", "cannot be read"),
        ("current_m_s = [nan, 0.0]", "finite"),
    ],
)
def test_wrong_tables_are_refused(tmp_path: Path, line: str, expected: str) -> None:
    (tmp_path / "robot.toml").write_text("[calibration]\n" + line)
    with pytest.raises(InputError, match=expected):
        read_knowledge(tmp_path / "robot.toml")


def test_the_covariance_widens_the_stated_error_by_what_the_table_says() -> None:
    """One standard deviation of C_yr moves the twist as the table moves between two robots."""
    lookup = load()
    sure = CalibrationKnowledge(("C_yr",), np.array([[1e-4]]))
    (mode,) = [m for m in table_vehicle(CONTROL, lookup, sure).modes if m.name.startswith("coefficients")]
    groups = {k: np.array([v]) for k, v in CONTROL.group_values().items()}
    ends = [lookup.query({**groups, "C_yr": groups["C_yr"] * np.exp(s)}) for s in (0.01, -0.01)]
    expected = (ends[0]["omega_yr_bar"] - ends[1]["omega_yr_bar"]) / 2
    assert mode.twist[0, 2] == pytest.approx(expected[0], rel=0.05)
    one, other = plan(circle(2.0), CONTROL), plan(circle(2.0), CONTROL, knowledge=sure)
    assert other.stated_error > 1.3 * one.stated_error


@pytest.mark.parametrize("name", NUMBERS)
def test_a_number_of_the_robot_moves_the_twist_in_seconds_and_metres(name: str) -> None:
    """The mode of a number is the difference between two robots, in the units of the first."""
    lookup = load()
    sure = CalibrationKnowledge((name,), np.array([[1e-4]]))
    (mode,) = [m for m in table_vehicle(CONTROL, lookup, sure).modes if m.name.startswith("coefficients")]
    ends = []
    for sign in (0.01, -0.01):
        value = getattr(CONTROL, name) or CONTROL.head_radius
        moved: dict[str, Any] = {name: value * np.exp(sign)}
        robot = replace(CONTROL, **moved)
        time, length = robot.time_scale / CONTROL.time_scale, robot.tail_length / CONTROL.tail_length
        ends.append(table_vehicle(robot, lookup).twist * [length / time, length / time, 1 / time])
    assert abs(mode.twist) == pytest.approx(abs(ends[0] - ends[1]) / 2, rel=0.05, abs=1e-5)


def test_another_robot_carries_a_plan_out_in_the_same_seconds_and_metres() -> None:
    result = plan(circle(2.0), CONTROL)
    other = replace(CONTROL, viscosity=1.1 * CONTROL.viscosity, tail_length=1.02 * CONTROL.tail_length)
    one, own = result.schedule(other), result.schedule()
    assert one.dwells * one.time_scale == pytest.approx(own.dwells * own.time_scale)
    assert np.array(one.start[:2]) * other.tail_length == pytest.approx(
        np.array(own.start[:2]) * CONTROL.tail_length
    )


def test_the_table_is_written_as_it_is_read(tmp_path: Path) -> None:
    V = np.array([[2e-3, -1e-4], [-1e-4, 0.04]])
    known = CalibrationKnowledge(("viscosity", "end_over_end_drag"), V, (1e-5, 0.0), (2e-6, 3e-6))
    (tmp_path / "robot.toml").write_text(robot_toml(CONTROL) + knowledge_toml(known))
    found = read_knowledge(tmp_path / "robot.toml")
    assert found.names == known.names
    assert found.covariance == pytest.approx(V)
    assert (found.current, found.current_error) == (known.current, known.current_error)


def test_a_current_is_steered_against() -> None:
    """Across a line: the robot looks upstream, and its track stays on the line."""
    unit = CONTROL.tail_length / CONTROL.time_scale
    flow = CalibrationKnowledge(current=(0.0, 0.004 * unit))
    result = plan(Path2D.of([[0, 0], [12, 0]]), CONTROL, knowledge=flow)
    assert result.predicted_rms < 1.4 * result.straight.rms
    middle = result.poses[len(result.poses) // 2 :, 2].mean()
    assert middle == pytest.approx(-math.asin(0.004 / result.straight.net_speed), abs=0.01)
    with pytest.raises(InputError, match="as fast as the robot"):
        plan(circle(3.0), CONTROL, knowledge=CalibrationKnowledge(current=(0.0, 0.5 * unit)))


def test_smoothing_takes_camera_noise_out_and_says_what_it_moves() -> None:
    rng = np.random.default_rng(0)
    clean = circle(2.0)
    noisy = Path2D.of(clean.points + 0.02 * rng.normal(size=clean.points.shape), closed=True)
    found, moved = smoothed(noisy, 0.5)
    assert np.abs(np.hypot(*found.points.T) - 2.0).max() < 0.03
    assert 0.01 < moved < 0.15
    assert plan(found, CONTROL).declared.missed < 0.05
    with pytest.raises(InputError, match="smoothing over"):
        smoothed(noisy, -1.0)


def test_an_open_path_keeps_its_ends() -> None:
    found, _ = smoothed(Path2D.of([[0, 0], [2, 0], [2, 3]]), 0.4)
    assert found.points[[0, -1]] == pytest.approx(np.array([[0.0, 0.0], [2.0, 3.0]]))
