"""to_goal(start, goal, robot): the motor's switching times from one pose to another, around obstacles.

The pivot moves like a car that only drives forward and has a least turn radius. Its shortest track between two
poses is one of Dubins' words, or a chain of them around obstacles (`planner.goal.route`). The schedule follows
that track like any other path (`planner.planning.solve`). Its last dwells are then adjusted so that the robot ends
at the goal with the wanted heading (`planner.goal.last_dwells`). If there is no track that leaves the margin,
shorter dwells are tried, which need less clearance. Lengths in l, angles in rad.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.keywords import checks_keywords
from planner.goal.last_dwells import Ending
from planner.goal.route import COURSES, Lattices, NoWayError, RouteLimits, route
from planner.guidance.line_of_sight import Start
from planner.options import AnyVehicle, GoalOptions, Length, asked, place_of, pose_of, swimmer_of
from planner.paths.dubins import DubinsPaths
from planner.paths.obstacles import Footprint, FreeSpace
from planner.paths.tractrix import Drift, Reference
from planner.paths.units import LONGEST, ask_about_days, heading_in_degrees, in_lab, place_in_lab
from planner.planning.declare import FeasiblePath
from planner.planning.picture import BODY, REPLAYED
from planner.planning.plan import Job, Plan
from planner.planning.solve import PathTask, Trial, solve
from planner.vehicle.zigzag import Objective, check_least
from sim.mechanics.planar import POSE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMAT = 1
_SPACING = 0.02  # l
_SHORTER = 0.4  # share of the chosen dwell that dwells near the end must keep
_ZIGZAGS = 1.5  # first margin over the zigzag


@dataclass(frozen=True)
class Trip(Job):
    """The way from a pose to a pose; poses are x, y and heading of the head's centre.

    Example:
        >>> from softflagella import load_robot, to_goal
        >>> plan = to_goal((0, 0, 0), (3, 1, 1), load_robot("paper-control"))
        >>> plan.job.end_error[0] < 0.01
        True
    """

    goal: POSE  # as asked for
    end: POSE  # predicted
    via: tuple[tuple[float, float], ...]  # places x, y that the pivot passes
    length: float  # of the pivot's track

    kind = "goal"

    @property
    def end_error(self) -> tuple[float, float]:
        """Predicted distance from the goal, and difference of the heading."""
        turn = (self.end[2] - self.goal[2] + math.pi) % (2 * math.pi) - math.pi
        return math.dist(self.end[:2], self.goal[:2]), abs(turn)

    def lines(self, plan: Plan) -> list[str]:
        """Say how long the way is, and where it ends."""
        robot, (off, turned), (x, y, heading) = plan.robot, self.end_error, self.end
        return [
            f"predicted end: {place_in_lab(x, y, robot)}, heading {heading_in_degrees(heading)}; "
            f"from the goal {in_lab(off, robot)} and {math.degrees(turned):.1g} degrees; "
            f"way of {in_lab(self.length, robot)}"
        ]

    def title(self, plan: Plan) -> str:
        """Name the length of the way."""
        return f"way {in_lab(self.length, plan.robot)}, {super().title(plan)}"

    def draw(self, axes: Axes, plan: Plan) -> None:
        """Draw the robot's axis at start and goal, and the places on its way."""
        cm, body = 100 * plan.robot.length_scale, Footprint.of(plan.robot, 0.0)
        axis = cm * np.array([body.places.min() - body.radius, body.places.max() + body.radius])
        for x, y, heading in (plan.start, self.goal):
            along = np.array([[math.cos(heading)], [math.sin(heading)]])
            axes.plot(*(np.array([[cm * x], [cm * y]]) + along * axis), color=BODY, lw=4, alpha=0.6)
            axes.plot(cm * x, cm * y, "o", color=BODY, ms=5)
        for x, y in self.via:
            axes.plot(cm * x, cm * y, "+", color=REPLAYED, ms=10)
        axes.autoscale_view()

    def to_dict(self, plan: Plan) -> dict[str, Any]:
        """Return the content of goal.json: what was asked for, what is predicted."""
        kept = plan.kept_clear
        return {
            "format": FORMAT,
            "start": plan.start,
            "goal": self.goal,
            "via": self.via,
            **(FreeSpace() if kept is None else kept.free_space).to_dict(),
            "predicted_end": self.end,
            "end_error_over_l": self.end_error[0],
            "end_error_rad": self.end_error[1],
            "length_over_l": self.length,
            "margin_over_l": 0.0 if kept is None else kept.margin,
            "predicted_clearance_over_l": None if kept is None else kept.clearance,
        }


