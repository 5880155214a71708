"""Where robots are at any time of their plans, how far they may be off, and how near their bodies come.

A body is a line along the axis, from head to the ends of straight tails, with a width on all sides; it covers the
discs of `planner.paths.obstacles.Footprint`. The distance of two bodies is that of their lines, less their
widths. Robots are apart at an instant if this distance, less the errors in place of both, is at least the distance
asked for.

*Error in place*: the stated error of a plan is a distance from its path, and says nothing about time. The error in
place is a curve over time below which 95 % of the robots that the model's uncertainty allows keep both ends of
their body, all the time. *Open loop* it comes from the deviations from which the stated error is computed
(`planner.planning.errors`), in all directions.

*With feedback*, a tracker holds the robot to its path, but not to a time. Across the path the robot is within the
stated error with feedback, the prediction within its own largest error, and the two may swing in opposite phases.
Along the path the robot is late or early by

    lag(s) = V [t′(s) − t(s)] + b ∫ |κ| √(1 + κ² a²) dσ,

where t is the time in which the pivot passes the tractrix of the path, t′ the same for a robot with another speed,
rod or current, and b the part of the error with feedback that is not the zigzag: the pivot of a robot that is
outside on a curve has a longer way. Lengths in m and times in s; errors in place in l and μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from planner.draws import normals
from planner.paths.obstacles import Footprint
from planner.paths.path import Path2D, arc_length, axis_at, points_at
from planner.paths.tractrix import reference
from planner.paths.units import Swimmer
from planner.planning.errors import LEVEL, WOBBLE, deviations_open_loop, error_growth
from planner.planning.plan import Plan
from planner.vehicle.rollout import roll_out
from planner.vehicle.tracked_point import TrackedVehicle
from planner.vehicle.zigzag import zigzag
from sim.arrays import Flags, Floats
from sim.io.errors import InputError
from sim.mechanics import planar

_PLACES = 300  # along a path
_DRAWS = 400
_SPACING = 0.05  # l, of the points of a tractrix
_ROWS = 200  # of a table of pairs at once
_FINER = 6  # instants in a dwell
_MOST = 40_000  # instants


@dataclass(frozen=True)
class Body:
    """A line along the robot's axis, with a width. Lengths in m."""

    front: float  # end of the line, forward from the head's centre
    back: float  # other end, negative
    radius: float  # of the body around the line

    @staticmethod
    def of(robot: Swimmer) -> Body:
        """Cover head and straight tails."""
        discs, length = Footprint.of(robot, 0.0), robot.length_scale
        front, back = discs.ends
        return Body(front * length, back * length, discs.radius * length)

    @property
    def reach(self) -> float:
        """Largest distance of a point of the body from the head's centre."""
        return max(self.front, -self.back) + self.radius

    def ends(self, poses: Floats) -> Floats:
        """Compute the ends (..., 2, 2) of the line at poses (..., 3) of the head's centre."""
        axis = axis_at(poses[..., 2])
        return np.asarray(poses[..., None, :2] + np.array([[self.front], [self.back]]) * axis[..., None, :])


@dataclass(frozen=True)
class TimedMotion:
    """A plan in time, from the start of its motor."""

    plan: Plan  # in l and μ0 l⁴/EI
    feedback: bool  # the pose is measured for a tracker

    @property
    def duration(self) -> float:
        """Time until the motor stops [s]."""
        return self.plan.duration * self.plan.robot.time_scale

    @cached_property
    def body(self) -> Body:
        """What must keep apart from other bodies."""
        return Body.of(self.plan.robot)

    def poses(self, times: Floats) -> Floats:
        """Predict the poses (K, 3) of the head's centre [m, rad] at times (K,) [s]; it rests before and after."""
        plan = self.plan
        vehicle, switches, robot = plan.tracked.vehicle, plan.switches, plan.robot
        ends = plan.flip_times
        own = np.clip(times / robot.time_scale, 0.0, ends[-1])
        dwell = np.clip(np.searchsorted(ends, own, side="right") - 1, 0, len(plan.dwells) - 1)
        elapsed, before = own - ends[dwell], plan.dwells[dwell - 1]
        changes = np.empty((len(own), 3))
        for parity, sense in enumerate((switches.first_direction, -switches.first_direction)):
            rows = dwell % 2 == parity
            changes[rows] = vehicle.motion(sense, before[rows], elapsed[rows])
        first = dwell == 0
        changes[first] = vehicle.motion(switches.first_direction, None, elapsed[first])
        poses = planar.compose(switches.poses[dwell], changes)
        poses[:, :2] += vehicle.current * elapsed[:, None]
        return np.asarray(poses * [robot.length_scale, robot.length_scale, 1.0])

    def error(self, times: Floats) -> Floats:
        """Return the error in place (K,) [m] at times (K,) [s]; a robot that has not begun is where it was put."""
        known, error = self._band
        return np.where(times <= 0, 0.0, np.interp(times, known, error))

    @cached_property
    def _band(self) -> tuple[Floats, Floats]:
        """Times [s] and errors in place [m]."""
        robot = self.plan.robot
        times, error = (error_with_feedback if self.feedback else error_open_loop)(self.plan)
        return times * robot.time_scale, error * robot.length_scale


