"""Robots that the table does not know are refused in the words of Python, with the values that it knows."""

from __future__ import annotations

from dataclasses import replace

import pytest

from planner.vehicle.from_table import table_vehicle
from sim.io.units import to_si
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from tests.planner.page.page_core import TABLE, answers, refusal_of
from tests.planner.page.plans import robot_to_page
from tests.planner.page.robots import shipped, shipped_data

CONTROL = PRESETS["paper-control"]
ROBOTS = [
    replace(CONTROL, motor_speed=to_si(1000.0, "rpm")),
    replace(CONTROL, tail_radius=0.02),
    replace(CONTROL, disc_offset=0.0016),
    replace(CONTROL, tail_length=0.3, name="it's long"),
    replace(CONTROL, tails=12, C_r=0.02),
    replace(CONTROL, C_r=0.02),
    replace(CONTROL, C_t=0.01, C_yr=10.0, motor_speed=to_si(9.0, "rpm")),
]


@pytest.fixture(scope="module")
def refusals() -> list[str]:
    """Ask for all robots in one process."""
    calls = [("from_table.js", "tableVehicle", robot_to_page(robot), TABLE) for robot in ROBOTS]
    return [str(refusal) for refusal in answers(calls, shipped_data())]


@pytest.mark.parametrize("number", range(len(ROBOTS)))
def test_refusals_in_lab_units(number: int, refusals: list[str]) -> None:
    robot: Robot = ROBOTS[number]
    assert refusals[number] == refusal_of(table_vehicle, robot, shipped())
