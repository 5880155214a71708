"""The declared path: the drawn path made feasible for the robot.

A path that the pivot can follow with some margin is declared as it is. Otherwise the nearest feasible path is
declared (`planner.paths.nearest_path`), by root mean square or by the largest distance; or corners are rounded by
arcs; or the path is rejected. The nearest path is sought several times, each time with a wider turn: a wider turn
leaves more margin, and the coarser poses that belong to it converge where finer ones do not. A candidate is
accepted if its pivot turns no tighter than the robot can, with a margin, and if it keeps the shape of the drawn
path. The distance between the two is reported in both directions: a missed corner is a point of the drawn path
that is far from the declared one.

A rejected path gets a remedy: smoothing or a scale, tried before it is recommended. The search is bounded by its
work, counted in poses of the nearest path, so the answer does not depend on the machine. The cheapest ways are
tried first, and each success bounds the scales that are still worth trying. When the allowed work is done, the
answer is the best so far. Lengths in l.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple, get_args

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from planner.paths.distance import two_sided
from planner.paths.nearest_path import nearest_path, pose_spacing
from planner.paths.path import Path2D, smoothed, steps_of
from planner.paths.tractrix import Drift, Reference, closest, reference
from planner.paths.units import LONGEST, Scales, extent, in_lab, place_in_lab
from planner.planning.conditions import Detour
from planner.planning.request import Corner
from planner.progress import DECLARING, REMEDY, ProgressCallback, tell
from planner.vehicle.vehicle import Vehicle

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
WARN = 0.1  # share of the extent; a declared path that is further off gets a warning
FAR = 0.3  # l; so does one that is further off than this
SCALES = (1.5, 2.0, 2.5, 3.5, 5.0, 7.5, 12.0, 20.0)
MOST_WORK = 20_000.0  # poses of the nearest path
_SMOOTHINGS = (1.0, 1.5, 2.2, 3.2, 4.7, 7.0)  # over the length that shows noise
_FIRST = 0.5  # of the turn radius: the first length over which a path that is not noisy is smoothed


class Feasibility(NamedTuple):
    """What decides whether a path can be followed, and which one is declared if it cannot."""

    robot: Scales  # whose lengths messages are in
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
class FeasiblePath:
    """The declared path with its tractrix, and its distances from the path as drawn [l]."""

    reference: Reference  # the path and the pivot that follows it
    curvature: float  # largest of the pivot's reference
    off_drawn: float = 0.0  # largest distance of a declared point from the drawn path
    missed: float = 0.0  # largest distance of a drawn point from the declared path
    warnings: tuple[str, ...] = ()  # in words
    detours: tuple[Detour, ...] = ()  # around obstacles, in the order of the path

    def moved(self, reference: Reference, drawn: Path2D) -> FeasiblePath:
        """Declare another reference in place of this one."""
        off_drawn, missed = two_sided(reference.p, drawn.polyline())
        curvature = float(np.abs(reference.curvature).max())
        return replace(self, reference=reference, curvature=curvature, off_drawn=off_drawn, missed=missed)

    def same(self, other: FeasiblePath) -> bool:
        """Tell whether the pivot has the same way."""
        return self is other or np.array_equal(self.reference.q, other.reference.q)


def feasible(
    raw: Path2D, feasibility: Feasibility, progress: ProgressCallback | None = None
) -> FeasiblePath | None:
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


def as_drawn(raw: Path2D, feasibility: Feasibility) -> FeasiblePath | None:
    """Take the path as it was drawn, if the robot can follow it.

    Raises:
        InputError: corners are not allowed, and the path has one.
    """
    drawn = reference(raw, feasibility.rod, spacing(raw), feasibility.drift)
    sharpest = float(drawn.sharpness.max()) * feasibility.vehicle.pivot_radius
    if sharpest <= AS_DRAWN and not feasibility.time_weight:
        return _accepted(raw, drawn, feasibility)
    if feasibility.corner != "error":
        return None
    _refuse_corner(raw, feasibility.robot)
    return _accepted(raw, drawn, feasibility)


def changed(
    raw: Path2D, feasibility: Feasibility, way: Way, progress: ProgressCallback | None = None
) -> FeasiblePath | None:
    """Change a path in one way so that the robot can follow it; None if that fails, or loses the shape."""
    vehicle, rod, drift, corner = feasibility.vehicle, feasibility.rod, feasibility.drift, feasibility.corner
    if way == ROUNDED:
        path = _rounded(raw, feasibility)
    elif raw.length < _FEWEST_POSES * pose_spacing(raw, vehicle.pivot_radius / way):
        return None
    else:
        path = nearest_path(
            raw, max(rod, 0.0), vehicle.pivot_radius / way, drift=drift, minimax=corner == "minimax",
            time_weight=feasibility.time_weight, apart=closest(rod, spacing(raw)),
            progress=lambda share: tell(progress, DECLARING, share),
        )  # fmt: skip
    return _accepted(raw, reference(path, rod, spacing(path), drift), feasibility)


def _accepted(raw: Path2D, followed: Reference, feasibility: Feasibility) -> FeasiblePath | None:
    """Accept a reference that turns wide enough, only goes ahead, and keeps the shape of the drawn path."""
    curvature = float(followed.sharpness.max())
    if curvature > TIGHTEST / feasibility.vehicle.pivot_radius or not np.ptp(followed.p, axis=0).any():
        return None
    declared = FeasiblePath(followed, curvature, *two_sided(followed.p, raw.polyline()))
    lost = LOST * max(extent(raw))
    if feasibility.corner != "fillet":  # arcs leave out the tip of a sharp corner, however large the path
        lost = min(lost, feasibility.vehicle.turn_radius)
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


def _refuse_corner(raw: Path2D, robot: Scales) -> None:
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

    def rounded(radius: float) -> Path2D:
        return fillet(raw, radius, closest(feasibility.rod, spacing(raw)))

    def tightest(radius: float) -> float:
        path = rounded(radius)
        return float(np.abs(reference(path, feasibility.rod, spacing(path), feasibility.drift).curvature).max())

    if tightest(high) > limit:
        return rounded(high)
    for _ in range(12):
        middle = (low + high) / 2
        low, high = (low, middle) if tightest(middle) <= limit else (middle, high)
    return rounded(high)


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


def fillet(path: Path2D, radius: float, apart: float = math.inf) -> Path2D:
    """Replace corners by arcs of `radius`, tangent to the edges; at most `largest_fillet`.

    Neighbours among the points of an arc are at most `apart` from each other.
    """
    angle = kinks(path)
    corner = np.abs(angle) > CORNER
    if radius == 0 or not corner.any():
        return path
    points = path.points
    count = len(points)
    step = min(math.radians(2), apart / radius)
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
        steps = np.linspace(0, angle[i], max(8, steps_of(abs(angle[i]), step)))
        spoke = start - centre
        c, s = np.cos(steps), np.sin(steps)
        rounded.append(centre + np.stack([c * spoke[0] - s * spoke[1], s * spoke[0] + c * spoke[1]], 1))
    return Path2D(np.concatenate(rounded), path.closed)


def make_feasible(raw: Path2D, feasibility: Feasibility, progress: ProgressCallback | None = None) -> FeasiblePath:
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


def _too_tight(raw: Path2D, feasibility: Feasibility, progress: ProgressCallback | None) -> str:
    """Say where a path is too tight, and what to change."""
    robot, vehicle = feasibility.robot, feasibility.vehicle
    drawn = reference(raw, feasibility.rod, spacing(raw), feasibility.drift)
    curvature = drawn.sharpness
    worst = place_of_largest(curvature)
    x, y = drawn.p[worst]
    return (
        f"path too tight at {place_in_lab(x, y, robot)}: the pivot would turn with radius "
        f"{in_lab(1 / float(curvature[worst]), robot)}, the robot can with "
        f"{in_lab(vehicle.pivot_radius / TIGHTEST, robot)}; its circle has radius "
        f"{in_lab(vehicle.turn_radius, robot)}, and the nearest path that it can follow has lost the shape; "
        f"{remedy(raw, feasibility, progress)}"
    )


def remedy(raw: Path2D, feasibility: Feasibility, progress: ProgressCallback | None = None) -> str:
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

    def __init__(self, feasibility: Feasibility, progress: ProgressCallback | None):
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
