"""Frames of a film with the time that the file states for each, decoded in a thread of their own.

Frame rates may vary: a frame's time is its time stamp, from the film's beginning. Converters to a constant rate
show a frame twice where the camera dropped one; such a copy differs from the frame before by far less than others
do, and is left out, since what it shows is older than its time stamp says.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from camera.view import opencv
from sim.io.errors import InputError

_AHEAD = 4  # decoded frames that wait
_COPY = 0.1  # of the usual difference of two frames in a row, the difference of a copy
_USUAL = 30  # frames from which the usual difference is taken


class Frame(NamedTuple):
    """One picture of a film."""

    number: int  # in the file, from 0
    time_s: float  # from the film's beginning
    picture: Any  # (H, W, 3) uint8, blue, green, red
    doubled: bool = False  # a copy of the frame before


class Film:
    """A film file."""

    def __init__(self, path: str | Path) -> None:
        """Open a film.

        Raises:
            InputError: there is no such file, or no film that OpenCV reads.
        """
        cv = opencv()
        if not Path(path).is_file():
            raise InputError(f"{path}: no such file; check the path")
        self.path, self._cv = str(path), cv
        self._capture = cv.VideoCapture(self.path, cv.CAP_FFMPEG, [cv.CAP_PROP_N_THREADS, 2])
        if not self._capture.isOpened() or not self._capture.grab():
            raise InputError(f"{path} is no film that can be read; convert it: ffmpeg -i FILM film.mp4")
        self._number = 0  # of the next frame
        self.count = int(self._capture.get(cv.CAP_PROP_FRAME_COUNT))
        if self.count <= 0:  # the film does not state them
            self.count = 1
            while self._capture.grab():
                self.count += 1
        self._capture = cv.VideoCapture(self.path, cv.CAP_FFMPEG, [cv.CAP_PROP_N_THREADS, 2])

    def samples(self, number: int, start: float = 0.0, end: float = math.inf) -> Iterator[Any]:
        """Yield pictures at about equal distances from `start` to `end` [s]."""
        seeking = self._cv.VideoCapture(self.path, self._cv.CAP_FFMPEG)
        rate = float(seeking.get(self._cv.CAP_PROP_FPS))
        rate = rate if 0 < rate < math.inf else 0.0
        first, last = np.clip([start * rate, end * rate if rate else math.inf], 0, self.count - 1)
        for index in np.unique(np.linspace(first, last, number).astype(int)):
            seeking.set(self._cv.CAP_PROP_POS_FRAMES, int(index))
            good, picture = seeking.read()
            if good:
                yield picture

    def frames(self, start: float = 0.0, end: float = math.inf) -> Iterator[Frame]:
        """Yield the frames from `start` to `end` [s], once; copies are marked.

        Raises:
            InputError: the time stamps do not increase.
        """
        differences: list[float] = []
        before, time = None, -math.inf
        with ThreadPoolExecutor(1) as reader:
            waiting = deque(reader.submit(self._next, start, end) for _ in range(_AHEAD))
            while (frame := waiting.popleft().result()) is not None:
                waiting.append(reader.submit(self._next, start, end))
                if frame.time_s <= time:
                    raise InputError(
                        f"{self.path}: the time stamp of frame {frame.number} is not after the one before; write "
                        "the film again with a frame rate: ffmpeg -r 30 -i FILM film.mp4"
                    )
                time, coarse = frame.time_s, frame.picture[::4, ::4].astype(np.int16)
                doubled = False
                if before is not None:
                    difference = float(np.abs(coarse - before).mean())
                    doubled = bool(differences) and difference < _COPY * float(np.median(differences))
                    if not doubled:
                        differences = [*differences[1 - _USUAL :], difference]
                before = coarse
                yield frame._replace(doubled=doubled)

    def _next(self, start: float, end: float) -> Frame | None:
        """Decode the next frame from `start` to `end`; None: there is none."""
        while self._capture.grab():
            number, self._number = self._number, self._number + 1
            time = float(self._capture.get(self._cv.CAP_PROP_POS_MSEC)) / 1000
            if time > end:
                break
            if time >= start:
                good, picture = self._capture.retrieve()
                if good:
                    return Frame(number, time, picture)
        return None
