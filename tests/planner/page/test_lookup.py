"""The look-up table of the page answers as Python's, in the domain and outside, for robots one at a time."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planner.page.table_data import packed_data, table_data
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.tracked_point import tracked_vehicle
from sim.io.errors import InputError
from sim.model.response import BEFORE
from tests.planner.page.cases import CONTROL, VEHICLES, columns_of, random_groups, shipped
from tests.planner.page.page_core import (
    TABLE,
    answer,
    answers,
    check_alike,
    check_near,
    refusal_of,
    without_digits,
)

SOLVED = 1e-9  # relative; balances are solved until a correction is 2e-12, on different ways
MOST_LETTERS = 1_350_000
Group = dict[str, Any]


def asked(name: str, robots: list[Group]) -> list[Any]:
    return answers([("table.js", name, TABLE, robot) for robot in robots])


def outside(robots: list[Group]) -> list[bool]:
    return shipped().query(columns_of(robots), flag=True)["outside"].tolist()


def known(count: int) -> list[Group]:
    robots = random_groups(60)
    return [robot for robot, out in zip(robots, outside(robots), strict=True) if not out][:count]


@pytest.mark.parametrize("tails", [None, 1.0])
def test_steady_outputs_and_who_is_outside(tails: float | None) -> None:
    robots = [robot | ({"N": tails} if tails else {}) for robot in random_groups(15 if tails else 100)]
    found, wanted = asked("query", robots), shipped().query(columns_of(robots), flag=True)
    assert [isinstance(one, InputError) for one in found] == wanted.pop("outside").tolist()
    rows = [row for row, one in enumerate(found) if not isinstance(one, InputError)]
    assert len(rows) > 3
    for name, values in wanted.items():
        given = np.array([found[row][name] for row in rows], dtype=float)
        np.testing.assert_allclose(given, values[rows], rtol=SOLVED)


def test_curves_of_the_response_and_modes_of_the_error() -> None:
    robots = known(6)
    wanted = shipped().response(columns_of(robots))
    for row, one in enumerate(asked("response", robots)):
        for name, curve in one.items():
            check_alike(curve, getattr(wanted, name)[row].reshape(-1, 3), SOLVED)
    for robot, modes in zip(robots, asked("tableErrorModes", robots), strict=True):
        errors = shipped().error_modes({name: np.array([value]) for name, value in robot.items()})
        check_alike([mode["twist"] for mode in modes], errors.twist, SOLVED)
        for name in ("lag", "memory"):
            expected = getattr(errors, name)
            curves = np.reshape([mode[name] or np.zeros(expected[0].size) for mode in modes], expected.shape)
            check_alike(curves, expected, SOLVED)


def test_numbers_come_back_exactly_from_a_text_that_means_nothing_in_html() -> None:
    for count in (0, 1, 2, 3, 5, 1000):
        rng = np.random.default_rng(count)
        numbers = rng.normal(size=(count, 2)) * 10.0 ** rng.integers(-300, 300, size=(count, 2))
        found = answer("data.js", "readData", json.loads(packed_data({"a": [numbers, "text", None, 2.5]})))
        assert found["a"] == [{"shape": [count, 2], "values": numbers.ravel().tolist()}, "text", None, 2.5]
    text = table_data(shipped())
    assert len(text) <= MOST_LETTERS
    assert not set("<>&`'\\") & set(text)


REFUSED = [
    replace(CONTROL, tails=1), replace(CONTROL, disc_offset=0.0016, name="it's"), replace(CONTROL, C_r=0.02),
    replace(CONTROL, tails=12, C_r=0.02), replace(CONTROL, C_t=0.01, C_yr=10.0, motor_speed=9 * np.pi / 30),
    replace(CONTROL, viscosity=40.0), replace(CONTROL, tail_length=0.5),
]  # fmt: skip


@pytest.mark.parametrize("robot", REFUSED)
def test_robots_outside_are_refused_in_lab_units(robot: Any) -> None:
    """The command tells which values of the number it knows, the page the range that was learned."""
    found = str(answer("from_table.js", "trackedVehicle", robot, TABLE, "head_centre"))
    wanted = refusal_of(table_vehicle, robot, shipped())
    head = [without_digits(words).split(", learned")[0].split(";")[0] for words in (found, wanted)]
    assert head[0] == head[1]
    assert "\n" not in found


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
    parts = {"twist": twist, "curves": [zeros, zeros], "before": BEFORE, "errors": [], "modes": []}
    assert str(answer("from_table.js", "vehicleOfParts", parts, "x")).startswith(words)


def test_tracked_points() -> None:
    basis = {"vehicle": VEHICLES["biased"], "unmeasured": [], "calibrated": False, "ownTable": True}
    found = answer("vehicle.js", "trackedPoint", CONTROL, basis, "nose", "x")
    assert str(found) == refusal_of(tracked_vehicle, CONTROL, shipped(), "nose", None)
    tip = answer("vehicle.js", "trackedPoint", CONTROL, basis, "head_tip", "x")
    check_near(tip["offset"], CONTROL.head_length / 2 / CONTROL.tail_length)
