"""The declared path: the drawn path made feasible for the robot.

A path that the pivot can follow with some margin is declared as it is. Otherwise the nearest feasible path is
declared (`planner.paths.nearest_path`), by root mean square or by the largest distance; or corners are rounded by
arcs; or the path is rejected. The distance between the declared and the drawn path is reported in both directions:
a missed corner is a point of the drawn path that is far from the declared one.

A rejected path gets a remedy: smoothing or a scale, tried before it is recommended. The search is bounded by its
work, counted in poses of the nearest path, so the answer does not depend on the machine. The cheapest ways are
tried first, and each success bounds the scales that are still worth trying. When the allowed work is done, the
answer is the best so far.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import get_args

import numpy as np

from planner.paths.path import Path2D, smoothed
from planner.paths.tractrix import reference
from planner.paths.units import LONGEST, extent, in_lab, place_in_lab
from planner.planning.feasible import (
    LOST,
    TIGHTEST,
    Declared,
    Feasibility,
    Way,
    as_drawn,
    changed,
    cost,
    feasible,
    place_of_largest,
    smoothing_of_noise,
    spacing,
)
from planner.planning.request import REMEDY, Corner, Progress, tell
from sim.io.errors import InputError

WARN = 0.1  # share of the extent; a declared path that is further off gets a warning
FAR = 0.3  # l; so does one that is further off than this
SCALES = (1.5, 2.0, 2.5, 3.5, 5.0, 7.5, 12.0, 20.0)
MOST_WORK = 20_000.0  # poses of the nearest path
_SMOOTHINGS = (1.0, 1.5, 2.2, 3.2, 4.7, 7.0)  # over the length that shows noise
_FIRST = 0.5  # of the turn radius: the first length over which a path that is not noisy is smoothed


def declare(raw: Path2D, feasibility: Feasibility, progress: Progress | None = None) -> Declared:
    """Choose the path that the robot will follow.

    Raises:
        InputError: the path is too tight (the message names the place, the radii and a change that helps), or
            corner or time weight are not allowed.
    """
    if feasibility.corner not in get_args(Corner):
        raise InputError(f"corner {feasibility.corner!r}; allowed are {', '.join(get_args(Corner))}")
    if not (math.isfinite(feasibility.time_weight) and feasibility.time_weight >= 0):
        raise InputError(f"time weight {feasibility.time_weight:g}; give a number of l², 0 or more")
    if feasibility.time_weight and feasibility.corner not in ("nearest", "minimax"):
        raise InputError(f"a time weight needs corner = nearest or minimax, not {feasibility.corner}")
    accepted = feasible(raw, feasibility, progress)
    if accepted is None:
        raise InputError(_too_tight(raw, feasibility, progress))
    robot, distance = feasibility.robot, max(accepted.off_drawn, accepted.missed)
    if distance > WARN * max(extent(raw)):
        warning = (
            f"the shape is lost in part: the declared path is up to {in_lab(distance, robot)} from the drawn one, "
            f"which is {in_lab(max(extent(raw)), robot)} across; draw it larger"
        )
    elif distance > FAR:
        warning = (
            f"the declared path leaves the drawn one by up to {in_lab(distance, robot)}, where the robot cannot "
            "turn so tightly; draw wider turns"
        )
    else:
        return accepted
    return replace(accepted, warnings=(warning,))


def _too_tight(raw: Path2D, feasibility: Feasibility, progress: Progress | None) -> str:
    """Say where a path is too tight, and what to change."""
    robot, vehicle = feasibility.robot, feasibility.vehicle
    drawn = reference(raw, feasibility.rod, spacing(raw), feasibility.drift)
    curvature = np.abs(drawn.curvature)
    worst = place_of_largest(curvature)
    x, y = drawn.p[worst]
    return (
        f"path too tight at {place_in_lab(x, y, robot)}: the pivot would turn with radius "
        f"{in_lab(1 / float(curvature[worst]), robot)}, the robot can with "
        f"{in_lab(vehicle.pivot_radius / TIGHTEST, robot)}; its circle has radius "
        f"{in_lab(vehicle.turn_radius, robot)}, and the nearest path that it can follow has lost the shape; "
        f"{remedy(raw, feasibility, progress)}"
    )


def remedy(raw: Path2D, feasibility: Feasibility, progress: Progress | None = None) -> str:
    """Say what helps a path that is too tight."""
    search = _Search(feasibility, progress)
    robot = feasibility.robot
    noise = smoothing_of_noise(raw, feasibility.vehicle)
    if noise is not None:
        found = search.smoothing(raw, noise, LOST)
        if found is None:
            return "it looks noisy, and no smoothing was found that keeps its shape: draw it with less noise"
        length, smooth, moved = found
        return (
            f"it looks noisy: smoothed over {in_lab(length, robot)} it is {in_lab(smooth.length, robot)} long, "
            f"not {in_lab(raw.length, robot)}, and moves by up to {in_lab(moved, robot)}; "
            f"give --smooth {length:g}l"
        )
    scale = search.scale(raw)
    if scale is not None:
        return f"scale the path by {scale:.3g}"
    found = search.smoothing(raw, _FIRST * feasibility.vehicle.turn_radius, LOST)
    if found is None:
        return "draw it with wider turns: neither a larger scale nor smoothing was found to help"
    length, _, moved = found
    return (
        f"smooth it over {in_lab(length, robot)}, which moves it by up to {in_lab(moved, robot)}: "
        f"give --smooth {length:g}l"
    )


class _Search:
    """A search whose work is bounded."""

    def __init__(self, feasibility: Feasibility, progress: Progress | None):
        self._feasibility, self._progress = feasibility, progress
        self._work = 0.0

    def _allowed(self, work: float) -> bool:
        """Count work, unless it is more than is left."""
        if self._work + work > MOST_WORK:
            return False
        self._work += work
        self._told()
        return True

    def _ways(self) -> Iterator[Way | None]:
        """List the path as drawn (None), and every other way to change it, the cheapest first."""
        yield None
        yield from self._feasibility.ways[::-2]

    def _works(self, path: Path2D, way: Way | None) -> bool:
        """Try one way; False where no work is left for it, too."""
        if way is None:
            return as_drawn(path, self._feasibility) is not None
        if smoothing_of_noise(path, self._feasibility.vehicle) is not None:
            return False
        if not self._allowed(cost(path, self._feasibility, way)):
            return False
        return changed(path, self._feasibility, way, self._told) is not None

    def _told(self, _: float = 0.0) -> None:
        """Tell that the search goes on."""
        tell(self._progress, REMEDY, self._work / MOST_WORK)

    def scale(self, raw: Path2D) -> float | None:
        """Find a small one of SCALES at which the path is accepted, by bisection; None if there is none."""
        scales = [scale for scale in SCALES if raw.length * scale < LONGEST]
        best = len(scales)
        for way in self._ways():
            low, high = 0, best
            while low < high:
                middle = (low + high) // 2
                if self._works(raw.scaled(scales[middle]), way):
                    best = high = middle
                else:
                    low = middle + 1
        return scales[best] if best < len(scales) else None

    def smoothing(self, raw: Path2D, first: float, most: float) -> tuple[float, Path2D, float] | None:
        """Find a length over which the path, smoothed, is accepted; return it, that path, and how far it moved.

        Args:
            raw: the path as drawn.
            first: length to begin with.
            most: share of the path's extent by which smoothing may move it.
        """
        for share in _SMOOTHINGS:
            length = float(f"{first * share:.2g}")
            if not length < raw.length / 2:
                return None
            smooth, moved = smoothed(raw, length)
            if moved > most * max(extent(raw)):
                return None
            if any(self._works(smooth, way) for way in self._ways()):
                return length, smooth, moved
        return None
