"""plan(path, robot): from a path to a frozen plan, without simulating.

1. The look-up table gives the vehicle (`planner.vehicle`).
2. Corners are rounded by the smallest radius that the pivot can follow with some margin. A path that is
   too tight is refused. The message gives the place, the radii and the smallest scale that works.
3. The tractrix of the rounded path is the pivot's reference (`planner.tractrix`).
4. Hysteresis about the line of sight gives the dwells (`planner.schedule`).
5. Guaranteed error, tube and predicted error are computed and stated (`planner.stated_error`).

Errors are distances of the tracked point from the declared path, which has rounded corners. `guaranteed` is a
bound for a vehicle without errors. `tube` is what the errors of the table add, in 95 % of random draws.
`stated_error` is their sum. The distance between the declared path and the path as given is reported, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from planner.corners import CORNER, fillet, kinks, largest_fillet
from planner.path import Path2D
from planner.schedule import follow, trace
from planner.stated_error import guaranteed, look_ahead, tube
from planner.tractrix import Reference, reference
from planner.vehicle import TURN_OVER, Vehicle, vehicle_of
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.model.robot import Robot
from sim.model.schedule import Schedule
from surrogate.table import LookupTable

Point = Literal["head_centre", "head_tip", "pivot"]

ROOM = 0.7  # rounded corners need at most this share of the pivot's largest curvature
TIGHTEST = 0.9  # a path that needs more than this share of the pivot's largest curvature is refused
_SPACING = 0.01  # of points on the reference, in l
_MOST_POINTS = 60_000
_LONGEST = 200.0  # path, in l: 8000 flips; time and memory grow with its square
_SHORTEST = 1e-3  # path, in l: a flip alone moves the robot by more


@dataclass(frozen=True)
class Plan:
    """A schedule and its errors. Lengths are in l, times in μ0 l⁴/EI, unless a name says its unit.

    Example:
        >>> from softflagella import circle, load_robot, plan
        >>> result = plan(circle(2.0), load_robot("paper-control"))
        >>> result.predicted_max < result.stated_error, len(result.seconds) == len(result.dwells)
        (True, True)
    """

    robot: Robot
    point: Point
    offset: float  # from the head's centre forward to the tracked point
    first_direction: int
    dwells: Floats  # (M,)
    poses: Floats  # (M + 1, 3): predicted head's centre at the flips
    track: Floats  # (K, 2): predicted tracked point, several samples a dwell
    reference: Floats  # (m, 2): declared path
    raw: Floats  # (k, 2): path as given
    closed: bool
    fillet_radius: float
    corner_cut: float  # largest distance of the raw path from the declared one
    minimum_dwell: float
    guaranteed: float
    tube: float
    predicted_rms: float
    predicted_max: float
    closure: float | None
    model: str  # hash of the look-up table
    warnings: tuple[str, ...]

    @property
    def stated_error(self) -> float:
        """The error that the plan states, guaranteed error plus tube [l]."""
        return self.guaranteed + self.tube

    def schedule(self, robot: Robot | None = None) -> Schedule:
        """The schedule for `sim.motion.replay`.

        Args:
            robot: the robot that carries it out; default: the one that the plan was made for.
        """
        own = robot or self.robot
        start = (float(self.poses[0, 0]), float(self.poses[0, 1]), float(self.poses[0, 2]))
        return Schedule(own.group_values(), self.first_direction, self.dwells, start, own.time_scale)

    @property
    def duration(self) -> float:
        return float(self.dwells.sum())

    @property
    def seconds(self) -> Floats:
        """Dwell times [s]."""
        return self.dwells * self.robot.time_scale


def plan(
    path: Path2D | ArrayLike,
    robot: Robot,
    *,
    lookup: LookupTable | None = None,
    point: Point = "head_centre",
    corner: Literal["fillet", "error"] = "fillet",
    minimum_dwell: float | None = None,
    tolerance: float | None = None,
    seed: int = 0,
) -> Plan:
    """Plan the motor's switching times for a path.

    Args:
        path: (n, 2) points or a Path2D, lengths in tail lengths l.
        robot: the robot; its motor speed is used in both directions.
        lookup: trained table, or the table of this one robot; default the shipped one.
        point: which point must follow the path.
        corner: round corners, or refuse them.
        minimum_dwell: shortest time between flips [μ0 l⁴/EI]; default the tails' turn-over time.
        tolerance: largest acceptable guaranteed error [l]. The longest dwell with this error is chosen, since
            with longer dwells the robot is faster and strays more. By default the minimum dwell is used.
        seed: of the random vehicles from which the tube is computed.

    Raises:
        InputError: the path is bad or too tight, the dwell too short, the tolerance too small, or the robot
            outside the table's domain.

    Example:
        >>> from softflagella import circle, load_robot, plan
        >>> result = plan(circle(2.0), load_robot("paper-control"))
        >>> len(result.dwells) > 100, result.predicted_rms < 0.03
        (True, True)
    """
    if lookup is None:
        from surrogate.export import load

        lookup = load()
    vehicle = vehicle_of(robot, lookup)
    raw = path if isinstance(path, Path2D) else Path2D.of(path)
    offset = _offset(point, robot, vehicle)
    _check_length(raw)
    distance = vehicle.pivot_distance + offset
    shortest = _minimum_dwell(minimum_dwell, vehicle)
    declared, radius = _round_corners(raw, vehicle, distance, corner)
    ref = reference(declared, distance, _spacing(declared))
    curvature = _check_curvature(ref, raw, vehicle, distance, corner)
    dwell = _choose_dwell(vehicle, distance, curvature, shortest, tolerance)
    ahead = look_ahead(vehicle, curvature)
    switches = follow(ref, vehicle, pivot_distance=distance, ahead=ahead, dwell=dwell, offset=offset)
    track = trace(vehicle, switches, offset)
    error = distance_to(ref.p, track)
    return Plan(
        robot=robot,
        point=point,
        offset=offset,
        first_direction=switches.first_direction,
        dwells=switches.dwells,
        poses=switches.poses,
        track=track,
        reference=ref.p,
        raw=raw.polyline(),
        closed=raw.closed,
        fillet_radius=radius,
        corner_cut=float(distance_to(ref.p, raw.polyline()).max()),
        minimum_dwell=dwell,
        guaranteed=guaranteed(vehicle, distance, curvature, dwell),
        tube=tube(vehicle, switches, offset, seed=seed),
        predicted_rms=float(np.sqrt(np.mean(error**2))),
        predicted_max=float(error.max()),
        closure=float(np.linalg.norm(track[-1] - track[0])) if raw.closed else None,
        model=lookup.identity,
        warnings=_warnings(vehicle),
    )


def _warnings(vehicle: Vehicle) -> tuple[str, ...]:
    if vehicle.tail_gap < 1.0:
        return (f"tails touch (predicted gap {vehicle.tail_gap:.2f} diameters): the model has no contact",)
    return ()


def distance_to(polyline: Floats, points: Floats) -> Floats:
    """Distance of points (M, 2) from a polyline (m, 2)."""
    start, along = polyline[:-1], np.diff(polyline, axis=0)
    square = np.maximum((along**2).sum(1), 1e-30)
    result = np.empty(len(points))
    for begin in range(0, len(points), 512):
        away = points[begin : begin + 512, None] - start
        share = np.clip((away * along).sum(-1) / square, 0, 1)
        gap = away - share[..., None] * along
        result[begin : begin + 512] = np.sqrt((gap**2).sum(-1).min(1))
    return result


def _offset(point: Point, robot: Robot, vehicle: Vehicle) -> float:
    """Distance from the head's centre forward to the tracked point [l]."""
    if point == "head_centre":
        return 0.0
    if point == "head_tip":
        return robot.head_length / 2 / robot.tail_length
    if point == "pivot":
        return -vehicle.pivot_distance
    raise InputError(f"point {point!r}; allowed are head_centre, head_tip, pivot")


