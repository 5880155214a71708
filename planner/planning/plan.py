"""plan(path, robot): from a path to a frozen plan, without simulating.

1. The look-up table gives the vehicle, both directions and the memory of the last dwell
(`planner.vehicle.from_table`).
2. The shortest dwell is chosen from the objective (`planner.vehicle.dwell_choice`).
3. The path that the robot can follow and that is nearest to the one drawn is declared
(`planner.planning.declared_path`). Its
   tractrix is the pivot's reference (`planner.paths.tractrix`).
4. Hysteresis about the line of sight gives the dwells (`planner.planning.schedule`).
5. The errors of this schedule are computed and stated (`planner.planning.stated_error`). If there is a tolerance
and they
   are above it, a shorter dwell is tried.

Errors are distances of the tracked point from the declared path. The distance of the declared path from the path
as drawn is reported from both sides.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planner.paths.distance import distance_to
from planner.paths.path import Path2D
from planner.paths.tractrix import Drift, Reference
from planner.paths.units import check_size
from planner.planning.declared_path import Corner, Declared, Feasibility, declare
from planner.planning.schedule import Start, follow
from planner.planning.stated_error import guaranteed, look_ahead, predicted_error, rms_in_time, stated_error
from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.dwell_choice import QUICK, Objective, check_least, dwells_for
from planner.vehicle.from_table import default_table, table_vehicle
from planner.vehicle.rollout import Switches, trace
from planner.vehicle.vehicle import Vehicle
from planner.vehicle.zigzag import Zigzag, zigzag
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.model.robot import Robot
from sim.model.schedule import Schedule
from surrogate.interface import LookupTable

Point = Literal["head_centre", "head_tip", "pivot"]
FEEDBACK_EVERY = 20  # flips


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
    raw: Floats  # (k, 2): path as drawn
    closed: bool
    objective: Objective
    minimum_dwell: float
    off_drawn: float  # largest distance of a declared point from the drawn path
    missed: float  # largest distance of a drawn point from the declared path
    zigzag_rms: float  # of straight motion with this dwell: no schedule does better
    predicted_rms: float
    predicted_max: float
    drawn_rms: float  # predicted, from the drawn path
    drawn_max: float
    stated_error: float  # holds for 95 % of the robots that the model's uncertainty allows, open loop
    feedback_error: float  # the same where the pose is measured, and the rest planned again, every 20 flips
    guaranteed: float | None  # bound for a robot without errors, however long the path; None: not known
    closure: float | None
    model: str  # hash of the look-up table
    warnings: tuple[str, ...]
    vehicle: Vehicle
    guide: Reference  # declared path, with the pivot and heading that belong to it
    pivot_distance: float
    ahead: float  # look-ahead Δ
    net_speed: float  # on a straight line
    swing: float  # 2 h, of the hysteresis on a straight line

    @property
    def start(self) -> tuple[float, float, float]:
        """Where the head's centre must be put, at rest: x, y [l] and heading [rad]."""
        x, y, heading = self.poses[0].tolist()
        return x, y, heading

    def schedule(self, robot: Robot | None = None) -> Schedule:
        """The schedule for `sim.motion.replay`.

        Args:
            robot: the robot that carries it out; default: the one that the plan was made for. Seconds and metres
                stay as planned, so numbers change where its units of time and length are others.
        """
        own = robot or self.robot
        time, length = self.robot.time_scale / own.time_scale, self.robot.tail_length / own.tail_length
        x, y, heading = self.start
        start = (x * length, y * length, heading)
        return Schedule(own.group_values(), self.first_direction, self.dwells * time, start, own.time_scale)

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
    corner: Corner = "nearest",
    time_weight: float = 0.0,
    objective: Objective = "error",
    minimum_dwell: float | None = None,
    minimum_seconds: float | None = None,
    dwell: float | None = None,
    tolerance: float | None = None,
    knowledge: CalibrationKnowledge | None = None,
    seed: int = 0,
    progress: Callable[[float], object] | None = None,
) -> Plan:
    """Plan the motor's switching times for a path.

    Args:
        path: (n, 2) points or a Path2D, lengths in tail lengths l.
        robot: the robot; its motor speed is used in both directions.
        lookup: trained table, or the table of this one robot; default the shipped one.
        point: which point must follow the path.
        corner: places that are too tight: declare the path that can be followed and is nearest by root mean square
            ("nearest") or by its largest distance ("minimax"), round corners ("fillet"), or refuse ("error").
        time_weight: for "nearest" and "minimax": the mean squared distance [l²] from the drawn path that is worth
            as much as the time in which the whole path is followed; 0: distance alone counts.
        objective: what decides the dwell: small "error", short "time", or few "flips"; see
        `planner.vehicle.dwell_choice`.
        minimum_dwell: shortest time between flips [μ0 l⁴/EI] that the motor allows.
        minimum_seconds: the same in seconds; the larger one counts.
        dwell: this shortest dwell, and not the one that the objective would choose.
        tolerance: largest acceptable stated error [l]. The dwell is shortened until it is kept.
        knowledge: what a calibration found besides the robot: covariance, current.
        seed: of the random robots from which the stated error is computed.
        progress: called now and then with the share of the path that is done.

    Raises:
        InputError: the path is bad or too tight, the dwell too short, the tolerance too small, or the robot
            outside the table's domain.

    Example:
        >>> from softflagella import circle, load_robot, plan
        >>> result = plan(circle(2.0), load_robot("paper-control"))
        >>> len(result.dwells) > 100, result.predicted_rms < 0.03
        (True, True)
    """
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance > 0):
        raise InputError(f"tolerance {tolerance:g} l; give a number above 0")
    tracked = tracked_vehicle(robot, lookup, point, knowledge)
    vehicle = tracked.vehicle
    raw = path if isinstance(path, Path2D) else Path2D.of(path)
    check_size(raw, robot, vehicle.turn_radius)
    least = least_dwell(minimum_dwell, minimum_seconds, robot)
    dwells = dwells_for(vehicle, objective, least) if dwell is None else [check_least(dwell)]

    @cache
    def declared(drift: Drift) -> Declared:
        return declare(raw, Feasibility(vehicle, tracked.rod, drift, corner, time_weight))

    def made(dwell: float) -> Plan:
        straight = zigzag(vehicle, dwell, tracked.offset)
        found = declared(zigzag_drift(vehicle, straight, dwell))
        return scheduled(tracked, raw, found, straight, objective, dwell, seed=seed, progress=progress)

    best = made(dwells[0])
    if tolerance is None or best.stated_error <= tolerance:
        return best
    low, high = 0, len(dwells)  # the first dwell is too long; halve between it and the shortest
    kept: Plan | None = None
    while high - low > 1:
        middle = (low + high) // 2
        tried = made(dwells[middle])
        if tried.stated_error < best.stated_error:
            best = tried
        if tried.stated_error <= tolerance:
            kept, high = tried, middle
        else:
            low = middle
    if kept is None:
        raise InputError(
            f"tolerance {tolerance:g} l cannot be kept: the smallest stated error is {best.stated_error:.3g} l, "
            f"with dwells from {best.minimum_dwell:.2g} time units; allow more, or make a table of this robot "
            "with python -m surrogate robot"
        )
    return kept


