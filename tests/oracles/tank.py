"""What a camera above a tank sees of a marked robot: pictures and films, drawn from known poses and spins.

Every pixel is traced back through lens and perspective to a place in the tank, and coloured by what lies there. So
the true pose is known without the code that is tested.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from camera.view import opencv
from common.arrays import Floats

RADIUS, LENGTH, TAIL = 0.016, 0.06, 0.11  # m, of the head and the tails
BAND, APART = 0.007, 0.044  # m, width of a band, distance of the bands
PAINT = {"red": (40, 40, 205), "green": (60, 170, 60), "blue": (200, 90, 30), "yellow": (40, 205, 215)}  # BGR
COARSE = 8  # samples, each way, between those that are asked whether a robot is near
Motion = Callable[[float], tuple[float, float, float, float, float]]  # t -> x, y [m], ψ, φ_head, φ_tails [rad]


def circling(
    rate: float = 0.3, radius: float = 0.07, slip: float = 1.17, head: float = -3.0, tails: float = 4.0,
    centre: tuple[float, float] = (0.16, 0.12), start: float = 0.5,
) -> Motion:  # fmt: skip
    """Swim along a circle at constant spins; spins are positive clockwise, seen from behind."""

    def motion(t: float) -> tuple[float, float, float, float, float]:
        angle = start + rate * t
        heading = angle + np.sign(rate) * (np.pi / 2 - slip)
        place = centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)
        return (*place, heading, 0.3 + head * t, 1.0 + tails * t)

    return motion


@dataclass
class Tank:
    """A camera, the light, and the marks of a robot; the tank's frame has its origin in the lower left corner."""

    width: int = 480
    height: int = 360
    scale: float = 0.32 / 480  # m per pixel in the middle
    tilt: float = 0.0  # share by which lengths shrink from the lower to the upper edge
    distortion: float = 0.0  # k1 of the lens, focal length 1.2 widths
    blur: float = 0.8  # pixels
    noise: float = 3.0
    glare: float = 0.0  # brightness of a stripe of light on the head
    shade: float = 0.0  # share by which the light falls from left to right
    hand: float = -1.0  # where a hand reaches into the picture, share of its width; below 0: none
    readout: float = 0.0  # s, rolling shutter
    mirrored: bool = False
    upside_down: bool = False
    clutter: bool = False  # a red and a green thing that lie in the tank
    colours: tuple[str, ...] = ("red", "green", "blue", "yellow")  # front, rear, head, tail; "" for none
    fine: int = 2  # samples a pixel, each way
    seed: int = 0
    _rng: Any = field(init=False)

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(self.seed)
        u, v = np.meshgrid(
            *((np.arange(n * self.fine) + 0.5) / self.fine - 0.5 for n in (self.width, self.height))
        )
        self._x, self._y = (places.astype(np.float32) for places in self.places(np.stack([u, v], -1)))
        self._row = v / self.height
        light = 1 - self.shade * u / self.width
        floor = 150 + 12 * np.sin(u / 37) * np.cos(v / 29)
        self._floor = ((floor * light)[..., None] * [1.0, 1.0, 0.97]).astype(np.float32)
        self._light = light[..., None].astype(np.float32)
        if self.clutter:
            for place, paint in (((0.03, 0.03), "red"), ((0.05, 0.2), "green")):
                near = np.hypot(self._x - place[0], self._y - place[1]) < 0.012
                self._floor[near] = PAINT[paint]

    @property
    def focal(self) -> float:
        return 1.2 * self.width

    def rays(self, pixels: Floats) -> Floats:
        """Trace pixels (..., 2) back through the lens, to points one focal length ahead."""
        seen = (pixels - np.array([(self.width - 1) / 2, (self.height - 1) / 2])) / self.focal
        ray = seen
        for _ in range(12 if self.distortion else 0):
            ray = seen / (1 + self.distortion * (ray**2).sum(-1, keepdims=True))
        return ray

    def places(self, pixels: Floats) -> tuple[Floats, Floats]:
        """Trace pixels (..., 2) back to places in the tank."""
        plane = self.rays(pixels) * self.focal * self.scale
        depth = 1 + self.tilt * plane[..., 1] / (self.height * self.scale)  # nearer at the lower edge
        x = plane[..., 0] / depth + self.width * self.scale / 2
        y = -plane[..., 1] / depth + self.height * self.scale / 2
        return x, y

    def pixel(self, x: float, y: float) -> Floats:
        """Find the pixel at which a place is seen."""
        from scipy.optimize import least_squares

        middle = np.array([self.width / 2, self.height / 2])

        def off(pixel: Floats) -> Floats:
            return 1e3 * (np.array(self.places(pixel)) - [x, y])

        return np.asarray(least_squares(off, middle, xtol=1e-12).x)

    def view_toml(self, *, robots: str = "", origin: tuple[float, float] = (0.0, 0.0)) -> str:
        """Write the view.toml of this tank: four points and their places, seen from an origin, and the lens."""
        corners = ((0.05, 0.06), (0.25, 0.06), (0.25, 0.18), (0.05, 0.18))
        pixels = [[round(float(c), 2) for c in self.pixel(*corner)] for corner in corners]
        places = [
            [round(float(100 * (c - o)), 6) for c, o in zip(corner, origin, strict=True)] for corner in corners
        ]
        scale = f"points_px = {pixels}\npoints_cm = {places}\n"
        lens = (
            f"[lens]\nfocal_px = [{self.focal}, {self.focal}]\ncentre_px = [{(self.width - 1) / 2}, "
            f"{(self.height - 1) / 2}]\ndistortion = [{self.distortion}, 0, 0, 0, 0]\n"
        )
        named = dict(zip(("front", "rear", "head", "tail"), self.colours, strict=False))
        marks = "[[robots]]\n" + "".join(f'{key} = "{colour}"\n' for key, colour in named.items() if colour)
        return f"[scale]\n{scale}{lens if self.distortion else ''}{robots or marks}"

    def frame(self, motion: Motion, time: float) -> Any:
        """Draw the picture that begins at a time."""
        return self.drawn([(motion, self.colours)], time)

    def drawn(self, robots: Sequence[tuple[Motion, Sequence[str]]], time: float) -> Any:
        """Draw the picture of several robots with their colours."""
        cv2 = opencv()
        picture: Any = self._floor.copy()
        for motion, colours in robots:
            self._draw(picture, motion, colours, time)
        if self.hand >= 0:
            u = np.linspace(0, 1, picture.shape[1])[None]
            v = np.linspace(0, 1, picture.shape[0])[:, None]
            reach = ((u - self.hand) / 0.12) ** 2 + ((v - 1) / 0.75) ** 2 < 1
            picture[reach] = (118, 142, 196)
        picture = cv2.resize(picture, (self.width, self.height), interpolation=cv2.INTER_AREA)
        if self.blur:
            picture = cv2.GaussianBlur(picture, (0, 0), self.blur)
        picture = picture + self.noise * self._rng.standard_normal(picture.shape, np.float32)
        picture = np.clip(np.round(picture), 0, 255).astype(np.uint8)
        up, left = (-1 if turned else 1 for turned in (self.upside_down, self.upside_down != self.mirrored))
        return picture[::up, ::left].copy()

    def _draw(self, picture: Any, motion: Motion, colours: Sequence[str], time: float) -> None:
        now, later = np.array(motion(time)), np.array(motion(time + self.readout))
        axis, half = np.array([np.cos(now[2]), np.sin(now[2])]), (LENGTH + TAIL) / 2
        middle = (now + later)[:2] / 2 - TAIL / 2 * axis
        extent = np.abs(axis) * half + np.abs(axis[::-1]) * RADIUS + np.abs(later - now)[:2] + 0.006
        extent += COARSE * self.scale / self.fine
        x, y = self._x[::COARSE, ::COARSE], self._y[::COARSE, ::COARSE]
        near = (np.abs(x - middle[0]) < extent[0]) & (np.abs(y - middle[1]) < extent[1])
        rows, columns = (COARSE * np.flatnonzero(near.any(axis=along)) for along in (1, 0))
        if not len(rows):
            return
        box = tuple(slice(max(0, each[0] - COARSE), each[-1] + COARSE + 1) for each in (rows, columns))
        picture, light = picture[box], self._light[box]
        x, y, heading, head, tails = (
            a + (b - a) * self._row[box] if self.readout else float(a) for a, b in zip(now, later, strict=True)
        )
        dx, dy = self._x[box] - x, self._y[box] - y
        along = dx * np.cos(heading) + dy * np.sin(heading)
        left = dy * np.cos(heading) - dx * np.sin(heading)
        paint = [np.array(PAINT[c], np.float32) if c else None for c in (*colours, "", "")]
        for k in range(2):  # tails turn clockwise seen from behind: from the top to the right
            side = -RADIUS * np.sin(tails + k * np.pi)
            reach = (along < -LENGTH / 2) & (along > -LENGTH / 2 - TAIL)
            picture[reach & (np.abs(left - side) < 0.0032)] = (70, 70, 75)
            if k == 0 and paint[3] is not None:
                size = 0.006 * (0.8 + 0.2 * np.cos(tails))  # deeper in the fluid it is seen less well
                dot = np.hypot(along + LENGTH / 2 + 0.03, left - side) < size
                picture[dot] = (paint[3] * light)[dot]
        body = (np.abs(along) < LENGTH / 2) & (np.abs(left) < RADIUS)
        round_ = np.sqrt(np.clip(1 - (left / RADIUS) ** 2, 0, 1))[..., None]
        lit = light * (0.55 + 0.45 * round_)
        picture[body] = 225 * lit[body]
        for paint_, place in ((paint[0], APART / 2), (paint[1], -APART / 2)):
            if paint_ is not None:
                band = body & (np.abs(along - place) < BAND / 2)
                picture[band] = (paint_ * lit)[band]
        if paint[2] is not None:
            azimuth = np.arcsin(np.clip(left / RADIUS, -1, 1))  # from the top to the left
            apart = (azimuth + head + np.pi) % (2 * np.pi) - np.pi
            dot = body & (np.hypot(apart * RADIUS, along) < 0.006)
            picture[dot] = (paint[2] * lit)[dot]
        if self.glare:
            stripe = np.exp(-(((left - 0.35 * RADIUS) / (0.12 * RADIUS)) ** 2))[..., None] * self.glare
            picture[body] = np.minimum(picture + stripe, 255)[body]

    def film(
        self, path: Path, motion: Motion | Sequence[tuple[Motion, Sequence[str]]], seconds: float,
        rate: float = 15.0,
        *, dropped: Sequence[int] = (), doubled: Sequence[int] = (), hand: tuple[int, int] = (0, 0),
        codec: str = "mp4v",
    ) -> Path:  # fmt: skip
        """Write a film; frames may be dropped, or shown twice in the place of their followers."""
        cv2 = opencv()
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), rate, (self.width, self.height))
        robots = [(motion, self.colours)] if callable(motion) else motion
        last = None
        for index in range(round(seconds * rate)):
            if index in dropped:
                continue
            self.hand = (index - hand[0]) / (hand[1] - hand[0]) if hand[0] <= index < hand[1] else -1.0
            last = last if index in doubled and last is not None else self.drawn(robots, index / rate)
            writer.write(last)
        writer.release()
        return path


