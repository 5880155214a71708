"""Frames of a film with the time that the file states for each, decoded in a thread of their own.

Frame rates may vary: a frame's time is its time stamp, from the film's beginning. Converters to a constant rate
show a frame twice where the camera dropped one; such a copy differs from the frame before by far less than others
do, and is left out, since what it shows is older than its time stamp says.

An AVI has no time stamps: its frames are counted. Where a part of the file is damaged, later ones come too early,
and are refused.
"""

from __future__ import annotations

import math
import os
import re
import zlib
from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from camera.view import opencv
from common.errors import InputError

_AHEAD = 2  # decoded frames that wait
_COPY = 0.1  # of the usual difference of two frames in a row, the difference of a copy
_PART = re.compile(rb"[ -~]{4}")  # the name of a part of an AVI
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
        capture = self._open()
        if not capture.isOpened() or not capture.grab():
            raise InputError(f"{path} is no film that can be read; convert it: ffmpeg -i FILM film.mp4")
        self._number = 0  # of the next frame
        self.damaged = 0  # frames without a picture
        self.ended = False  # all has been read
        self._rate = float(capture.get(cv.CAP_PROP_FPS))
        stated = capture.get(cv.CAP_PROP_FRAME_COUNT)
        self._stated = stated > 0
        self.count = int(stated) if self._stated else self._readable()
        whole = _whole_frames(self.path)
        gap = whole < self.count - 1 and self._readable() < self.count - 1
        self._early = (whole - 0.5) / self._rate if gap else math.inf  # time from which frames come too early

    def samples(self, number: int, start: float = 0.0, end: float = math.inf) -> Iterator[Any]:
        """Yield different pictures at about equal distances from `start` to `end` [s]."""
        seeking = self._open()
        rate = self._rate if 0 < self._rate < math.inf else 0.0
        first, last = np.clip([start * rate, end * rate if rate else math.inf], 0, self.count - 1)
        at, seen = 0, set[int]()
        for index in np.linspace(first, last, number).astype(int).tolist():
            if self._stated:
                seeking.set(self._cv.CAP_PROP_POS_FRAMES, index)
            while not self._stated and at < index and seeking.grab():
                at += 1
            good, picture = seeking.read()
            at += 1
            if good and (known := zlib.crc32(picture)) not in seen:
                seen.add(known)
                yield picture

    def frames(self, start: float = 0.0, end: float = math.inf) -> Iterator[Frame]:
        """Yield the frames from `start` to `end` [s], once; copies are marked.

        Raises:
            InputError: the time stamps do not increase, or are too early from some frame on.
        """
        self._capture, differences = self._open(), list[float]()
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
                if frame.time_s > self._early:
                    raise InputError(
                        f"{self.path}: {self.stated(self._readable())}: an AVI has no time stamps, so times "
                        f"after the gap at {self._early:.3f} s are too early; track the part before it (--end), "
                        "or film again"
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

    def _open(self) -> Any:
        return self._cv.VideoCapture(self.path, self._cv.CAP_FFMPEG, [self._cv.CAP_PROP_N_THREADS, 2])

    @property
    def read(self) -> int:
        """The frames that have been read so far."""
        return self._number - self.damaged

    def stated(self, read: int) -> str:
        """Say how many frames the film states, and how many can be read."""
        return f"the film states {self.count} frames, {read} can be read"

    def _readable(self) -> int:
        """Count the frames that can be read."""
        capture = self._open()
        return sum(1 for _ in iter(capture.grab, False))

    def _next(self, start: float, end: float) -> Frame | None:
        """Decode the next frame from `start` to `end`; None: there is none."""
        while not self.ended and self._capture.grab():
            number, self._number = self._number, self._number + 1
            time = float(self._capture.get(self._cv.CAP_PROP_POS_MSEC)) / 1000
            if time > end:
                break
            if time >= start:
                good, picture = self._capture.retrieve()
                if good:
                    return Frame(number, time, picture)
                self.damaged += 1
        else:
            self.ended = True
        return None


def _whole_frames(path: str) -> float:
    """Count the pictures of an AVI before the first place where a part of it should begin, and none does.

    Returns:
        Their number; inf for other films, and where there is no such place.
    """
    frames = 0
    with open(path, "rb") as file:
        while _PART.match(head := file.read(8)):
            if head[:4] in (b"RIFF", b"LIST"):  # the parts of this one begin after the name of its kind
                file.seek(4, os.SEEK_CUR)
            elif file.tell() == len(head):
                return math.inf
            else:
                frames += head[2:4] in (b"dc", b"db")
                size = int.from_bytes(head[4:], "little")
                file.seek(size + size % 2, os.SEEK_CUR)
    return frames if head and frames else math.inf
