"""Pictures of paths and tracks: the path as given, the declared path with the stated error, the prediction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from common.arrays import Floats
from common.units import format_length
from planner.paths.obstacles import FreeSpace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RAW, DECLARED, PREDICTED, REPLAYED = "#b0b0b0", "#1a1a1a", "#2a7fba", "#c8452f"
START = "#2b8a3e"
KEEP_OUT, BODY = "#d8b365", "#8a4fa3"
_START = 0.5  # length of the arrow of the heading, in l
_DIRECTIONS, _DIRECTION = (
    (0.2, 0.5, 0.8),
    0.02,
)  # of the path: where arrows say which way it goes, and their length
_WIDE, _HIGH = 0.65, 1.2  # of a letter, over the size of the font
_ASIDE = (1.0, 2.0, 3.0)  # distances of a label from its point, over the size of the font
_WAYS = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1], [0, 1], [0, -1], [1, 0], [-1, 0]])


def draw_tracks(axes: Axes, raw: Floats, declared: Floats, stated: float, length_scale: float) -> None:
    """Draw the raw and the declared path with a band of the stated error, on axes in cm.

    Args:
        axes: where to draw.
        raw, declared: points (n, 2), in l.
        stated: half the width of the band, in l.
        length_scale: l in m.
    """
    from matplotlib.collections import PolyCollection

    cm = 100 * length_scale
    edges = cm * band(declared, stated)
    label = f"stated error {format_length(stated * length_scale)}"
    axes.add_collection(PolyCollection([edges], color="#2a7fba", alpha=0.25, lw=0, label=label))
    axes.plot(*(cm * raw.T), color=RAW, lw=1.0, label="path as given")
    axes.plot(*(cm * declared.T), color=DECLARED, lw=1.2, label="declared")
    axes.set_aspect("equal")
    axes.set_xlabel("x [cm]")
    axes.set_ylabel("y [cm]")


def draw_start(axes: Axes, start: tuple[float, float, float], way: Floats, length: float) -> None:
    """Draw where the robot starts and how it heads, and along the path which way it goes, on axes in cm.

    Args:
        axes: where to draw.
        start: x, y and heading, in l and rad.
        way: points of the path (n, 2), in cm.
        length: of a tail, in cm.
    """
    place, heading = length * np.array(start[:2]), np.array([np.cos(start[2]), np.sin(start[2])])
    axes.plot(*place, "o", color=START, ms=5, label="start, with heading")
    tip = place + _START * length * heading
    axes.annotate(
        "", (tip[0], tip[1]), (place[0], place[1]), arrowprops={"arrowstyle": "-|>", "color": START, "lw": 1.5}
    )
    axes.update_datalim([tip])
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(way, axis=0).T)))
    for share in _DIRECTIONS:
        ends = (share + np.array([_DIRECTION, 0.0])) * along[-1]
        (x, before_x), (y, before_y) = (np.interp(ends, along, column) for column in way.T)
        axes.annotate(
            "", (x, y), (before_x, before_y), arrowprops={"arrowstyle": "->", "color": DECLARED, "lw": 1.2}
        )


def draw_regions(axes: Axes, free_space: FreeSpace, length_scale: float) -> None:
    """Draw obstacles, given in l, as areas, and walls as lines, on axes in cm; `length_scale` is l in m."""
    from matplotlib.collections import PolyCollection

    cm = 100 * length_scale
    outlines = [cm * region.corners for region in free_space.regions]
    axes.add_collection(PolyCollection(outlines, color=KEEP_OUT, lw=0))  # at once: a map has thousands
    axes.autoscale_view()
    if free_space.walls is not None:
        corners = cm * free_space.walls.corners
        axes.plot(*np.concatenate([corners, corners[:1]]).T, color=KEEP_OUT, lw=3)


def label_points(axes: Axes, points: Floats, words: Sequence[str], colour: str, size: float) -> None:
    """Write words beside points (n, 2), each on the side where it covers least of other words and points.

    Args:
        axes: with all that is drawn, so that their limits are known.
        points: in the axes' own units.
        words: one for each point.
        colour: of all.
        size: of the font, in points.
    """
    axes.apply_aspect()
    dots = axes.transData.transform(points) * 72 / axes.figure.get_dpi() if len(points) else points
    half = 0.5 * size * np.array([0.5, 0.5])
    taken = [(dot, half) for dot in dots]
    for point, dot, text in zip(points, dots, words, strict=True):
        box = 0.5 * size * np.array([_WIDE * len(text), _HIGH])
        places = [way * (box + 0.4 * size * aside) for aside in _ASIDE for way in _WAYS]

        def covered(place: Floats, dot: Floats = dot, box: Floats = box) -> float:
            return sum(
                float(np.maximum(box + other - np.abs(dot + place - centre), 0).prod()) for centre, other in taken
            )

        best = min(places, key=covered)
        taken.append((dot + best, box))
        axes.annotate(text, point, textcoords="offset points", xytext=best, ha="center", va="center",
                      fontsize=size, color=colour)  # fmt: skip


def band(polyline: Floats, width: float) -> Floats:
    """Return the outline (2 n, 2) of a band about a line (n, 2), `width` wide on each side."""
    tangent = np.gradient(polyline, axis=0)
    norm = np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    left = np.stack([-tangent[:, 1], tangent[:, 0]], 1) / norm * width
    return np.concatenate([polyline + left, (polyline - left)[::-1]])