def _minimum_dwell(wanted: float | None, vehicle: Vehicle) -> float:
    if wanted is None:
        return TURN_OVER
    if not math.isfinite(wanted) or wanted < TURN_OVER:
        raise InputError(
            f"minimum dwell {wanted:g} is below the tails' turn-over time; give at least {TURN_OVER:g} "
            f"(time units), where a flip moves the robot by {_flip_size(vehicle):.3g} l"
        )
    return wanted


def _flip_size(vehicle: Vehicle) -> float:
    lag = vehicle.lag_at(1, np.array(TURN_OVER))
    return float(np.hypot(lag[0], lag[1]))


def _check_length(path: Path2D) -> None:
    """Refuse a path that would ask for unbounded time and memory, or that is shorter than a flip."""
    with np.errstate(over="ignore", invalid="ignore"):
        length = path.length
    if not _SHORTEST <= length <= _LONGEST:
        raise InputError(
            f"the path is {length:.3g} tail lengths long; give between {_SHORTEST:g} and {_LONGEST:g}: scale it, "
            "check its unit, or split it"
        )


def _spacing(path: Path2D) -> float:
    return max(_SPACING, path.length / _MOST_POINTS)


def _round_corners(raw: Path2D, vehicle: Vehicle, distance: float, corner: str) -> tuple[Path2D, float]:
    """The path with rounded corners, and their radius: the smallest one that leaves the pivot some margin."""
    angle = np.abs(kinks(raw))
    sharpest = int(angle.argmax())
    if angle[sharpest] <= CORNER:
        return raw, 0.0
    if corner not in ("fillet", "error"):
        raise InputError(f"corner {corner!r}; allowed are fillet, error")
    if corner == "error":
        x, y = raw.points[sharpest]
        raise InputError(
            f"corner of {math.degrees(angle[sharpest]):.0f} degrees at ({x:.3g}, {y:.3g}); "
            "round it, or allow corner = fillet"
        )
    limit = ROOM / vehicle.pivot_radius
    low, high = 0.0, min(largest_fillet(raw), math.hypot(distance, 1 / limit))
    if _largest_curvature(fillet(raw, high), distance) > limit:
        return fillet(raw, high), high
    for _ in range(20):
        middle = (low + high) / 2
        followed = _largest_curvature(fillet(raw, middle), distance) <= limit
        low, high = (low, middle) if followed else (middle, high)
    return fillet(raw, high), high


