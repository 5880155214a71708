"""Robots, their groups and refusals are Python's."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from sim.model.presets import PRESETS
from sim.model.robot import Robot
from tests.planner.page.page_core import answer, answers
from tests.planner.page.plans import robot_to_page

BASE = PRESETS["paper-control"]


def fields(robot: Robot) -> dict[str, Any]:
    """Return the numbers of a robot without those that follow from them."""
    return {name: value for name, value in robot_to_page(robot).items() if name not in ("timeScale", "omegaBar")}


def test_scales_and_groups() -> None:
    robots = [*PRESETS.values(), replace(BASE, disc_offset=0.02)]
    made = answers([("robot.js", "makeRobot", fields(robot)) for robot in robots])
    for found, robot in zip(made, robots, strict=True):
        assert found["timeScale"] == pytest.approx(robot.time_scale, rel=1e-15)
        assert found["omegaBar"] == pytest.approx(robot.omega_bar, rel=1e-15)
        groups = answer("robot.js", "groupValues", {**found, "omegaBar": robot.omega_bar})
        assert groups == robot.group_values()
        assert list(groups) == list(robot.group_values())
    assert answer("robot.js", "groupValues", {"groups": {"C_t": 1.5}}) == {"C_t": 1.5}


@pytest.mark.parametrize(
    "changes",
    [
        {"tails": 0}, {"tails": 65}, {"tails": 2.5}, {"tail_length": 0.0}, {"viscosity": -1.5}, {"C_t": -1e-7},
        {"motor_speed": 0.0}, {"disc_offset": -0.01}, {"tail_radius": 0.03}, {"youngs_modulus": 1e-320},
        {"tail_length": 1e200, "tail_radius": 1e-200}, {"viscosity": 1e-310, "motor_speed": 1e-300},
    ],
    ids=str,
)  # fmt: skip
def test_robots_that_cannot_be(changes: dict[str, float]) -> None:
    camel = {"tail_length": "tailLength", "tail_radius": "tailRadius", "motor_speed": "motorSpeed",
             "disc_offset": "discOffset", "youngs_modulus": "youngsModulus"}  # fmt: skip
    given = {**fields(BASE), **{camel.get(name, name): value for name, value in changes.items()}}
    with pytest.raises(ValueError, match=r".") as refusal:
        replace(BASE, **changes)  # type: ignore[arg-type]
    assert str(answer("robot.js", "makeRobot", given)) == str(refusal.value)
    assert math.isfinite(BASE.time_scale)
