"""docs/reference/signs.md and the simulator agree: its table, slip angle, camera, the bench."""

from __future__ import annotations

import math
import re
from functools import cache

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from camera.measured_runs import measure_tracks
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.model.schedule import Schedule
from sim.motion.replay import replay
from sim.motion.shapes import nodes_in_body, steady_states
from sim.motion.steady import steady
from surrogate.domain import BOUNDS
from tests.docs.pages import DOCS
from tests.sim.robots import CONTROL_VALUES

PAGE = (DOCS / "reference" / "signs.md").read_text()
ROBOT = PRESETS["paper-control"]
# What the page says about the motor at +1: column -> words, sign.
ROWS = re.findall(r"^\| (the .*) \| `(\w+)` \| ([+−]) \|$", PAGE, re.MULTILINE)
TABLE = {column: (words, {"+": 1, "−": -1}[sign]) for words, column, sign in ROWS}


@cache
def steady_part(direction: int) -> pd.DataFrame:
    """Simulate two thirds of a circle from rest, without its beginning."""
    track = replay(Schedule(CONTROL_VALUES, direction, np.array([90.0]), (0.3, -0.2, 0.4), 2.0))
    return track[track["time_bar"] > 6].reset_index(drop=True)


def velocity(track: pd.DataFrame) -> tuple[float, float]:
    """Return the mean velocity along the axis and to its left."""
    x, y, heading = (track[column].to_numpy() for column in ("x_over_l", "y_over_l", "heading_rad"))
    moved = np.exp(-0.5j * (heading[1:] + heading[:-1])) * (np.diff(x) + 1j * np.diff(y))
    return moved.real.mean(), moved.imag.mean()


@pytest.mark.parametrize("tails", [2, 3, 5])
@pytest.mark.parametrize("direction", [1, -1])
def test_the_table_holds_in_the_simulator(direction: int, tails: int) -> None:
    """Random robots of the domain."""
    rng = np.random.default_rng(7)
    values = {name: np.exp(rng.uniform(np.log(low), np.log(high), 24)) for name, (low, high) in BOUNDS.items()}
    turned = {"omega_bar": direction * values["omega_bar"], "N": np.full(24, tails)}
    motion = steady(Groups.from_columns({**values, **turned}))
    solved = motion.converged & ~motion.failed
    assert solved.sum() > 12
    assert len(TABLE) == 5
    for column, (_, sign) in TABLE.items():
        expected = sign if column == "v_z" else sign * direction
        assert (np.sign(motion.columns()[column][solved]) == expected).all(), column


def test_the_words_of_the_table_are_what_is_seen() -> None:
    """From the shapes and the track, not from the columns' signs."""
    motion, track = steady(ROBOT.groups()), steady_part(1)
    body, states = steady_states(ROBOT, 2 * np.pi * np.arange(12) / 12)
    tails = np.array([nodes_in_body(body, state) for state in states])
    assert tails[:, :, -1, 2].max() < -0.9  # behind the head
    clamp = -tails[:, 0, 0, 0] + 1j * tails[:, 0, 0, 1]  # from behind e_x is on the left, because e_y is up
    clockwise = -np.sign((clamp[0].conj() * clamp[1]).imag)
    path = np.diff(track["x_over_l"] + 1j * track["y_over_l"])
    ahead, left = velocity(track)
    seen = {
        "omega_t_bar": (clockwise * motion.omega_t[0], "turn clockwise", "turn counter-clockwise"),
        "omega_h_bar": (clockwise * motion.omega_h[0], "turns clockwise", "turns counter-clockwise"),
        "omega_yr_bar": ((path[:-1].conj() * path[1:]).imag.sum(), "left: counter-clockwise", "right"),
        "v_z": (ahead, "forward", "back"),
        "v_x": (left, "to the left", "to the right"),
    }
    for column, (value, positive, negative) in seen.items():
        assert f" {positive if value > 0 else negative}" in TABLE[column][0]


@pytest.mark.parametrize("direction", [1, -1])
def test_the_path_is_at_the_slip_angle_on_the_side_of_the_turn(direction: int) -> None:
    track, slip = steady_part(direction), float(steady(ROBOT.groups()).slip_angle[0])
    assert np.sign(np.diff(track["heading_rad"]).mean()) == direction
    ahead, left = velocity(track)
    assert math.atan2(left, ahead) == pytest.approx(direction * slip, abs=0.02)
    assert f"θ is {math.degrees(slip):.0f}°" in PAGE


@pytest.mark.parametrize("above", [True, False])
def test_the_picture_of_a_camera(above: bool) -> None:
    """Pixels of a camera above or below the tank, y downwards in its picture."""
    track, side = steady_part(1), -1 if above else 1
    picture = pd.DataFrame({"run": 1, "time_s": track["time_s"], "x_cm": 11 * track["x_over_l"]})
    picture["y_cm"] = side * 11 * track["y_over_l"]
    picture["heading_deg"] = side * np.degrees(track["heading_rad"])
    runs = pd.DataFrame({"run": [1], "N": [2], "l_cm": [11.0], "omega_rpm": [43.3]})
    measured = measure_tracks(picture, runs, y_down=above).table
    assert measured["omega_yr_rad_s"][0] > 0
    assert measured["theta_deg"][0] == pytest.approx(67.1, abs=0.5)
    with pytest.raises(sf.InputError, match="turn to the other side"):
        measure_tracks(picture, runs, y_down=not above)


def test_five_seconds_at_plus_one_turn_left_on_the_bench() -> None:
    """From rest with straight tails."""
    for robot in PRESETS.values():
        five = np.array([5 / robot.time_scale])
        track = replay(Schedule(robot.group_values(), 1, five, (0.0, 0.0, 0.0), robot.time_scale))
        assert (np.diff(track["heading_rad"]) > 0).all()
        assert (np.diff(track["y_over_l"]) > 0).all()
        if robot is ROBOT:
            turned, moved = track["heading_rad"].iloc[-1], 100 * robot.tail_length * track["y_over_l"].iloc[-1]
            assert f"turns by {math.degrees(turned):.0f}°, and its head moves {moved:.0f} cm" in PAGE