@dataclass(frozen=True, eq=False)
class Scheduled:
    """A motion that begins at a time; before, the robot rests at its start, and afterwards at its end."""

    motion: TimedMotion  # that is carried out
    begin: float  # [s]
    circles: int = 0  # waiting circles that the motion has more than the plan it was made from

    @property
    def end(self) -> float:
        """Time at which the robot stops [s]."""
        return self.begin + self.motion.duration

    def places(self, times: Floats) -> Places:
        """Return poses and errors at times (K,) of the fleet."""
        own = times - self.begin
        return Places(self.motion.body, self.motion.poses(own), self.motion.error(own))


@dataclass(frozen=True)
class Places:
    """A body at K poses, with its error in place at each."""

    body: Body
    poses: Floats  # (K, 3)
    error: Floats  # (K,)

    def middles(self) -> Floats:
        """Return the middles (K, 2) of the body's line."""
        return self.body.ends(self.poses).mean(-2)


def instants(scheduled: Sequence[Scheduled]) -> Floats:
    """Choose times (K,) from 0 to the end of the last motion, several in the shortest dwell of any robot."""
    last = max(each.end for each in scheduled)
    dwell = min(each.motion.plan.minimum_dwell * each.motion.plan.robot.time_scale for each in scheduled)
    return np.linspace(0.0, last, min(math.ceil(_FINER * last / dwell), _MOST) + 1)


def distances(first: Places, second: Places) -> Floats:
    """Compute the distances (K,) of two bodies at the same K instants, negative where they overlap."""
    lines = line_distance(first.body.ends(first.poses), second.body.ends(second.poses))
    return np.asarray(lines - first.body.radius - second.body.radius)


class Approach(NamedTuple):
    """How near two robots come to each other at K instants [s, m]."""

    times: Floats  # (K,)
    predicted: Floats  # (K,), distances between bodies
    sure: Floats  # (K,), less the errors in place of both


def approach(first: Scheduled, second: Scheduled) -> Approach:
    """Compute the distances of two robots from the beginning until both have ended."""
    times = instants([first, second])
    one, other = first.places(times), second.places(times)
    predicted = distances(one, other)
    return Approach(times, predicted, predicted - one.error - other.error)


def too_near(first: Places, second: Places, apart: float) -> Flags:
    """Tell for all pairs of poses (I, J) whether bodies may be nearer than `apart`."""
    ends, other_ends = first.body.ends(first.poses), second.body.ends(second.poses)
    middles, others = first.middles(), second.middles()
    widths = first.body.radius + second.body.radius + apart
    halves = (first.body.front - first.body.back + second.body.front - second.body.back) / 2
    near = np.zeros((len(middles), len(others)), dtype=bool)
    gap = np.maximum(middles.min(0) - others.max(0), others.min(0) - middles.max(0)).max()
    if gap > widths + halves + first.error.max() + second.error.max():
        return near
    for begin in range(0, len(middles), _ROWS):
        rows = slice(begin, begin + _ROWS)
        needed = widths + first.error[rows, None] + second.error
        away = np.hypot(middles[rows, None, 0] - others[:, 0], middles[rows, None, 1] - others[:, 1])
        i, j = np.nonzero(away < needed + halves)
        near[begin + i, j] = line_distance(ends[begin + i], other_ends[j]) < needed[i, j]
    return near


def line_distance(first: Floats, second: Floats) -> Floats:
    """Compute the distances (...) of straight lines with ends (..., 2, 2); 0 where they cross."""
    a, b, c, d = first[..., 0, :], first[..., 1, :], second[..., 0, :], second[..., 1, :]
    squares = [_to_line(a, c, d), _to_line(b, c, d), _to_line(c, a, b), _to_line(d, a, b)]
    crossing = (_side(a, b, c) * _side(a, b, d) < 0) & (_side(c, d, a) * _side(c, d, b) < 0)
    return np.where(crossing, 0.0, np.sqrt(np.minimum.reduce(squares)))


def _to_line(point: Floats, begin: Floats, end: Floats) -> Floats:
    """Compute squared distances (...) of points (..., 2) from lines."""
    edge, away = end - begin, point - begin
    share = np.clip((away * edge).sum(-1) / np.maximum((edge**2).sum(-1), 1e-300), 0.0, 1.0)
    return np.asarray(((away - share[..., None] * edge) ** 2).sum(-1))


def _side(begin: Floats, end: Floats, point: Floats) -> Floats:
    """Tell by the sign on which side of a line points lie."""
    edge, away = end - begin, point - begin
    return np.asarray(edge[..., 0] * away[..., 1] - edge[..., 1] * away[..., 0])


