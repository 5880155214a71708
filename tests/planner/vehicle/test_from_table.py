"""The vehicle of a table: the reference robot's motion, and modes of error against differences between robots."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planner.paths.path import circle
from planner.planning.plan import plan
from planner.vehicle.calibration_table import NUMBERS, CalibrationKnowledge
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.vehicle import Mode, interpolated
from planner.vehicle.zigzag import zigzag
from sim.model.presets import PRESETS
from surrogate.interface import LookupTable
from surrogate.one_robot.tabulate import tabulate
from surrogate.table.model_file import load

CONTROL = PRESETS["paper-control"]


def test_vehicle_of_the_shipped_table_matches_the_reference_robot() -> None:
    """ω̄_yr, v_x, v_z of the control example from an independent solver."""
    car = table_vehicle(CONTROL, load())
    assert car.twist[0] == pytest.approx([0.0180, 0.0425, 0.0490], rel=0.02)
    assert zigzag(car, 2.0).net_speed == pytest.approx(0.0169, rel=0.02)


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


@pytest.mark.parametrize("name", ["C_t", "C_yr"])
def test_a_coefficient_moves_the_lags_as_the_table_does(name: str) -> None:
    """The mode of a coefficient is the difference between two robots."""
    lookup = load()
    (mode,) = _coefficient_modes(name)
    ends = [
        table_vehicle(replace(CONTROL, **{name: getattr(CONTROL, name) * np.exp(sign)}), lookup).lag
        for sign in (0.01, -0.01)
    ]
    expected = (ends[0] - ends[1]) / 2
    assert mode.lag is not None
    assert abs(mode.lag) == pytest.approx(abs(expected), abs=0.05 * float(np.abs(expected).max()))


def test_with_the_robot_s_own_table_heading_lags_follow_the_yaw_rate() -> None:
    """The shipped table and the robot's own say the same, to a quarter, of lags that C_yr changes."""
    lookup = tabulate(CONTROL)
    (mode,), (other,) = _coefficient_modes("C_yr", lookup), _coefficient_modes("C_yr")
    assert mode.lag is not None
    assert other.lag is not None
    heading = abs(other.lag[..., 2])
    assert abs(mode.lag[..., 2]) == pytest.approx(heading, abs=0.25 * float(heading.max()))


def _coefficient_modes(name: str, lookup: LookupTable | None = None) -> list[Mode]:
    sure = CalibrationKnowledge((name,), np.array([[1e-4]]))
    modes = table_vehicle(CONTROL, lookup or load(), sure).modes
    return [mode for mode in modes if mode.name.startswith("coefficients")]


@pytest.mark.parametrize("name", NUMBERS)
def test_a_number_of_the_robot_moves_twist_and_lags_in_seconds_and_metres(name: str) -> None:
    """The mode of a number is the difference between two robots, in the units of the first."""
    lookup = load()
    (mode,) = _coefficient_modes(name)
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
    assert mode.lag is not None
    changed = interpolated(mode.lag[0], 0.5, np.array([0.4, 0.8, 1.5]))
    assert abs(changed) == pytest.approx(abs(lags[0] - lags[1]) / 2, rel=0.1, abs=2e-6)
