"""The declared path: the drawn path made feasible for the robot.

A path that the pivot can follow with some margin is declared as it is. Otherwise the nearest feasible path is
declared (`planner.paths.nearest_feasible`), by root mean square or by the largest distance; or corners are rounded
by arcs (`planner.paths.fillets`); or the path is rejected. The distance between the declared and the drawn path is
reported in both directions: a missed corner is a point of the drawn path that is far from the declared one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, get_args

import numpy as np

from planner.paths.distance import two_sided
from planner.paths.fillets import CORNER, fillet, kinks, largest_fillet
from planner.paths.nearest_feasible import nearest_path
from planner.paths.path import Path2D, smoothed
from planner.paths.tractrix import Drift, Reference, reference
from planner.paths.units import LONGEST, extent, in_lab, place_in_lab
from planner.planning.request import Corner
from planner.vehicle.vehicle import Vehicle
from sim.io.errors import InputError
from sim.model.robot import Robot

AS_DRAWN = 0.85  # share of the pivot's largest curvature up to which a path is followed as it was drawn
ROOMS = (0.92, 0.85, 0.7, 0.55)  # shares of it that the nearest path may use
TIGHTEST = 0.95  # a reference that needs more than this share is refused
LOST = 0.3  # share of the drawn path's extent; a declared path that is further off is refused
WARN = 0.1  # share of the extent; a declared path that is further off gets a warning
_FILLET_ROOM = 0.7
_SPACING = 0.02  # of points on the reference, in l
_MOST_POINTS = 150_000
_SCALES = (1.5, 2.0, 2.5, 3.5, 5.0, 7.5, 12.0, 20.0)  # that a message may suggest
_NOISY = 1.5  # ratio of a path's length to that of the smoothed path
_SMALL = 0.1  # of the path's extent: what smoothing may move a path that is noisy


class Feasibility(NamedTuple):
    """What decides whether a path can be followed, and which one is declared if it cannot."""

    robot: Robot  # whose lengths messages are in
    vehicle: Vehicle  # its pivot radius limits the curvature
    rod: float  # from the pivot to the tracked point
    drift: Drift  # what carries the robot off its heading
    corner: Corner  # what to do with places that are too tight
    time_weight: float = 0.0  # as in `planner.paths.nearest_feasible` [l²]


@dataclass(frozen=True)
class Declared:
    """The declared path with its tractrix, and its distances from the path as drawn [l]."""

    reference: Reference  # the path and the pivot that follows it
    curvature: float  # largest of the pivot's reference
    off_drawn: float  # largest distance of a declared point from the drawn path
    missed: float  # largest distance of a drawn point from the declared path
    warnings: tuple[str, ...]  # in words


def declare(raw: Path2D, feasibility: Feasibility) -> Declared:
    """Choose the path that the robot will follow.

    Raises:
        InputError: the path is too tight (the message names the place, the radii and a scale that works), or
            corner or time weight are not allowed.
    """
    if feasibility.corner not in get_args(Corner):
        raise InputError(f"corner {feasibility.corner!r}; allowed are {', '.join(get_args(Corner))}")
    if not (math.isfinite(feasibility.time_weight) and feasibility.time_weight >= 0):
        raise InputError(f"time weight {feasibility.time_weight:g}; give a number of l², 0 or more")
    if feasibility.time_weight and feasibility.corner not in ("nearest", "minimax"):
        raise InputError(f"a time weight needs corner = nearest or minimax, not {feasibility.corner}")
    followed = _try(raw, feasibility)
    if followed is None:
        raise InputError(_too_tight(raw, feasibility))
    curvature = float(np.abs(followed.curvature).max())
    off_drawn, missed = two_sided(followed.p, raw.polyline())
    distance = max(off_drawn, missed)
    too_sharp = curvature > TIGHTEST / feasibility.vehicle.pivot_radius
    if too_sharp or distance > _lost(raw, feasibility.vehicle):
        raise InputError(_too_tight(raw, feasibility))
    warnings, robot = [], feasibility.robot
    if distance > WARN * max(extent(raw)):
        warnings.append(
            f"the shape is lost in part: the declared path is up to {in_lab(distance, robot)} from the drawn one, "
            f"which is {in_lab(max(extent(raw)), robot)} across; draw it larger"
        )
    return Declared(followed, curvature, off_drawn, missed, tuple(warnings))


def _try(raw: Path2D, feasibility: Feasibility) -> Reference | None:
    """Find a reference that can be followed; None if there is none."""
    _, vehicle, rod, drift, corner, time_weight = feasibility
    limit = TIGHTEST / vehicle.pivot_radius
    drawn = reference(raw, rod, _spacing(raw), drift)
    sharpest = np.abs(drawn.curvature).max()
    if sharpest * vehicle.pivot_radius <= AS_DRAWN and not time_weight:
        return drawn
    if corner == "error":
        _refuse_corner(raw, feasibility.robot)
        return drawn if sharpest <= limit else None
    if _smoothing_advice(raw, vehicle.turn_radius / 4, feasibility.robot):
        return None
    if corner == "fillet":
        path = _rounded(raw, feasibility)
        rounded = reference(path, rod, _spacing(path), drift)
        return rounded if np.abs(rounded.curvature).max() <= limit else None
    for room in ROOMS:
        path = nearest_path(
            raw, max(rod, 0.0), vehicle.pivot_radius / room, drift=drift, minimax=corner == "minimax",
            time_weight=time_weight,
        )  # fmt: skip
        nearest = reference(path, rod, _spacing(path), drift)
        if np.abs(nearest.curvature).max() <= limit:
            return nearest
    return None


def _lost(raw: Path2D, vehicle: Vehicle) -> float:
    """Return the distance at which a declared path has lost the shape."""
    return min(LOST * max(extent(raw)), vehicle.turn_radius)


def _spacing(path: Path2D) -> float:
    """Choose the spacing of the reference's points."""
    return max(_SPACING, path.length / _MOST_POINTS)