class TrackedVehicle(NamedTuple):
    """Who follows a path: the robot, its vehicle, and the point of its axis that must be on the path."""

    robot: Robot
    vehicle: Vehicle
    point: Point
    offset: float  # from the head's centre forward to the point
    model: str  # hash of the look-up table

    @property
    def rod(self) -> float:
        """Distance from the pivot to the point."""
        return self.vehicle.pivot_distance + self.offset


def tracked_vehicle(
    robot: Robot, lookup: LookupTable | None, point: Point, knowledge: CalibrationKnowledge | None
) -> TrackedVehicle:
    """Ask a table for the vehicle of a robot, and add the tracked point; default: the shipped table."""
    lookup = default_table() if lookup is None else lookup
    vehicle = table_vehicle(robot, lookup, knowledge)
    return TrackedVehicle(robot, vehicle, point, _offset(point, robot, vehicle), lookup.identity)


def zigzag_drift(vehicle: Vehicle, straight: Zigzag, dwell: float) -> Drift:
    """What carries the robot off its heading, with one shortest dwell.

    Raises:
        InputError: with such dwells the robot does not get ahead.
    """
    if straight.speed <= 0:
        raise InputError(f"with dwells of {dwell:.2g} time units the robot does not get ahead; allow longer ones")
    return Drift(_clean(straight.drift / straight.speed), _shares(vehicle.current, straight.speed))


