"""Replays of schedules."""

from __future__ import annotations

import numpy as np
import pytest

from sim.model.schedule import Schedule
from sim.motion.replay import replay
from tests.sim.robots import CONTROL_VALUES


def test_replays_of_several_schedules_equal_replays_alone() -> None:
    schedules = [
        Schedule(CONTROL_VALUES, 1, np.array([0.8, 1.2, 0.9]), (1.0, 2.0, 0.5), 2.0),
        Schedule(CONTROL_VALUES, -1, np.array([1.0]), (0.0, 0.0, 0.0), 2.0),
    ]
    together = replay(schedules)
    for schedule, track in zip(schedules, together, strict=True):
        alone = replay([schedule])[0]
        assert track.equals(alone)
        assert float(track.time_bar.iloc[-1]) == pytest.approx(schedule.dwells.sum())
    assert together[0].iloc[0][["x_over_l", "y_over_l", "heading_rad"]].tolist() == [1.0, 2.0, 0.5]
