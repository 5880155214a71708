"""What a calibration knows is read from the robot's file, and written as it is read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from planner.vehicle.calibration_table import COEFFICIENTS, CalibrationKnowledge, knowledge_toml, read_knowledge
from sim.inputs import load_robot
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.robot_toml import robot_toml

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


def test_the_table_is_written_as_it_is_read(tmp_path: Path) -> None:
    V = np.array([[2e-3, -1e-4], [-1e-4, 0.04]])
    known = CalibrationKnowledge(("viscosity", "end_over_end_drag"), V, (1e-5, 0.0), (2e-6, 3e-6))
    (tmp_path / "robot.toml").write_text(robot_toml(CONTROL) + knowledge_toml(known))
    found = read_knowledge(tmp_path / "robot.toml")
    assert found.names == known.names
    assert found.covariance == pytest.approx(V)
    assert (found.current, found.current_error) == (known.current, known.current_error)
