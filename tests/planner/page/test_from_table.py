"""The vehicle that the core makes of a robot is Python's, with its modes; robots that cannot be are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner.vehicle.from_table import table_vehicle
from planner.vehicle.vehicle import Vehicle
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from tests.planner.page.page_core import TABLE, answers, refusal_of, without_digits
from tests.planner.page.plans import robot_to_page
from tests.planner.page.robots import EXACT, check_alike, random_robots, shipped, shipped_data, vehicle_of

COUNT = 40
WITH_MODES = 3
CONTROL = PRESETS["paper-control"]


def made(robots: list[Robot]) -> list[dict[str, object]]:
    calls = [("from_table.js", "tableVehicle", robot_to_page(robot), TABLE) for robot in robots]
    return answers(calls, shipped_data())


def check_tables(found: dict[str, object], wanted: Vehicle) -> None:
    check_alike(np.array(found["twist"]).T, wanted.twist.T)
    for name in ("lag", "rest", "spread"):
        check_alike(np.reshape(found[name], (-1, 3)), getattr(wanted, name).reshape(-1, 3))
    assert found["phaseRate"] == pytest.approx(wanted.phase_rate.tolist(), rel=EXACT)
    assert found["current"] == [0.0, 0.0]
    assert found["tailGap"] == pytest.approx(wanted.tail_gap, rel=EXACT)
    assert found["leastGap"] == wanted.least_gap


def test_tables_of_vehicles() -> None:
    robots = random_robots(COUNT)
    for start in range(0, COUNT, 8):
        some = robots[start : start + 8]
        for found, robot in zip(made(some), some, strict=True):
            check_tables(found, vehicle_of(robot))
            if robot in robots[:WITH_MODES]:
                check_modes(found["modes"], vehicle_of(robot))


def check_modes(found: object, wanted: Vehicle) -> None:
    assert isinstance(found, list)
    assert [mode["name"] for mode in found] == [mode.name for mode in wanted.modes]
    for mode, expected in zip(found, wanted.modes, strict=True):
        assert np.abs(np.array(mode["twist"]) - expected.twist).max() <= 1e-10 * np.abs(wanted.twist).max()
        assert (mode["lag"] is None) == (expected.lag is None)
        if expected.lag is not None:
            check_alike(np.reshape(mode["lag"], (-1, 3)), expected.lag.reshape(-1, 3), 1e-10)


@pytest.mark.parametrize(
    "robot",
    [CONTROL.with_motor(0.01), CONTROL.with_motor(2000.0), replace(CONTROL, tails=1),
     replace(CONTROL, C_yr=400.0)],
    ids=str,
)  # fmt: skip
def test_robots_that_are_refused(robot: Robot) -> None:
    (refusal,) = made([robot])
    assert without_digits(refusal) == without_digits(refusal_of(table_vehicle, robot, shipped()))


def parts(twist: list[list[float]]) -> dict[str, object]:
    zeros = {"lag": np.zeros(75), "memory": np.zeros(1200), "rest": np.zeros(75), "spread": np.zeros(75)}
    return {"twist": twist, "curves": [zeros, zeros], "before": np.geomspace(0.2, 1.2, 16), "modes": []}


@pytest.mark.parametrize(
    ("twist", "words"),
    [
        ([[-1.0, 1.0, 1.0], [0.5, -1.0, -1.0]], "robot 'x' does not move forward (v_z = -0.25); turn its motor"),
        (
            [[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]],
            "robot 'x' turns to the same side in both directions of its motor; it",
        ),
    ],
)
def test_vehicles_that_cannot_follow_a_path(twist: list[list[float]], words: str) -> None:
    (refusal,) = answers([("from_table.js", "vehicleOfParts", parts(twist), "x")])
    assert str(refusal).startswith(words)
