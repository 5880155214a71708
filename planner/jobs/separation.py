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
from numpy.typing import NDArray
from shapely import distance, linestrings

from planner.paths.obstacles import Footprint
from planner.paths.path import Path2D, arc_length, axis_at, points_at
from planner.paths.tractrix import reference
from planner.planning.errors import LEVEL, WOBBLE, deviations_open_loop, error_growth, normals
from planner.planning.plan import Plan
from planner.vehicle.tracked_point import TrackedVehicle
from planner.vehicle.vehicle import roll_out
from planner.vehicle.zigzag import zigzag
from sim.arrays import Flags, Floats
from sim.io.errors import InputError
from sim.mechanics import planar

_PLACES = 300  # along a path
_DRAWS = 400
_SPACING = 0.05  # l, of the points of a tractrix
_FINER = 6  # instants in a dwell
_MOST = 40_000  # instants


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
    def body(self) -> Footprint:
        """The ends of the line that covers the body; all in m."""
        robot = self.plan.robot
        discs, length = Footprint.of(robot, 0.0), robot.length_scale
        return Footprint(length * np.array(discs.ends), length * discs.radius)

    def places(self, times: Floats) -> Places:
        """Return poses and errors at times (K,)."""
        return Places(self.body, self.poses(times), self.error(times))

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
        return self.motion.places(times - self.begin)


@dataclass(frozen=True)
class Places:
    """A body at K poses, with its error in place at each."""

    body: Footprint  # the ends of its line
    poses: Floats  # (K, 3)
    error: Floats  # (K,)

    @cached_property
    def lines(self) -> NDArray[np.object_]:
        """The body's line (K,) at each pose."""
        return np.asarray(linestrings(self.body.centres(self.poses)))


def instants(scheduled: Sequence[Scheduled]) -> Floats:
    """Choose times (K,) from 0 to the end of the last motion, several in the shortest dwell of any robot."""
    last = max(each.end for each in scheduled)
    dwell = min(each.motion.plan.minimum_dwell * each.motion.plan.robot.time_scale for each in scheduled)
    return np.linspace(0.0, last, min(math.ceil(_FINER * last / dwell), _MOST) + 1)


def distances(first: Places, second: Places) -> Floats:
    """Compute the distances (K,) of two bodies at the same K instants, negative where they overlap."""
    lines = distance(first.lines, second.lines)
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
    one, other = (each.body.centres(each.poses).mean(-2) for each in (first, second))
    needed = first.body.radius + second.body.radius + apart + first.error[:, None] + second.error
    halves = (np.ptp(first.body.places) + np.ptp(second.body.places)) / 2
    away = np.hypot(one[:, None, 0] - other[:, 0], one[:, None, 1] - other[:, 1])
    i, j = np.nonzero(away < needed + halves)  # distances of lines take longer
    near = np.zeros(needed.shape, dtype=bool)
    near[i, j] = distance(first.lines[i], second.lines[j]) < needed[i, j]
    return near


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