def board(tank: Tank, pose: Sequence[float], squares: tuple[int, int] = (10, 7)) -> Any:
    """Draw a chessboard in front of the camera of a tank.

    Args:
        tank: with the lens, the size of the picture and the noise.
        pose: turns about the picture's horizontal and vertical axis [rad]; place of the board's middle to the
            right and down, and in front of the camera [squares].
        squares: of the board.
    """
    from scipy.spatial.transform import Rotation

    cv2, fine = opencv(), 3  # samples a pixel, each way
    grid = np.meshgrid(*((np.arange(n * fine) + 0.5) / fine - 0.5 for n in (tank.width, tank.height)))
    rays = np.concatenate([tank.rays(np.stack(grid, -1)), np.ones((*grid[0].shape, 1))], -1)
    turn, middle = Rotation.from_euler("xy", pose[:2]).as_matrix(), np.array(pose[2:])
    normal = turn[:, 2]
    points = (rays * (middle @ normal / (rays @ normal))[..., None] - middle) @ turn[:, :2] + np.array(squares) / 2
    on = ((points >= 0) & (points < squares)).all(-1)
    dark = on & (np.floor(points).sum(-1) % 2 == 0)
    picture = cv2.resize(np.where(dark, 40.0, 220.0), (tank.width, tank.height), interpolation=cv2.INTER_AREA)
    picture += np.random.default_rng(0).normal(scale=tank.noise, size=picture.shape)
    return np.clip(np.round(picture), 0, 255).astype(np.uint8)
