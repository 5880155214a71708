"""Planar motion is Python's, straight motion included."""

from __future__ import annotations

import numpy as np

from sim.mechanics import planar
from tests.planner.page.page_core import answers, check_near

RNG = np.random.default_rng(0)
POSES, TWISTS = RNG.normal(size=(10, 3)), RNG.normal(size=(10, 3)) * [[1, 1, k % 2] for k in range(10)]


def test_poses_and_arcs() -> None:
    pairs = list(zip(POSES, TWISTS, strict=True))
    check_near(answers([("planar.js", "compose", *pair) for pair in pairs]), planar.compose(POSES, TWISTS), 1e-15)
    check_near(answers([("planar.js", "inversePose", pose) for pose in POSES]), planar.inverse(POSES), 1e-15)
    check_near(answers([("planar.js", "arc", twist, 1.7) for twist in TWISTS]), planar.arc(TWISTS, 1.7), 1e-14)


def test_net_speed() -> None:
    found = answers([("planar.js", "netSpeed", *pair, 0.7) for pair in zip(TWISTS, POSES, strict=True)])
    check_near(found, planar.net_speed(TWISTS, POSES, 0.7), 1e-14)
