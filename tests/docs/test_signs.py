"""docs/reference/signs.md and the simulator agree: the rows of its table, frames, slip angle, camera, picture."""

from __future__ import annotations

import math
import re
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import softflagella as sf
from calibration.swimmer.camera_tracks import measure_tracks
from planner.files.plan_files import controller_header
from planner.files.tracker_header import DIRECTIONS, tracker_header
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.model.schedule import Schedule
from sim.motion.replay import replay
from sim.motion.robot_views import from_behind, scene
from sim.motion.shapes import tails_over_a_revolution
from sim.motion.steady import steady
from surrogate.input_ranges import BOUNDS
from tests.docs.pages import DOCS, module_of_docs
from tests.sim.robots import CONTROL_VALUES, control

PAGE = (DOCS / "reference" / "signs.md").read_text()
ROBOT = PRESETS["paper-control"]


def table() -> dict[str, tuple[str, int]]:
    """Return what the page says about the motor at +1: column -> words, sign."""
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in PAGE.splitlines() if line[:1] == "|"]
    return {column.strip("`"): (words, {"+": 1, "−": -1}[sign]) for words, column, sign in rows[2:]}


@cache
def swum(direction: int) -> pd.DataFrame:
    """Simulate two thirds of a circle, and return the steady part."""
    track = replay([Schedule(CONTROL_VALUES, direction, np.array([90.0]), (0.3, -0.2, 0.4), 2.0)])[0]
    return track[track["time_bar"] > 6].reset_index(drop=True)


