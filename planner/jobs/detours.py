"""Ways around obstacles that stand on a declared path.

A stretch of the path is blocked where the robot's body would come nearer than the margin to what it must keep
clear of. A way around leaves the path before the stretch and joins it again behind. Among the places where it may
leave and join, and among all ways of the lattice between them (`planner.goal.route`), it makes

    length of the way + length of the path that is not followed

smallest: it neither leaves the path early nor goes far from it. The way is then shortened by direct joints, and
moved as near to the path as the body's margin, a residual of the least squares (`Hindered`), and the robot's
turns allow (`planner.paths.nearest_path`). Its turns are wider than the robot's narrowest one, as those of a
path that is followed as drawn. Lengths in l.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from common.arrays import Flags, Floats
from planner.goal.route import AROUND, LEVELS, Lattice, RouteLimits, shortened
from planner.paths.distance import nearest
from planner.paths.dubins import shortest_paths
from planner.paths.nearest_path import nearest_poses, tracked_points
from planner.paths.obstacles import Footprint, FreeSpace
from planner.paths.path import Path2D, arc_length, points_at, runs_of
from planner.paths.tractrix import Drift, Reference, closest
from planner.paths.tractrix import reference as follow_path
from planner.paths.units import in_lab, place_in_lab
from planner.planning.conditions import BlockedError, Detour
from planner.planning.declare import AS_DRAWN, TIGHTEST, FeasiblePath
from planner.planning.solve import Trial
from planner.vehicle.tracked_point import TrackedVehicle

_REACH = 6.0  # radii before and behind a blocked stretch, within which a way around leaves and joins
_STEP = 0.35  # radii between two such places
_SPACING = 0.02  # of the points of a way around
_POSES = 0.2  # radii between the poses that are moved towards the path
_SLACKS = (0.01, 0.03, 0.06)  # beyond the margin: the moved poses touch it, and what is between them crosses it
_BLOCKED = 0.05  # share that distances from a blocked stretch count: it cannot be kept near
_BESIDE = 3.0  # radii of the path before and behind a way around that may move, too
_OFF = 0.02  # from the path: farther points belong to a way around
_FAR = 0.05  # that it reaches at least
_APART = 1.0  # between two ways around
_DIFFERENCE = 1e-4  # l, for derivatives of distances


@dataclass(frozen=True)
class Around:
    """Replaces what obstacles block of a declared path by ways around, once a trial has a margin."""

    space: FreeSpace  # walls and regions
    drawn: Path2D  # the path as drawn
    detours: dict[Drift, Detours] = field(default_factory=dict)  # they have lattices

    def __call__(self, declared: FeasiblePath, trial: Trial) -> FeasiblePath:
        """Keep clear.

        Raises:
            BlockedError: there is no way around; it says whether there is one without a margin.
        """
        if trial.margin is None:
            return declared
        drift = trial.drift
        ways = self.detours.setdefault(drift, Detours(trial.tracked, self.space, drift))
        try:
            reference, detours = ways.around(declared.reference, trial.margin)
        except BlockedError as blocked:
            try:
                ways.around(declared.reference, 0.0)
            except BlockedError:
                blocked.hopeless = True
            raise
        return replace(declared.moved(reference, self.drawn), detours=detours) if detours else declared


class BlockedStretch(NamedTuple):
    """A blocked part of a reference, and the parts where a way around may leave and join; indices."""

    leave_from: int
    first: int  # blocked
    last: int  # blocked
    join_until: int


class WayAround(NamedTuple):
    """A way around: the points of the reference where it leaves and joins, and the part between."""

    leave: int
    join: int
    part: Reference


class Detours:
    """Finds ways around, and remembers the lattices that it made.

    Args:
        tracked: the vehicle and its tracked point.
        space: walls and regions.
        drift: what carries the robot off its heading.
    """

    def __init__(self, tracked: TrackedVehicle, space: FreeSpace, drift: Drift):
        self.tracked, self.drift = tracked, drift
        self.limits = RouteLimits(tracked.vehicle.pivot_radius / AS_DRAWN, tracked.body, space, drift)
        self._lattices: dict[tuple[float, ...], Lattice] = {}

    def clearance(self, reference: Reference) -> Floats:
        """Compute the distance (m,) of the body from what is not free, at the points of a reference."""
        return self.limits.body.clearance(reference.poses, self.limits.space)

    def around(self, reference: Reference, margin: float) -> tuple[Reference, tuple[Detour, ...]]:
        """Replace the blocked stretches of a reference by ways around.

        Raises:
            BlockedError: there is no way around, or the path begins or ends where it is blocked.
        """
        blocked = self.clearance(reference) < margin
        if not blocked.any():
            return reference, ()
        if reference.closed:
            reference = _turned(reference, blocked)
            blocked = self.clearance(reference) < margin
        stretches = _stretches(blocked, reference.arc, self.limits.radius)
        self._check_ends(reference, stretches, margin)
        ways = [self._way(reference, stretch, margin) for stretch in stretches]
        for slack in _SLACKS:
            changed = self._nearest(reference, ways, stretches, margin + slack)
            too_sharp = np.abs(changed.curvature).max() * self.tracked.vehicle.pivot_radius > TIGHTEST
            if not too_sharp and self.clearance(changed).min() >= margin:
                break
        else:
            changed = _with_ways(reference, ways)
        return changed, _compared(reference, changed)

    def _nearest(
        self, reference: Reference, ways: list[WayAround], stretches: list[BlockedStretch], margin: float
    ) -> Reference:
        """Move ways around as near to the path as possible."""
        rod, done = max(self.tracked.rod, 0.0), 0
        parts: list[Floats] = []
        for way, stretch in zip(ways, stretches, strict=True):
            beside = _BESIDE * self.limits.radius
            first = max(stretch.leave_from, int(np.searchsorted(reference.arc, reference.arc[way.leave] - beside)))
            last = min(stretch.join_until, int(np.searchsorted(reference.arc, reference.arc[way.join] + beside)))
            rows = (slice(first, way.leave), slice(way.join + 1, last + 1))
            before, behind = (reference.part(each.start, each.stop) for each in rows)
            moved = Reference.joined(before, way.part, behind)
            progress = np.concatenate(
                [
                    reference.arc[rows[0]],
                    np.interp(way.part.arc, way.part.arc[[0, -1]], reference.arc[[way.leave, way.join]]),
                    reference.arc[rows[1]],
                ]
            )
            length = float(moved.arc[-1])
            at = np.linspace(0, length, max(3, math.ceil(length / (_POSES * self.limits.radius)) + 1))
            x, y, angle, place = (np.interp(at, moved.arc, values) for values in (*moved.poses.T, progress))
            target = points_at(place, reference.arc, reference.p)
            inside = (place > reference.arc[stretch.first]) & (place < reference.arc[stretch.last])
            shares = np.where(inside, _BLOCKED, 1.0)
            poses = nearest_poses(
                np.stack([x, y, angle], 1), target, rod, self.limits.radius, drift=self.drift, shares=shares,
                hindrance=Hindered(self.limits.body, self.limits.space, margin, angle[[0, -1]]),
            )  # fmt: skip
            parts += [reference.p[done:first], tracked_points(poses, rod, closest(rod, _SPACING))]
            done = last + 1
        points = np.concatenate([*parts, reference.p[done:]])
        path = Path2D.of(points, closed=reference.closed)
        return follow_path(path, rod, _SPACING, self.drift)

    def _check_ends(self, reference: Reference, stretches: list[BlockedStretch], margin: float) -> None:
        for index, at, name in ((0, 0, "begins"), (-1, len(reference.q) - 1, "ends")):
            if at in (stretches[index].first, stretches[index].last):
                room = float(self.clearance(reference.part(at, at + 1))[0])
                robot = self.tracked.robot
                place, free = place_in_lab(*_place(reference.p[at]), robot), in_lab(max(room, 0.0), robot)
                raise BlockedError(
                    f"the path {name} at {place}, where the robot has {free} around it; it needs "
                    f"{in_lab(margin, robot)}, the stated error"
                )

    def _way(self, reference: Reference, stretch: BlockedStretch, margin: float) -> WayAround:
        """Find a way around one stretch.

        Raises:
            BlockedError: there is none.
        """
        leaves = _places(reference.arc, stretch.first - 1, stretch.leave_from, _STEP * self.limits.radius)
        joins = _places(reference.arc, stretch.last + 1, stretch.join_until, _STEP * self.limits.radius)
        poses = reference.courses(self.drift)
        starts, ends = poses[leaves], poses[joins]
        before = reference.arc[stretch.first] - reference.arc[leaves]
        behind = reference.arc[joins] - reference.arc[stretch.last]
        near = np.concatenate([starts, ends, poses[stretch.first : stretch.last + 1]])
        tried: list[Lattice] = []
        for whole in (False, True):
            for spacing, courses in LEVELS:
                lattice = self._lattice(near, spacing, courses, margin, whole=whole)
                if lattice in tried:
                    continue
                tried.append(lattice)
                costs, ways = lattice.ways(starts, before, ends, margin)
                if np.isfinite(costs).any():
                    best = int((costs + behind).argmin())
                    way = ways[best]
                    leave = int(leaves[np.abs(starts - way[0]).sum(1).argmin()])
                    tracks = shortest_paths(way[:-1], way[1:], self.limits.radius)
                    route = shortened(tracks, lattice, margin)
                    part = Reference.of_pivot(
                        route.chain(_SPACING), self.tracked.rod, self.drift, float(reference.heading[leave])
                    )
                    return WayAround(leave, int(joins[best]), part)
        robot = self.tracked.robot
        first, last = (place_in_lab(*_place(reference.p[i]), robot) for i in (stretch.first, stretch.last))
        raise BlockedError(
            f"the path is blocked from {first} to {last}, and there is no way around that leaves "
            f"{in_lab(margin, robot)}, the stated error, around the robot and turns with a radius of "
            f"{in_lab(self.limits.radius, robot)}"
        )

    def _lattice(self, near: Floats, spacing: float, courses: int, margin: float, *, whole: bool) -> Lattice:
        """Make a lattice around poses (k, 3) and the regions that block them, or around everything."""
        space, limits = self.limits.space, self.limits
        boxes = [near[:, :2]]
        for region in space.regions:
            part = FreeSpace((region,))
            if whole or (limits.clearance(near, part) < margin).any():
                boxes.append(region.box)
        reach = AROUND * limits.radius + limits.body.reach
        low = np.min([box.min(0) for box in boxes], 0) - reach
        high = np.max([box.max(0) for box in boxes], 0) + reach
        if space.walls is not None:
            low, high = np.maximum(low, space.walls.box[0]), np.minimum(high, space.walls.box[1])
        # Rounded outward, so that a slightly larger margin finds the lattice again.
        low, high = np.floor(low / limits.radius) * limits.radius, np.ceil(high / limits.radius) * limits.radius
        key = (*low.tolist(), *high.tolist(), spacing)
        if key not in self._lattices:
            self._lattices[key] = Lattice(limits, low, high, spacing * limits.radius, courses)
        return self._lattices[key]


def _place(point: Floats) -> tuple[float, float]:
    x, y = point.tolist()
    return x, y


def _turned(reference: Reference, blocked: Flags) -> Reference:
    """Begin a closed reference in the middle of its longest clear stretch.

    Raises:
        BlockedError: it is blocked everywhere.
    """
    count = len(reference.q) - 1
    at = np.flatnonzero(blocked[:count])
    gaps = np.diff(np.append(at, at[0] + count))
    longest = int(gaps.argmax())
    if gaps[longest] < 2:
        raise BlockedError("the path is blocked everywhere; draw it elsewhere")
    begin = (int(at[longest]) + int(gaps[longest]) // 2) % count
    return reference.begun_at(begin)


def _stretches(blocked: Flags, arc: Floats, radius: float) -> list[BlockedStretch]:
    """Find blocked stretches; those that are near one another are one."""
    runs, stretches = runs_of(blocked, arc, 2 * radius), []
    for k, (first, last) in enumerate(runs):
        middle_before = 0 if k == 0 else _halfway(arc, runs[k - 1][1], first)
        middle_behind = len(arc) - 1 if k == len(runs) - 1 else _halfway(arc, last, runs[k + 1][0]) - 1
        leave_from = max(middle_before, int(np.searchsorted(arc, arc[first] - _REACH * radius)))
        join_until = min(middle_behind, int(np.searchsorted(arc, arc[last] + _REACH * radius)))
        stretches.append(BlockedStretch(leave_from, first, last, join_until))
    return stretches


def _halfway(arc: Floats, first: int, last: int) -> int:
    return int(np.searchsorted(arc, (arc[first] + arc[last]) / 2))


def _places(arc: Floats, near: int, far: int, step: float) -> Floats:
    """Choose indices between two ones, about `step` of arc length apart."""
    count = max(1, math.ceil(abs(float(arc[far] - arc[near])) / step)) + 1
    rows = np.searchsorted(arc, np.linspace(arc[near], arc[far], count))
    return np.unique(np.clip(rows, min(near, far), max(near, far)))


def _with_ways(reference: Reference, ways: list[WayAround]) -> Reference:
    """Replace parts of a reference by ways around."""
    parts, done = [], 0
    for way in ways:
        parts += [reference.part(done, way.leave), way.part]
        done = way.join + 1
    return Reference.joined(*parts, reference.part(done), closed=reference.closed)


def _compared(reference: Reference, changed: Reference) -> tuple[Detour, ...]:
    """List the parts of a changed reference that are off the original one."""
    distance, segment, _ = nearest(reference.p, changed.p)
    arc = arc_length(changed.p)
    detours = []
    for first, last in runs_of(distance > _OFF, arc, _APART):
        a, b = max(first - 1, 0), min(last + 1, len(arc) - 1)
        farthest = float(distance[a : b + 1].max())
        if farthest > _FAR:
            replaced = float(arc_length(reference.p[segment[a] : segment[b] + 1])[-1])
            places = _place(changed.p[a]), _place(changed.p[b])
            detours.append(Detour(*places, float(arc[b] - arc[a]), replaced, farthest))
    return tuple(detours)


class Hindered:
    """Residuals of poses where the body comes nearer than a margin to what it must keep clear of.

    Args:
        body: with the pivot as origin.
        space: walls and regions.
        margin: around the body.
        headings: at the first and at the last pose, which stay.
    """

    def __init__(self, body: Footprint, space: FreeSpace, margin: float, headings: Floats):
        self._body, self._space, self._headings = body, space, headings
        self._least = margin + body.radius

    def __call__(self, poses: Floats) -> tuple[Floats, Floats]:
        """Compute residuals (m, discs + 1) and derivatives (m, discs + 1, 3)."""
        centres = self._body.centres(poses)
        count, discs = centres.shape[:2]
        residual, slopes = np.zeros((count, discs + 1)), np.zeros((count, discs + 1, 3))
        room = self._space.distance(centres.reshape(-1, 2)).reshape(count, discs)
        rows, columns = np.nonzero(room < self._least)
        points = centres[rows, columns]
        gradient = np.stack(
            [
                (self._space.distance(points + step) - self._space.distance(points - step)) / (2 * _DIFFERENCE)
                for step in _DIFFERENCE * np.eye(2)
            ],
            1,
        )
        sideways = np.stack([-np.sin(poses[rows, 2]), np.cos(poses[rows, 2])], 1)
        residual[rows, columns] = self._least - room[rows, columns]
        slopes[rows, columns, :2] = -gradient
        slopes[rows, columns, 2] = -(gradient * sideways).sum(1) * self._body.places[columns]
        for end, heading in zip((0, -1), self._headings.tolist(), strict=True):
            residual[end, discs], slopes[end, discs, 2] = poses[end, 2] - heading, 1.0
        return residual, slopes
