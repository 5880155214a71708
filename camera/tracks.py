"""Tracks of the robots in a film, as tables that `softflagella check` and `calibration tracks` read.

A row is a frame in which the robot was seen: run, frame, time_s, x_cm, y_cm, heading_deg, their standard errors
x_error_cm (of y, too) and heading_error_deg, and for a dot on the head or on a tail head_left_cm or tail_left_cm
(left of the axis, empty out of sight) and head_area_mm2 or tail_area_mm2. Frames without a pose are counted by
their reason.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from camera.circle import LEAST_TURN, fit_track
from camera.detector import Detector, Lost, Pose, wrong_distance
from camera.film import Film
from camera.gaps import unwrapped
from camera.learning import learn
from camera.spin import Spin, aliasing, fit_spin
from camera.view import DOTS, Markers, Setup, View, opencv
from common.errors import InputError, naming

if TYPE_CHECKING:
    import pandas as pd

_SHOWN = 10  # poses in the picture of a track
_UNCOUNTED = 0.01  # of the frames of a film, by which the number that it states may differ from what is read
_GAP = 1.5  # usual times between two frames, at which frames are missing
_CERTAIN = 5.0  # standard errors by which a robot that moves tail first has moved
_EXCHANGE = "exchange the colours of front and rear in view.toml (turn a tag by 180 degrees)"


class FilmTracks(NamedTuple):
    """The tracks of a film."""

    tables: dict[str, pd.DataFrame]  # robot -> its track
    notes: list[str]  # frames that were lost, doubled or missing, and why
    view: View
    picture: Any  # the last frame


def track_film(
    path: str | Path,
    setup: Setup,
    *,
    head_length: float = math.nan,
    motor_speed: float = math.nan,
    start: float = 0.0,
    end: float = math.inf,
    progress: Callable[[int, int], object] | None = None,
) -> FilmTracks:
    """Track the robots of a film.

    Args:
        path: the film.
        setup: scale, lens, region and markers.
        head_length: of the robots [m].
        motor_speed: of the robots, for whose dots the film may have too few frames [rad/s].
        start: time in the film that becomes time_s = 0 [s].
        end: of what is tracked [s].
        progress: is called with the frames done and the frames of the film.

    Raises:
        InputError: the film cannot be read, or a robot is not seen in it; the message says what to change.
    """
    with naming(path):
        if not start < end:
            raise InputError(f"no frame between {start:g} and {end:g} s; give the earlier time as the start")
        film, tell = Film(path), progress or (lambda done, count: None)
        tell(0, film.count)
        robots, still = learn(film, setup, head_length, start, end)
        detector = Detector(robots, setup.view, still=still, head_length=head_length)
        seen = _follow(film, detector, [each.name for each in setup.robots], start, end, tell)
        if seen.picture is None:
            raise InputError(f"no frame between {start:g} and {end:g} s; the film has {film.count} frames")
        notes = _missing_frames(film, seen)
        if any(set(DOTS) & set(each.hues) for each in setup.robots) and len(seen.times) > 1:
            notes += filter(None, [aliasing(np.array(seen.times), motor_speed)])
        tables = {}
        for markers in setup.robots:
            run = Path(path).stem if len(setup.robots) == 1 else f"{Path(path).stem}-{markers.name}"
            table = tables[markers.name] = _table(seen, markers, run)
            notes += _doubts(table, markers, head_length, motor_speed)
        return FilmTracks(tables, notes, detector.view, seen.picture)


class _Seen(NamedTuple):
    """What the frames of a film show."""

    rows: dict[str, list[dict[str, float]]]  # robot -> rows of its table
    lost: dict[str, Counter[str]]  # robot -> frames without a pose, by their reason
    times: list[float]  # of all frames [s]
    doubled: int  # copies of the frame before, which are left out
    picture: Any  # the last frame


def _follow(
    film: Film, detector: Detector, robots: list[str], start: float, end: float, tell: Callable[[int, int], object]
) -> _Seen:
    """Detect the robots in each frame of a film."""
    rows: dict[str, list[dict[str, float]]] = {name: [] for name in robots}
    lost = {name: Counter[str]() for name in robots}
    times, doubled, picture = list[float](), 0, None
    for frame in film.frames(start, end):
        if frame.number % 10 == 0:
            tell(frame.number, film.count)
        times.append(frame.time_s)
        if frame.doubled:
            doubled += 1
            continue
        picture = frame.picture
        for each in detector.poses(picture):
            if isinstance(each, Lost):
                lost[each.robot][each.why] += 1
            else:
                rows[each.robot].append(_row(each, frame.number, frame.time_s - start))
    return _Seen(rows, lost, times, doubled, picture)


def _missing_frames(film: Film, seen: _Seen) -> list[str]:
    """Say which frames are missing, doubled or without a pose."""
    notes, steps, count = list[str](), np.diff(seen.times), len(seen.times)
    if film.ended and film.count - film.read > max(_UNCOUNTED * film.count, 2):
        notes.append(f"{film.stated(film.read)}: it is damaged or cut, or the camera dropped frames")
    if gaps := int((steps > _GAP * np.median(steps)).sum()) if len(steps) else 0:
        notes.append(f"{gaps} gaps in the time stamps: the camera dropped frames")
    if seen.doubled:
        notes.append(f"{seen.doubled} of {count} frames are copies of the frame before, and left out")
    for robot, reasons in seen.lost.items():
        for reason, frames in reasons.most_common():
            notes.append(f"robot {robot}: {frames} of {count} frames without a pose: {reason}")
    return notes


def _table(seen: _Seen, markers: Markers, run: str) -> pd.DataFrame:
    """Tabulate the poses of a robot.

    Raises:
        InputError: there are none.
    """
    import pandas as pd

    if not seen.rows[markers.name]:
        reason = seen.lost[markers.name].most_common(1)[0][0]
        raise InputError(_nothing(markers, reason, len(seen.times) - seen.doubled))
    table = pd.DataFrame(seen.rows[markers.name])
    table.insert(0, "run", run)
    return table


def _doubts(table: pd.DataFrame, markers: Markers, head_length: float, motor_speed: float) -> list[str]:
    """Say where a track may not be the robot's, or where its front and rear may be exchanged."""
    notes, name = list[str](), markers.name
    if markers.tag is None and float(np.ptp(table[["x_cm", "y_cm"]], axis=0).max()) < 100 * head_length:
        notes.append(f"robot {name}: it hardly moves, so a thing of its colours may be taken for it")
    turn = turn_sense(table)
    if turn and turn == _spin_sense(table, motor_speed):
        notes.append(f"robot {name}: its head spins as if front and rear were exchanged; {_EXCHANGE}")
    elif _swims_backwards(table):
        notes.append(f"robot {name}: it moves tail first; if it did not, {_EXCHANGE}")
    return notes


