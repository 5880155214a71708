"""Replays of schedules, responses to switches by time steps, and what the last dwell but one changes."""

from __future__ import annotations

import numpy as np
import pytest

from sim.io.errors import InputError
from sim.mechanics import planar
from sim.model.response import BEFORE, DWELLS, at_equal_dwells
from sim.model.schedule import Schedule
from sim.motion.replay import replay, replay_error
from sim.motion.response import longer_memory, responses
from sim.motion.run import Resolution
from sim.motion.steady import steady
from sim.motion.steady_motion import twists
from tests.oracles.switching import switch_response
from tests.sim.robots import CONTROL_VALUES, control


def test_a_replay_begins_at_the_start_and_ends_with_the_last_dwell() -> None:
    schedules = [
        Schedule(CONTROL_VALUES, 1, np.array([0.8, 1.2, 0.9]), (1.0, 2.0, 0.5), 2.0),
        Schedule(CONTROL_VALUES, -1, np.array([1.0]), (0.0, 0.0, 0.0), 2.0),
    ]
    for schedule in schedules:
        track = replay(schedule)
        assert "x_cm" not in track
        assert float(track.time_bar.iloc[-1]) == pytest.approx(schedule.dwells.sum())
        assert track.iloc[0][["x_over_l", "y_over_l", "heading_rad"]].tolist() == list(schedule.start)


def test_a_track_of_a_robot_with_a_size_is_in_centimetres_too() -> None:
    track = replay(Schedule(CONTROL_VALUES, 1, np.array([0.8]), (1.0, 2.0, 0.5), 2.0, 0.11))
    assert track["x_cm"].to_numpy() == pytest.approx(11 * track["x_over_l"].to_numpy())
    assert track["y_cm"].to_numpy() == pytest.approx(11 * track["y_over_l"].to_numpy())
    assert np.radians(track["heading_deg"].to_numpy()) == pytest.approx(track["heading_rad"].to_numpy())
    with pytest.raises(InputError, match="tail_length_m = -1"):
        Schedule(CONTROL_VALUES, 1, np.array([0.8]), (1.0, 2.0, 0.5), 2.0, -1.0)


@pytest.mark.parametrize("tails", [2.0, 4.0])
def test_a_replay_turns_as_fast_as_the_steady_motion(tails: float) -> None:
    values = {**CONTROL_VALUES, "N": tails}
    track = replay(Schedule(values, 1, np.array([12.0]), (0.0, 0.0, 0.0), 1.0))
    late = track[track["time_bar"] > 4]
    rate = np.polyfit(late["time_bar"], late["heading_rad"], 1)[0]
    assert rate == pytest.approx(steady(control(N=tails)).omega_yr[0], rel=1e-3)


@pytest.mark.parametrize("robot", [
    pytest.param({**CONTROL_VALUES, "N": 2.0}, id="control"),
    pytest.param({**CONTROL_VALUES, "N": 4.0, "omega_bar": 30.0}, id="fast", marks=pytest.mark.rest),
])  # fmt: skip
def test_the_error_of_a_track_is_that_against_a_much_finer_mesh(robot: dict[str, float]) -> None:
    """The reference has three times the edges and the steps, so a ninth of the error."""
    dwells = np.array([1.0, 0.6, 1.4, 0.8, 1.0, 0.5])
    schedule = Schedule(robot, 1, dwells, (0.0, 0.0, 0.0), 1.0)
    track = replay(schedule)
    finest = replay(schedule, resolution=Resolution.for_tracks(robot["omega_bar"]).finer(3))
    places = [part.groupby("dwell").last()[["x_over_l", "y_over_l"]].to_numpy() for part in (track, finest)]
    found = np.hypot(*(places[0] - places[1]).T).max()
    assert 0.5 * found < replay_error(schedule, track) < 2 * found


def test_net_speed_falls_with_faster_flips_as_the_tails_turn_over() -> None:
    dwell = np.array([0.5, 1.0, 2.0, 4.0])
    groups = control(4)
    response = switch_response(groups, dwell)
    surge = steady(groups).v_z[0]
    assert not response.failed.any()
    assert (np.diff(response.net_speed) > 0).all()
    assert response.net_speed[-1] < surge
    assert response.net_speed == pytest.approx([0.0133, 0.0160, 0.0169, 0.0173], rel=0.02)
    # The offset of a flip no longer changes once the tails have turned over.
    assert response.lag_z[2:] == pytest.approx(np.full(2, response.lag_z[1]), rel=0.05)


@pytest.mark.parametrize("dwell", [0.35, 2.5])
def test_net_motion_agrees_with_a_brute_force_replay(dwell: float) -> None:
    """Many flips in the lab against lag and arc of one; shorter and longer dwells than the tails' memory."""
    count = 24
    response = switch_response(control(N=3), np.array([dwell]))
    schedule = Schedule({**CONTROL_VALUES, "N": 3.0}, 1, np.full(count, dwell), (0.0, 0.0, 0.0), 1.0)
    track = replay(schedule)
    flips = track.groupby("dwell").last()[["x_over_l", "y_over_l"]].to_numpy()
    moved = np.linalg.norm(flips[-1] - flips[3]) / (dwell * (count - 4))
    assert moved == pytest.approx(float(response.net_speed[0]), rel=8e-3)


@pytest.mark.parametrize("dwell", [0.35, 1.0])
def test_a_flip_leaves_little_error_of_the_step(dwell: float) -> None:
    """Every mode of the tails starts anew at a flip; with equal steps they are 1.6 and 0.5 % off."""
    default, fine = (
        switch_response(control(N=4), np.array([dwell]), resolution=Resolution(16, steps)).net_speed[0]
        for steps in (24, 24 * 16)
    )
    assert default == pytest.approx(fine, rel=4e-3)


def test_with_it_the_net_speed_of_short_dwells_is_that_of_flips_that_go_on() -> None:
    """At dwells of 0.3 and 0.4 it explains most of what the curves, which know one dwell before, leave."""
    few = np.array([3, 5])
    groups = control(omega_bar=12.0, N=4.0)
    both = control(2, omega_bar=12.0, N=4.0)
    stepped = switch_response(both, DWELLS[few], resolution=Resolution(24, 72)).net_speed
    motion, curves = steady(groups), responses(groups)
    twist = twists(motion.v_z, motion.v_x, motion.omega_yr, np.ones(1))
    longer = curves.memory + longer_memory(groups)
    lags = [curves.lag + at_equal_dwells(memory) for memory in (curves.memory, longer)]
    off = [abs(planar.net_speed(twist[:, None], lag, DWELLS)[0, few] - stepped) for lag in lags]
    assert (off[1] < 0.4 * off[0]).all()


@pytest.mark.parametrize("changes", [{}, {"left_right_bias": 0.2}])
def test_it_fades(changes: dict[str, float]) -> None:
    found = np.abs(longer_memory(control(omega_bar=20.0, **changes))[0]).max((1, 2))
    assert found[BEFORE > 1.0].max() < 0.02 * found[0]


def test_a_reversed_motor_gives_the_same() -> None:
    there, back = (longer_memory(control(omega_bar=w, end_over_end_drag=3.0)) for w in (12.0, -12.0))
    assert there == pytest.approx(back, abs=1e-6)
