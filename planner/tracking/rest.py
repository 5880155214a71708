"""The rest of a plan from where a robot is: a way back to the path, and the path that is left.

The place that the robot has reached follows from its track so far. Along the track a place of the path is chosen
for each pose, so that the sum of their mismatches is least. Places never go back, and never advance faster than
the robot can swim. So where a robot was carried to another part of its path, it has reached the place where it was
taken away: the last one at less than FARTHEST from a pose. The mismatch is the distance of the pivots, at most
FARTHEST, and TURNED (1 − cos Δ) for headings that differ by Δ. Where the track begins in the middle of the path,
the length that is left out before counts LEFT_OUT, as on a way back. The least sum is found by dynamic
programming.

Where the robot is near that place and turned along the path, the rest begins there. Elsewhere it gets the
tracker's way back (`planner.tracking.guidance`), or with obstacles a way among them (`planner.goal.route`). Way
and path together are the declared path of the new plan, so its errors are stated from where the robot is. It keeps
dwell and guidance of the old plan. Lengths in l.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import minimum_filter1d

from planner.goal.dubins import words
from planner.goal.route import Lattices, NoWayError, RouteLimits, route
from planner.paths.distance import two_sided
from planner.paths.path import Path2D, arc_length, axis_at, resample
from planner.paths.tractrix import Drift, Reference
from planner.paths.units import in_lab, place_in_lab
from planner.planning.conditions import KeptClear
from planner.planning.declare import Declared
from planner.planning.line_of_sight import Start
from planner.planning.plan import Job, Plan
from planner.planning.request import POSE
from planner.planning.solve import Setting, follow_declared
from planner.tracking.guidance import LEFT_OUT, ROOM, SEGMENTS, TrackerGuidance, shortest_way, stride
from sim.arrays import Floats, Integers
from sim.io.errors import InputError

_SPACING = 0.02  # of a way
_WORTH = 1.0  # of a length of the path: what it costs to leave it out
_NEAR = 0.02  # l, rad: what is near in any case
_ROUNDING = 1e-9  # the start may be the place with the largest error
_CANDIDATES = 12  # places of the path, a turn radius apart, to which a way among obstacles may lead
_GUESS = 0.2  # what a length along the drawn path counts beside the distance from it
FARTHEST = 1.0
TURNED = 0.5
FASTER = 1.5  # times the robot's largest speed
_MOST_POSES = 2000
_MOST_PLACES = 4000


@dataclass(frozen=True)
class Remainder(Job):
    """What is left of a plan, and how the robot comes back to it."""

    followed: float  # length of the path up to the place that the robot has reached
    way: float  # length of the way back; 0: none
    left_out: float  # length of the path that the way leaves out
    joins: tuple[float, float]  # x, y of the tracked point where the way ends

    def lines(self, plan: Plan) -> list[str]:
        """Say it in one sentence."""
        robot = plan.robot
        done = f"the track has followed {in_lab(self.followed, robot)} of the path"
        if self.way == 0:
            return [f"{done}; the robot goes on from there"]
        return [
            f"{done}; a way of {in_lab(self.way, robot)} joins it at {place_in_lab(*self.joins, robot)}, "
            f"{in_lab(self.left_out, robot)} of the path is left out"
        ]


def rest_of(plan: Plan, times: Floats, poses: Floats) -> Plan[Remainder]:
    """Plan the rest of a plan from the last pose of a track, at rest there.

    Args:
        plan: the plan that the robot has followed so far.
        times: (N,), not falling [μ0 l⁴/EI].
        poses: (N, 3) of the head's centre at these times.

    Raises:
        InputError: the path has been followed to its end, or no way leads back to it.
    """
    reference = plan.declared.reference
    place = place_reached(plan, times, poses)
    if place > len(reference.q) - 2:
        raise InputError("the track has followed the path to its end; there is nothing left to plan")
    x, y, heading = poses[-1].tolist()
    heading += 2 * math.pi * round((float(reference.heading[place]) - heading) / (2 * math.pi))
    way, join = _way(plan, (x, y, heading), place, plan.drift)
    path = reference.part(join)
    if way is not None:
        path = Reference.joined(way.part(0, -1), path)
    joins_x, joins_y = reference.p[join].tolist()
    remainder = Remainder(
        float(arc_length(reference.p)[place]),
        0.0 if way is None else float(way.arc[-1]),
        float(arc_length(reference.p[place : join + 1])[-1]),
        (joins_x, joins_y),
    )
    rest = _planned(plan, path, (x, y, heading), 0 if way is None else len(way.q) - 1, join)
    return rest.with_job(remainder)


def place_reached(plan: Plan, times: Floats, poses: Floats) -> int:
    """Return the point of the reference that a robot has reached; see `rest_of`."""
    vehicle, heading = plan.tracked.vehicle, poses[:, 2]
    q = poses[:, :2] - vehicle.pivot_distance * axis_at(heading)
    speed = vehicle.speed + float(np.hypot(*vehicle.current))
    return reached(plan.declared.reference, times, np.column_stack([q, heading]), speed)


def _way(plan: Plan, pose: POSE, place: int, drift: Drift) -> tuple[Reference | None, int]:
    """Find the way from a pose to the path, and the point of the reference where it ends."""
    law = TrackerGuidance(plan)
    law.go_to((place, 0.0, SEGMENTS, 0.0))
    distance = law.distance(pose)[0]
    turned = pose[2] - float(plan.declared.reference.heading[law.place])
    near = max(plan.predicted_max, plan.straight.largest, _NEAR) * (1 + _ROUNDING)
    if abs(distance) <= near and abs(turned) <= max(plan.straight.swing, _NEAR):
        return None, law.place
    a, (x, y, heading) = plan.tracked.vehicle.pivot_distance, pose
    course = heading + float(drift.slip_at(heading))
    start = x - a * math.cos(heading), y - a * math.sin(heading), course
    current = float(np.hypot(*plan.tracked.vehicle.current)) / plan.straight.speed
    radius = plan.tracked.vehicle.pivot_radius * (1 + current) / ROOM
    reference = plan.declared.reference
    targets = reference.part(place, -1).courses(drift)
    left_out = reference.arc[place:-1] - reference.arc[place]
    track, target = shortest_way(start, targets, left_out, stride(plan), radius, _WORTH)
    poses, join = track.sampled(_SPACING), place + target
    if (kept := plan.kept_clear) is not None:
        limits = RouteLimits(radius, plan.tracked.body, kept.free_space, drift)
        if len(poses) and float(limits.clearance(poses).min()) < kept.margin:
            poses, join = _around(plan, start, place, limits, kept.margin)
    if len(poses) < 2:
        return None, join
    return Reference.of_pivot(poses, plan.tracked.rod, drift, heading), join


def _around(plan: Plan, start: POSE, place: int, limits: RouteLimits, margin: float) -> tuple[Floats, int]:
    """Find a way among obstacles to one of the next places of the path: poses (m, 3), and the point where it ends.

    Raises:
        NoWayError: there is none.
    """
    reference = plan.declared.reference
    steps = reference.arc[place] + limits.radius * np.arange(_CANDIDATES)
    rows = np.unique(np.clip(np.searchsorted(reference.arc, steps), place, len(reference.q) - 2))
    targets = reference.courses(limits.drift)[rows]
    stop = np.array([start])
    lattices: Lattices = {}
    best = route([stop, targets], limits, margin, lattices, plan.robot)
    end = best.ends[-1]
    join = int(rows[int(np.hypot(*(targets[:, :2] - end[:2]).T).argmin())])
    cost = best.total + _WORTH * (reference.arc[join] - reference.arc[place])
    left_out = _WORTH * (reference.arc[rows] - reference.arc[place])
    bounds = words(stop, targets, limits.radius).sum(-1).min(-1) + left_out  # obstacles make ways longer
    for k in np.argsort(bounds).tolist():
        if bounds[k] >= cost:
            break
        try:
            way = route([stop, targets[k : k + 1]], limits, margin, lattices, plan.robot)
        except NoWayError:
            continue
        if way.total + left_out[k] < cost:
            best, join, cost = way, int(rows[k]), way.total + left_out[k]
    return best.chain(_SPACING), join


def _planned(plan: Plan, path: Reference, pose: POSE, way: int, join: int) -> Plan[None]:
    """Plan for way and path; `way` points of them are the way."""
    drawn, kept = _drawn(plan, path.p[: way + 1], join), plan.kept_clear
    off_drawn, missed = two_sided(path.p, drawn.polyline())
    declared = Declared(path, plan.declared.curvature, off_drawn, missed, plan.declared.warnings)
    turned = pose[2] - float(path.heading[0])
    start = Start(pose, path.first_turn if abs(turned) < 1e-6 else -1 if turned > 0 else 1)
    setting = Setting(plan.tracked, plan.minimum_dwell, plan.straight, plan.drift)
    rest = follow_declared(declared, setting, plan.request, drawn=drawn, start=start, guidance=plan.guidance)
    if kept is None:
        return rest
    clearance = rest.clearance(kept.free_space)
    if clearance <= 0:
        raise InputError("on the way back the robot would touch what it must keep out of; move it, and plan again")
    return replace(rest, kept_clear=KeptClear(kept.free_space, min(kept.margin, clearance), clearance, ()))


def _drawn(plan: Plan, way: Floats, join: int) -> Path2D:
    """Return the way, and after it the rest of the path as drawn."""
    declared, path = plan.declared.reference.p, plan.drawn.polyline()
    if plan.drawn.closed:  # it may be followed from another point of it
        begin = int(np.hypot(*(path[:-1] - declared[0]).T).argmin())
        path = np.concatenate([path[begin:-1], path[: begin + 1]])
    path = resample(path, _SPACING)
    arc, done = arc_length(path), arc_length(declared)
    guess = arc[-1] * done[join] / done[-1]
    apart = np.hypot(*(path - declared[join]).T) + _GUESS * np.abs(arc - guess)
    rest = path[int(apart.argmin()) :]
    return Path2D.of(np.concatenate([way[:-1], rest if len(rest) > 1 else path[-2:]]), closed=False)


def reached(reference: Reference, times: Floats, pivots: Floats, speed: float) -> int:
    """Return the point of the reference that the robot has reached.

    Args:
        reference: the pivot's.
        times: (N,), not falling.
        pivots: (N, 3), places and headings of the pivot at these times.
        speed: the largest of the robot.
    """
    rows = np.unique(np.linspace(0, len(times) - 1, min(len(times), _MOST_POSES)).round().astype(int))
    every = math.ceil(len(reference.q) / _MOST_PLACES)
    places = np.unique(np.append(np.arange(0, len(reference.q), every), len(reference.q) - 1))
    arc = reference.arc[places] - reference.arc[0]
    spacing = float(np.diff(arc).max())
    # Arc lengths are nearly equal from place to place, so that a number of places stands for a length.
    ahead = np.ceil(FASTER * speed * np.diff(times[rows]) / max(spacing, 1e-9)).astype(int) + 1
    mismatch = _mismatch(reference, places, pivots[rows[0]])
    total = LEFT_OUT * arc + mismatch
    best, last = int(total.argmin()), rows[0]
    for row, most in zip(rows[1:].tolist(), ahead.tolist(), strict=True):
        mismatch = _mismatch(reference, places, pivots[row])
        total = _least_before(total, min(most, len(places))) + mismatch
        place = int(total.argmin())
        if mismatch[place] < FARTHEST:
            best, last = place, row
    coarse = int(places[best])
    near = np.arange(max(coarse - every, 0), min(coarse + every + 1, len(reference.q)))
    return int(near[int(_mismatch(reference, near, pivots[last]).argmin())])


def _mismatch(reference: Reference, places: Integers, pivot: Floats) -> Floats:
    x, y, heading = pivot.tolist()
    q = reference.q[places]
    apart = np.minimum(np.hypot(q[:, 0] - x, q[:, 1] - y), FARTHEST)
    return np.asarray(apart + TURNED * (1 - np.cos(reference.heading[places] - heading)))


def _least_before(total: Floats, most: int) -> Floats:
    """Find the least of each entry and of `most` entries before it."""
    size = most + 1
    return np.asarray(minimum_filter1d(total, size, mode="constant", cval=np.inf, origin=(size - 1) // 2))
