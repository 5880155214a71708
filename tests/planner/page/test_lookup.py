"""The query of the core is Python's: steady outputs, response, intervals, errors, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sim.io.errors import InputError
from sim.model.groups import DWELL
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.table.errors import RESPONSE_OUTPUTS
from tests.planner.page.page_core import TABLE, answers, refusal_of, without_digits
from tests.planner.page.robots import (
    SOLVED,
    check_alike,
    check_equal_outputs,
    columns_of,
    random_groups,
    shipped,
    shipped_data,
)

COUNT = 500
FILE = "lookup.js"
PAPER = {"C_t": 3.0, "C_r": 2.8, "C_yr": 2.0, "l_over_R": 6.875, "L_over_R": 3.75, "l_over_r0": 34.375,
         "omega_bar": 10.0, "N": 2.0, "a_over_R": 1.0}  # fmt: skip


def asked(name: str, robots: list[dict[str, float]], *options: Any) -> list[Any]:
    return answers([(FILE, name, TABLE, robot, *options) for robot in robots], shipped_data())


def test_steady_outputs_and_who_is_outside() -> None:
    """Robots outside the domain are answered, too, so that all are compared; both refuse the same ones."""
    robots = random_groups(COUNT)
    wanted = shipped().query(columns_of(robots), flag=True)
    found = asked("query", robots, {"flag": True})
    assert [answer["outside"] for answer in found] == wanted.pop("outside").tolist()
    for row, answer in enumerate(found):
        check_equal_outputs(answer, wanted, row, SOLVED)


def test_one_tail_is_answered() -> None:
    """Its motion is found from two sides."""
    robots = [robot | {"N": 1.0} for robot in random_groups(40)]
    wanted = shipped().query(columns_of(robots), flag=True)
    converged = np.isfinite(wanted["v_z"])
    for row, answer in enumerate(asked("query", robots, {"flag": True})):
        assert answer["outside"] == wanted["outside"][row]
        if converged[row] and not answer["outside"]:
            outputs = {name: wanted[name] for name in STEADY_OUTPUTS if name != "tail_gap"}
            check_equal_outputs(answer, outputs, row, 1e-11)
            assert answer["tail_gap"] == np.inf


def known(count: int) -> list[dict[str, float]]:
    robots = random_groups(COUNT)
    outside = shipped().query(columns_of(robots), flag=True)["outside"]
    return [robot for robot, out in zip(robots, outside, strict=True) if not out][:count]


def test_response_at_one_dwell_and_intervals() -> None:
    robots = known(100)
    robots = [
        robot | {DWELL: float(dwell)} for robot, dwell in zip(robots, np.geomspace(0.2, 5, 100), strict=True)
    ]
    wanted = shipped().query(columns_of(robots), intervals=True)
    scales = {name: np.abs(wanted[name]).max() for name in RESPONSE_OUTPUTS}
    for row, answer in enumerate(asked("query", robots, {"intervals": True})):
        assert set(answer) == set(wanted)
        for name in RESPONSE_OUTPUTS:
            assert abs(answer[name] - wanted[name][row]) <= SOLVED * scales[name]
        ends = {name: values for name, values in wanted.items() if name.endswith(("_low", "_high"))}
        check_equal_outputs(answer, {name: ends[name] for name in ends if "lag" not in name}, row, 1e-11)


def test_curves_of_the_response() -> None:
    robots = known(COUNT)
    wanted = shipped().response(columns_of(robots))
    for row, answer in enumerate(asked("response", robots)):
        for name, curve in answer.items():
            expected = getattr(wanted, name)[row].reshape(-1, 3)
            check_alike(np.reshape(curve, (-1, 3)), expected, SOLVED)


def test_error_modes() -> None:
    robots = known(20)
    for robot, modes in zip(robots, asked("tableErrorModes", robots), strict=True):
        wanted = shipped().error_modes({name: np.array([value]) for name, value in robot.items()})
        check_alike([mode["twist"] for mode in modes], wanted.twist, 1e-10)
        for name in ("lag", "memory"):
            expected = getattr(wanted, name)
            curves = np.reshape([mode[name] or np.zeros(expected[0].size) for mode in modes], expected.shape)
            check_alike(curves, expected, 1e-11)


@pytest.mark.parametrize(
    "change",
    [{"l_over_R": 40.0}, {"l_over_r0": 9.0}, {"a_over_R": 0.2}, {"omega_bar": 400.0}, {"omega_bar": -0.01},
     {"l_over_r0": 4.0}, {"C_t": -1.0}, {"C_r": 0.0}, {"N": 2.5}, {"N": 0.0}, {"N": 65.0},
     {"omega_bar": 0.0}, {"N": 1.0}, {"C_yr": 400.0}],
    ids=str,
)  # fmt: skip
def test_refusals_have_the_same_words(change: dict[str, float]) -> None:
    robot = PAPER | change
    columns = {name: np.array([value]) for name, value in robot.items()}
    (refusal,) = asked("response", [robot])
    assert isinstance(refusal, InputError)
    assert without_digits(refusal) == without_digits(refusal_of(shipped().response, columns))


@pytest.mark.parametrize("change", [{"N": 12.0}, {"L_over_R": 60.0}, {"C_t": 1e5}], ids=str)
def test_what_the_support_allows_is_refused_by_none(change: dict[str, float]) -> None:
    robot = PAPER | change
    wanted = shipped().query({name: np.array([value]) for name, value in robot.items()})
    check_equal_outputs(asked("query", [robot])[0], wanted, 0, SOLVED)


@pytest.mark.parametrize("dwell", [0.1, -1.0])
def test_dwells_that_are_not_known_are_refused(dwell: float) -> None:
    robot = PAPER | {DWELL: dwell}
    columns = {name: np.array([value]) for name, value in robot.items()}
    assert str(asked("query", [robot])[0]) == refusal_of(shipped().query, columns)
