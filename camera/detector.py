"""Poses of robots in single pictures: by two coloured bands around the head, or by an ArUco or AprilTag marker.

The head spins about its axis, so a marker that is seen in every picture goes around the head: two bands of tape of
different colours, front and rear. A dot, or a tag that is fixed to the head, is seen for a part of each turn.

A colour is a direction in the plane of chroma, linear in the picture's red, green and blue,

    α = R − (G + B)/2,   β = √3/2 (G − B),   p = α cos h + β sin h,   q = β cos h − α sin h,

and a pixel has the weight p of a hue h if |q| < p tan 30° and p is above the noise and `_EDGE` of
the marker's own p. Blur and mixing with grey shrink p and leave the hue. So the weighted mean of the pixels is
the band's centre to a fraction of a pixel.

What has the colour of a marker and rests, a thing in the tank or its rim, is known from pictures of the whole film
and counts as grey. A robot that was seen lately is looked for around its last pose, at full resolution; any other
in the whole picture, smaller. Of several candidates the pair counts whose distance is that of the bands, which is
given or learnt from the pictures before.

The standard error of a centre is that of a weighted mean with the picture's own noise, and `_BIAS` and `_SHIFT`
for what noise does not explain: shading, glare, compression. What the distance of the bands is wrong by is added.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from camera.view import BANDS, DOTS, Markers, View, opencv
from common.arrays import Floats
from common.errors import InputError

_CONE = math.tan(math.radians(30))  # of hues that count as one colour
_FAINT = 14.0  # p of the faintest marker, of 255
_ABOVE = 2.0  # times the p that rests at a place: least p of a marker in front of it
_EDGE = 0.3  # of a marker's p
_RIVAL = 0.45  # of the strongest p in a picture, of what may be a marker, too
_WIDTH = 480  # pixels of the picture in which a lost robot is looked for
_FINE = 40.0  # pixels between the bands; where they are further apart, the picture is made smaller
_CANDIDATES = 6
_PIXEL = 0.3  # standard error of a centre besides [pixels]: films have a colour for each 2 × 2 pixels
_ALIKE = 0.2  # relative difference of the bands' distance from the known one
_BIAS = 0.0025  # of the bands' distance, standard error of a centre that does not come from noise
_SHIFT = 0.0065  # of the bands' distance, of what shifts both: light from one side, glare
_WHOLE = 0.3  # of the bands' distance, half the length of a band that must be in the picture, and in the region
_END = 0.18  # of the bands' distance, by which a band's centre moves for a whole band that is hidden at one end
_CHANGED = 0.13  # of a band's usual area, by which another area shows that it is hidden or has a thing beside it
_NOISE = 25.0  # pixels, three to four standard deviations of a band's area in a compressed film
_OTHER = 0.3  # of a band's usual area, by which it may differ where the robot was not seen for _MEMORY pictures
_MEMORY = 20  # pictures over which distance and areas are averaged
_CORNER = 0.25  # standard error of a tag's corner [pixels]
_MOVED = 0.25  # pixels, standard error of what moves a whole tag: lens, rolling shutter, compression
_SIDE = 2.0  # standard error of the side of a tag from its outline [pixels]
_REACH = {"head": (-0.7, 0.7, 0.75), "tail": (-3.0, -0.6, 1.5)}  # where dots are: along the axis, to the side


class Pose(NamedTuple):
    """Where a robot is, in the tank's frame."""

    robot: str
    x: float  # of the head's centre [m]
    y: float
    heading: float  # counter-clockwise from x [rad], -π to π
    sigma_x: float  # standard error of x, and of y [m]
    sigma_heading: float  # [rad]
    dots: Mapping[str, tuple[float, float]] = {}  # "head", "tail": left of the axis [m], seen area [m²]
    marks: tuple[tuple[float, float], ...] = ()  # places of front and rear, or of the tag's corners [pixels]


class Lost(NamedTuple):
    """A robot that is not seen, and why."""

    robot: str
    why: str


@dataclass
class _Robot:
    """A robot's markers, and what is known of it from the pictures before."""

    markers: Markers
    places: dict[str, Floats] = field(default_factory=dict)  # of the markers [pixels]; none: to be looked for
    apart: float = math.nan  # distance of front and rear, or side of the tag [m]
    areas: dict[str, float] = field(default_factory=dict)  # of the bands [m²]
    seen: int = 0  # pictures
    missed: int = 0  # pictures in a row

    @property
    def known(self) -> float:
        """The distance of its bands [m]; NaN: it is not known."""
        return self.apart if self.seen else self.markers.apart


