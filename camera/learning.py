"""What is learnt from some pictures of a film before it is tracked: what rests, and how far bands are apart.

A camera rests, and a robot moves. So a place that has a marker's colour in two thirds of the pictures in which no
robot is there, at the rim of the tank or where a thing lies, is no marker. Front and rear of a robot have one
distance in all pictures; a thing and a band have another in each.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from camera.detector import Detector, Pose, chroma
from camera.film import Film
from camera.view import BANDS, DOTS, Markers, Setup, View, opencv
from common.arrays import Floats
from common.errors import InputError

_LARGE = 1920  # pixels, of the width of the pictures from which is learnt, at most
_SAMPLES = 12  # pictures from which is learnt what rests, and the distance of the bands
_AGREED = 0.04  # relative difference of two distances of the bands in small pictures
_BAND_REACH, _DOTS_REACH = 0.5, 3  # of the bands' distance, around a band's centre and a robot: there they are
_LEAST = 0.3  # of the head's length, of which the bands are apart
_UNKNOWN = 255  # for p of a place at which a robot is
_WIDE = 1.0  # tangent of the half-angle of hues that count as one, wider than a marker's: noise moves a hue


def learn(
    film: Film, setup: Setup, head_length: float, start: float, end: float
) -> tuple[list[Markers], dict[float, Any]]:
    """Learn from some pictures what rests, and how far the bands of each robot are apart; compare with its head.

    A distance that view.toml gives is taken. What is around a robot does not rest; where a robot is seen only if
    everything may be a marker, or where nothing is left once it moves, it does so itself.

    Raises:
        InputError: the bands are further apart than the head is long, or hardly apart.
    """
    banded = [each for each in setup.robots if each.tag is None]
    pictures, size, view = _small_pictures(film, setup.view, start, end) if banded else ([], (0, 0), setup.view)
    hues = {hue for each in banded for hue in each.hues.values()}
    colours = {hue: np.array([_map(picture, hue) for picture in pictures]) for hue in hues}
    unknown = {each.name for each in banded if math.isnan(each.apart)}
    # With what rests, things are no markers; without it, a robot that itself rests is seen, too.
    for still in (_resting(colours), {}):
        agreed = {each.name: _agreed(pictures, each, view, still, head_length) for each in banded
                  if each.name in unknown}  # fmt: skip
        guessed = [each._replace(apart=agreed.get(each.name, each.apart)) for each in banded]
        seen = _seen(pictures, guessed, view, still)
        if all(seen.values()):
            break
    _erase(colours, banded, seen)
    # A robot that is seen in some pictures only may rest in the others, where its colours are still in the map.
    for each in guessed:
        known = list(seen[each.name])
        if 0 < len(known) < len(pictures):
            left = _resting({hue: colours[hue][known] for hue in each.hues.values()})
            _erase(colours, [each], _seen(pictures, [each], view, left))
    still = _resting(colours)
    seen = _seen(pictures, guessed, view, still)
    distances = {name: float(np.median([apart for _, apart in poses.values()])) for name, poses in seen.items()
                 if poses and name in unknown}  # fmt: skip
    _check_distances(distances.values(), head_length)
    still = {hue: opencv().resize(weights, size) for hue, weights in still.items()}
    return [each._replace(apart=distances.get(each.name, each.apart)) for each in setup.robots], still


def _small_pictures(film: Film, view: View, start: float, end: float) -> tuple[list[Any], tuple[int, int], View]:
    """Return some pictures of a film, at most `_LARGE` wide, the film's width and height, and the view of them."""
    pictures, size, small_view = list[Any](), (0, 0), view
    for picture in film.samples(_SAMPLES, start, end):
        size = width, height = picture.shape[1::-1]
        fold = math.ceil(width / _LARGE)
        small = width // fold, height // fold
        pictures.append(opencv().resize(picture, small, interpolation=opencv().INTER_AREA))
        small_view = view.smaller(fold)
    return pictures, size, small_view


