"""Vehicles that the look-up table gives, their dwells and tracked points, and robots that are refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planner.vehicle.dwell_choice import check_least, dwells_for, nearly_fastest
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.tracked_point import tracked_vehicle
from planner.vehicle.vehicle import Vehicle
from sim.model.response import BEFORE
from sim.model.robot import Robot
from tests.planner.page.cases import CONTROL, VEHICLES, random_robots, shipped, tracked_of
from tests.planner.page.page_core import (
    TABLE,
    answer,
    answers,
    check_alike,
    check_parity,
    refusal_of,
)

RPM = np.pi / 30


def check_tables(found: dict[str, Any], wanted: Vehicle) -> None:
    check_alike(np.array(found["twist"]).T, wanted.twist.T, 1e-12)
    for name in ("lag", "rest", "spread"):
        check_alike(found[name], getattr(wanted, name).reshape(-1, 3), 1e-12)
    assert found["phaseRate"] == pytest.approx(wanted.phase_rate.tolist(), rel=1e-12)
    assert found["current"] == [0.0, 0.0]
    assert found["tailGap"] == pytest.approx(wanted.tail_gap, rel=1e-12)
    assert found["leastGap"] == wanted.least_gap


def check_modes(found: list[dict[str, Any]], wanted: Vehicle) -> None:
    assert [mode["name"] for mode in found] == [mode.name for mode in wanted.modes]
    for mode, expected in zip(found, wanted.modes, strict=True):
        assert np.abs(np.array(mode["twist"]) - expected.twist).max() <= 1e-10 * np.abs(wanted.twist).max()
        assert (mode["lag"] is None) == (expected.lag is None)
        if expected.lag is not None:
            check_alike(mode["lag"], expected.lag.reshape(-1, 3), 1e-10)


def test_the_vehicle_of_the_table() -> None:
    (robot,) = random_robots(1)
    found, wanted = answer("from_table.js", "tableVehicle", robot, TABLE), table_vehicle(robot, shipped())
    check_tables(found, wanted)
    check_modes(found["modes"], wanted)


REFUSED: list[Robot] = [
    replace(CONTROL, tails=1), replace(CONTROL, disc_offset=0.0016, name="it's"), replace(CONTROL, C_r=0.02),
    replace(CONTROL, tails=12, C_r=0.02), replace(CONTROL, C_t=0.01, C_yr=10.0, motor_speed=9 * RPM),
]  # fmt: skip


def test_robots_outside_are_refused_in_lab_units() -> None:
    found = answers([("from_table.js", "tableVehicle", robot, TABLE) for robot in REFUSED])
    assert list(map(str, found)) == [refusal_of(table_vehicle, robot, shipped()) for robot in REFUSED]


@pytest.mark.parametrize(
    ("twist", "words"),
    [
        ([[-1.0, 1, 1], [0.5, -1, -1]], "robot 'x' does not move forward (v_z = -0.25); turn its motor"),
        ([[1.0, 1, 1], [1, 1, 1]], "robot 'x' turns to the same side in both directions of its motor; it"),
    ],
    ids=["backward", "one side"],
)
def test_vehicles_that_cannot_follow_a_path_are_refused(twist: list[list[float]], words: str) -> None:
    zeros = {"lag": np.zeros(75), "memory": np.zeros(1200), "rest": np.zeros(75), "spread": np.zeros(75)}
    parts = {"twist": twist, "curves": [zeros, zeros], "before": BEFORE, "modes": []}
    assert str(answer("from_table.js", "vehicleOfParts", parts, "x")).startswith(words)


def test_choices_of_dwells() -> None:
    vehicle, least = VEHICLES["biased"], (None, 0.2, 1.5, 50.0)
    cases = [(vehicle, goal, seconds) for goal in ("error", "time", "flips") for seconds in least]
    assert check_parity("dwell_choice.js", "dwellsFor", dwells_for, cases, 1e-13) == 0
    check_parity("dwell_choice.js", "nearlyFastest", nearly_fastest, [(vehicle, each) for each in least], 1e-13)
    too_short = [(0.1,), (-1.0,), (0.19999,)]
    assert check_parity("dwell_choice.js", "checkLeast", check_least, too_short) == 3


def test_tracked_points() -> None:
    """Plans have offsets of those that are known."""
    basis = {"vehicle": VEHICLES["biased"], "unmeasured": [], "calibrated": False, "ownTable": True}
    found = answer("tracked_point.js", "trackedPoint", CONTROL, basis, "nose", "x")
    assert str(found) == refusal_of(tracked_vehicle, CONTROL, shipped(), "nose", None)
    for gap, least in ((2.0, 1.0), (0.3, 1.0), (0.99, 0.98), (0.5, 0.98)):
        vehicle = replace(VEHICLES["symmetric"], tail_gap=gap, least_gap=least)
        told = answer("tracked_point.js", "gapWarnings", {"tailGap": gap, "leastGap": least})
        assert told == list(tracked_of(vehicle).warnings)
