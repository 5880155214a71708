"""tracker.h of the page is Python's, if the plan's numbers are: the same text, and numbers to the last bits."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from planner.files.tracker_header import header_template, tracker_header
from planner.planning.planned import Plan
from planner.vehicle.vehicle import Mode
from tests.planner.page.page_core import answer
from tests.planner.page.plans import plan_to_page, planned

NUMBER = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e[-+]?\d+)?(?![\w.])")


@pytest.mark.parametrize(
    ("name", "robot", "options"),
    [
        ("circle", "paper-control", {"objective": "flips"}),
        ("eight", "paper-triangle", {"objective": "time"}),
        ("bend", "paper-control", {"point": "head_tip", "objective": "flips"}),
        ("line", "paper-measured", {"minimum_dwell": 0.9}),
    ],
)
def test_header(name: str, robot: str, options: dict[str, object]) -> None:
    check_header(planned(name, robot, **options))


def test_header_of_a_robot_in_a_current() -> None:
    result = planned("line")
    current = np.array([0.002, -0.001])
    twist = 1e-3 * np.arange(6.0).reshape(2, 3)
    mode = Mode("current", twist, None, np.array([1e-4, 2e-4]))
    vehicle = result.tracked.vehicle
    vehicle = replace(vehicle, current=current, modes=(*vehicle.modes, mode))
    check_header(replace(result, tracked=result.tracked._replace(vehicle=vehicle)))


def check_header(result: Plan) -> None:
    found = answer("tracker_header.js", "trackerHeader", plan_to_page(result), "p1", "a robot", header_template())
    robot = replace(result.robot, name="a robot")
    wanted = tracker_header(replace(result, tracked=result.tracked._replace(robot=robot)), "p1")
    assert NUMBER.sub("#", found).splitlines() == NUMBER.sub("#", wanted).splitlines()
    # The last bit of a product of matrices depends on the processor.
    numbers, wanted_numbers = ([float(text) for text in NUMBER.findall(header)] for header in (found, wanted))
    np.testing.assert_allclose(numbers, wanted_numbers, rtol=1e-13)
    assert "@" not in found
