"""Replays of schedules."""

from __future__ import annotations

import numpy as np
import pytest

from sim.io.errors import InputError
from sim.model.schedule import Schedule
from sim.motion.replay import replay, replay_error
from sim.motion.resolution import Resolution
from sim.motion.steady import steady
from tests.sim.robots import CONTROL_VALUES, control


def test_replays_of_several_schedules_equal_replays_alone() -> None:
    schedules = [
        Schedule(CONTROL_VALUES, 1, np.array([0.8, 1.2, 0.9]), (1.0, 2.0, 0.5), 2.0),
        Schedule(CONTROL_VALUES, -1, np.array([1.0]), (0.0, 0.0, 0.0), 2.0),
    ]
    together = replay(schedules)
    for schedule, track in zip(schedules, together, strict=True):
        alone = replay([schedule])[0]
        assert track.equals(alone)
        assert "x_cm" not in track
        assert float(track.time_bar.iloc[-1]) == pytest.approx(schedule.dwells.sum())
    assert together[0].iloc[0][["x_over_l", "y_over_l", "heading_rad"]].tolist() == [1.0, 2.0, 0.5]


def test_a_track_of_a_robot_with_a_size_is_in_centimetres_too() -> None:
    track = replay([Schedule(CONTROL_VALUES, 1, np.array([0.8]), (1.0, 2.0, 0.5), 2.0, 0.11)])[0]
    assert track["x_cm"].to_numpy() == pytest.approx(11 * track["x_over_l"].to_numpy())
    assert track["y_cm"].to_numpy() == pytest.approx(11 * track["y_over_l"].to_numpy())
    assert np.radians(track["heading_deg"].to_numpy()) == pytest.approx(track["heading_rad"].to_numpy())
    with pytest.raises(InputError, match="tail_length_m = -1"):
        Schedule(CONTROL_VALUES, 1, np.array([0.8]), (1.0, 2.0, 0.5), 2.0, -1.0)


@pytest.mark.parametrize(("tails", "omega_bar"), [(2.0, 10.0), (4.0, 10.0)])
def test_a_replay_turns_as_fast_as_the_steady_motion(tails: float, omega_bar: float) -> None:
    """A yaw rate 0.2 % too small adds up to a tenth of l in a plan of some hundred dwells."""
    values = {**CONTROL_VALUES, "N": tails, "omega_bar": omega_bar}
    track = replay([Schedule(values, 1, np.array([12.0]), (0.0, 0.0, 0.0), 1.0)])[0]
    late = track[track["time_bar"] > 4]
    rate = np.polyfit(late["time_bar"], late["heading_rad"], 1)[0]
    assert rate == pytest.approx(steady(control(N=tails, omega_bar=omega_bar)).omega_yr[0], rel=1e-3)


@pytest.mark.parametrize("robot", [
    pytest.param({**CONTROL_VALUES, "N": 2.0}, id="control"),
    pytest.param({**CONTROL_VALUES, "N": 4.0, "omega_bar": 30.0}, id="fast", marks=pytest.mark.slow),
])  # fmt: skip
def test_the_error_of_a_track_is_that_against_a_much_finer_mesh(robot: dict[str, float]) -> None:
    """The reference has three times the edges and the steps, so a ninth of the error."""
    dwells = np.array([1.0, 0.6, 1.4, 0.8, 1.0, 0.5])
    schedule = Schedule(robot, 1, dwells, (0.0, 0.0, 0.0), 1.0)
    (track,) = replay([schedule])
    (finest,) = replay([schedule], resolution=Resolution.for_tracks(robot["omega_bar"]).finer(3))
    places = [part.groupby("dwell").last()[["x_over_l", "y_over_l"]].to_numpy() for part in (track, finest)]
    found = np.hypot(*(places[0] - places[1]).T).max()
    assert 0.5 * found < replay_error(schedule, track) < 2 * found
