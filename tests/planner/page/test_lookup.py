"""The look-up table of the page, and vehicles of it, answer as Python's, in the domain and outside."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planner.page.table_data import packed_data, table_data
from planner.vehicle.dwell_choice import check_least, dwells_for, nearly_fastest
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.tracked_point import tracked_vehicle
from sim.model.groups import DWELL
from sim.model.response import BEFORE, DWELLS
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.table.errors import RESPONSE_OUTPUTS
from surrogate.table.lookup import table_content
from surrogate.table.response_table import between_dwells
from tests.planner.page.cases import CONTROL, VEHICLES, columns_of, random_groups, shipped, tracked_of
from tests.planner.page.page_core import TABLE, answer, answers, check_near
from tests.planner.page.parity import check_alike, check_parity, refusal_of, without_digits

SOLVED = 1e-11  # relative; balances are solved until a correction is 2e-12, on different ways
MOST_LETTERS = 1_350_000
PAPER = {"C_t": 3.0, "C_r": 2.8, "C_yr": 2.0, "l_over_R": 6.875, "L_over_R": 3.75, "l_over_r0": 34.375,
         "omega_bar": 10.0, "N": 2.0, "a_over_R": 1.0}  # fmt: skip
Group = dict[str, Any]


def asked(name: str, robots: list[Group], *options: Any) -> list[Any]:
    return answers([("lookup.js", name, TABLE, robot, *options) for robot in robots])


def columns(robot: Group) -> dict[str, np.ndarray]:
    return {name: np.array([value]) for name, value in robot.items()}


def check_outputs(found: list[Group], wanted: dict[str, np.ndarray], allowed: float = SOLVED) -> None:
    """Assert that outputs are equal up to `allowed` of each one."""
    for name, values in wanted.items():
        given = np.array([one[name] for one in found], dtype=float)
        assert (np.abs(given - values) <= allowed * np.abs(values)).all(), name


def known(count: int) -> list[Group]:
    robots = random_groups(60)
    outside = shipped().query(columns_of(robots), flag=True)["outside"]
    return [robot for robot, out in zip(robots, outside, strict=True) if not out][:count]


def test_steady_outputs_and_who_is_outside() -> None:
    """Robots outside the domain are answered, too, so that all are compared; both refuse the same ones."""
    robots = random_groups(150)
    wanted = shipped().query(columns_of(robots), flag=True)
    found = asked("query", robots, {"flag": True})
    assert [one["outside"] for one in found] == wanted.pop("outside").tolist()
    check_outputs(found, wanted)


def test_one_tail_is_answered() -> None:
    """Its motion is found from two sides."""
    robots = [robot | {"N": 1.0} for robot in random_groups(15)]
    wanted = shipped().query(columns_of(robots), flag=True)
    found = asked("query", robots, {"flag": True})
    outside = wanted["outside"]
    assert [one["outside"] for one in found] == outside.tolist()
    rows = np.flatnonzero(np.isfinite(wanted["v_z"]) & ~outside)
    assert len(rows) > 3
    outputs = {name: wanted[name][rows] for name in STEADY_OUTPUTS if name != "tail_gap"}
    check_outputs([found[row] for row in rows], outputs)
    assert {found[row]["tail_gap"] for row in rows} == {np.inf}


def test_the_response_at_one_dwell_and_intervals() -> None:
    dwells = np.geomspace(0.2, 5, 30)
    robots = [robot | {DWELL: float(dwell)} for robot, dwell in zip(known(30), dwells, strict=True)]
    wanted = shipped().query(columns_of(robots), intervals=True)
    found = asked("query", robots, {"intervals": True})
    assert all(set(one) == set(wanted) for one in found)
    for name in RESPONSE_OUTPUTS:
        given = np.array([one[name] for one in found])
        check_near(given / np.abs(wanted[name]).max(), wanted[name] / np.abs(wanted[name]).max(), SOLVED)
    ends = {name: part for name, part in wanted.items() if name.endswith(("_low", "_high")) and "lag" not in name}
    assert ends
    check_outputs(found, ends)


def test_curves_of_the_response() -> None:
    robots = known(20)
    wanted = shipped().response(columns_of(robots))
    for row, one in enumerate(asked("response", robots)):
        for name, curve in one.items():
            check_alike(curve, getattr(wanted, name)[row].reshape(-1, 3), SOLVED)


def test_curves_between_dwells() -> None:
    curve, dwells = np.random.default_rng(0).normal(size=(len(DWELLS), 3)), [*DWELLS, *np.geomspace(0.2, 6, 40)]
    found = answers([("response_table.js", "betweenDwells", curve.ravel(), dwell) for dwell in dwells])
    check_near(found, between_dwells(np.broadcast_to(curve, (len(dwells), *curve.shape)), np.array(dwells)), 1e-12)


def test_modes_of_the_error() -> None:
    for robot, modes in zip(known(4), asked("tableErrorModes", known(4)), strict=True):
        wanted = shipped().error_modes(columns(robot))
        check_alike([mode["twist"] for mode in modes], wanted.twist, 1e-10)
        for name in ("lag", "memory"):
            expected = getattr(wanted, name)
            curves = np.reshape([mode[name] or np.zeros(expected[0].size) for mode in modes], expected.shape)
            check_alike(curves, expected, SOLVED)


OUTSIDE: list[Group] = [
    {"l_over_R": 40.0}, {"l_over_r0": 9.0}, {"a_over_R": 0.2}, {"omega_bar": 400.0}, {"omega_bar": -0.01},
    {"l_over_r0": 4.0}, {"C_t": -1.0}, {"C_r": 0.0}, {"N": 2.5}, {"N": 0.0}, {"N": 65.0}, {"omega_bar": 0.0},
    {"N": 1.0}, {"C_yr": 400.0}, {"C_t": np.inf}, {"C_yr": np.nan}, {"L_over_R": 0.0}, {"a_over_R": -1.0},
    {"N": 1e9},
]  # fmt: skip


def test_robots_outside_are_refused() -> None:
    robots = [PAPER | change for change in OUTSIDE]
    found = [without_digits(refusal) for refusal in asked("response", robots)]
    assert found == [without_digits(refusal_of(shipped().response, columns(robot))) for robot in robots]
    lacking = {name: value for name, value in PAPER.items() if name != "C_r"}
    assert str(asked("response", [lacking])[0]) == refusal_of(shipped().response, columns(lacking))
    for dwell in (0.1, -1.0):
        robot = PAPER | {DWELL: dwell}
        assert str(asked("query", [robot])[0]) == refusal_of(shipped().query, columns(robot))


def test_what_the_support_allows_is_refused_by_none() -> None:
    robots = [PAPER | change for change in ({"N": 12.0}, {"L_over_R": 60.0}, {"C_t": 1e5})]
    check_outputs(asked("query", robots), shipped().query(columns_of(robots)))


def test_numbers_come_back_exactly() -> None:
    for count in (0, 1, 2, 3, 5, 1000):
        rng = np.random.default_rng(count)
        numbers = rng.normal(size=(count, 2)) * 10.0 ** rng.integers(-300, 300, size=(count, 2))
        found = answer("table_data.js", "readData", json.loads(packed_data({"a": [numbers, "text", None, 2.5]})))
        assert found["a"] == [{"shape": [count, 2], "values": numbers.ravel().tolist()}, "text", None, 2.5]


def test_the_shipped_table_comes_back_exactly_from_a_text_that_means_nothing_in_html() -> None:
    text = table_data(shipped())
    assert len(text) <= MOST_LETTERS
    assert not set("<>&`'\\") & set(text)
    found = answer("table_data.js", "readData", json.loads(text))
    content, wanted = found["content"], table_content(shipped())
    assert found["identity"] == shipped().identity
    assert content["ranges"] == {name: list(ends) for name, ends in shipped().ranges.items()}
    assert content["curve_errors"]["curves"]["values"] == wanted["curve_errors"]["curves"].ravel().tolist()
    for part, network in zip(content["wrench"], wanted["wrench"], strict=True):
        for name, array in network["state"].items():
            assert part["state"][name] == {"shape": list(array.shape), "values": array.ravel().tolist()}


REFUSED = [
    replace(CONTROL, tails=1), replace(CONTROL, disc_offset=0.0016, name="it's"), replace(CONTROL, C_r=0.02),
    replace(CONTROL, tails=12, C_r=0.02), replace(CONTROL, C_t=0.01, C_yr=10.0, motor_speed=9 * np.pi / 30),
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