def _refuse_corner(raw: Path2D, robot: Robot) -> None:
    """Refuse a path with a sharp corner, and name the corner."""
    angle = np.abs(kinks(raw))
    sharpest = int(angle.argmax())
    if angle[sharpest] > CORNER:
        x, y = raw.points[sharpest]
        raise InputError(
            f"corner of {math.degrees(angle[sharpest]):.0f} degrees at {place_in_lab(x, y, robot)}; "
            "round it, or allow corner = nearest"
        )


def _rounded(raw: Path2D, feasibility: Feasibility) -> Path2D:
    """Round corners by the smallest radius that leaves the pivot some room."""
    limit = _FILLET_ROOM / feasibility.vehicle.pivot_radius
    low, high = 0.0, min(largest_fillet(raw), math.hypot(feasibility.rod, 1 / limit))

    def tightest(radius: float) -> float:
        path = fillet(raw, radius)
        return float(np.abs(reference(path, feasibility.rod, _spacing(path), feasibility.drift).curvature).max())

    if tightest(high) > limit:
        return fillet(raw, high)
    for _ in range(12):
        middle = (low + high) / 2
        low, high = (low, middle) if tightest(middle) <= limit else (middle, high)
    return fillet(raw, high)


def _too_tight(raw: Path2D, feasibility: Feasibility) -> str:
    """Say where a path is too tight, and what to change."""
    robot, vehicle = feasibility.robot, feasibility.vehicle
    drawn = reference(raw, feasibility.rod, _spacing(raw), feasibility.drift)
    curvature = np.abs(drawn.curvature)
    worst = int(curvature.argmax())
    x, y = drawn.p[worst]
    remedy = _smoothing_advice(raw, vehicle.turn_radius / 4, feasibility.robot)
    scale = None if remedy else _working_scale(raw, feasibility)
    remedy = remedy or (f"scale the path by {scale:.3g}" if scale else "smooth the path, with --smooth LENGTH")
    return (
        f"path too tight at {place_in_lab(x, y, robot)}: the pivot would turn with radius "
        f"{in_lab(1 / float(curvature[worst]), robot)}, the robot can with "
        f"{in_lab(vehicle.pivot_radius / TIGHTEST, robot)}; its circle has radius "
        f"{in_lab(vehicle.turn_radius, robot)}, and the nearest path that it can follow has lost the shape; "
        f"{remedy}"
    )


def _working_scale(raw: Path2D, feasibility: Feasibility) -> float | None:
    """Find the first of _SCALES at which the path is accepted; None if there is none."""

    def works(factor: float) -> bool:
        larger = raw.scaled(factor)
        followed = _try(larger, feasibility)
        if followed is None or np.abs(followed.curvature).max() > TIGHTEST / feasibility.vehicle.pivot_radius:
            return False
        return max(two_sided(followed.p, larger.polyline())) <= _lost(larger, feasibility.vehicle)

    for factor in _SCALES:
        if raw.length * factor < LONGEST and works(factor):
            return factor
    return None


def _smoothing_advice(raw: Path2D, radius: float, robot: Robot) -> str:
    """Advise to smooth a path that is much longer than after smoothing: it is noisy, and no scale helps.

    A path that smoothing changes as a whole is small, not noisy.
    """
    length = float(f"{2 * radius:.2g}")
    if not length < raw.length / 2:
        return ""
    smooth, moved = smoothed(raw, length)
    if raw.length < _NOISY * smooth.length or moved > _SMALL * max(extent(raw)):
        return ""
    return (
        f"it looks noisy: smoothed over {in_lab(length, robot)} it is {in_lab(smooth.length, robot)} long, not "
        f"{in_lab(raw.length, robot)}, and moves by up to {in_lab(moved, robot)}; give --smooth {length:g}"
    )