def scheduled(
    tracked: TrackedVehicle,
    raw: Path2D,
    declared: Declared,
    straight: Zigzag,
    objective: Objective,
    dwell: float,
    *,
    seed: int = 0,
    progress: Callable[[float], object] | None = None,
    start: Callable[[float], Start] | None = None,
    finish: Callable[[Switches], Switches] | None = None,
) -> Plan:
    """The plan that follows a declared path with one shortest dwell.

    Args:
        tracked: who follows.
        raw: the path as drawn.
        declared: the path that is followed, with the pivot's poses.
        straight: the zigzag with this dwell.
        objective: what decided the dwell.
        dwell: the shortest one.
        seed: of the random robots.
        progress: called now and then with the share of the path that is done.
        start: where the schedule begins, from the swing of the zigzag; default: as the path begins.
        finish: changes the schedule before its errors are computed.
    """
    robot, vehicle, point, offset, model = tracked
    guide, distance = declared.reference, tracked.rod
    ahead = look_ahead(vehicle, declared.curvature, straight)
    swing = straight.hysteresis(ahead)
    switches = follow(
        guide,
        vehicle,
        pivot_distance=distance,
        ahead=ahead,
        dwell=dwell,
        swing=swing,
        offset=offset,
        start=None if start is None else start(swing),
        progress=progress,
    )
    if finish is not None:
        switches = finish(switches)
    track = trace(vehicle, switches, offset)
    error = predicted_error(guide.p, track, closed=raw.closed)
    drawn = distance_to(raw.polyline(), track)
    return Plan(
        robot=robot,
        point=point,
        offset=offset,
        first_direction=switches.first_direction,
        dwells=switches.dwells,
        poses=switches.poses,
        track=track,
        reference=guide.p,
        raw=raw.polyline(),
        closed=raw.closed,
        objective=objective,
        minimum_dwell=dwell,
        off_drawn=declared.off_drawn,
        missed=declared.missed,
        zigzag_rms=straight.rms,
        predicted_rms=rms_in_time(error.distance, switches.dwells),
        predicted_max=error.largest,
        drawn_rms=rms_in_time(drawn, switches.dwells),
        drawn_max=float(drawn.max()),
        stated_error=stated_error(vehicle, switches, track, error, seed=seed),
        feedback_error=stated_error(vehicle, switches, track, error, every=FEEDBACK_EVERY, seed=seed),
        guaranteed=guaranteed(vehicle, distance, straight.swing, ahead),
        closure=float(np.linalg.norm(track[-1] - guide.p[0])) if raw.closed else None,
        model=model,
        warnings=(*declared.warnings, *_warnings(vehicle)),
        vehicle=vehicle,
        guide=guide,
        pivot_distance=distance,
        ahead=ahead,
        net_speed=straight.net_speed,
        swing=swing,
    )


def _warnings(vehicle: Vehicle) -> tuple[str, ...]:
    if vehicle.tail_gap < vehicle.least_gap:
        without = "the model has no contact" if vehicle.least_gap == 1.0 else "contact does not hold them apart"
        return (f"tails touch (predicted gap {vehicle.tail_gap:.2f} diameters): {without}",)
    return ()


def least_dwell(dwell: float | None, seconds: float | None, robot: Robot) -> float | None:
    """The shortest dwell that the motor allows, in time units."""
    if seconds is None:
        return dwell
    if not (math.isfinite(seconds) and seconds > 0):
        raise InputError(f"minimum dwell {seconds:g} s; give a number above 0")
    own = seconds / robot.time_scale
    return max(own, dwell) if dwell is not None else max(own, QUICK)


def _clean(value: float) -> float:
    """Rounding errors of a mirror-symmetric robot are no drift."""
    return 0.0 if abs(value) < 1e-9 else value


def _shares(current: Floats, speed: float) -> tuple[float, float]:
    x, y = (current / speed).tolist()
    return x, y


def _offset(point: Point, robot: Robot, vehicle: Vehicle) -> float:
    """Distance from the head's centre forward to the tracked point [l]."""
    if point == "head_centre":
        return 0.0
    if point == "head_tip":
        return robot.head_length / 2 / robot.tail_length
    if point == "pivot":
        return -vehicle.pivot_distance
    raise InputError(f"point {point!r}; allowed are head_centre, head_tip, pivot")
