"""Tracks of vehicles with a current are Python's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planner.vehicle.rollout import Switches, poses_at_flips, predicted_poses, trace
from tests.planner.page.page_core import answers, check_near
from tests.planner.page.robots import random_robots, vehicle_of, vehicle_to_page


def test_poses_and_tracks() -> None:
    rng = np.random.default_rng(0)
    for robot, first in zip(random_robots(2), (1, -1), strict=True):
        vehicle = replace(vehicle_of(robot), current=np.array([0.01, -0.02]), modes=())
        switches = Switches(first, rng.uniform(0.25, 3.0, 30), rng.normal(size=(31, 3)))
        page = {"firstDirection": first, "dwells": switches.dwells, "poses": switches.poses}
        vehicle_page = vehicle_to_page(vehicle)
        flips, track, poses = answers(
            [
                ("rollout.js", "posesAtFlips", vehicle_page, page),
                ("rollout.js", "trace", vehicle_page, page, 0.2),
                ("rollout.js", "predictedPoses", vehicle_page, page),
            ]
        )
        check_near(flips, poses_at_flips(vehicle, switches), 1e-13)
        check_near(track, trace(vehicle, switches, 0.2), 1e-13)
        check_near(poses, predicted_poses(vehicle, switches), 1e-13)