def _check_distances(distances: Iterable[float], head_length: float) -> None:
    """Compare distances of bands with the head's length.

    Raises:
        InputError: the bands are further apart than the head is long, or hardly apart.
    """
    for apart in distances:
        if apart > 1.05 * head_length or apart < _LEAST * head_length:
            raise InputError(
                f"the bands are {100 * apart:.3g} cm apart, and the head of the robot is "
                f"{100 * head_length:.3g} cm long: correct [scale] in view.toml, or give the right robot, or "
                "the bands' distance as apart_cm"
            )


def _agreed(
    pictures: Sequence[Any], markers: Markers, view: View, still: Mapping[float, Any], head_length: float
) -> float:
    """Return the distance of two bands that most pictures allow [m]; NaN: no picture shows two bands.

    Other things that have the colours, and one of them and a band, come nearer to each other as the robot moves.
    """
    allowed = []
    for picture in pictures:
        detector = Detector([markers], view, still=still, head_length=head_length)
        if view.homography is None:
            detector.poses(picture)  # which finds the tag of the scale
        allowed.append(np.array(detector.distances(0, picture) if detector.view.homography is not None else []))
    votes = {
        apart: sum(bool((np.abs(others / apart - 1) < _AGREED).any()) for others in allowed)
        for apart in np.concatenate([*allowed, []]).tolist()
    }
    return max(votes, key=lambda apart: (votes[apart], -apart), default=math.nan)


def _seen(
    pictures: Sequence[Any], robots: Sequence[Markers], view: View, still: Mapping[float, Any]
) -> dict[str, dict[int, tuple[Floats, float]]]:
    """Find robots with bands in single pictures: name -> picture -> marks (2, 2) [pixels], their distance [m]."""
    seen: dict[str, dict[int, tuple[Floats, float]]] = {each.name: {} for each in robots}
    for index, picture in enumerate(pictures):
        detector = Detector(robots, view, still=still)
        for each in detector.poses(picture):
            if isinstance(each, Pose):
                marks = np.array(each.marks)
                seen[each.robot][index] = marks, float(np.hypot(*np.diff(detector.view.to_tank(marks), axis=0)[0]))
    return seen


def _erase(
    colours: Mapping[float, Any], robots: Sequence[Markers], seen: Mapping[str, Mapping[int, tuple[Floats, float]]]
) -> None:
    """Set the p of hues (`_resting`) to `_UNKNOWN` around robots that are seen (`_seen`)."""
    for each in robots:
        for index, (marks, _) in seen[each.name].items():
            distance = float(np.linalg.norm(marks[0] - marks[1]))
            around = {**dict(zip(BANDS, marks, strict=True)), **dict.fromkeys(DOTS, marks.mean(axis=0))}
            for name, hue in each.hues.items():
                reach = distance * (_DOTS_REACH if name in DOTS else _BAND_REACH)
                low, high = ((around[name] + side * reach).clip(0).astype(int) for side in (-1, 1))
                colours[hue][index, low[1] : high[1], low[0] : high[0]] = _UNKNOWN


def _map(picture: Any, hue: float) -> Any:
    """Return p of a hue in a picture, uint8 (H, W), also of hues near it, which noise may move."""
    p, q = chroma(picture, hue)
    weights = opencv().blur(np.where(np.abs(q) < _WIDE * p, p, np.float32(0)), (3, 3))
    return weights.clip(0, _UNKNOWN - 1).astype(np.uint8)


def _resting(colours: Mapping[float, Any]) -> dict[float, Any]:
    """Return for each hue the p, uint8 (H, W), that two thirds of the pictures have at a place: what rests there.

    Args:
        colours: hue -> `_map` of pictures, (K, H, W), over which a camera rests; `_UNKNOWN` where a robot is, and
            where one is in all, nothing rests.
    """
    rests = {}
    for hue, maps in colours.items():
        if len(maps):
            third = (maps < _UNKNOWN).sum(axis=0, dtype=np.uint8) // 3
            weights = np.take_along_axis(np.sort(maps, axis=0), third[None].astype(np.intp), axis=0)[0]
            weights[weights == _UNKNOWN] = 0
            rests[hue] = opencv().dilate(weights, np.ones((5, 5)))
    return rests