@checks_keywords
def to_goal(
    start: Sequence[Length],
    goal: Sequence[Length],
    robot: AnyVehicle,
    *,
    via: Sequence[tuple[Length, Length]] = (),
    objective: Objective = "time",
    progress: Callable[[float], object] | None = None,
    **options: Unpack[GoalOptions],
) -> Plan[Trip]:
    """Plan the motor's switching times from one pose to another.

    Args:
        start: x, y [l] and heading [rad] of the head's centre, at rest; or words: X, Y and degrees.
        goal: the same at the end.
        robot: robot.toml or the name of a preset, with its motor speed in both directions; or the vehicle.toml of
            a measured vehicle. In Python also the robot or the vehicle.
        via: X Y, of a place that the pivot passes on its way.
        objective: what decides the dwell: small error, short time, or few flips.
        progress: called now and then with the share of what is done.
        options: see `GoalOptions`.

    Raises:
        NoWayError: there is no way to the goal; it is an `InputError`.
        InputError: a pose or a region is bad, or the robot cannot be simulated.

    Example:
        >>> import softflagella as sf
        >>> trip = sf.to_goal((0, 0, 0), (4, 1, 0), "paper-control")
        >>> trip.job.end_error[0] < 0.01
        True
    """
    swims, unit = swimmer_of(robot), options.get("unit")
    begin, end = pose_of(start, unit, swims, "--start"), pose_of(goal, unit, swims, "--goal")
    passed = tuple(place_of(place, unit, swims, "--via") for place in via)
    tracked, request = asked(robot, options, objective=objective)
    vehicle, space = tracked.vehicle, request.space
    ask_about_days(sum(map(math.dist, [begin[:2], *passed], [*passed, end[:2]])), swims, vehicle.speed)
    least_dwell = check_least(request.least_dwell(swims))
    lattices: dict[Drift, Lattices] = {}

    @cache
    def track(drift: Drift, margin: float) -> DubinsPaths:
        limits = RouteLimits(vehicle.pivot_radius, tracked.body, space, drift)
        stops = _stops(begin, end, passed, vehicle.pivot_distance, drift)
        return route(stops, limits, margin, lattices.setdefault(drift, {}), swims)

    def source(trial: Trial) -> FeasiblePath:
        way = track(trial.drift, trial.margin or 0.0)
        if way.total > LONGEST:
            raise InputError(f"the way is {in_lab(way.total, swims)} long; at most {LONGEST:g} l can be planned")
        poses = way.chain(_SPACING)
        if len(poses) < 2:
            raise InputError("start and goal are the same; nothing to do")
        # The guaranteed bound is for paths that turn less than the robot can; these arcs turn as much as it can.
        return FeasiblePath(
            Reference.of_pivot(poses, tracked.rod, drift=trial.drift, heading=begin[2]), curvature=0.0
        )

    task = PathTask(
        source=source, start=lambda declared: Start(begin, declared.reference.first_turn),
        finish=Ending(end, least_dwell, _SHORTER), zigzags=_ZIGZAGS, try_longer=False, blocked=NoWayError,
    )  # fmt: skip
    plan = solve(task, tracked, request, progress)
    margin = 0.0 if plan.kept_clear is None else plan.kept_clear.margin
    length = track(tracked.drift(plan.straight), margin).total
    return plan.with_job(Trip(end, plan.end, passed, length))


def _stops(start: POSE, goal: POSE, via: Sequence[tuple[float, float]], back: float, drift: Drift) -> list[Floats]:
    """Return the pivot's poses to choose from at the start, at each place on the way, and at the goal.

    Args:
        start, goal: poses of the head's centre.
        via: places on the way.
        back: distance from the head's centre back to the pivot.
        drift: what carries the robot off its heading.
    """
    ends = []
    for x, y, heading in (start, goal):
        course = heading + float(drift.slip_at(heading))
        ends.append(np.array([[x - back * math.cos(heading), y - back * math.sin(heading), course]]))
    courses = 2 * math.pi * np.arange(COURSES) / COURSES
    return [ends[0], *(np.stack([0 * courses + x, 0 * courses + y, courses], 1) for x, y in via), ends[1]]
