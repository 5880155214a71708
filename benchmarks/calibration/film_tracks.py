"""Films: processor time, peak memory and errors of `softflagella tracks` on one of 1080p.

Usage: python -m benchmarks film_tracks [SECONDS]     (default: 60)

Takes two minutes.
"""

from __future__ import annotations

import math
import resource
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.common import heading, interpreter_time, row
from camera.view import opencv

SIZE, RATE = (1920, 1080), 30.0  # pixels; frames per second
SCALE = 30.0  # pixels per cm
HEAD = 180, 96  # pixels, length and width
BAND, APART = 21, 132  # pixels, a band's width, distance of the bands
BANDS, TAG = '[[robots]]\nfront = "red"\nrear = "green"\n', "[[robots]]\ntag = 3\n"
VIEW = f"[scale]\npoints_px = [[100, 1000], [1000, 1000]]\nlength_cm = {900 / SCALE}\n"


def _sprite(tag: bool) -> Any:
    """Draw the head from above, its front to the right: two bands, or a tag whose upper edge is ahead."""
    cv2 = opencv()
    length, width = HEAD
    across = np.linspace(-1, 1, width + 1)[:, None, None]
    light = np.broadcast_to(0.55 + 0.45 * np.sqrt(1 - across**2), (width + 1, length + 1, 3))
    picture = 225 * light
    if tag:
        known = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        square = np.pad(cv2.aruco.generateImageMarker(known, 3, 72), 12, constant_values=255)
        picture[:96, 42:138] = np.rot90(square, -1)[..., None]
        return picture.astype(np.uint8)
    for place, colour in ((APART / 2, (40, 40, 205)), (-APART / 2, (60, 170, 60))):
        left = round(length / 2 + place - BAND / 2)
        picture[:, left : left + BAND] = (light * colour)[:, left : left + BAND]
    return picture.astype(np.uint8)


def _pose(time: float) -> tuple[float, float, float]:
    """Swim along a circle: pixel, and heading counter-clockwise."""
    angle = 0.5 + 0.2 * time
    return 960 + 350 * math.cos(angle), 540 - 350 * math.sin(angle), angle + 0.4


def _draw(path: Path, seconds: float, *, tag: bool) -> None:
    cv2: Any = opencv()
    sprite, rng, (width, height) = _sprite(tag), np.random.default_rng(0), SIZE
    middle = np.array(HEAD) / 2 - (0.5 if tag else 0)  # the bands' on a pixel, the tag's between pixels
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    floor = (150 + 12 * np.sin(u / 37) * np.cos(v / 29))[..., None] * np.array([1.0, 1.0, 0.97])
    noisy = [np.clip(floor + rng.normal(scale=3, size=floor.shape), 0, 255).astype(np.uint8) for _ in range(12)]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), RATE, SIZE)
    for index in range(round(seconds * RATE)):
        x, y, angle = _pose(index / RATE)
        turn = cv2.getRotationMatrix2D(middle, math.degrees(angle), 1)
        turn[:, 2] += np.array([x, y]) - middle
        frame = noisy[index % len(noisy)].copy()
        cv2.warpAffine(sprite, turn, SIZE, frame, cv2.INTER_LINEAR, cv2.BORDER_TRANSPARENT)
        writer.write(cv2.GaussianBlur(frame, (0, 0), 0.8))
    writer.release()


def main(seconds: str = "60") -> None:
    print(heading("markers", "frames", "lost", "processor time [s]", "of 10 minutes", "peak memory [MB]",
                  "error [mm]", "error [°]"))  # fmt: skip
    for name, robots in (("bands", BANDS), ("tag", TAG)):
        with TemporaryDirectory() as folder:
            film, view, out = (Path(folder) / file for file in ("film.mp4", "view.toml", "tracks.csv"))
            _draw(film, float(seconds), tag=robots == TAG)
            view.write_text(VIEW + robots)
            words = f"tracks {film} --robot paper-control --view {view} --out {out}"
            time, _ = interpreter_time("-m", "softflagella", *words.split())
            track, frames = pd.read_csv(out), round(float(seconds) * RATE)
        truth = np.array([_pose(t) for t in track["time_s"]])
        off = np.hypot(track["x_cm"] - (truth[:, 0] - 100) / SCALE, track["y_cm"] - (1000 - truth[:, 1]) / SCALE)
        turned = (track["heading_deg"] - np.degrees(truth[:, 2]) + 180) % 360 - 180
        memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1000  # of the largest process so far
        print(row(name, frames, frames - len(track), f"{time:.0f}", f"{600 / float(seconds) * time:.0f}",
                  f"{memory:.0f}", f"{10 * np.sqrt((off**2).mean()):.2f}",
                  f"{np.sqrt((turned**2).mean()):.2f}"))  # fmt: skip
