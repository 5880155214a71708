"""The vehicle: its memory against direct formulas, zigzags, splines; its table and modes of error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from common.errors import InputError
from planner.jobs.plan import plan
from planner.paths.path import circle
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.vehicle import BEFORE_KNOTS, TIMES, Mode, Switches, interpolated, lag_table, roll_out
from planner.vehicle.zigzag import Zigzag, zigzag
from sim.inputs import load_robot
from sim.knowledge import (
    COEFFICIENTS,
    NUMBERS,
    CalibrationKnowledge,
    knowledge_toml,
    read_knowledge,
)
from sim.mechanics import planar
from sim.model.response import BEFORE, DWELLS, memory_after
from sim.model.robot import Robot
from sim.model.robot_toml import robot_toml
from surrogate.interface import LookupTable
from surrogate.table_file import load
from tests.planner.plans import BIASED, CONTROL, own_table, planned
from tests.planner.vehicles import vehicle


def test_lags_are_those_of_the_curves() -> None:
    """At the dwells of the table exactly; between lengths of the dwell before, as `memory_after` says."""
    rng = np.random.default_rng(0)
    lag = rng.normal(size=(len(DWELLS), 3))
    memory = np.exp(-BEFORE / 0.3)[:, None, None] * rng.normal(size=(len(DWELLS), 3))
    table = lag_table(lag, memory)
    car = replace(vehicle(), lag=np.stack([table, table * planar.MIRROR]))
    at = DWELLS[TIMES[-1] > DWELLS][-1]
    i = int(np.flatnonzero(at == DWELLS)[0])
    for before in (0.2, 0.27, 0.42, 0.7, 1.1, 1.4, 3.0):
        expected = lag[i] + memory_after(memory, before)[i]
        near = car.lag_after(1, before, np.array([at - 0.01, at + 0.01]))
        assert car.lag_after(1, before, at) == pytest.approx(expected, abs=2 * np.abs(np.diff(near, axis=0)).max())
        assert car.lag_after(-1, before, at) == pytest.approx(car.lag_after(1, before, at) * planar.MIRROR)


def test_nothing_has_happened_at_a_flip_and_nothing_changes_after_settling() -> None:
    car = vehicle()
    for before in (None, 0.3, 2.0):
        assert car.lag_after(1, before, 0.0) == pytest.approx(np.zeros(3))
        assert car.lag_after(1, before, 50.0) == pytest.approx(car.lag_after(1, before, TIMES[-1]))
    assert car.lag_after(1, float(BEFORE_KNOTS[-1]), 0.5) == pytest.approx(car.lag_after(1, 9.0, 0.5))


@pytest.mark.parametrize("seed", range(4))
def test_the_pivot_moves_as_a_slip_free_car(seed: int) -> None:
    """q = p − a e(φ) has no sideways velocity on any sequence of arcs."""
    rng = np.random.default_rng(seed)
    car = vehicle(lag=0.0)
    pose = rng.normal(size=3)
    for _ in range(10):
        sense = 1 if rng.random() < 0.5 else -1
        times = np.linspace(0, rng.uniform(0.5, 5), 2001)
        poses = planar.compose(pose, car.motion(sense, 1.0, times))
        q = planar.compose(poses, np.array([-car.pivot_distance, 0.0, 0.0]))
        velocity = np.diff(q[:, :2], axis=0)
        middle = (poses[1:, 2] + poses[:-1, 2]) / 2
        sideways = velocity[:, 1] * np.cos(middle) - velocity[:, 0] * np.sin(middle)
        assert np.abs(sideways).max() < 1e-13
        assert np.linalg.norm(velocity, axis=1).sum() == pytest.approx(car.twist[0, 0] * times[-1], rel=1e-6)
        pose = poses[-1]


def test_an_even_robot_swims_straight_and_a_lopsided_one_at_an_angle() -> None:
    even, odd = zigzag(vehicle(), 0.8), zigzag(vehicle(bias=0.3), 0.8)
    assert even.drift == pytest.approx(0.0, abs=1e-12)
    assert even.dwells == pytest.approx((0.8, 0.8))
    assert odd.dwells[0] == pytest.approx(0.8)
    assert Zigzag.from_dict(odd.to_dict()) == odd
    assert odd.dwells[1] / odd.dwells[0] == pytest.approx(1.3 / 0.7, rel=0.02)
    # With (T+, T−) that turn as far, the mean sideways speed is (Ω− v+ − Ω+ v−)/(Ω+ + Ω−), v without lags.
    assert odd.drift == pytest.approx(0.0424 * (0.7 - 1.3) / 2, rel=0.05)


def test_the_zigzag_is_that_of_arcs() -> None:
    """Without lags: net speed V cos θ sinc(ΩT/2), and the same arcs seen from their mean line."""
    car = vehicle(lag=0.0)
    found = zigzag(car, 2.0)
    angle = 0.0489 * 2.0 / 2
    assert found.net_speed == pytest.approx(0.0179 * np.sin(angle) / angle, rel=1e-6)
    pair = Switches(1, np.array([2.0, 2.0]), np.array([[0.0, 0.0, -angle]]))
    across = roll_out(car, pair, 0.0, samples=400).track[:-1, 1]
    assert found.rms == pytest.approx(across.std(), rel=0.02)


def test_vehicle_of_the_shipped_table_matches_the_reference_robot() -> None:
    """ω̄_yr, v_x, v_z of the control example from an independent solver."""
    car = table_vehicle(CONTROL, load())
    assert car.twist[0] == pytest.approx([0.0180, 0.0425, 0.0490], rel=0.02)
    assert zigzag(car, 2.0).net_speed == pytest.approx(0.0169, rel=0.02)


def mode_of(name: str, robot: Robot = CONTROL, lookup: LookupTable | None = None) -> Mode:
    """Return what one per cent of a coefficient or of a number changes."""
    sure = CalibrationKnowledge((name,), np.array([[1e-4]]))
    modes = table_vehicle(robot, lookup or load(), sure).modes
    (mode,) = [mode for mode in modes if mode.name.startswith("coefficients")]
    assert mode.lag is not None
    return mode


def test_the_covariance_widens_the_stated_error() -> None:
    sure = CalibrationKnowledge(("C_yr",), np.array([[1e-4]]))
    other = plan(circle(2.0), CONTROL, knowledge=sure)
    assert other.stated_error > 1.3 * planned().stated_error


@pytest.mark.parametrize("name", ["C_t", "C_yr"])
def test_a_coefficient_moves_twist_and_lags_as_the_table_does(name: str) -> None:
    """The mode of a coefficient is the difference between two robots."""
    lookup = load()
    mode = mode_of(name)
    one, other = (
        table_vehicle(replace(CONTROL, **{name: getattr(CONTROL, name) * np.exp(sign)}), lookup)
        for sign in (0.01, -0.01)
    )
    expected = (one.lag - other.lag) / 2
    assert abs(mode.lag) == pytest.approx(abs(expected), abs=0.05 * float(np.abs(expected).max()))
    assert abs(mode.twist) == pytest.approx(abs(one.twist - other.twist) / 2, rel=0.05, abs=1e-6)


def test_with_the_robot_s_own_table_heading_lags_follow_the_yaw_rate() -> None:
    """The shipped table and a robot's own say the same, to a quarter, of lags that C_yr changes."""
    own, other = (
        abs(mode.lag[..., 2]).mean(0) for mode in (mode_of("C_yr", BIASED, own_table()), mode_of("C_yr"))
    )
    assert own == pytest.approx(other, abs=0.25 * float(other.max()))


