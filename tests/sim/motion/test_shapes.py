"""Shapes of the tails over a revolution."""

from __future__ import annotations

import numpy as np
import pytest

from sim.model.presets import PRESETS
from sim.motion.shapes import tails_over_a_revolution


def test_tails_over_a_revolution_hang_on_their_clamps() -> None:
    robot = PRESETS["paper-triangle"]
    phases, tails = tails_over_a_revolution(robot, 8)
    assert tails.shape == (8, 4, 13, 3)
    radius = robot.head_radius / robot.tail_length
    for j in range(4):
        angle = phases + 2 * np.pi * j / 4
        clamp = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], 1)
        assert tails[:, j, 0] == pytest.approx(clamp, abs=1e-12)
    lengths = np.linalg.norm(np.diff(tails, axis=2), axis=-1).sum(-1)
    assert lengths == pytest.approx(1.0, abs=1e-2)
    # After a quarter turn tail 1 is where tail 0 was.
    assert tails[2, 0] == pytest.approx(tails[0, 1], abs=1e-9)
