"""Films: what is seen is what is simulated, and a film is written completely or not at all."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from scipy.interpolate import interp1d

from sim.__main__ import main
from sim.io.errors import InputError, run_command
from sim.model.presets import PRESETS
from sim.model.schedule import Schedule
from sim.motion.film import Film, _draw_scale_bar, fitting_speed, write_film
from sim.motion.replay import replay
from sim.motion.shapes import nodes_in_body, scheduled_shapes, steady_states

ROBOT = PRESETS["paper-triangle"]
LINE = [[0.0, 0.0], [1.0, 0.5]]
CONTENT = {"raw_path": LINE, "reference": LINE, "closed": False}


def schedule(*dwells: float) -> Schedule:
    start = (0.3, -0.2, 0.7)
    return Schedule(ROBOT.group_values(), -1, np.array(dwells), start, ROBOT.time_scale, ROBOT.tail_length)


def test_poses_and_directions_are_those_of_a_replay() -> None:
    wanted = schedule(1.1, 0.8, 1.3)
    track = replay(wanted)
    frames = scheduled_shapes(wanted, np.linspace(0, 3.2, 41))
    for k, name in enumerate(("x_over_l", "y_over_l", "heading_rad")):
        assert np.abs(frames.heads[:, k] - np.interp(frames.times, track.time_bar, track[name])).max() < 3e-3
        if k < 2:
            assert np.abs(frames.track[-1, 1 + k] - track[name].iloc[-1]) < 1e-3
    assert frames.directions.tolist() == [-1] * 14 + [1] * 10 + [-1] * 17
    assert scheduled_shapes(wanted, np.cumsum(wanted.dwells)).directions.tolist() == [1, -1, -1]  # after the flips


def test_no_frame_is_lost_where_rounded_dwells_end() -> None:
    for seed in (1, 8):  # sums of dwells that depend on the order
        wanted = schedule(*np.random.default_rng(seed).uniform(0.05, 0.1, 20))
        times = Film(speed=wanted.time_scale).times(wanted)
        assert len(scheduled_shapes(wanted, times).heads) == len(times)


def test_tails_are_those_of_a_steadily_swimming_robot() -> None:
    body, states = steady_states(ROBOT, 2 * np.pi * np.arange(128) / 128)
    tails = np.array([nodes_in_body(body, state) for state in states])
    swims = Schedule(ROBOT.group_values(), 1, np.array([12.0]), (0.0, 0.0, 0.0), 1.0)
    frames = scheduled_shapes(swims, np.array([11.5, 11.9]))
    ahead = ROBOT.head_length / ROBOT.tail_length / 2
    shapes = resampled(tails[..., [2, 0]] - [ahead, 0])
    for pose, seen in zip(frames.heads, frames.nodes[..., :2], strict=True):
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        body = (seen - pose[:2]) @ np.array([[cos, -sin], [sin, cos]])  # forward, left
        assert np.abs(shapes - resampled(body)).max((1, 2, 3)).min() < 0.03


def resampled(tails: np.ndarray) -> np.ndarray:
    """Return tails (..., n, 2) at thirteen places."""
    return np.asarray(interp1d(np.linspace(0, 1, tails.shape[-2]), tails, axis=-2)(np.linspace(0, 1, 13)))


def test_a_film_has_a_picture_for_each_of_its_times(tmp_path: Path) -> None:
    wanted = schedule(1.0, 1.0)
    film = Film(speed=2.0 * ROBOT.time_scale, width=200)
    count = write_film(CONTENT, wanted, tmp_path / "swim.gif", film)
    with Image.open(tmp_path / "swim.gif") as image:
        assert count == 13
        assert image.size[0] == 200
        first = np.asarray(image.convert("RGB")).astype(int)
        image.seek(image.n_frames - 1)
        assert np.abs(np.asarray(image.convert("RGB")).astype(int) - first).max() > 100
    write_film(CONTENT, wanted, tmp_path / "swim.webp", film)
    assert (tmp_path / "swim.webp").read_bytes()[8:12] == b"WEBP"


def test_the_scale_bar_is_as_long_as_it_says_and_the_speed_is_a_round_number() -> None:
    for width, words in ((60.0, "10 cm"), (24.0, "2 cm"), (3.0, "0.5 cm")):
        axes = Figure().add_subplot()
        axes.set_xlim(-5.0, width - 5.0)
        _draw_scale_bar(axes, width, "cm")
        low, high = axes.lines[0].get_xdata()
        assert axes.texts[0].get_text() == words == f"{high - low:g} cm"
        assert low + high == pytest.approx(sum(axes.get_xlim()))
    assert fitting_speed(schedule(60.0)) in (1, 2, 5, 10, 20, 50, 100)
    assert fitting_speed(schedule(0.5)) == 1.0


def test_a_film_that_cannot_be_written_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    wanted, film = schedule(1.0), Film(speed=1.0)
    with pytest.raises(InputError, match=r"ends in \.gif, \.webp, \.mp4"):
        write_film(CONTENT, wanted, tmp_path / "swim.avi", film)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(InputError, match=r"needs ffmpeg.*write a \.gif"):
        write_film(CONTENT, wanted, tmp_path / "swim.mp4", film)
    with pytest.raises(InputError, match="pictures; give"):
        write_film(CONTENT, schedule(2000.0), tmp_path / "swim.gif", film)
    with pytest.raises(InputError, match="number above 0"):
        write_film(CONTENT, wanted, tmp_path / "swim.gif", Film(speed=-1.0))
    assert run_command(main, ["film", "plan.json", "--out", str(tmp_path / "no.gif"), "--width", "10"]) == 2
    assert capsys.readouterr().err == "error: --width 10; give 100 to 2000 pixels\n"
    assert list(tmp_path.iterdir()) == []