@pytest.mark.parametrize("name", NUMBERS)
def test_a_number_of_the_robot_moves_twist_and_lags_in_seconds_and_metres(name: str) -> None:
    """The mode of a number is the difference between two robots, in the units of the first."""
    lookup = load()
    mode = mode_of(name)
    twists, lags = [], []
    for sign in (0.01, -0.01):
        value = getattr(CONTROL, name) or CONTROL.head_radius
        moved: dict[str, Any] = {name: value * np.exp(sign)}
        robot = replace(CONTROL, **moved)
        time, length = robot.time_scale / CONTROL.time_scale, robot.tail_length / CONTROL.tail_length
        car = table_vehicle(robot, lookup)
        twists.append(car.twist * [length / time, length / time, 1 / time])
        lags.append(car.lag_after(1, 0.5 / time, np.array([0.4, 0.8, 1.5]) / time) * [length, length, 1.0])
    assert abs(mode.twist) == pytest.approx(abs(twists[0] - twists[1]) / 2, rel=0.05, abs=1e-5)
    changed = interpolated(mode.lag[0], 0.5, np.array([0.4, 0.8, 1.5]))
    assert abs(changed) == pytest.approx(abs(lags[0] - lags[1]) / 2, rel=0.1, abs=2e-6)


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
    assert "do not determine" not in knowledge_toml(known)
    vague = CalibrationKnowledge(("C_t", "C_r"), np.diag([50.0, 0.1]))
    assert "do not determine C_t, but" in knowledge_toml(vague)
    (tmp_path / "robot.toml").write_text(robot_toml(CONTROL) + knowledge_toml(known))
    found = read_knowledge(tmp_path / "robot.toml")
    assert found.names == known.names
    assert found.covariance == pytest.approx(V)
    assert (found.current, found.current_error) == (known.current, known.current_error)