def _largest_curvature(path: Path2D, distance: float) -> float:
    return float(np.abs(reference(path, distance, _spacing(path)).curvature).max())


def _check_curvature(ref: Reference, raw: Path2D, vehicle: Vehicle, distance: float, corner: str) -> float:
    """The largest curvature of the reference. One that the pivot cannot follow is refused."""
    curvature = np.abs(ref.curvature)
    worst = int(curvature.argmax())
    limit = TIGHTEST / vehicle.pivot_radius
    if curvature[worst] <= limit:
        return float(curvature[worst])
    x, y = ref.p[worst]
    raise InputError(
        f"path too tight at ({x:.3g}, {y:.3g}) l: the pivot would turn with radius "
        f"{1 / curvature[worst]:.3g} l, the robot can with {1 / limit:.3g} l (its circle has radius "
        f"{vehicle.turn_radius:.3g} l); {_smallest_scale(raw, vehicle, distance, corner)}"
    )


def _smallest_scale(raw: Path2D, vehicle: Vehicle, distance: float, corner: str) -> str:
    limit = TIGHTEST / vehicle.pivot_radius
    for factor in np.geomspace(1.05, 50, 80):
        try:
            declared, _ = _round_corners(raw.scaled(factor), vehicle, distance, corner)
        except InputError:
            continue
        if _largest_curvature(declared, distance) <= limit:
            return f"scale the path by {factor:.2g}"
    return "make the path smoother"


def _choose_dwell(
    vehicle: Vehicle, distance: float, curvature: float, shortest: float, tolerance: float | None
) -> float:
    """The longest minimum dwell whose guaranteed error is within the tolerance."""
    if tolerance is None:
        return shortest
    least = guaranteed(vehicle, distance, curvature, shortest)
    if not math.isfinite(tolerance) or tolerance < least:
        raise InputError(
            f"tolerance {tolerance:g} l is below what the dwell {shortest:g} guarantees ({least:.3g} l); "
            "allow more"
        )
    longest = float(vehicle.dwells[-1])
    candidates = np.linspace(shortest, max(longest, shortest), 400)
    kept = [t for t in candidates if guaranteed(vehicle, distance, curvature, t) <= tolerance]
    return float(kept[-1])


def plan_record(result: Plan) -> dict[str, Any]:
    """The plan as JSON-like content; `sim.model.schedule.load_schedule` reads its schedule."""
    robot, schedule = result.robot, result.schedule()
    x, y, heading = schedule.start
    return {
        "format": 1,
        "robot": {
            "name": robot.name,
            "groups": schedule.robot,
            "tail_length_m": robot.tail_length,
            "motor_speed_rad_s": robot.motor_speed,
            "time_scale_s": robot.time_scale,
        },
        "point": result.point,
        "offset_over_l": result.offset,
        "first_direction": result.first_direction,
        "start": {"x_over_l": x, "y_over_l": y, "heading_rad": heading},
        "dwell_bar": result.dwells.tolist(),
        "dwell_s": result.seconds.tolist(),
        "predicted_poses": result.poses.tolist(),
        "reference": result.reference.tolist(),
        "raw_path": result.raw.tolist(),
        "closed": result.closed,
        "fillet_radius_over_l": result.fillet_radius,
        "corner_cut_over_l": result.corner_cut,
        "minimum_dwell_bar": result.minimum_dwell,
        "guaranteed_error_over_l": result.guaranteed,
        "tube_over_l": result.tube,
        "stated_error_over_l": result.stated_error,
        "predicted_rms_over_l": result.predicted_rms,
        "predicted_max_over_l": result.predicted_max,
        "closure_over_l": result.closure,
        "model": result.model,
        "warnings": list(result.warnings),
    }
