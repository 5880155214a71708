"""to_goal(start, goal, robot): the motor's switching times from one pose to another, around obstacles.

The pivot moves like a car that only drives forward and has a least turn radius. Its shortest track between two
poses is one of Dubins' words, or a chain of them around obstacles (`planner.goal.route`). The schedule follows
that track like any other path. Its last dwells are then adjusted so that the robot ends at the goal with the
wanted heading (`planner.goal.final_dwells`).

The margin around obstacles is the stated error of the plan, which is known only when the plan is made. So the
track is planned again with a larger margin until the two agree. If there is no such track, shorter dwells are
tried, which need less clearance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from planner.goal.arrive import arrive
from planner.goal.final_dwells import end_at_goal
from planner.goal.goal_plan import GoalPlan, Pose
from planner.goal.lattice import RouteLimits
from planner.goal.route import COURSES, Lattices, NoWayError, Route, route
from planner.goal.swings import swung_clear
from planner.paths.obstacles import Circle, Footprint, FreeSpace, Polygon
from planner.paths.path import Path2D
from planner.paths.tractrix import Drift, Reference, slips_at_heading
from planner.paths.units import LONGEST, in_lab, time_in_lab
from planner.planning.camera import DOCUMENTED, Camera
from planner.planning.declared_path import Declared
from planner.planning.errors import plan_errors
from planner.planning.plan import choose_guidance, zigzag_drift
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.planning.schedule import Start, follow
from planner.vehicle.calibration_table import CalibrationKnowledge
from planner.vehicle.coefficient_modes import OWN_TABLE
from planner.vehicle.dwell_choice import Objective, check_least, dwells_for
from planner.vehicle.rollout import predicted_poses
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from planner.vehicle.zigzag import Zigzag, zigzag
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.model.robot import Robot
from surrogate.interface import LookupTable

_SPACING = 0.02  # l
_SHORTER = 0.4  # share of the chosen dwell that dwells near the end must keep
_MARGINS = 6  # tried for each dwell
_MORE = 1.05  # times the stated error is the next margin
_DWELLS = 5  # shortest dwells that are tried
_FARTHEST = 1e6  # l


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
    arrive_seconds: float | None = None,
    knowledge: CalibrationKnowledge | None = None,
    seed: int = 0,
    camera: Camera = DOCUMENTED,
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
        feedback: the robot's pose will be measured (`planner.tracking.tracker`), so the margin
            around obstacles is the stated error with feedback.
        arrive_seconds: the time from start to goal; see `planner.goal.arrive`. Default: as the objective says.
        knowledge: what a calibration found besides the robot: covariance, current.
        seed: of the random robots from which the stated error is computed.
        camera: of the stated error with feedback.

    Raises:
        NoWayError: there is no way to the goal; it is an `InputError`.
        InputError: a pose or a region is bad, or the robot is outside the table's domain.

    Example:
        >>> from softflagella import load_robot, to_goal
        >>> trip = to_goal((0, 0, 0), (4, 1, 0), load_robot("paper-control"))
        >>> trip.end_error[0] < 0.01
        True
    """
    request = PlanRequest(
        objective=objective,
        minimum_dwell=minimum_dwell,
        minimum_seconds=minimum_seconds,
        tolerance=tolerance,
        seed=seed,
        camera=camera,
    )
    tracked = tracked_vehicle(robot, lookup, "head_centre", knowledge)
    space = FreeSpace.of(keep_out, walls)
    return make_goal_plan(
        start, goal, tracked, request, space, via=via, feedback=feedback, arrive_seconds=arrive_seconds
    )


