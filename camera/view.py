"""A camera's view of a tank, and the file view.toml that describes it with the robots' markers.

A picture's coordinates are pixels (u, v) from its upper left corner, u to the right and v down; those of the tank
are metres (x, y), seen from above, y counter-clockwise from x. Between them stand the lens, with the radial and
tangential distortion of OpenCV, and a homography H of the plane in which the robot swims:

    (x, y, 1) ~ H (u', v', 1),     (u', v') the pixel without distortion.

H comes from two points of a ruler and their distance (a camera that looks straight down; the origin is the
first point, x points to the right in the picture), from four or more points and their places in the tank (any
camera), or from an ArUco tag of known size that lies in the picture. Ruler, points or tag lie at the height of the
robot: one that lies lower by the share s of the camera's height makes lengths too large by s.
"""

from __future__ import annotations

import difflib
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from common.arrays import Floats
from common.errors import InputError, naming
from common.reading import read_toml
from common.units import split, to_si

HUES = {"red": 0, "orange": 30, "yellow": 60, "green": 120, "cyan": 180, "blue": 240, "magenta": 300}  # degrees
BANDS = ("front", "rear")
DOTS = ("head", "tail")  # markers that come and go as the robot spins
_LEAST, _LARGEST = 1e-5, 1e3  # m, between which a length in a tank is
_CLICK = 1.0  # pixels, standard deviation of a point that a person reads off a picture
_APART = 40  # degrees between the hues of two markers
_NARROW = 1e-3  # of the length of a set of points, its width at which they lie on a line
_STRETCH = 1.15  # greatest ratio of the sides of a tag from which the scale alone is taken
_KEYS = {
    "": ("looks", "dictionary", "scale", "lens", "tank", "robots"),
    "scale": ("points_px", "tag_id"),
    "lens": ("focal_px", "centre_px", "distortion"),
    "tank": ("region_px",),
    "robots": ("name", *BANDS, *DOTS, "tag", "turned_deg"),
}
_LENGTHS = {"scale": ("points", "length", "tag"), "robots": ("ahead", "apart")}  # their keys have a unit
EXAMPLE = """\
# Pixels count from the picture's upper left corner, x to the right and y down.
looks = "down"                       # the camera; "up" through the bottom of the tank
# dictionary = "4x4_50"              # of ArUco tags, as OpenCV names it; "aruco_original", "apriltag_36h11", …

[scale]                              # two points of a ruler at the robot's height, and their distance
points_px = [[100, 650], [900, 650]]
length_cm = 30
# points_cm = [[0, 0], [30, 0], [30, 20], [0, 20]]  # instead of the length: places of four points or more
# tag_cm = 4                         # instead of points: the side of an ArUco tag, number tag_id, in the picture

# [lens]                             # what softflagella camera lens prints, from pictures of a chessboard
# [tank]
# region_px = [[50, 50], [1230, 50], [1230, 670], [50, 670]]  # a polygon; nothing outside is a marker

[[robots]]                           # once for each robot
front = "red"                        # bands of tape around the head; red, orange, yellow, green, cyan, blue,
rear = "green"                       # magenta, or a colour of the picture, "#c03020"
# head = "blue"                      # a dot on the head's side, which comes and goes as the head spins
# tail = "yellow"                    # a dot on one tail
# ahead_mm = 0                       # how far the middle of front and rear is ahead of the head's centre
"""


def opencv() -> Any:
    """Return the module cv2.

    Raises:
        InputError: it is not installed.
    """
    try:
        import cv2
    except ImportError:
        raise InputError("films need OpenCV: pip install 'softflagella[camera]'") from None
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # what it would say is said by an InputError
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    return cv2


class Markers(NamedTuple):
    """How a robot is marked: by bands of two colours or by a tag, and by dots on head and tail."""

    name: str
    hues: Mapping[str, float] = {}  # of the bands and dots, by BANDS and DOTS [deg]
    colours: Mapping[str, str] = {}  # as they were given
    tag: int | None = None
    ahead: float = 0.0  # of the markers' middle from the head's centre [m]
    apart: float = math.nan  # distance of front and rear [m]; NaN: learnt from the film
    turned: float = 0.0  # of a tag's upper edge from the front, counter-clockwise as the camera sees it [rad]


class Lens(NamedTuple):
    """A pinhole camera with OpenCV's distortion."""

    matrix: Floats  # (3, 3), with focal lengths and centre [pixels]
    distortion: Floats  # (5,) k1, k2, p1, p2, k3


