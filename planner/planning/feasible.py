"""Paths that a robot can follow, near a path that it cannot follow as it was drawn.

A candidate is accepted if its pivot turns no tighter than the robot can, with a margin, and if it keeps the shape
of the drawn path. The nearest path is sought several times, each time with a wider turn: a wider turn leaves more
margin, and the coarser poses that belong to it converge where finer ones do not. Or corners are rounded by arcs.
Lengths in l.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from planner.paths.distance import two_sided
from planner.paths.nearest_path import nearest_path, pose_spacing
from planner.paths.path import Path2D, smoothed, steps_of
from planner.paths.tractrix import Drift, Reference, reference
from planner.paths.units import Swimmer, extent, place_in_lab
from planner.planning.conditions import Detour, Swing
from planner.planning.request import DECLARING, Corner, Progress, tell
from planner.vehicle.vehicle import Vehicle
from sim.arrays import Floats
from sim.io.errors import InputError

AS_DRAWN = 0.85  # share of the pivot's largest curvature up to which a path is followed as it was drawn
ROOMS = (0.92, 0.85, 0.7, 0.55, 0.35, 0.2)  # shares of it that the nearest path may use
TIGHTEST = 0.95  # a reference that needs more than this share is refused
LOST = 0.3  # share of the drawn path's extent; a declared path that is further off is refused
ROUNDED = 0.0  # the way that rounds corners
Way = float  # ROUNDED, or a share of ROOMS
_SMALL = 0.1  # of the path's extent: what smoothing may move a path that is noisy
_NOISY = 1.5  # ratio of a path's length to that of the smoothed path
_FEWEST_POSES = 5  # of the nearest path; a path with fewer is too small for such turns
_FILLET_ROOM = 0.7
_SPACING = 0.02  # of points on the reference, in l
_MOST_POINTS = 150_000
_MINIMAX = 3.4  # cost of the minimax distance over that of the root mean square
_ROUNDING = 1e-9  # relative
_POINTS_A_POSE = 80  # points of a reference that cost as much as one pose of the nearest path
CORNER = math.radians(15.0)  # larger kinks are corners; smaller ones belong to curves


class Feasibility(NamedTuple):
    """What decides whether a path can be followed, and which one is declared if it cannot."""

    robot: Swimmer  # whose lengths messages are in
    vehicle: Vehicle  # its pivot radius limits the curvature
    rod: float  # from the pivot to the tracked point
    drift: Drift  # what carries the robot off its heading
    corner: Corner  # what to do with places that are too tight
    time_weight: float = 0.0  # as in `planner.paths.nearest_path` [l²]

    @property
    def ways(self) -> tuple[Way, ...]:
        """Ways to change a path, in order of preference."""
        return {"error": (), "fillet": (ROUNDED,)}.get(self.corner, ROOMS)


@dataclass(frozen=True)
class Declared:
    """The declared path with its tractrix, and its distances from the path as drawn [l]."""

    reference: Reference  # the path and the pivot that follows it
    curvature: float  # largest of the pivot's reference
    off_drawn: float = 0.0  # largest distance of a declared point from the drawn path
    missed: float = 0.0  # largest distance of a drawn point from the declared path
    warnings: tuple[str, ...] = ()  # in words
    swing: Swing | None = None  # that takes time
    detours: tuple[Detour, ...] = ()  # around obstacles, in the order of the path

    def moved(self, reference: Reference, drawn: Path2D, curvature: float | None = None) -> Declared:
        """Declare another reference in place of this one, with `curvature` or its own one."""
        off_drawn, missed = two_sided(reference.p, drawn.polyline())
        curvature = float(np.abs(reference.curvature).max()) if curvature is None else curvature
        return replace(self, reference=reference, curvature=curvature, off_drawn=off_drawn, missed=missed)

    def same(self, other: Declared) -> bool:
        """Tell whether the pivot has the same way."""
        return self is other or np.array_equal(self.reference.q, other.reference.q)


def feasible(raw: Path2D, feasibility: Feasibility, progress: Progress | None = None) -> Declared | None:
    """Find the path to declare: the first way that is accepted; None if there is none.

    Raises:
        InputError: corners are not allowed, and the path has one.
    """
    accepted = as_drawn(raw, feasibility)
    if accepted is not None or smoothing_of_noise(raw, feasibility.vehicle) is not None:
        return accepted
    for way in feasibility.ways:
        accepted = changed(raw, feasibility, way, progress)
        if accepted is not None:
            return accepted
    return None


def as_drawn(raw: Path2D, feasibility: Feasibility) -> Declared | None:
    """Take the path as it was drawn, if the robot can follow it.

    Raises:
        InputError: corners are not allowed, and the path has one.
    """
    drawn = reference(raw, feasibility.rod, spacing(raw), feasibility.drift)
    sharpest = float(np.abs(drawn.curvature).max()) * feasibility.vehicle.pivot_radius
    if sharpest <= AS_DRAWN and not feasibility.time_weight:
        return _accepted(raw, drawn, feasibility)
    if feasibility.corner != "error":
        return None
    _refuse_corner(raw, feasibility.robot)
    return _accepted(raw, drawn, feasibility)


def changed(raw: Path2D, feasibility: Feasibility, way: Way, progress: Progress | None = None) -> Declared | None:
    """Change a path in one way so that the robot can follow it; None if that fails, or loses the shape."""
    vehicle, rod, drift, corner = feasibility.vehicle, feasibility.rod, feasibility.drift, feasibility.corner
    if way == ROUNDED:
        path = _rounded(raw, feasibility)
    elif raw.length < _FEWEST_POSES * pose_spacing(raw, vehicle.pivot_radius / way):
        return None
    else:
        path = nearest_path(
            raw, max(rod, 0.0), vehicle.pivot_radius / way, drift=drift, minimax=corner == "minimax",
            time_weight=feasibility.time_weight, progress=lambda share: tell(progress, DECLARING, share),
        )  # fmt: skip
    return _accepted(raw, reference(path, rod, spacing(path), drift), feasibility)


def _accepted(raw: Path2D, followed: Reference, feasibility: Feasibility) -> Declared | None:
    """Accept a reference that turns wide enough and keeps the shape of the drawn path."""
    curvature = float(np.abs(followed.curvature).max())
    if curvature > TIGHTEST / feasibility.vehicle.pivot_radius:
        return None
    declared = Declared(followed, curvature, *two_sided(followed.p, raw.polyline()))
    lost = min(LOST * max(extent(raw)), feasibility.vehicle.turn_radius)
    return None if max(declared.off_drawn, declared.missed) > lost else declared


def smoothing_of_noise(raw: Path2D, vehicle: Vehicle) -> float | None:
    """Return the length over which a noisy path is to be smoothed; None: it is not noisy.

    A noisy path is much longer than after smoothing, and no scale helps. A path that smoothing changes as a whole
    is small, not noisy.
    """
    length = float(f"{vehicle.turn_radius / 2:.2g}")
    if not length < raw.length / 2:
        return None
    smooth, moved = smoothed(raw, length)
    noisy = raw.length >= _NOISY * smooth.length and moved <= _SMALL * max(extent(raw))
    return length if noisy else None


def cost(raw: Path2D, feasibility: Feasibility, way: Way) -> float:
    """Estimate the work of `changed`, in poses of the nearest path."""
    points = raw.length / spacing(raw) / _POINTS_A_POSE
    if way == ROUNDED:
        return 14 * points
    poses = raw.length / pose_spacing(raw, feasibility.vehicle.pivot_radius / way)
    return points + poses * (_MINIMAX if feasibility.corner == "minimax" else 1.0)


def spacing(path: Path2D) -> float:
    """Choose the spacing of the reference's points."""
    return max(_SPACING, path.length / _MOST_POINTS)