def make_goal_plan(
    start: Sequence[float],
    goal: Sequence[float],
    tracked: TrackedVehicle,
    request: PlanRequest,
    space: FreeSpace,
    *,
    via: Sequence[Sequence[float]] = (),
    feedback: bool = False,
    arrive_seconds: float | None = None,
) -> GoalPlan:
    """Plan from a pose to a pose for a vehicle and a request; see `to_goal`."""
    first, last = _pose(start, "start"), _pose(goal, "goal")
    places = tuple(_place(place) for place in via)
    task = _Task(tracked, first, last, places, space, request, feedback)
    if arrive_seconds is None:
        return task.plan_with(request)
    trip, arrival = arrive(arrive_seconds, tracked, request, task.plan_with, lambda trip: trip.plan)
    return replace(trip, plan=replace(trip.plan, arrival=arrival))


def _pose(values: Sequence[float], name: str) -> Pose:
    """Check a pose that the user gave."""
    x, y, heading = _finite(values, 3, f"{name}: give x, y and heading")
    if abs(heading) > math.tau:
        raise InputError(
            f"{name}: a heading of {heading:g} is more than one turn; headings are in radians here, so give "
            f"math.radians({heading:g}) if you mean degrees"
        )
    return x, y, heading


def _place(values: Sequence[float]) -> tuple[float, float]:
    """Check a place that the user gave."""
    x, y = _finite(values, 2, "place on the way: give x and y")
    return x, y


def _finite(values: Sequence[float], count: int, wanted: str) -> list[float]:
    """Check that there are `count` finite numbers; the message says what is wanted."""
    try:
        numbers = [float(value) for value in values]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != count or not all(abs(number) < _FARTHEST for number in numbers):
        raise InputError(f"{wanted}, as finite numbers; not {values}")
    return numbers