def error_open_loop(plan: Plan) -> tuple[Floats, Floats]:
    """Return times (E,) and the error in place (E,) of a robot that carries out the schedule open loop."""
    tracked, switches = plan.tracked, plan.switches
    growth = error_growth(tracked.vehicle, switches, roll_out(tracked.vehicle, switches))
    moved, turned = deviations_open_loop(growth)
    heading = plan.poses[growth.flips[1:], 2]
    left = np.stack([-np.sin(heading), np.cos(heading)], -1)
    sizes = []
    for place in Footprint.of(plan.robot, 0.0).ends:
        away = moved + turned[..., None] * place * left
        sizes.append(np.hypot(away[..., 0], away[..., 1]))
    times = plan.flip_times[growth.flips]
    return times, WOBBLE + np.concatenate([[0.0], _band(np.maximum(*sizes))])


def error_with_feedback(plan: Plan) -> tuple[Floats, Floats]:
    """Return times (E,) and the error in place (E,) of a robot under a tracker."""
    declared, tracked = plan.declared.reference, plan.tracked
    arcs = np.linspace(0.0, declared.arc[-1], _PLACES)
    lag = _lag(plan, arcs)
    levers = tracked.body.ends
    along = np.zeros(_PLACES)
    for lever in levers:
        p = declared.q + lever * axis_at(declared.heading)
        here = points_at(arcs, declared.arc, p)
        for shifted in (arcs + lag, arcs - lag):
            along = np.maximum(along, np.hypot(*(points_at(shifted, declared.arc, p) - here).T))
    beyond = max(0.0, max(map(abs, levers)) - tracked.rod)
    across = plan.predicted_max + plan.feedback_error + plan.straight.swing * beyond
    return times_at(plan, arcs), np.hypot(WOBBLE + along, across)


def times_at(plan: Plan, arcs: Floats) -> Floats:
    """Estimate the times (K,) at which the pivot has come so far (K,) along its reference."""
    axis = axis_at(plan.poses[:, 2])
    way = arc_length(plan.poses[:, :2] - plan.tracked.vehicle.pivot_distance * axis)
    at = arcs / float(plan.declared.reference.arc[-1]) * way[-1]
    return np.asarray(np.interp(at, way, plan.flip_times))


def _lag(plan: Plan, arcs: Floats) -> Floats:
    """Bound how far along its reference (K,) the pivot is late or early."""
    declared, tracked = plan.declared.reference, plan.tracked
    path = Path2D(declared.p, False)
    planned = _passing_times(path, tracked, plan.minimum_dwell)
    lags = []
    for mode in tracked.vehicle.modes:
        try:
            changed = tracked._replace(vehicle=tracked.vehicle.off_by(mode))
            late = _passing_times(path, changed, plan.minimum_dwell) - planned
        except InputError:  # such a robot does not get ahead; the others tell enough
            continue
        lags.append(plan.straight.net_speed * late)
    bend = np.abs(declared.curvature)
    bias = max(plan.feedback_error - plan.predicted_max, 0.0)
    outside = np.concatenate([
        [0.0],
        np.cumsum(bend * np.sqrt(1 + (bend * tracked.vehicle.pivot_distance) ** 2) * np.diff(declared.arc)),
    ])  # fmt: skip
    late = np.zeros(_PLACES)
    if lags:
        late = _band(np.abs(normals(0, 0, _DRAWS * len(lags)).reshape(_DRAWS, -1) @ np.array(lags)))
    return np.asarray(late + bias * np.interp(arcs, declared.arc, outside))


def _passing_times(path: Path2D, tracked: TrackedVehicle, dwell: float) -> Floats:
    """Compute the times (K,) at which the pivot of a robot that follows a path passes equal parts of it."""
    straight = zigzag(tracked.vehicle, dwell, tracked.offset)
    drift = tracked.drift(straight)
    followed = reference(path, tracked.rod, max(_SPACING, path.length / 4000), drift)
    heading = (followed.heading[1:] + followed.heading[:-1]) / 2
    ahead = 1 + drift.current[0] * np.cos(heading) + drift.current[1] * np.sin(heading)
    steps = np.diff(followed.arc) / np.maximum(ahead, 0.1) / straight.speed
    times = np.concatenate([[0.0], np.cumsum(steps)])
    return np.asarray(np.interp(np.linspace(0.0, 1.0, _PLACES), np.linspace(0.0, 1.0, len(times)), times))


def _band(sizes: Floats) -> Floats:
    """Bound draws (D, E) by a curve (E,) below which LEVEL of them stay all the time."""
    level = np.maximum(np.quantile(sizes, LEVEL, axis=0), 1e-9)
    return np.asarray(level * np.quantile((sizes / level).max(1), LEVEL))