def _refuse_corner(raw: Path2D, robot: Swimmer) -> None:
    """Refuse a path with a sharp corner, and name the corner."""
    angle = np.abs(kinks(raw))
    sharpest = place_of_largest(angle)
    if angle[sharpest] > CORNER:
        x, y = raw.points[sharpest]
        raise InputError(
            f"corner of {math.degrees(angle[sharpest]):.0f} degrees at {place_in_lab(x, y, robot)}; "
            "round it, or allow corner = nearest"
        )


def place_of_largest(values: Floats) -> int:
    """Return the place of the largest value above 0; of values that only rounding tells apart, the first one."""
    return int(np.flatnonzero(values >= values.max() * (1 - _ROUNDING))[0])


def _rounded(raw: Path2D, feasibility: Feasibility) -> Path2D:
    """Round corners by the smallest radius that leaves the pivot some room."""
    limit = _FILLET_ROOM / feasibility.vehicle.pivot_radius
    low, high = 0.0, min(largest_fillet(raw), math.hypot(feasibility.rod, 1 / limit))

    def tightest(radius: float) -> float:
        path = fillet(raw, radius)
        return float(np.abs(reference(path, feasibility.rod, spacing(path), feasibility.drift).curvature).max())

    if tightest(high) > limit:
        return fillet(raw, high)
    for _ in range(12):
        middle = (low + high) / 2
        low, high = (low, middle) if tightest(middle) <= limit else (middle, high)
    return fillet(raw, high)


def kinks(path: Path2D) -> Floats:
    """Compute the signed turning angle [rad] at every point; zero at the ends of an open path."""
    edges = np.diff(path.polyline(), axis=0)
    direction = np.arctan2(edges[:, 1], edges[:, 0])
    if path.closed:
        turn = direction - np.roll(direction, 1)
    else:
        turn = np.concatenate([[0.0], np.diff(direction), [0.0]])
    return np.asarray((turn + math.pi) % (2 * math.pi) - math.pi)


def largest_fillet(path: Path2D) -> float:
    """Compute the largest radius that fits all corners; infinite without corners."""
    angle = np.abs(kinks(path))
    reach = np.where(angle > CORNER, np.tan(angle / 2), 0.0)
    edges = np.linalg.norm(np.diff(path.polyline(), axis=0), axis=1)
    both = reach[: len(edges)] + np.roll(reach, -1)[: len(edges)]
    fits = edges[both > 0] / both[both > 0]
    return float(fits.min()) if len(fits) else math.inf


def fillet(path: Path2D, radius: float) -> Path2D:
    """Replace corners by arcs of `radius`, tangent to the edges; at most `largest_fillet`."""
    angle = kinks(path)
    corner = np.abs(angle) > CORNER
    if radius == 0 or not corner.any():
        return path
    points = path.points
    count = len(points)
    reach = np.where(corner, radius * np.tan(np.abs(angle) / 2), 0.0)
    edges = np.diff(path.polyline(), axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    rounded: list[Floats] = []
    for i in range(count):
        if not corner[i]:
            rounded.append(points[i : i + 1])
            continue
        into = edges[i - 1] / lengths[i - 1]
        start = points[i] - reach[i] * into
        inward = math.copysign(1.0, angle[i]) * np.array([-into[1], into[0]])
        centre = start + radius * inward
        steps = np.linspace(0, angle[i], max(8, steps_of(abs(angle[i]), math.radians(2))))
        spoke = start - centre
        c, s = np.cos(steps), np.sin(steps)
        rounded.append(centre + np.stack([c * spoke[0] - s * spoke[1], s * spoke[0] + c * spoke[1]], 1))
    return Path2D(np.concatenate(rounded), path.closed)