class _Task:
    """A request for a way to a goal, with the lattices that were made for it."""

    def __init__(self, tracked: TrackedVehicle, start: Pose, goal: Pose, via: tuple[tuple[float, float], ...],
                 free_space: FreeSpace, request: PlanRequest, feedback: bool):  # fmt: skip
        self.tracked, self.start, self.goal, self.via = tracked, start, goal, via
        self.free_space, self.request, self.feedback = free_space, request, feedback
        self.least_dwell = check_least(request.least_dwell(tracked.robot))
        self.body = Footprint.of(tracked.robot, -tracked.vehicle.pivot_distance)
        self._lattices: dict[Drift, Lattices] = {}

    def plan_with(self, request: PlanRequest, longer: float = 0.0) -> GoalPlan:
        """Plan with the dwell that the request prefers; where there is no way, with shorter ones.

        Args:
            request: objective or dwell, tolerance.
            longer: length that a swing adds to the way.

        Raises:
            NoWayError: there is no way.
            InputError: the tolerance is not kept.
        """
        robot = self.tracked.robot
        if request.dwell is None:
            dwells = dwells_for(self.tracked.vehicle, request.objective, request.least_dwell(robot))
        else:
            dwells = [request.dwell]
        refusal: InputError | None = None
        for dwell in (dwells[i] for i in np.unique(np.linspace(0, len(dwells) - 1, _DWELLS).astype(int))):
            try:
                trip = self._plan_with_dwell(dwell, longer)
            except NoWayError as no_way:
                refusal = refusal or no_way
                continue
            if request.tolerance is None or trip.plan.stated_error <= request.tolerance:
                return trip
            refusal = InputError(
                f"tolerance {in_lab(request.tolerance, robot)} cannot be kept: with dwells of "
                f"{time_in_lab(dwell, robot)} the stated error is {in_lab(trip.plan.stated_error, robot)}; allow "
                "more"
            )
        assert refusal is not None
        raise refusal

    def _plan_with_dwell(self, dwell: float, longer: float) -> GoalPlan:
        """Plan with one shortest dwell; raise the margin until it is at least the stated error.

        Raises:
            NoWayError: there is no way with this dwell.
        """
        vehicle = self.tracked.vehicle
        straight = zigzag(vehicle, dwell)
        drift = zigzag_drift(self.tracked, straight, dwell)
        limits = RouteLimits(vehicle.pivot_radius, self.body, self.free_space, drift)
        margin = 0.0 if self.free_space.empty else 1.5 * straight.largest
        for _ in range(_MARGINS):
            lattices = self._lattices.setdefault(drift, {})
            track = route(self._stops(drift), limits, margin, lattices, self.tracked.robot)
            trip = self._follow(track, drift, straight, dwell, margin, longer)
            needed = trip.plan.feedback_error if self.feedback else trip.plan.stated_error
            if self.free_space.empty or (needed <= margin and trip.clearance > 0):
                return trip
            margin = max(_MORE * needed, margin * 1.02)
        raise NoWayError(
            f"there is no way that leaves the plan's stated error around the robot: it is "
            f"{in_lab(needed, self.tracked.robot)}; plan with feedback, make a table of this robot "
            f"({OWN_TABLE}), or move goal or obstacles"
        )

    def _stops(self, drift: Drift) -> list[Floats]:
        """Return the pivot's poses to choose from at the start, at each place on the way, and at the goal."""
        start, goal = (self._pivot(pose, drift)[None] for pose in (self.start, self.goal))
        courses = 2 * math.pi * np.arange(COURSES) / COURSES
        places = [np.stack([0 * courses + x, 0 * courses + y, courses], 1) for x, y in self.via]
        return [start, *places, goal]

    def _pivot(self, pose: Pose, drift: Drift) -> Floats:
        """Return place and course of the pivot: its direction of motion while the robot has this heading."""
        x, y, heading = pose
        a = self.tracked.vehicle.pivot_distance
        course = heading + float(slips_at_heading(np.array(heading), drift))
        return np.array([x - a * math.cos(heading), y - a * math.sin(heading), course])

    def _follow(
        self, track: Route, drift: Drift, straight: Zigzag, dwell: float, margin: float, longer: float
    ) -> GoalPlan:
        """Plan the schedule that follows a track of the pivot and ends at the goal."""
        tracked, vehicle = self.tracked, self.tracked.vehicle
        declared, sense = self._declared(track, drift)
        if longer:
            swinging, swing = swung_clear(declared.reference, longer, tracked, drift, self.free_space, margin)
            declared = replace(declared, reference=swinging, swing=swing)
        reference = declared.reference
        guidance = choose_guidance(vehicle, declared, straight, dwell)
        switches = follow(reference, vehicle, guidance, tracked.offset, start=Start(self.start, sense))
        least = min(dwell, max(self.least_dwell, _SHORTER * dwell))
        switches = end_at_goal(switches, self.goal, vehicle, least, reference.q)
        guidance = guidance._replace(dwell=min(dwell, float(switches.dwells.min())))
        drawn = Path2D(reference.p, False)
        # The guaranteed bound is for paths that turn less than the robot can; these arcs turn as much as it can.
        errors = plan_errors(tracked, drawn, declared, switches, guaranteed=None, seed=self.request.seed)
        plan = Plan(
            tracked, self.request.objective, drawn, declared, straight, guidance, switches, errors,
            camera=self.request.camera,
        )  # fmt: skip
        x, y, heading = switches.poses[-1].tolist()
        clearance = math.inf
        if not self.free_space.empty:
            body = Footprint.of(tracked.robot, 0.0)
            clearance = float(body.clearance(predicted_poses(vehicle, switches), self.free_space).min())
        end = (x, y, heading)
        return GoalPlan(plan, self.goal, end, self.via, self.free_space, track.length, margin, clearance)

    def _declared(self, track: Route, drift: Drift) -> tuple[Declared, int]:
        """Turn a track of the pivot into a declared path, and say to which side it turns first."""
        if track.length > LONGEST:
            length = in_lab(track.length, self.tracked.robot)
            raise InputError(f"the way is {length} long; at most {LONGEST:g} l can be planned")
        poses = track.poses(_SPACING)
        if len(poses) < 2:
            raise InputError("start and goal are the same; nothing to do")
        reference = Reference.of_pivot(poses, self.tracked.rod, drift, self.start[2])
        return Declared(reference, 0.0, 0.0, 0.0, ()), reference.first_turn
