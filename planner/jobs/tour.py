"""tour(places, robot): the order in which a robot visits places, and one plan that visits them all.

The tracked point passes every place; its heading there is free. The order is the one in which this vehicle needs
the least time (`planner.jobs.travel`, `planner.jobs.shortest_order`), with COURSES directions of motion at
each place. The directions of this order and of its rivals are then refined, and the quickest of them is taken.
Where places are nearer to each other than a turn, a direction that is a few degrees off costs a whole circle, so
COURSES is large. The tracks between the places are joined to one reference, which is
followed as every declared path is. Obstacles are left to the ways around (`planner.jobs.detours`); where a track
is blocked, the order is chosen as if that took some turn radii more. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.keywords import checks_keywords
from common.units import format_time
from planner.goal.route import best_options
from planner.jobs.shortest_order import EXACT, shortest_order
from planner.jobs.travel import SLACK, Travel, plan_track, preferred_trial
from planner.options import AnyVehicle, JobOptions, asked, places_of
from planner.paths.distance import distance_to
from planner.paths.dubins import DubinsPaths
from planner.paths.tractrix import Drift
from planner.paths.units import in_lab, place_in_lab
from planner.planning.picture import REPLAYED, label_points
from planner.planning.plan import Job, Plan
from planner.progress import ProgressCallback

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMAT = 1
COURSES = 72  # directions of motion at a place, for an exact order
FEWER_COURSES = 16  # for many places, and among obstacles
_SPACING = 0.02  # of the reference's points
_FINER = 4  # refinements of the directions
_MARGINS = 3  # around obstacles, with which orders are sought
_MISSED = 0.05  # l; a place that a way around leaves further aside is refused


@dataclass(frozen=True)
class Visits(Job):
    """The places that a plan visits. Lengths in l, times in μ0 l⁴/EI.

    Example:
        >>> import softflagella as sf
        >>> tour = sf.tour([(0, 0), (4, 0), (2, 1)], "paper-control")
        >>> tour.job.order, tour.job.exact
        ((0, 2, 1), True)
    """

    places: Floats  # (n, 2), as they were given
    order: tuple[int, ...]  # indices of the places; with a return, the first one again at the end
    exact: bool  # no order is quicker, with the directions of motion that were tried at each place
    gap: float  # how much longer than the quickest order this one may take, as a share
    estimate: float  # time of the tour by which orders were compared
    reached: Floats  # (k,), time at which the predicted track is nearest to each place of the order
    distance: Floats  # (k,), from the predicted track then
    courses: int  # directions of motion that were tried at each place

    kind = "tour"

    def lines(self, plan: Plan) -> list[str]:
        """Say order, times and distances."""
        robot = plan.robot
        tried = f"with {self.courses} headings tried at each place"
        if self.exact:
            proven = f"no other order is quicker, {tried}"
        elif plan.kept_clear is None:
            proven = f"at most {100 * self.gap:.0f} % longer than the quickest order, {tried}"
        else:
            proven = "the quickest one of those with direct ways; ways around obstacles were estimated"
        return [
            f"order: {' '.join(str(index + 1) for index in self.order)}; {proven}",
            f"{format_time(plan.duration * robot.time_scale)} in all; the predicted track passes every place "
            f"within {in_lab(float(self.distance.max()), robot)}",
        ]

    def draw(self, axes: Axes, plan: Plan) -> None:
        """Draw the numbers of the places."""
        cm = 100 * plan.robot.length_scale
        places = cm * self.places
        axes.plot(*places.T, "o", color=REPLAYED, ms=5)
        numbers = [str(index + 1) for index in range(len(places))]
        label_points(axes, places, numbers, REPLAYED, 9)

    def to_dict(self, plan: Plan) -> dict[str, Any]:
        """Return the content of tour.json. Lengths in l, times in seconds."""
        scale = plan.robot.time_scale
        return {
            "format": FORMAT,
            "places": self.places.tolist(),
            "order": list(self.order),
            "exact": self.exact,
            "gap": self.gap,
            "estimated_s": self.estimate * scale,
            "reached_s": (self.reached * scale).tolist(),
            "distance_over_l": self.distance.tolist(),
        }


@checks_keywords
def tour(
    places: str | Path | Sequence[Sequence[float] | str],
    robot: AnyVehicle,
    *,
    back: bool = False,
    any_start: bool = False,
    **options: Unpack[JobOptions],
) -> Plan[Visits]:
    """Visit places in the order that takes the robot the least time, with free headings.

    Args:
        places: X,Y of each, or one CSV or SVG with a point for each. The tour begins at the first one. Up to 12
            more are ordered exactly; of more it is stated how much longer than the quickest order the tour may
            be. In Python, `job.gap` states it, and a place may be x, y [l].
        robot: robot.toml or the name of a preset, or the vehicle.toml of a measured vehicle. In Python also the
            robot or the vehicle.
        back: end where the tour began.
        any_start: begin at any of the places.
        options: see `JobOptions`.

    Raises:
        InputError: a place is no pair of finite numbers, is there twice, or cannot be visited.

    Example:
        >>> import softflagella as sf
        >>> tour = sf.tour([(0, 0), (4, 0), (2, 1)], "paper-control", objective="time")
        >>> tour.job.order, tour.job.exact, len(tour.dwells) > 10
        ((0, 2, 1), True, True)
    """
    tracked, request = asked(robot, options)
    visited = _checked(places_of(places, options.get("unit"), tracked.robot))
    task, trial = _Tour(visited, any_start, back), preferred_trial(tracked, request)
    margin = 1.5 * trial.straight.largest
    for _ in range(_MARGINS):
        found = task.ordered(Travel.of(trial, request.space, margin), options.get("progress"))
        plan = plan_track(partial(task.track, found), trial, request, options.get("progress"))
        if plan.kept_clear is None or not plan.kept_clear.detours or plan.kept_clear.margin <= margin:
            break
        margin = plan.kept_clear.margin
    return plan.with_job(task.visits(plan, found.job))


def _checked(places: Sequence[Sequence[float]]) -> Floats:
    """Refuse fewer than two places, and two that are the same."""
    table = np.array(places, dtype=float)
    if len(table) < 2:
        raise InputError("places: give two or more, each as x and y")
    for index, place in enumerate(table):
        same = np.flatnonzero(np.hypot(*(table[:index] - place).T) < 1e-6)
        if len(same):
            raise InputError(f"places {same[0] + 1} and {index + 1} are the same; leave one out")
    return table


class _Ordered(NamedTuple):
    """An order of places with a direction of motion at each."""

    job: Visits  # without times and distances
    courses: Floats  # (k,)
    travel: Travel


class _Tour(NamedTuple):
    """The places of a tour, and how it begins and ends."""

    places: Floats
    any_start: bool
    back: bool

    def ordered(self, travel: Travel, progress: ProgressCallback | None) -> _Ordered:
        """Find the order, and refine the directions of motion."""
        count = len(self.places)
        # Among obstacles times are estimates, which prove nothing of an order.
        exact = count - (not self.any_start) <= EXACT and travel.limits.space.empty
        options = COURSES if exact else FEWER_COURSES
        courses = 2 * math.pi * np.arange(options) / options
        poses = travel.poses(self.places[:, None], np.tile(courses, (count, 1)))
        free = travel.limits.clearance(poses) >= travel.margin + SLACK
        if not free.any(1).all():
            blocked = int(free.any(1).argmin())
            x, y = self.places[blocked].tolist()
            raise InputError(
                f"place {blocked + 1} at {place_in_lab(x, y, travel.tracked.robot)} cannot be visited: with "
                "every heading the robot touches what it must keep clear of; move the place away from it"
            )
        flat = poses.reshape(-1, 3)
        costs = travel.times(np.repeat(flat, len(flat), 0), np.tile(flat, (len(flat), 1)), progress)
        costs = costs.reshape(count, options, count, options)
        closing = costs.min(-1).transpose(2, 0, 1) if self.back else np.zeros((count, count, options))
        # A given first place is not in the order: the way from it, with its best course, is the cost of a start.
        if self.any_start:
            first, start, end = 0, np.where(free, 0.0, np.inf), closing if self.back else closing[0]
        else:
            first, start, end = 1, costs[0, :, 1:].min(0), closing[0, 1:]
        # Rivals are within what finer courses may change, so the best order is known only after refining.
        best = shortest_order(costs[first:, :, first:], start, end)
        refined = []
        for visits in (best.visits, *best.rivals):
            order = [*range(first), *(first + k for k in visits)]
            order += order[: self.back]
            refined.append((*self._refined(order, courses, travel), order))
        chosen, estimate, order = min(refined, key=itemgetter(1))
        unknown = np.zeros(0)
        job = Visits(self.places, tuple(order), exact, best.gap, estimate, unknown, unknown, options)
        return _Ordered(job, chosen, travel)

    def _refined(self, order: list[int], courses: Floats, travel: Travel) -> tuple[Floats, float]:
        """Find the directions of motion with which an order takes the least time."""
        places = self.places[order]
        step = float(courses[1])
        choices = np.tile(courses, (len(order), 1))
        for _ in range(_FINER + 1):
            poses = travel.poses(places[:, None], choices)
            chosen, total = _quickest(poses, travel)
            step /= 3
            choices = chosen[:, None] + step * np.arange(-3, 4)
        return chosen, total

    def track(self, found: _Ordered, drift: Drift) -> DubinsPaths:
        """Join the places by tracks of the pivot."""
        travel = found.travel.drifting(drift)
        poses = travel.poses(self.places[list(found.job.order)], found.courses)
        return travel.tracks(poses[:-1], poses[1:])

    def visits(self, plan: Plan, job: Visits) -> Visits:
        """Compare the predicted track with the places.

        Raises:
            InputError: a way around leaves a place aside.
        """
        visited = self.places[list(job.order)]
        aside = distance_to(plan.reference, visited)
        if aside.max() > _MISSED:
            worst = int(aside.argmax())
            x, y = visited[worst].tolist()
            raise InputError(
                f"place {job.order[worst] + 1} at {place_in_lab(x, y, plan.robot)} cannot be visited: the way "
                f"around obstacles passes it at {in_lab(float(aside[worst]), plan.robot)}; move it away from them"
            )
        samples = (len(plan.track) - 1) // len(plan.dwells)
        times = np.concatenate([[0.0], np.cumsum(np.repeat(plan.dwells / samples, samples))])
        reached, distance = _passed(plan.track, times, visited, before=plan.predicted_max)
        return replace(job, reached=reached, distance=distance)


def _quickest(poses: Floats, travel: Travel) -> tuple[Floats, float]:
    """Choose among poses (k, C, 3) at each stop those of the quickest chain; return courses (k,) and its time."""
    stops, options, _ = poses.shape
    here, there = np.repeat(poses[:-1], options, 1), np.tile(poses[1:], (1, options, 1))
    times = travel.times(here.reshape(-1, 3), there.reshape(-1, 3))
    chosen, total = best_options(list(times.reshape(stops - 1, options, options)))
    return poses[np.arange(stops), chosen, 2], total


def _passed(track: Floats, times: Floats, visited: Floats, *, before: float) -> tuple[Floats, Floats]:
    """Find when a track (S, 2) passes places (k, 2) in their order, and how near.

    The track may come near to one place several times: the first time after the place before counts, unless it
    comes nearer by more than `before` later.
    """
    reached, distance, first = [], [], 0
    for index, place in enumerate(visited):
        away = np.hypot(*(track[first:] - place).T)
        if index == 0:
            nearest = 0
        elif index == len(visited) - 1:
            nearest = len(away) - 1 - int(away[::-1].argmin())
        else:
            near = away <= away.min() + before
            begin = int(near.argmax())
            end = begin + int((~near[begin:]).argmax()) if not near[begin:].all() else len(near)
            nearest = begin + int(away[begin:end].argmin())
        first += nearest
        reached.append(float(times[first]))
        distance.append(float(np.hypot(*(track[first] - place))))
    return np.array(reached), np.array(distance)
