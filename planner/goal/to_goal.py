"""to_goal(start, goal, robot): the motor's switching times from one pose to another, around obstacles.

The pivot moves like a car that only drives forward and has a least turn radius. So its shortest way between two
poses is one of Dubins' words, or a chain of them around obstacles (`planner.goal.route`). The way is followed by a
plan like any other. The last dwells are changed a little, so that the robot ends at the goal with the heading that
was asked for.

The margin around obstacles is the error that the plan states. That error is known when the plan is made. So the
way is sought again with a larger margin until the two agree. If there is no way, shorter dwells are tried, which
need less room.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from planner.goal.final_dwells import ending_at
from planner.goal.lattice import RouteLimits
from planner.goal.obstacles import Circle, Footprint, FreeSpace, Polygon
from planner.goal.route import COURSES, Lattices, NoWayError, Route, route
from planner.paths.path import Path2D
from planner.paths.tractrix import Drift, Reference, slips
from planner.paths.units import LONGEST
from planner.planning.declared_path import Declared
from planner.planning.plan import Plan, TrackedVehicle, least_dwell, scheduled, tracked_vehicle, zigzag_drift
from planner.planning.schedule import Start
from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.dwell_choice import Objective, check_least, dwells_for
from planner.vehicle.rollout import pose_changes
from planner.vehicle.zigzag import Zigzag, zigzag
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.mechanics import planar
from sim.model.robot import Robot
from surrogate.interface import LookupTable

Pose = tuple[float, float, float]
_SPACING = 0.02  # l
_SHORTER = 0.4  # of the dwell that was chosen: dwells near the end may be that short
_MARGINS = 6  # tried for each dwell
_MORE = 1.05  # times the stated error is the next margin
_DWELLS = 5  # shortest dwells that are tried
_FARTHEST = 1e6  # l


@dataclass(frozen=True)
class GoalPlan:
    """A plan from a pose to a pose. Lengths in l, angles in rad.

    Poses are x, y and heading of the head's centre.

    Example:
        >>> from softflagella import load_robot, to_goal
        >>> goal_plan = to_goal((0, 0, 0), (3, 1, 1), load_robot("paper-control"))
        >>> goal_plan.end_error[0] < 0.01
        True
    """

    plan: Plan
    goal: Pose
    end: Pose  # predicted
    via: tuple[tuple[float, float], ...]
    free_space: FreeSpace
    length: float  # of the pivot's track
    margin: float  # kept around the body on the declared path; 0 without obstacles
    clearance: float  # smallest, of the body on the predicted track; infinite without obstacles

    @property
    def end_error(self) -> tuple[float, float]:
        """Distance from the goal and difference of the heading, as predicted."""
        turn = (self.end[2] - self.goal[2] + math.pi) % (2 * math.pi) - math.pi
        return math.dist(self.end[:2], self.goal[:2]), abs(turn)


def to_goal(
    start: Sequence[float],
    goal: Sequence[float],
    robot: Robot,
    *,
    via: Sequence[Sequence[float]] = (),
    keep_out: Sequence[Circle | Polygon | Path2D | ArrayLike] = (),
    walls: Polygon | Path2D | ArrayLike | None = None,
    lookup: LookupTable | None = None,
    objective: Objective = "time",
    minimum_dwell: float | None = None,
    minimum_seconds: float | None = None,
    tolerance: float | None = None,
    feedback: bool = False,
    knowledge: CalibrationKnowledge | None = None,
    seed: int = 0,
) -> GoalPlan:
    """Plan the motor's switching times from one pose to another.

    Args:
        start: x, y [l] and heading [rad] of the head's centre, at rest.
        goal: the same at the end.
        robot: the robot.
        via: places x, y that the pivot passes on its way, in this order.
        keep_out: circles, and polygons as (n, 2) corners, that the robot's body must not touch.
        walls: a polygon that it must not leave.
        lookup: trained table, or the table of this one robot; default the shipped one.
        objective: what decides the dwell, see `planner.vehicle.dwell_choice`.
        minimum_dwell: shortest time between flips [μ0 l⁴/EI] that the motor allows.
        minimum_seconds: the same in seconds; the larger one counts.
        tolerance: largest acceptable stated error [l].
        feedback: the robot's pose will be measured every 20 flips (`planner.tracking.tracker`), so the margin
        around
            obstacles is the stated error with feedback.
        knowledge: what a calibration found besides the robot: covariance, current.
        seed: of the random robots from which the stated error is computed.

    Raises:
        NoWayError: there is no way to the goal; it is an `InputError`.
        InputError: a pose or a region is bad, or the robot is outside the table's domain.

    Example:
        >>> from softflagella import load_robot, to_goal
        >>> goal_plan = to_goal((0, 0, 0), (4, 1, 0), load_robot("paper-control"))
        >>> goal_plan.end_error[0] < 0.01
        True
    """
    first, last = _pose(start, "start"), _pose(goal, "goal")
    places = tuple(_place(place) for place in via)
    regions = tuple(one if isinstance(one, Circle | Polygon) else Polygon.of(one) for one in keep_out)
    outline = walls if isinstance(walls, Polygon) or walls is None else Polygon.of(walls)
    room = FreeSpace(regions, outline)
    tracked = tracked_vehicle(robot, lookup, "head_centre", knowledge)
    vehicle = tracked.vehicle
    least = least_dwell(minimum_dwell, minimum_seconds, robot)
    dwells = dwells_for(vehicle, objective, least)
    tried = [dwells[i] for i in np.unique(np.linspace(0, len(dwells) - 1, _DWELLS).astype(int))]
    trip = _Trip(tracked, first, last, places, room, objective, check_least(least), feedback, seed)
    refusal: InputError | None = None
    for dwell in tried:
        try:
            found = trip.with_dwell(dwell)
        except NoWayError as none:
            refusal = refusal or none
            continue
        if tolerance is None or found.plan.stated_error <= tolerance:
            return found
        refusal = InputError(
            f"tolerance {tolerance:g} l cannot be kept: with dwells of {dwell:.2g} time units the stated error is "
            f"{found.plan.stated_error:.3g} l; allow more"
        )
    assert refusal is not None
    raise refusal


def _pose(values: Sequence[float], name: str) -> Pose:
    found = _finite(values, 3, f"{name}: give x, y and heading")
    return found[0], found[1], found[2]


def _place(values: Sequence[float]) -> tuple[float, float]:
    found = _finite(values, 2, "place on the way: give x and y")
    return found[0], found[1]


def _finite(values: Sequence[float], count: int, wanted: str) -> list[float]:
    try:
        found = [float(value) for value in values]
    except (TypeError, ValueError):
        found = []
    if len(found) != count or not all(abs(value) < _FARTHEST for value in found):
        raise InputError(f"{wanted}, as finite numbers; not {values}")
    return found


class _Trip:
    """What is asked for, with the lattices that were made for it."""

    def __init__(self, tracked: TrackedVehicle, start: Pose, goal: Pose, via: tuple[tuple[float, float], ...],
                 room: FreeSpace, objective: Objective, least: float, feedback: bool, seed: int):  # fmt: skip
        self.tracked, self.start, self.goal, self.via, self.room = tracked, start, goal, via, room
        self.objective, self.least, self.feedback, self.seed = objective, least, feedback, seed
        self.body = Footprint.of(tracked.robot, -tracked.vehicle.pivot_distance)
        self._lattices: dict[Drift, Lattices] = {}

    def with_dwell(self, dwell: float) -> GoalPlan:
        """The goal_plan with one shortest dwell; the margin is raised to what its plan states."""
        straight = zigzag(self.tracked.vehicle, dwell)
        drift = zigzag_drift(self.tracked.vehicle, straight, dwell)
        limits = RouteLimits(self.tracked.vehicle.pivot_radius, self.body, self.room, drift)
        margin = 0.0 if self.room.empty else 1.5 * straight.largest
        for _ in range(_MARGINS):
            way = route(self._stops(drift), limits, margin, self._lattices.setdefault(drift, {}))
            found = self._follow(way, limits, straight, dwell, margin)
            needed = found.plan.feedback_error if self.feedback else found.plan.stated_error
            if self.room.empty or (needed <= margin and found.clearance > 0):
                return found
            margin = max(_MORE * needed, margin * 1.02)
        raise NoWayError(
            f"there is no way that leaves the plan's stated error around the robot: it is {needed:.3g} l; plan "
            "with feedback, make a table of this robot (python -m surrogate robot), or move goal or obstacles"
        )

    def _stops(self, drift: Drift) -> list[Floats]:
        """Poses of the pivot: place and course."""
        ends = [self._pivot(pose, drift)[None] for pose in (self.start, self.goal)]
        courses = 2 * math.pi * np.arange(COURSES) / COURSES
        middle = [np.stack([0 * courses + x, 0 * courses + y, courses], 1) for x, y in self.via]
        return [ends[0], *middle, ends[1]]

    def _pivot(self, pose: Pose, drift: Drift) -> Floats:
        x, y, heading = pose
        a = self.tracked.vehicle.pivot_distance
        # The course is the direction in which the pivot moves while the robot has this heading.
        course = heading + float(_slip_at(np.array(heading), drift))
        return np.array([x - a * math.cos(heading), y - a * math.sin(heading), course])

    def _follow(self, way: Route, limits: RouteLimits, straight: Zigzag, dwell: float, margin: float) -> GoalPlan:
        tracked, vehicle = self.tracked, self.tracked.vehicle
        if way.length > LONGEST:
            raise InputError(f"the way is {way.length:.3g} l long; at most {LONGEST:g} l can be planned")
        poses = way.poses(_SPACING)
        if len(poses) < 2:
            raise InputError("start and goal are the same; nothing to do")
        heading = poses[:, 2] - slips(poses[:, 2], limits.drift)
        heading += self.start[2] - heading[0]
        q = poses[:, :2]
        p = q + tracked.rod * np.stack([np.cos(heading), np.sin(heading)], 1)
        arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(q, axis=0).T))])
        guide = Reference(p, q, heading, arc, False)
        declared = Declared(guide, 0.0, 0.0, 0.0, ())
        turning = np.flatnonzero(np.abs(np.diff(heading)) > 1e-9)
        sense = 1 if not len(turning) or np.diff(heading)[turning[0]] > 0 else -1
        plan = scheduled(
            tracked,
            Path2D(p, False),
            declared,
            straight,
            self.objective,
            dwell,
            seed=self.seed,
            start=lambda _: Start(self.start, 0, sense),
            finish=ending_at(self.goal, vehicle, min(dwell, max(self.least, _SHORTER * dwell)), q),
        )
        # The bound is for paths that turn less than the robot can; these arcs turn as much as it can.
        plan = replace(plan, guaranteed=None, minimum_dwell=min(dwell, float(plan.dwells.min())))
        x, y, angle = plan.poses[-1].tolist()
        clearance = math.inf
        if not self.room.empty:
            body = Footprint.of(tracked.robot, 0.0)
            clearance = float(body.clearance(_swum(plan), self.room).min())
        return GoalPlan(plan, self.goal, (x, y, angle), self.via, self.room, way.length, margin, clearance)


def _slip_at(heading: Floats, drift: Drift) -> Floats:
    """Angle from a heading to the direction of motion."""
    course = heading
    for _ in range(30):
        course = heading + slips(course, drift)
    return np.asarray(course - heading)


def _swum(plan: Plan) -> Floats:
    """Predicted poses of the head's centre, several a dwell."""
    dwells = plan.dwells
    times = dwells[:, None] * np.arange(0, 9) / 8
    changes = pose_changes(plan.vehicle, plan.first_direction, dwells, times)
    poses = planar.compose(plan.poses[:-1, None], changes)
    poses[..., :2] += plan.vehicle.current * times[..., None]
    return np.asarray(poses.reshape(-1, 3))