def _nothing(markers: Markers, reason: str, count: int) -> str:
    """Say that a robot is in no frame, why, and what to change."""
    remedy = 'give its markers as they look in the picture, front = "#c03020", or light the tank'
    if markers.tag is not None:
        remedy = "check its number, its dictionary and its white border, and that the film is not mirrored"
    elif reason == wrong_distance(markers):
        remedy = "correct [scale] in view.toml, or apart, the distance of the bands, if it is given"
    return f"no robot {markers.name} in {count} frames ({reason}): {remedy}"


def _row(pose: Pose, index: int, time: float) -> dict[str, float]:
    row = {
        "frame": index,
        "time_s": time,
        "x_cm": 100 * pose.x,
        "y_cm": 100 * pose.y,
        "heading_deg": math.degrees(pose.heading),
        "x_error_cm": 100 * pose.sigma_x,
        "heading_error_deg": math.degrees(pose.sigma_heading),
    }
    for name, (left, area) in pose.dots.items():
        row |= {f"{name}_left_cm": 100 * left, f"{name}_area_mm2": 1e6 * area}
    return row


def turn_sense(table: pd.DataFrame) -> int:
    """Return 1 for a robot that turns to the left all the time, −1 to the right, 0 if it does neither."""
    turns, known = unwrapped(table["time_s"].to_numpy(), np.radians(table["heading_deg"].to_numpy()))
    heading = turns[known]
    halves = np.diff(heading[[0, len(heading) // 2, -1]])
    return int(np.sign(halves[0])) if halves.prod() > 0 and np.abs(halves).min() > LEAST_TURN / 2 else 0


def _spin_sense(table: pd.DataFrame, motor_speed: float) -> int:
    """Return 1 for a head that spins clockwise, seen from behind, −1 for the other sense, 0 where no dot shows it.

    A motor at +1 spins the head at −1 and turns the robot to the left, and a mirror changes all three.
    """
    if "head_left_cm" not in table or not motor_speed > 0:
        return 0
    time, left, area = (table[name].to_numpy() for name in ("time_s", "head_left_cm", "head_area_mm2"))
    spin = fit_spin(time, left, area, motor_speed)
    return int(np.sign(spin.omega)) if isinstance(spin, Spin) and spin.sign_seen else 0


def _swims_backwards(table: pd.DataFrame) -> bool:
    """Return whether a robot moves against its heading, by more than the errors of its poses."""
    x, y, angle = table["x_cm"].to_numpy(), table["y_cm"].to_numpy(), np.radians(table["heading_deg"].to_numpy())
    axis = np.exp(1j * angle)
    surge = float(np.real(np.diff(x + 1j * y) * np.conj(axis[1:] + axis[:-1]) / 2).sum())
    return surge < -_CERTAIN * float(table["x_error_cm"].median())


def write_check(path: Path, tracks: FilmTracks) -> None:
    """Write a PNG of the last frame with each track, its fitted circle, and some of its poses."""
    cv2, picture = opencv(), tracks.picture.copy()
    size = picture.shape[1] / 100
    for table in tracks.tables.values():
        places = table[["x_cm", "y_cm"]].to_numpy() / 100
        lines = [(places, (255, 255, 255))]
        if len(places) >= _SHOWN:
            fit = fit_track(*(table[name].to_numpy() for name in ("time_s", "x_cm", "y_cm", "heading_deg")))
            lines.append((fit.path / 100, (0, 160, 255)))
        for line, colour in lines:
            pixels = np.round(tracks.view.to_picture(line) * 8).astype(np.int32)
            cv2.polylines(picture, [pixels], False, colour, max(int(size / 5), 1), cv2.LINE_AA, 3)
        stride = max(len(places) // _SHOWN, 1)
        angle = np.radians(table["heading_deg"].to_numpy())
        ahead = places + 0.02 * np.stack([np.cos(angle), np.sin(angle)], 1)
        ends = np.round([tracks.view.to_picture(part[::stride]) for part in (places, ahead)]).astype(int)
        for foot, tip in zip(*ends.tolist(), strict=True):
            cv2.arrowedLine(picture, foot, tip, (0, 0, 0), max(int(size / 4), 1), cv2.LINE_AA, tipLength=0.3)
    good, data = cv2.imencode(".png", picture)
    assert good
    path.write_bytes(data.tobytes())
