"""Films of schedules: a picture for each time, to scale, or nothing at all."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from common.errors import InputError, run_command
from sim.__main__ import main
from sim.motion.shapes import scheduled_shapes
from sim.pictures.film import FilmSettings, _draw_scale_bar, fitting_speed, write_film
from tests.sim.motion.test_shapes import ROBOT, schedule

LINE = [[0.0, 0.0], [1.0, 0.5]]
CONTENT = {"raw_path": LINE, "reference": LINE, "closed": False}


def test_no_frame_is_lost_where_rounded_dwells_end() -> None:
    for seed in (1, 8):  # sums of dwells that depend on the order
        wanted = schedule(*np.random.default_rng(seed).uniform(0.05, 0.1, 20))
        times = FilmSettings(speed=wanted.time_scale).times(wanted)
        assert len(scheduled_shapes(wanted, times).heads) == len(times)


def test_a_film_has_a_picture_for_each_of_its_times(tmp_path: Path) -> None:
    wanted = schedule(1.0, 1.0)
    film = FilmSettings(speed=2.0 * ROBOT.time_scale, width=200)
    count = write_film(CONTENT, wanted, tmp_path / "swim.gif", film)
    with Image.open(tmp_path / "swim.gif") as image:
        assert count == 13
        assert image.size[0] == 200
        assert 60 <= image.size[1] <= 300
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
    wanted, film = schedule(1.0), FilmSettings(speed=1.0)
    with pytest.raises(InputError, match=r"ends in \.gif, \.webp, \.mp4"):
        write_film(CONTENT, wanted, tmp_path / "swim.avi", film)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(InputError, match=r"needs ffmpeg.*write a \.gif"):
        write_film(CONTENT, wanted, tmp_path / "swim.mp4", film)
    with pytest.raises(InputError, match="pictures; give"):
        write_film(CONTENT, schedule(2000.0), tmp_path / "swim.gif", film)
    with pytest.raises(InputError, match="number above 0"):
        write_film(CONTENT, wanted, tmp_path / "swim.gif", FilmSettings(speed=-1.0))
    assert run_command(main, ["film", "plan.json", "--out", str(tmp_path / "no.gif"), "--width", "10"]) == 2
    assert capsys.readouterr().err == "error: --width 10; give 100 to 2000 pixels\n"
    assert list(tmp_path.iterdir()) == []