class _Blob(NamedTuple):
    centre: Floats  # (2,) pixels
    area: float  # pixels
    error: float  # of the centre [pixels]


class Detector:
    """Find the marked robots in one picture after another."""

    def __init__(
        self,
        robots: Sequence[Markers],
        view: View,
        *,
        still: Mapping[float, Any] = {},
        head_length: float = math.nan,
    ) -> None:
        """Prepare for pictures of one camera.

        Args:
            robots: their markers.
            view: of the camera; where a tag gives its scale, `view` is complete once the tag was seen.
            still: see `camera.learning`; {} where no film shows it.
            head_length: of the robots, which the bands cannot be further apart than [m].

        Raises:
            InputError: OpenCV is not installed.
        """
        self.view, self._robots, self._longest = view, [_Robot(each) for each in robots], 1.1 * head_length
        self._cv, self._still = (cv := opencv()), still
        self._mask: Any = None
        self._finder = self._reader(cv.aruco.CORNER_REFINE_NONE)
        self._refiners = (  # the first counts from a pixel's corner
            (self._reader(cv.aruco.CORNER_REFINE_APRILTAG), 0.5, _CORNER),
            (self._reader(cv.aruco.CORNER_REFINE_CONTOUR), 0.0, 2 * _CORNER),
        )

    def poses(self, frame: Any) -> list[Pose | Lost]:
        """Return the pose of each robot, or why it is not seen, in the order of the robots.

        Args:
            frame: picture (H, W, 3), blue, green and red, uint8; pictures come in order.

        Raises:
            InputError: the picture has another shape, or the tag of the scale is seen too slantwise.
        """
        if frame.ndim != 3 or frame.shape[2] != 3:
            raise InputError("a picture without colours; film in colour")
        if self.view.region is not None and self._mask is None:
            self._mask = np.zeros(frame.shape[:2], np.uint8)
            self._cv.fillPoly(self._mask, [np.round(self.view.region).astype(np.int32)], 255)
        if self.view.homography is None:
            assert self.view.tag is not None
            number = self.view.tag[0]
            tag = self._tag(number, frame)
            if tag is None:
                return [Lost(each.markers.name, f"no tag {number} that gives the scale") for each in self._robots]
            corners, error = tag
            self.view = self.view.with_tag(corners, _SIDE if error > _CORNER else _CORNER * math.sqrt(2))
        return [self._look(robot, frame) for robot in self._robots]

    def _look(self, robot: _Robot, frame: Any) -> Pose | Lost:
        """Look for a robot where it is expected, then everywhere, and remember."""
        look = self._by_bands if robot.markers.tag is None else self._by_tag
        pose = look(robot, frame)
        if isinstance(pose, str) and robot.places:
            robot.places = {}
            pose = look(robot, frame)
        if isinstance(pose, Pose):
            robot.seen, robot.missed = robot.seen + 1, 0
            return pose
        robot.places, robot.missed = {}, robot.missed + 1
        if robot.missed > robot.seen:  # what was seen may have been something else
            robot.seen = 0
            if robot.missed > _MEMORY:
                robot.areas = {}
        return Lost(robot.markers.name, pose)

    # Tags

    def _reader(self, refinement: int) -> Any:
        aruco = self._cv.aruco
        options = aruco.DetectorParameters()
        options.cornerRefinementMethod = refinement
        options.detectInvertedMarker = True  # white on black
        known = aruco.getPredefinedDictionary(getattr(aruco, f"DICT_{self.view.dictionary.upper()}"))
        return aruco.ArucoDetector(known, options)

    def _tag(self, number: int, frame: Any, around: Floats | None = None) -> tuple[Floats, float] | None:
        """Return the corners (4, 2) of a tag from lines along its sides, and their standard error [pixels].

        Where the sides are too short or blurred for lines through the steepest grey, or white on black, those
        through the outline serve, with which a tag is up to 3 pixels smaller or larger than it is.
        """
        corners = self._read(self._finder, number, frame) if around is None else around
        if corners is None:
            return None
        for reader, shift, error in self._refiners:
            with suppress(self._cv.error):  # of an outline with too few pixels on one side
                refined = self._read(reader, number, frame, corners)
                if refined is not None:
                    return refined - shift, error
        if around is not None:
            corners = self._read(self._finder, number, frame, around)
        return None if corners is None else (corners, 4 * _CORNER)

    def _read(self, reader: Any, number: int, frame: Any, around: Floats | None = None) -> Floats | None:
        """Return the corners (4, 2) of a tag in a picture, or in its part around the corners that it had."""
        low = np.zeros(2, int)
        if around is not None:
            side = np.ptp(around, axis=0).max()
            low = np.maximum((around.min(axis=0) - side).astype(int), 0)
            right, down = (around.max(axis=0) + side).astype(int)
            frame = frame[low[1] : down, low[0] : right]
        corners, numbers, _ = reader.detectMarkers(self._cv.cvtColor(frame, self._cv.COLOR_BGR2GRAY))
        found = np.flatnonzero(np.asarray(numbers) == number)  # None, where there is no tag
        return low + np.asarray(corners[found[-1]], dtype=float)[0] if len(found) else None

    def _by_tag(self, robot: _Robot, frame: Any) -> Pose | str:
        """Fit a square to the corners: first the upper left one, then clockwise, as the camera sees them."""
        number = int(robot.markers.tag or 0)
        tag = self._tag(number, frame, robot.places.get("tag"))
        if tag is None or not self._inside(tag[0].mean(axis=0)):
            return f"no tag {number}"
        corners, error = tag
        robot.places = {"tag": corners}
        places = self.view.to_tank(corners)
        centre = places.mean(axis=0)
        square = np.array([1 + 1j, 1 - 1j, -1 - 1j, -1 + 1j])  # forward + i left
        square = square * np.exp(1j * robot.markers.turned)
        square = square.conj() if self.view.up else square
        arms = (places - centre) @ [1, 1j]
        turn = (square.conj() @ arms) / 8
        misfit = float(np.sum(np.abs(arms - turn * square) ** 2))  # with four degrees of freedom
        pixel = self.view.metres(corners.mean(axis=0))
        sigma = math.sqrt(((error * pixel) ** 2 + misfit / 4) / 2)  # of a corner
        place, turned = math.hypot(sigma / 2, _MOVED * pixel), sigma / math.sqrt(8) / abs(turn)
        robot.apart = 2 * abs(turn)
        return self._pose(robot, frame, centre, float(np.angle(turn)), place, turned, corners)

    # Bands

    def _by_bands(self, robot: _Robot, frame: Any) -> Pose | str:
        first = 0.5 if robot.places else 0.4
        places = robot.places or self._search(robot, frame)
        if isinstance(places, str):
            return places
        distance, blobs = float(np.linalg.norm(places["front"] - places["rear"])), list[_Blob]()
        for name in BANDS:
            centre = places[name]
            for reach in (first, 0.45, 0.45):
                blob = self._blob(frame, robot.markers.hues[name], centre, reach * distance, distance)
                if blob is None:
                    return f"no {robot.markers.colours[name]}"
                centre = blob.centre
            assert blob is not None
            blobs.append(blob)
        return self._pair(robot, frame, blobs)

    def _pair(self, robot: _Robot, frame: Any, blobs: Sequence[_Blob]) -> Pose | str:
        """Check a pair of bands against what is known of them, and return its pose."""
        marks = np.stack([blob.centre for blob in blobs])
        places, known = self.view.to_tank(marks), robot.known
        arm, distance = places[0] - places[1], float(np.linalg.norm(marks[0] - marks[1]))
        apart = float(np.hypot(*arm))
        if not distance > 0 or abs(apart / known - 1) > _ALIKE:
            return wrong_distance(robot.markers)
        side = _WHOLE * (marks[0] - marks[1])[::-1] * [1, -1]  # from a band's centre to its end
        ends = np.concatenate([marks + side, marks - side])
        if (ends < 0).any() or (ends > np.array(frame.shape[1::-1]) - 1).any():
            return "at the edge of the picture"
        if not all(map(self._inside, ends)):
            return "outside the region of the tank"
        metres, forget, anew = apart / distance, min(robot.seen + 1, _MEMORY), robot.missed > _MEMORY
        bias = math.hypot(_BIAS * distance, _PIXEL)
        variance, areas = 0.0, {}  # of the difference of the centres, in squares of pixels
        for name, blob in zip(BANDS, blobs, strict=True):
            pixel = self.view.metres(blob.centre) ** 2
            area = blob.area * pixel
            usual = robot.areas.get(name, area)
            least = 1 - (_OTHER if anew else min(max(_CHANGED, _NOISE * pixel / usual), _OTHER))
            if area < least * usual:
                return f"{robot.markers.colours[name]} partly hidden"
            if area * least > usual:
                return f"more that is {robot.markers.colours[name]} beside it"
            areas[name] = area if anew else usual + (area - usual) / forget  # the light may have changed
            variance += blob.error**2 + bias**2 + (_END * distance * (1 - area / usual)) ** 2
        robot.apart = known + (apart - known) / forget if robot.seen else apart
        robot.places, robot.areas = dict(zip(BANDS, marks, strict=True)), areas
        error = metres * math.sqrt(variance)
        sigma = math.hypot(error / 2, (apart - robot.apart) / 2, _SHIFT * apart)
        return self._pose(
            robot, frame, places.mean(axis=0), math.atan2(arm[1], arm[0]), sigma, error / apart, marks
        )

    def _pose(
        self, robot: _Robot, frame: Any, centre: Floats, heading: float, sigma: float, sigma_heading: float,
        marks: Floats,
    ) -> Pose:  # fmt: skip
        """Move the pose to the head's centre, and look for the dots."""
        markers, axis = robot.markers, np.array([math.cos(heading), math.sin(heading)])
        x, y = (centre - markers.ahead * axis).tolist()
        dots = {name: self._dot(robot, frame, centre, axis, name) for name in DOTS if name in markers.hues}
        sigma = math.hypot(sigma, markers.ahead * sigma_heading)
        return Pose(markers.name, x, y, heading, sigma, sigma_heading, dots, tuple(map(tuple, marks.tolist())))

    def _dot(self, robot: _Robot, frame: Any, centre: Floats, axis: Floats, name: str) -> tuple[float, float]:
        """Return how far a dot is left of the axis [m] and its seen area [m²]; (nan, 0) where it is not seen."""
        back, ahead, side = (robot.apart * reach for reach in _REACH[name])
        left = np.array([-axis[1], axis[0]])
        corners = np.array([centre + a * axis + b * left for a in (back, ahead) for b in (-side, side)])
        outline = self.view.to_picture(corners)
        middle, reach = outline.mean(axis=0), float(np.ptp(outline, axis=0).max()) / 2
        metres = self.view.metres(middle)
        blob = self._blob(frame, robot.markers.hues[name], middle, reach, robot.apart / metres)
        if blob is not None:
            along, across = (self.view.to_tank(blob.centre)[0] - centre) @ np.column_stack([axis, left])
            if back <= along <= ahead and abs(across) <= side:
                return float(across), blob.area * metres**2
        return math.nan, 0.0

    # Colours

    def _inside(self, pixel: Floats) -> bool:
        region = self.view.region
        return region is None or self._cv.pointPolygonTest(region.astype(np.float32), pixel.tolist(), False) >= 0

    def _weights(self, picture: Any, hue: float, box: tuple[slice, slice], size: tuple[int, int]) -> Any:
        """Return p of a hue where it counts as that hue, 0 elsewhere, in a part of the picture made smaller."""

        def part(whole: Any) -> Any:
            return self._cv.resize(whole[box], size, interpolation=self._cv.INTER_AREA)

        p, q = chroma(part(picture), hue)
        weights = np.where(np.abs(q) < _CONE * p, p, np.float32(0))
        if hue in self._still:
            weights[weights < _ABOVE * part(self._still[hue])] = 0
        if self._mask is not None:
            weights[part(self._mask) < 128] = 0
        return weights

    def _blob(self, frame: Any, hue: float, centre: Floats, reach: float, distance: float) -> _Blob | None:
        """Return the weighted mean of the pixels of a hue around a place; None if there are none to speak of."""
        fold = max(int(distance / _FINE), 1)  # pixels that become one, each way
        low = np.maximum((centre - reach).astype(int), 0)
        across, down = (np.minimum((centre + reach).astype(int) + 2, frame.shape[1::-1]) - low) // fold
        if across < 3 or down < 3:
            return None
        box = (slice(low[1], low[1] + down * fold), slice(low[0], low[0] + across * fold))
        weights = self._weights(frame, hue, box, (int(across), int(down)))
        steps = np.diff(frame[box][:: 2 * fold, ::fold, 1].astype(np.float32), axis=1)
        noise = max(1.05 * float(np.median(np.abs(steps))), 0.5)
        peak = float(np.partition(weights.ravel(), -6)[-6])
        if peak < max(_FAINT, 5 * noise / fold):
            return None
        weights = np.maximum(weights - _EDGE * peak, 0)
        total, at = float(weights.sum()), np.indices(weights.shape)[::-1]
        place = (weights * at).sum(axis=(1, 2)) / total
        spread = float(((at - place[:, None, None]) ** 2 * (weights > 0)).sum()) / 2
        error = 1.2 * noise * math.sqrt(spread) / total  # p has √(3/2) times the noise of a colour; × fold / fold
        area = float(np.minimum(weights / (_EDGE * peak), 1).sum()) * fold**2  # a pixel at its edge counts in part
        return _Blob(low + (place + 0.5) * fold - 0.5, area, error)

    def distances(self, robot: int, frame: Any) -> list[float]:
        """Return how far apart the bands of a robot may be in a picture, for each pair of candidates [m]."""
        pairs = self._pairs(self._robots[robot], frame)
        return [] if isinstance(pairs, str) else [pair[3] for pair in pairs if not pair[3] > self._longest]

    def _search(self, robot: _Robot, frame: Any) -> dict[str, Floats] | str:
        """Look for the pair in the whole picture; return its places, or why it is not there."""
        pairs, known = self._pairs(robot, frame), robot.known
        if isinstance(pairs, str):
            return pairs

        def fit(pair: tuple[float, Floats, Floats, float]) -> float:
            strength, _, _, apart = pair
            if known > 0:
                return strength * math.exp(-(((apart / known - 1) / _ALIKE) ** 2))
            return 0.0 if apart > self._longest else strength / apart

        best = max(pairs, key=fit, default=None)
        return dict(zip(BANDS, best[1:3], strict=True)) if best and fit(best) else wrong_distance(robot.markers)

    def _pairs(self, robot: _Robot, frame: Any) -> list[tuple[float, Floats, Floats, float]] | str:
        """Return pairs of candidates in the whole picture: strength, places [pixels], distance [m]."""
        height, width = frame.shape[:2]
        factor, whole = max(width / _WIDTH, 1.0), (slice(None), slice(None))
        candidates = []
        for name in BANDS:
            weights = self._weights(
                frame, robot.markers.hues[name], whole, (round(width / factor), round(height / factor))
            )
            candidates.append([(p, (place + 0.5) * factor - 0.5) for p, place in self._patches(weights)])
            if not candidates[-1]:
                return f"no {robot.markers.colours[name]}"
        pairs = []
        for (strength, front), (other, rear) in product(*candidates):
            apart = float(np.hypot(*np.diff(self.view.to_tank(np.stack([front, rear])), axis=0)[0]))
            if np.linalg.norm(front - rear) > 3:
                pairs.append((min(strength, other), front, rear, apart))
        return pairs

    def _patches(self, weights: Any) -> list[tuple[float, Floats]]:
        """Return the strongest connected patches: their largest weights, and their centres (2,)."""
        weights = self._cv.blur(weights, (3, 3))
        weights[weights < max(_FAINT / 2, _RIVAL * float(weights.max()))] = 0
        count, labels, _, centres = self._cv.connectedComponentsWithStats(
            self._cv.dilate((weights > 0).astype(np.uint8), np.ones((3, 3), np.uint8))
        )
        strengths, seen = np.zeros(count), labels > 0
        np.maximum.at(strengths, labels[seen], weights[seen])
        order = np.argsort(-strengths)[:_CANDIDATES]
        return [(float(strengths[label]), centres[label]) for label in order if strengths[label] > 0]


def chroma(picture: Any, hue: float) -> Any:
    """Return p and q of a hue, each (H, W)."""
    c, s, root = math.cos(math.radians(hue)), math.sin(math.radians(hue)), math.sqrt(3) / 2
    alpha, beta = np.array([-0.5, -0.5, 1.0]), np.array([-root, root, 0.0])  # of blue, green, red
    axes = np.array([c * alpha + s * beta, c * beta - s * alpha], np.float32)
    return opencv().split(opencv().transform(picture.astype(np.float32), axes))


def wrong_distance(markers: Markers) -> str:
    """Say why a robot is lost whose bands have another distance than is known."""
    return f"{markers.colours['front']} and {markers.colours['rear']} at a wrong distance"