@dataclass(frozen=True)
class View:
    """The lens, the plane of the tank, the region in which robots are."""

    homography: Floats | None = None  # (3, 3) from pixels without distortion to metres; None: see `tag`
    scale_error: float = 0.0  # standard deviation of its scale, relative
    lens: Lens | None = None
    region: Floats | None = None  # (n, 2) pixels, a polygon
    tag: tuple[int, float] | None = None  # number and side [m] of the tag that gives the scale
    dictionary: str = "4x4_50"  # of the tags, as OpenCV names it
    up: bool = False  # the camera looks up

    def to_tank(self, pixels: Floats) -> Floats:
        """Map pixels (n, 2) to places in the tank (n, 2) [m]."""
        assert self.homography is not None
        plane: Any = np.asarray(pixels, dtype=float).reshape(-1, 1, 2)
        if self.lens is not None:
            plane = opencv().undistortPoints(plane, *self.lens, P=self.lens.matrix)
        return _mapped(self.homography, plane)

    def to_picture(self, places: Floats) -> Floats:
        """Map places (n, 2) in the tank [m] to pixels (n, 2)."""
        assert self.homography is not None
        pixels = _mapped(np.linalg.inv(self.homography), np.asarray(places, dtype=float))
        if self.lens is None:
            return pixels
        rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(self.lens.matrix).T
        zero = np.zeros(3)
        return np.asarray(opencv().projectPoints(rays, zero, zero, *self.lens)[0][:, 0], dtype=float)

    def metres(self, pixel: Floats) -> float:
        """Return the length that one pixel has at a place in the picture [m]."""
        corners = self.to_tank(pixel + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
        across, down = corners[1:] - corners[0]
        return math.sqrt(abs(float(across[0] * down[1] - across[1] * down[0])))

    def smaller(self, fold: int) -> View:
        """Return the view of pictures whose pixels are `fold` × `fold` of these pixels."""
        middle = (fold - 1) / 2
        scale = np.array([[fold, 0, middle], [0, fold, middle], [0, 0, 1.0]])  # to the old pixels
        back = np.linalg.inv(scale)
        return replace(
            self,
            homography=None if self.homography is None else self.homography @ scale,
            lens=None if self.lens is None else self.lens._replace(matrix=back @ self.lens.matrix),
            region=None if self.region is None else (self.region - middle) / fold,
        )

    def with_tag(self, corners: Floats, error: float) -> View:
        """Return the view with the scale of its tag, whose corners (4, 2) are seen in a picture.

        Args:
            corners: of the tag [pixels].
            error: standard error of its side [pixels].

        Raises:
            InputError: the tag is seen too slantwise for a scale.
        """
        assert self.tag is not None
        unscaled = replace(self, homography=np.eye(3))
        plane = unscaled.to_tank(corners)
        sides = np.linalg.norm(plane - np.roll(plane, 1, axis=0), axis=1)
        if sides.max() > _STRETCH * sides.min():
            raise InputError(
                f"tag {self.tag[0]} is seen slantwise, {sides.min():.0f} to {sides.max():.0f} pixels a side; "
                "let the camera look straight down, or give four points, points_px and points_cm"
            )
        size = float(sides.mean())
        homography = _scaled(plane.mean(axis=0), self.tag[1] / size, self.up)
        return replace(self, homography=homography, scale_error=error / size)


class Setup(NamedTuple):
    """What a view.toml holds."""

    view: View
    robots: tuple[Markers, ...]


def read_setup(path: str | Path) -> Setup:
    """Read a view.toml (`EXAMPLE`).

    Raises:
        InputError: an entry is unknown, missing or impossible; the message names it.
    """
    with naming(path):
        return _setup(read_toml(path))


def _mapped(homography: Any, points: Any) -> Floats:
    mapped = np.column_stack([points.reshape(-1, 2), np.ones(len(points))]) @ homography.T
    return np.asarray(mapped[:, :2] / mapped[:, 2:], dtype=np.float64)


def _scaled(origin: Floats, scale: float, up: bool) -> Floats:
    """Return the homography of a camera that looks straight down, or straight up: one scale, y upwards or down."""
    side = scale if up else -scale
    return np.array([[scale, 0, -scale * origin[0]], [0, side, -side * origin[1]], [0, 0, 1.0]])


def _setup(content: dict[str, Any]) -> Setup:
    content = _read("", content)
    scale, lens, tank = (_read(table, content.get(table, {})) for table in ("scale", "lens", "tank"))
    robots = content.get("robots")
    if not isinstance(robots, list) or not robots:
        raise InputError('no robot; write [[robots]] with front = "red" and rear = "green", or tag = 0')
    looks = content.get("looks", "down")
    if looks not in ("down", "up"):
        raise InputError(
            f'looks = {looks!r}; give "down" (the camera above the tank) or "up" (through its bottom)'
        )
    region = _points(tank, "region_px", 3) if "region_px" in tank else None
    dictionary = str(content.get("dictionary", View.dictionary)).lower()
    if dictionary not in (known := _dictionaries()):
        raise InputError(f"dictionary = {dictionary!r}; give one of OpenCV's: {', '.join(known)}")
    view = View(lens=_lens(lens) if lens else None, region=region, dictionary=dictionary, up=looks == "up")
    view = _with_scale(view, scale)
    marked = tuple(_markers(robot, number) for number, robot in enumerate(robots, 1))
    if len({each.name for each in marked}) < len(marked):
        raise InputError("two robots have one name; give each [[robots]] a name of its own")
    marks = {each.tag if each.tag is not None else tuple(map(each.hues.get, BANDS)) for each in marked}
    if len(marks) < len(marked):
        raise InputError("two robots have the same markers; give each its own colours or tag")
    return Setup(view, marked)


def _dictionaries() -> list[str]:
    return sorted({name[5:].lower() for name in dir(opencv().aruco) if name.startswith("DICT_")})


def _read(table: str, entries: Any) -> dict[str, Any]:
    """Check the keys of a table, and return its entries; lengths in metres, by their names without a unit."""
    if not isinstance(entries, dict):
        raise InputError(f"{table} is no table; write [{table}] and its entries below")
    read, lengths = {}, _LENGTHS.get(table, ())
    for key, value in entries.items():
        (quantity, unit), place = split(key), f"[{table}] {key}" if table else key
        if key in _KEYS[table]:
            read[key] = value
        elif quantity not in lengths:
            near = difflib.get_close_matches(quantity, (*_KEYS[table], *lengths), n=1)
            raise InputError(f"unknown entry {place}{f'; is it {near[0]}?' if near else ''}")
        elif unit is None or unit.kind != "length":
            raise InputError(f"{place} has no unit of length; give {quantity}_cm, or another unit")
        elif quantity in read:
            raise InputError(f"{place}: another entry gives {quantity}, too; drop all but one")
        else:
            read[quantity] = length = to_si(_numbers(value), unit.suffix)
            least = -_LARGEST if quantity == "ahead" else _LEAST
            if quantity != "points" and not (length.shape == () and least < length < _LARGEST):
                raise InputError(
                    f"{place} = {value!r}; give a number, {quantity}_cm or in another unit, from {least:g} to "
                    f"{_LARGEST:g} m"
                )
    return read


def _with_scale(view: View, scale: Mapping[str, Any]) -> View:
    if scale.keys() - {"tag_id"} not in ({"tag"}, {"points_px", "length"}, {"points_px", "points"}):
        raise InputError(
            "no scale, or two; give [scale] points_px = [[100, 650], [900, 650]] and length_cm = 30, two points "
            "of a ruler, or points_px and points_cm, four or more and their places, or tag_cm, a tag's side"
        )
    if "tag" in scale:
        return replace(view, tag=(_tag_number(scale.get("tag_id", 0), "[scale] tag_id"), float(scale["tag"])))
    pixels = _points(scale, "points_px", 2)
    plane = replace(view, homography=np.eye(3)).to_tank(pixels)
    if "points" in scale:
        return _from_places(view, plane, _points(scale, "points", 4))
    if len(pixels) != 2:
        raise InputError(f"[scale] a length and {len(pixels)} points_px; give two, or points_cm, a place for each")
    distance = float(np.linalg.norm(plane[1] - plane[0]))
    if not distance > 0:
        raise InputError("[scale] the two points are the same; give two ends of a ruler")
    homography = _scaled(plane[0], float(scale["length"]) / distance, view.up)
    return replace(view, homography=homography, scale_error=_CLICK * math.sqrt(2) / distance)


def _from_places(view: View, plane: Floats, places: Floats) -> View:
    """Fit a homography to points (n, 2) and their places (n, 2) [m]."""
    if len(places) != len(plane):
        raise InputError(f"[scale] {len(plane)} points_px and {len(places)} places; give a place for each point")
    spreads = [np.linalg.svd(points - points.mean(axis=0), compute_uv=False) for points in (plane, places)]
    homography = None
    if all(narrow > _NARROW * wide for wide, narrow in spreads):
        homography, _ = opencv().findHomography(plane, places)
    if homography is None:
        raise InputError("[scale] the points lie on a line; give the corners of a rectangle")
    homography = homography / (homography[2] @ [*plane.mean(axis=0), 1.0])
    if not (plane @ homography[2, :2] + homography[2, 2] > 0).all():
        raise InputError("[scale] points_px and their places go around in different orders; give a place for each")
    if (np.linalg.det(homography) > 0) != view.up:
        other = "down" if view.up else "up"
        raise InputError(
            "[scale] points_px and their places are mirror images of each other: give places with y "
            f'counter-clockwise from x, seen from above, or looks = "{other}"'
        )
    error = _CLICK / float(np.linalg.norm(plane - plane.mean(axis=0)))
    return replace(view, homography=homography, scale_error=error)


def _lens(table: Mapping[str, Any]) -> Lens:
    focal, centre, distortion = (_numbers(table.get(name)) for name in _KEYS["lens"])
    for name, numbers, count in zip(_KEYS["lens"], (focal, centre, distortion), (2, 2, 5), strict=True):
        if numbers.shape != (count,):
            raise InputError(f"[lens] {name}: give {count} numbers, as OpenCV calibrates them")
    if not (focal >= 1).all():
        raise InputError("[lens] focal_px: give numbers of pixels, 1 or more")
    return Lens(np.array([[focal[0], 0, centre[0]], [0, focal[1], centre[1]], [0, 0, 1.0]]), distortion)


def _markers(table: Any, number: int) -> Markers:
    with naming(f"[[robots]] {number}"):
        table = _read("robots", table)
        tag = table.get("tag")
        colours = {key: table[key] for key in (*BANDS, *DOTS) if key in table}
        if tag is None and (missing := [key for key in BANDS if key not in colours]):
            raise InputError(
                f'no {missing[0]}; give two bands of other colours, front = "red" and rear = "green", or a tag'
            )
        hues = {key: _hue(colour, key) for key, colour in colours.items()}
        for one, other in combinations(sorted(hues), 2):
            if abs(math.remainder(hues[one] - hues[other], 360)) < _APART:
                raise InputError(f"{one} and {other} have nearly the same colour; give them others")
        turned = table.get("turned_deg", 0)
        if _numbers(turned).shape != () or (turned and tag is None):
            raise InputError(f"turned_deg = {turned!r}; give the degrees by which the tag's upper edge is turned")
        tag = None if tag is None else _tag_number(tag, "tag")
        name, ahead, apart = str(table.get("name", number)), table.get("ahead", 0.0), table.get("apart", math.nan)
        if not re.fullmatch(r"[\w .-]+", name):
            raise InputError(f"name = {name!r}; give letters, digits and - . _, as for a file")
        return Markers(name, hues, colours, tag, float(ahead), float(apart), math.radians(turned))


def _hue(colour: object, key: str) -> float:
    """Return the hue of a colour [deg], red 0, green 120, blue 240."""
    if not isinstance(colour, str) or not (colour in HUES or re.fullmatch("#[0-9a-fA-F]{6}", colour)):
        raise InputError(f'{key} = {colour!r}; give {", ".join(HUES)}, or a colour of the picture, "#c03020"')
    if colour in HUES:
        return float(HUES[colour])
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    along, across = red - (green + blue) / 2, math.sqrt(3) / 2 * (green - blue)
    if math.hypot(along, across) < 30:
        raise InputError(f'{key} = "{colour}" is nearly grey; give the marker a strong colour')
    return math.degrees(math.atan2(across, along)) % 360


def _points(table: Mapping[str, Any], key: str, fewest: int) -> Floats:
    points = _numbers(table[key])
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < fewest:
        raise InputError(f"{key}: give {fewest} points or more, [[100, 650], [900, 650], …]")
    return points


def _numbers(value: object) -> Floats:
    """Return an array of finite numbers; an empty one if the value is none."""
    try:
        numbers = np.array(value)
    except ValueError:  # rows of different lengths
        return np.empty(0)
    return numbers.astype(float) if numbers.dtype.kind in "if" and (np.abs(numbers) < 1e9).all() else np.empty(0)


def _tag_number(value: object, key: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1000:
        raise InputError(f"{key} = {value!r}; give the number of a tag, 0 to 999")
    return value