def velocity(track: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean velocity along and to the left of the axis, by windows of the track."""
    x, y, heading = (track[c].to_numpy() for c in ("x_over_l", "y_over_l", "heading_rad"))
    middle = (heading[1:] + heading[:-1]) / 2
    dx, dy = np.diff(x), np.diff(y)
    return np.cos(middle) * dx + np.sin(middle) * dy, -np.sin(middle) * dx + np.cos(middle) * dy


def clamp_sense() -> float:
    """Return the turning of a clamp in a picture from behind (right, up) with the disc's phase: + clockwise."""
    _, tails = tails_over_a_revolution(ROBOT, 12)
    right, up = -tails[:, 0, 0, 0], tails[:, 0, 0, 1]  # e_x is on the left, because e_y is up and e_z points away
    return -float(np.sign(right[0] * up[1] - right[1] * up[0]))


def test_the_axes_of_the_body_are_right_handed_with_the_tails_behind() -> None:
    left, up, forward = np.eye(3)
    assert np.cross(left, up) @ forward == 1
    _, tails = tails_over_a_revolution(ROBOT, 4)
    assert tails[:, :, -1, 2].max() < -0.9


@pytest.mark.parametrize("column", table())
@pytest.mark.parametrize("direction", [1, -1])
def test_the_table_holds_in_the_simulator(column: str, direction: int) -> None:
    """Random robots of the domain, two to five tails."""
    rng = np.random.default_rng(7)
    size = 24
    values = {name: np.exp(rng.uniform(np.log(low), np.log(high), size)) for name, (low, high) in BOUNDS.items()}
    _, sign = table()[column]
    expected = sign if column == "v_z" else sign * direction
    for tails in (2, 3, 5):
        columns = {**values, "omega_bar": direction * values["omega_bar"], "N": np.full(size, tails)}
        motion = steady(Groups.from_columns(columns))
        solved = motion.converged & ~motion.failed
        assert solved.sum() > size // 2
        assert (np.sign(motion.columns()[column][solved]) == expected).all()


def test_the_words_of_the_table_are_what_is_seen() -> None:
    """From the shapes and the track, not from the columns' signs."""
    motion = steady(ROBOT.groups())
    clockwise = {1.0: "clockwise", -1.0: "counter-clockwise"}
    track = swum(1)
    ahead, left = velocity(track)
    cross = np.diff(track["x_over_l"])[:-1] * np.diff(track["y_over_l"], 2)
    cross -= np.diff(track["y_over_l"])[:-1] * np.diff(track["x_over_l"], 2)
    seen = {
        "omega_t_bar": clockwise[clamp_sense() * np.sign(motion.omega_t[0])],
        "omega_h_bar": clockwise[clamp_sense() * np.sign(motion.omega_h[0])],
        "omega_yr_bar": "left: counter-clockwise"
        if cross.sum() > 0 and np.ptp(track["heading_rad"]) > 1
        else "right",
        "v_z": "forward" if ahead.mean() > 0 else "back",
        "v_x": "to the left" if left.mean() > 0 else "to the right",
    }
    for column, (words, _) in table().items():
        assert f" {seen[column]}" in words


def test_the_fluid_pushes_the_head_to_the_left_at_plus_one() -> None:
    """The lower side moves to the right; without the side force the robot does not turn."""
    motion = steady(ROBOT.groups())
    spin, down = np.array([0, 0, motion.omega_h[0]]), np.array([0, -1.0, 0])
    assert np.cross(spin, down)[0] < 0  # e_x is to the left
    assert abs(steady(control(C_yr=0.0)).omega_yr[0]) < 1e-9
    assert steady(control(C_yr=-2.0)).omega_yr[0] < 0


@pytest.mark.parametrize("direction", [1, -1])
def test_the_path_is_at_the_slip_angle_on_the_side_of_the_turn(direction: int) -> None:
    track = swum(direction)
    turned = np.diff(track["heading_rad"]).mean()
    assert np.sign(turned) == direction
    ahead, left = (part.mean() for part in velocity(track))
    slip = float(steady(ROBOT.groups()).slip_angle[0])
    assert math.atan2(left, ahead) == pytest.approx(direction * slip, abs=0.02)
    assert f"θ is {math.degrees(slip):.0f}°" in PAGE


def test_over_many_flips_the_robot_moves_along_its_axis() -> None:
    track = replay([Schedule(CONTROL_VALUES, 1, np.array([1.0, *[2.0] * 60]), (0.0, 0.0, 0.0), 2.0)])[0]
    middle = track["heading_rad"].iloc[len(track) // 4 :].mean()
    moved = track[["x_over_l", "y_over_l"]].iloc[-1] - track[["x_over_l", "y_over_l"]].iloc[len(track) // 4]
    assert math.atan2(moved.iloc[1], moved.iloc[0]) == pytest.approx(middle, abs=0.1)


@pytest.mark.parametrize("above", [True, False])
def test_the_picture_of_a_camera(above: bool) -> None:
    """Pixels of a camera above or below the tank, y downwards in its picture."""
    track = swum(1)
    lab = pd.DataFrame({"time_s": track["time_s"], "x_cm": 11 * track["x_over_l"], "y_cm": 11 * track["y_over_l"]})
    samples = lab.assign(run=1, heading_deg=np.degrees(track["heading_rad"]))
    side = -1 if above else 1
    picture = samples.assign(y_cm=side * samples["y_cm"], heading_deg=side * samples["heading_deg"])
    runs = pd.DataFrame({"run": [1], "N": [2], "l_cm": [11.0], "omega_rpm": [43.3]})
    measured = measure_tracks(picture, runs, y_down=above).table
    assert measured["omega_yr_rad_s"][0] > 0
    assert measured["theta_deg"][0] == pytest.approx(67.1, abs=0.5)
    with pytest.raises(sf.InputError, match="turn to the other side"):
        measure_tracks(picture, runs, y_down=not above)


def test_the_c_headers_say_the_same() -> None:
    """Their comment has the senses of the table, and +1 is the direction in which the simulator turns left."""
    said, words = " ".join(DIRECTIONS.replace("*", "").split()), table()
    assert "Direction +1: the motor turns the tails clockwise relative to the head, seen from behind." in said
    assert words["omega_t_bar"] == ("the tails turn clockwise, seen from behind", 1)
    assert "The robot then turns left, seen from above." in said
    assert words["omega_yr_bar"] == ("the robot turns left: counter-clockwise, seen from above", 1)
    result = sf.plan(sf.circle(2.0), ROBOT)
    for header in (controller_header(result, "test"), tracker_header(result, "test")):
        assert DIRECTIONS in header
    turned = np.diff(result.poses[:, 2])
    assert (np.sign(turned) == result.first_direction * (-1) ** np.arange(len(turned))).all()


def test_five_seconds_at_plus_one_turn_left_on_the_bench() -> None:
    """From rest with straight tails."""
    for robot in PRESETS.values():
        five = np.array([5 / robot.time_scale])
        track = replay([Schedule(robot.group_values(), 1, five, (0.0, 0.0, 0.0), robot.time_scale)])[0]
        assert (np.diff(track["heading_rad"]) > 0).all()
        assert (np.diff(track["y_over_l"]) > 0).all()
        if robot is ROBOT:
            turned, moved = track["heading_rad"].iloc[-1], 100 * robot.tail_length * track["y_over_l"].iloc[-1]
            assert f"turns by {math.degrees(turned):.0f}°, and its head moves {moved:.0f} cm" in PAGE


def said(figures: dict[str, Figure]) -> set[str]:
    """Return the words of the pictures."""
    return {text.get_text() for figure in figures.values() for axes in figure.axes for text in axes.texts}


def test_the_picture_shows_the_simulated_senses() -> None:
    """Its words and arrows follow from the simulation: of a robot with C_yr < 0 it draws a right turn."""
    drawing = module_of_docs("draw_signs")
    shown = scene(ROBOT)
    moved = shown.at(1.0)
    assert moved[2] > shown.at(0.0)[2]
    right, up = (from_behind(np.array(angle), 1.0) for angle in (math.pi, math.pi / 2))
    assert right == pytest.approx([1, 0])
    assert up == pytest.approx([0, 1])
    words = said(drawing.draw(shown))
    assert {"motor at +1:\nit turns left", "tails: clockwise", "head: counter-clockwise"} <= words
    mirrored = shown._replace(twist=shown.twist * [1, -1, -1], spins=(-shown.spins[0], -shown.spins[1]))
    words = said(drawing.draw(mirrored))
    assert {"motor at +1:\nit turns right", "tails: counter-clockwise", "head: clockwise"} <= words


def test_the_pictures_are_what_is_drawn(tmp_path: Path) -> None:
    module_of_docs("draw_signs").write(tmp_path)
    number = re.compile(r"-?\d+\.\d+")
    clip = re.compile(r"\bp[0-9a-f]{10}\b")  # the name of a clip path: a hash of its corners, to the last digit
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {path.name for path in DOCS.glob("signs*.svg")}
    for name in names:
        assert f"](../{name})" in PAGE
        kept, drawn = (clip.sub("clip", (folder / name).read_text()) for folder in (DOCS, tmp_path))
        assert number.sub("#", kept) == number.sub("#", drawn)
        assert [float(n) for n in number.findall(kept)] == pytest.approx(
            [float(n) for n in number.findall(drawn)], abs=0.01
        )


def test_each_picture_can_be_read_on_a_narrow_screen() -> None:
    """At 340 px, the width of the text on a screen of 390 px, letters have 10 px or more; nothing sticks out."""
    for name, figure in module_of_docs("draw_signs").draw(scene(ROBOT)).items():
        figure.canvas = FigureCanvasAgg(figure)
        figure.canvas.draw()
        points_wide = 72 * figure.get_figwidth()
        texts = [*figure.axes[0].texts, figure.axes[0].title]
        for text in texts:
            assert text.get_fontsize() * 340 / points_wide >= 10, (name, text.get_text())
            box = text.get_window_extent()
            assert 0 <= box.x0 <= box.x1 <= figure.bbox.width, (name, text.get_text())
