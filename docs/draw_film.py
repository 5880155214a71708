"""Draw the pictures of films: a frame and the check of docs/tutorial/film.md, and a robot that is steered live.

Usage: python docs/draw_film.py

Takes two minutes.
"""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np

import softflagella as sf
from camera.film import Film
from camera.tracks import track_film, write_check
from camera.view import read_setup
from tests.oracles.tank import Tank, circling

DOCS = Path(__file__).parent


def draw_film(folder: Path) -> None:
    """Draw a frame with a hand in it, and the check, of a film such as the tutorial draws."""
    tank = Tank(width=640, height=480, scale=0.4 / 640, shade=0.3)
    swum = circling(0.35, 0.06, math.radians(84), head=-4.7, tails=10.8, centre=(0.2, 0.15))
    film = tank.film(folder / "swim.mp4", swum, seconds=12, rate=12, hand=(100, 118))
    (folder / "view.toml").write_text(tank.view_toml())
    setup = read_setup(folder / "view.toml")
    _save(next(f.picture for f in Film(film).frames() if f.number == 104), "tutorial/film-frame.png")
    write_check(folder / "check.png", track_film(film, setup))
    _save(cv2.imread(str(folder / "check.png")), "tutorial/film-check.png")


def draw_live(folder: Path) -> None:
    """Draw a square (white), the declared path (blue), and the track (orange) of a robot that a tracker steers."""
    robot = sf.load_robot("paper-control")
    plan = sf.plan(sf.polygon(4, side=2.0), robot)
    track = sf.swim(plan, truth=robot, camera=sf.Camera(noise=(0.01, 0.01), every_s=0.2, delay_s=0.1)).to_frame()
    track = track[: int(0.8 * len(track))]
    tank, centre = Tank(width=640, height=480, scale=0.56 / 640, noise=0.0), np.array([0.28, 0.21])
    (folder / "view.toml").write_text(tank.view_toml())
    view = read_setup(folder / "view.toml").view
    middle = robot.tail_length * plan.reference[:, :2].mean(axis=0) - centre
    x, y, heading = track[["x_cm", "y_cm", "heading_deg"]].to_numpy()[-1] * [0.01, 0.01, math.pi / 180]
    picture = tank.frame(lambda t: (x - middle[0], y - middle[1], heading, 0.5, 1.0), 0.0)
    for line, colour in (
        (robot.tail_length * np.vstack([plan.drawn.points, plan.drawn.points[:1]]), (255, 255, 255)),
        (robot.tail_length * plan.reference[:, :2], (200, 90, 30)),
        (track[["x_cm", "y_cm"]].to_numpy() / 100, (0, 160, 255)),
    ):
        pixels = np.round(8 * view.to_picture(line - middle)).astype(np.int32)
        cv2.polylines(picture, [pixels], False, colour, 2, cv2.LINE_AA, 3)
    _save(picture, "live.png")


def _save(picture: Any, name: str) -> None:
    small = cv2.resize(picture, (480, 360), interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(DOCS / name), small, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(f"{(DOCS / name).stat().st_size // 1000} kB -> {DOCS / name}")


def main() -> None:
    with TemporaryDirectory() as folder:
        draw_film(Path(folder))
        draw_live(Path(folder))


if __name__ == "__main__":
    main()
