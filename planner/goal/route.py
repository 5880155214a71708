"""The shortest track of bounded curvature through a few poses, around obstacles.

Every stop offers one pose, or one place with several courses. The courses are chosen to minimise the total
length, first among equally spaced ones, then among finer ones. Two poses are joined by Dubins' words. Where
obstacles block the direct track, Dijkstra's algorithm finds a route on a lattice of poses, which is then shortened
by direct joints between places on it.

The lattice has poses at equal distances, with equal steps of the course. Each is joined to its neighbours by the
shortest track of bounded curvature, if the robot's body is free along it. Start and goal are joined to nearby
poses in the same way. The search is resolution-complete: a route with some clearance is found on a sufficiently
fine lattice. Lengths in l.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from common.arrays import Flags, Floats, Integers
from planner.paths.dubins import ROUNDING, TURNS, DubinsPaths, first_least, segment_lengths, shortest_paths
from planner.paths.obstacles import Footprint, FreeSpace, Map
from planner.paths.path import steps_of
from planner.paths.tractrix import Drift
from planner.paths.units import Scales, in_lab, place_in_lab
from planner.planning.conditions import BlockedError

_RANGE = 3  # of the joints between poses, in spacings
_DETOUR = 1.15  # joints that are longer than this, beside the straight way or the turn, are left out
_LINK = 2.5  # radii: poses within this distance are joined to start and goal
_LONGEST_LINK = 4.0  # radii
_STEP = 0.05  # l, between the places where a track is checked
_EVERY = 16, 4, 1  # of these places are checked, in turn; most tracks that are blocked end at the first
_BLOCK = 200_000  # poses that are checked at once
_PART = 512  # places of the lattice whose joints are sorted out at once
_CELLS = 12  # of the map, for each spacing
_MOST_POSES = 400_000
COURSES = 24  # tried at a stop whose course is free
LEVELS = ((0.6, 16), (0.3, 32))  # spacing of the lattice, in radii, and number of courses
_FINER = 4  # refinements of the courses of stops
_ROUNDS = 3  # of shortening
_PLACES = 40  # on a leg, between which shorter joints are sought
_ENOUGH = 1.005  # a chain at most this much longer than the shortest one without obstacles needs no lattice
_THIN = 3  # of the courses at a stop, every third one is joined to the lattice
_GRAIN = 1e-4  # l: ways over a lattice are counted in whole ones, and those of equal length are equal
_MOST_CHECKS = 300  # chains of words
AROUND = 6.0  # radii that the lattice reaches beyond stops and obstacles


@dataclass(frozen=True)
class RouteLimits:
    """What a track must keep to: its least radius, and free space for a body whose origin is on the track."""

    radius: float
    body: Footprint
    space: FreeSpace
    drift: Drift

    def clearance(self, poses: Floats, space: FreeSpace | Map | None = None) -> Floats:
        """Compute the distance (...) of the body from what is not free, at poses (..., 3): place and course."""
        heading = poses[..., 2] - self.drift.slip_along(poses[..., 2])
        placed = np.concatenate([poses[..., :2], heading[..., None]], -1)
        return self.body.clearance(placed, self.space if space is None else space)

    def free(
        self, tracks: DubinsPaths, margin: float, space: FreeSpace | Map | None = None, step: float = _STEP
    ) -> Flags:
        """Tell whether the body keeps a margin all along each of M tracks."""
        result = np.zeros(len(tracks.start), dtype=bool)
        length = tracks.length
        order = np.argsort(length)
        while len(order):
            count = math.ceil(float(length[order[0]]) / step) + 1
            rows = order[: max(1, _BLOCK // (2 * count))]
            rows = rows[length[rows] <= max(2 * length[rows[0]], 4 * step)]
            order = order[len(rows) :]
            way = _ways(float(length[rows[-1]]), step)
            for every in _EVERY:
                poses = tracks.take(rows).poses(way[:, ::-every])
                rows = rows[(self.clearance(poses, space) >= margin).all(1)]
            result[rows] = True
        return result


class Joints(NamedTuple):
    """J joints from any place to poses nearby, ordered by the course at the start and the pose at the end."""

    course: Integers  # (J,), its index
    ahead: Integers  # (J,), by how much the index of a pose is larger than that of one with course 0 at the start
    length: Floats  # (J,), in grains


class Lattice:
    """Poses at equal distances within a box, joined by the paths that keep to the limits."""

    def __init__(self, limits: RouteLimits, low: Floats, high: Floats, spacing: float, courses: int):
        self.limits, self.courses = limits, courses
        area = float((high - low).prod())
        self.spacing = spacing = max(spacing, math.sqrt(area * courses / _MOST_POSES))
        nx, ny = (np.floor((high - low) / spacing).astype(int) + 1).tolist()
        pad = math.ceil(limits.body.reach / spacing) + _RANGE + 3
        self.map = Map(limits.space, low - pad * spacing, high + pad * spacing, spacing / _CELLS)
        self._shape, self._pad = (nx, ny), pad
        x, y = low[0] + spacing * np.arange(nx), low[1] + spacing * np.arange(ny)
        self.course = 2 * math.pi * np.arange(courses) / courses
        grid = np.stack(np.meshgrid(x, y, self.course, indexing="ij"), -1)
        self.poses = grid.reshape(-1, 3)  # index (ix ny + iy) courses + k
        self._joints, self._room = self._join()
        self._open = np.count_nonzero(self._room > 0)

    def _join(self) -> tuple[Joints, NDArray[np.float32]]:
        """Find the joints, and at each place (places, J) the distance along them from what is not free."""
        (nx, ny), n = self._shape, self.courses
        steps = np.arange(-_RANGE, _RANGE + 1)
        course, i, j, k = (
            part.ravel() for part in np.meshgrid(np.arange(n), steps, steps, np.arange(n), indexing="ij")
        )
        goals = np.stack([i * self.spacing, j * self.spacing, self.course[k]], 1)
        starts = np.stack([0 * goals[:, 0], 0 * goals[:, 0], self.course[course]], 1)
        tracks = shortest_paths(starts, goals, self.limits.radius)
        turn = np.abs((self.course[k] - self.course[course] + math.pi) % (2 * math.pi) - math.pi)
        least = np.maximum(np.hypot(goals[:, 0], goals[:, 1]), self.limits.radius * turn)
        rows = np.flatnonzero((tracks.length <= _DETOUR * least) & (tracks.length > 0))
        table, room = self._split(), np.full((nx, ny, len(rows)), -np.inf, dtype=np.float32)
        for joint, row in enumerate(rows.tolist()):
            di, dj = int(i[row]), int(j[row])
            inside = slice(max(0, -di), nx - max(0, di)), slice(max(0, -dj), ny - max(0, dj))
            room[(*inside, joint)] = self._distance(tracks.take(np.array([row])), table)[inside]
        ahead = (i[rows] * ny + j[rows]) * n + k[rows]
        return Joints(course[rows], ahead, _counted(tracks.length[rows])), room.reshape(nx * ny, -1)

    def _distance(self, track: DubinsPaths, table: NDArray[np.float32]) -> NDArray[np.float32]:
        """Compute the distance (nx, ny) along the track of one joint on the map, by its place in the lattice."""
        poses = track.poses(_ways(float(track.length[0]), _STEP))[0]
        heading = poses[:, 2] - self.limits.drift.slip_along(poses[:, 2])
        centres = self.limits.body.centres(np.stack([poses[:, 0], poses[:, 1], heading], 1)).reshape(-1, 2)
        offsets = np.rint(centres / self.map.step).astype(int) + self._pad * _CELLS
        (nx, ny), wide = self._shape, table.shape[-1]
        rows, room = table.reshape(_CELLS, _CELLS, -1), np.full(nx * wide, np.inf, dtype=np.float32)
        for (i, j), (pi, pj) in zip(*_distinct(offsets), strict=True):  # whole rows of the map are one piece
            np.minimum(room, rows[pi, pj, i * wide + j :][: len(room)], out=room)
        return room.reshape(nx, wide)[:, :ny]

    def _split(self) -> NDArray[np.float32]:
        """Split the map's table by the place between two poses of the lattice, (cells, cells, ., .)."""
        table = self.map.table.astype(np.float32)
        rows, columns = len(table) // _CELLS, len(table.T) // _CELLS
        parts = table[: rows * _CELLS, : columns * _CELLS].reshape(rows, _CELLS, columns, _CELLS)
        return np.ascontiguousarray(parts.transpose(1, 3, 0, 2))

    def ways(self, starts: Floats, costs: Floats, goals: Floats, margin: float) -> tuple[Floats, list[Floats]]:
        """Find the shortest ways from any of the starts (S, 3), with initial costs, to each of the goals (G, 3).

        The body keeps `margin` on all of them. Of ways of the same length it is the one whose poses, from the goal
        back, have the lowest indices.

        Returns:
            costs (G,), infinite where there is no way, and the poses (n, 3) on each way, ends included; the first
            one is the start.
        """
        count, source = len(self.poses), len(self.poses) + len(starts)
        begun = np.flatnonzero(np.isfinite(costs))
        none = np.empty(0, int), np.empty(0)
        rows = [
            self._links(pose, margin, True) if np.isfinite(c) else none
            for pose, c in zip(starts, costs, strict=True)
        ]
        graph = self._graph(margin, [*rows, (count + begun, _counted(costs[begun]) + 1)])
        (distance,), into = dijkstra(graph, indices=np.array([source])) - 1, graph.tocsc()
        poses, lowest, ways = np.concatenate([self.poses, starts]), np.full(len(goals), np.inf), []
        for index, pose in enumerate(goals):
            near, length = self._links(pose, margin, False)
            total = distance[near] + length
            chain, at = [], source
            if len(near) and np.isfinite(total.min()):
                at = int(near[total.argmin()])
                lowest[index] = _GRAIN * total.min()
            while at != source:
                chain.append(at)
                joints = slice(*into.indptr[at : at + 2])
                before = into.indices[joints]
                at = int(before[distance[before] + into.data[joints] == distance[at]].min())
            ways.append(np.concatenate([poses[chain[::-1]], pose[None]]))
        return lowest, ways

    def _graph(self, margin: float, further: Sequence[tuple[Integers, Floats]]) -> Any:
        """Return the lengths of the joints with this margin, and further rows: ends and lengths."""
        n, (course, ahead, lengths) = self.courses, self._joints
        most = self._open + sum(len(ends) for ends, _ in further)
        end, length = np.empty(most, np.int32), np.empty(most, np.float32)  # whole numbers below 2²⁴: exact
        degrees, done = [np.zeros(1, int)], 0

        def add(ends: Integers, row: Floats, degree: Integers) -> None:
            nonlocal done
            part = slice(done, done := done + len(ends))
            end[part], length[part] = ends, row
            degrees.append(degree)

        for first in range(0, len(self._room), _PART):
            room = self._room[first : first + _PART].astype(float) - self.limits.body.radius - self.map.slack
            place, joint = np.nonzero((room > 0) & (room >= margin))
            degree = np.bincount(place * n + course[joint], minlength=len(room) * n)
            add((first + place) * n + ahead[joint], lengths[joint], degree)
        for ends, row in further:
            add(ends, row, np.array([len(ends)]))
        rows = np.cumsum(np.concatenate(degrees)).astype(np.int32)
        return csr_array((length[:done], end[:done], rows), shape=(len(rows) - 1, len(rows) - 1))

    def _links(self, pose: Floats, margin: float, onward: bool) -> tuple[Integers, Floats]:
        """Find poses of the lattice that a pose can be joined to, or that can be joined to it; and the lengths."""
        radius = self.limits.radius
        reach = max(_LINK * radius, 2 * self.spacing)
        near = np.flatnonzero(np.hypot(*(self.poses[:, :2] - pose[:2]).T) <= reach)
        origin, neighbours = np.repeat(pose[None], len(near), 0), self.poses[near]
        tracks = (
            shortest_paths(origin, neighbours, radius) if onward else shortest_paths(neighbours, origin, radius)
        )
        rows = np.flatnonzero(tracks.length <= _LONGEST_LINK * radius + self.spacing)
        rows = rows[self.limits.free(tracks.take(rows), margin, self.map)]
        return near[rows], _counted(tracks.length[rows])


def _ways(length: float, step: float) -> Floats:
    """List ways (1, K) along a track, a step apart, up to its end or beyond: there poses are those of the end."""
    return np.asarray([step * np.arange(math.ceil(length / step) + 1)], dtype=np.float64)


def _counted(lengths: Floats) -> Floats:
    return np.rint(lengths / _GRAIN)


def _distinct(offsets: Integers) -> tuple[list[list[int]], list[list[int]]]:
    """Split offsets (n, 2) in cells into whole steps and remainders, each pair once."""
    once = np.unique(offsets[:, 0] * 2**32 + offsets[:, 1])
    pairs = np.stack([once >> 32, once & (2**32 - 1)], 1)
    return (pairs // _CELLS).tolist(), (pairs % _CELLS).tolist()


class NoWayError(BlockedError):
    """There is no way to the goal."""

    status = 3


Lattices = dict[tuple[float, int], "Lattice"]  # by spacing and number of courses


def route(
    stops: list[Floats], limits: RouteLimits, margin: float, lattices: Lattices, robot: Scales
) -> DubinsPaths:
    """Find a short route through the stops.

    Args:
        stops: poses (c, 3) to choose from at the start, at each place on the way, and at the goal.
        limits: least radius and free space.
        margin: clearance of the body.
        lattices: cache of the lattices of these limits and stops; new ones are added.
        robot: its tail length, for lengths in messages.

    Raises:
        NoWayError: a stop is not free, or no way was found on the finest lattice.
    """
    for number, stop in enumerate(stops):
        _check(stop, number, len(stops), limits, margin, robot)
    direct = _direct(stops, limits, margin)
    if limits.space.empty and direct is not None:
        return direct
    shortest = _direct(stops, replace(limits, space=FreeSpace()), margin)
    if direct is not None and shortest is not None and direct.total < _ENOUGH * shortest.total:
        return direct
    for spacing, courses in LEVELS:
        if (spacing, courses) not in lattices:
            lattices[spacing, courses] = _lattice(stops, limits, spacing * limits.radius, courses)
        around = _around(stops, lattices[spacing, courses], margin)
        candidates = [candidate for candidate in (direct, around) if candidate is not None]
        if candidates:
            return min(candidates, key=lambda candidate: candidate.total)
    kept, radius, step = (in_lab(x, robot) for x in (margin, limits.radius, LEVELS[-1][0] * limits.radius))
    raise NoWayError(
        f"there is no way to the goal that leaves {kept} around the robot and turns with a radius of {radius}, on "
        f"a lattice with steps of {step} and {360 / LEVELS[-1][1]:.0f} degrees; move the goal or the obstacles"
    )


def _check(stop: Floats, number: int, count: int, limits: RouteLimits, margin: float, robot: Scales) -> None:
    clearance = float(limits.clearance(stop).max())
    if clearance >= margin:
        return
    name = "start" if number == 0 else "goal" if number == count - 1 else f"place {number} on the way"
    x, y = stop[0, :2].tolist()
    pivot, apart = place_in_lab(x, y, robot), in_lab(abs(clearance), robot)
    raise NoWayError(
        f"there is no way: at the {name}, with its pivot at {pivot}, the robot is "
        f"{f'{apart} inside' if clearance < 0 else f'only {apart} away from'} what it must keep out of; it needs "
        f"{in_lab(margin, robot)}, which is the plan's stated error"
    )


def _direct(stops: list[Floats], limits: RouteLimits, margin: float) -> DubinsPaths | None:
    """Join successive stops by one word each, and refine the courses of the stops."""
    chosen, best = stops, None
    for finer in range(_FINER + 1):
        shortest = _chosen(chosen, limits, margin)
        if shortest is None:
            return best
        if best is None or shortest.total < best.total:
            best = shortest
        places = [*best.start, best.ends[-1]]
        chosen = [_finer(stop, pose, finer) for stop, pose in zip(stops, places, strict=True)]
        if all(len(stop) == len(poses) for stop, poses in zip(stops, chosen, strict=True)):
            break
    return best


def _finer(stop: Floats, pose: Floats, level: int) -> Floats:
    """Refine the courses around that of a pose, if the stop leaves its course open."""
    if len(stop) < COURSES:
        return stop
    step = 2 * math.pi / len(stop) / 3**level
    poses = np.repeat(pose[None], 7, 0)
    poses[:, 2] += step * np.arange(-3, 4) / 3
    return poses


def _chosen(stops: list[Floats], limits: RouteLimits, margin: float) -> DubinsPaths | None:
    """Find the shortest chain of one word between successive stops, among all their poses.

    Words are checked only when they are on the shortest chain. Those that are not free are excluded.
    """
    legs = [segment_lengths(starts[:, None], ends[None], limits.radius) for starts, ends in pairwise(stops)]
    lengths = [leg.sum(-1) for leg in legs]
    for _ in range(_MOST_CHECKS):
        options, total = best_options([length.min(-1) for length in lengths])
        if not np.isfinite(total):
            return None
        ends = list(pairwise(options))
        chosen = [int(first_least(length[pair])) for length, pair in zip(lengths, ends, strict=True)]
        start = np.array([stop[k] for stop, k in zip(stops[:-1], options[:-1], strict=True)])
        parts = np.array([leg[pair][word] for leg, pair, word in zip(legs, ends, chosen, strict=True)])
        joined = DubinsPaths(start, TURNS[chosen], parts, limits.radius)
        free = np.ones(len(ends), dtype=bool) if limits.space.empty else limits.free(joined, margin)
        if free.all():
            return joined
        for k in np.flatnonzero(~free).tolist():
            lengths[k][(*ends[k], chosen[k])] = np.inf
    return None


def best_options(legs: Sequence[Floats]) -> tuple[list[int], float]:
    """Choose an option at each stop of a chain; return the options and what the chain costs.

    Args:
        legs: (C, C') each, from the options of a stop to those of the next one.
    """
    total, back = np.zeros(len(legs[0])), []
    for leg in legs:
        sums = total[:, None] + leg
        back.append(sums.argmin(0))
        total = sums.min(0)
    options = [int(total.argmin())]
    for came in reversed(back):
        options.append(int(came[options[-1]]))
    return options[::-1], float(total.min())


def _lattice(stops: list[Floats], limits: RouteLimits, spacing: float, courses: int) -> Lattice:
    """Make a lattice that reaches around all obstacles, or to the walls."""
    boxes = [*limits.space.boxes(), *(stop[:, :2] for stop in stops)]
    reach = AROUND * limits.radius + limits.body.reach
    low = np.min([box.min(0) for box in boxes], 0) - reach
    high = np.max([box.max(0) for box in boxes], 0) + reach
    if limits.space.walls is not None:
        low, high = limits.space.walls.box
    return Lattice(limits, low, high, spacing, courses)


def _around(stops: list[Floats], lattice: Lattice, margin: float) -> DubinsPaths | None:
    """Find a route over a lattice and shorten it; None where there is none on this lattice."""
    limits = lattice.limits
    stops = [stop[::_THIN] if len(stop) == COURSES else stop for stop in stops]
    costs, chains = np.zeros(len(stops[0])), []
    for starts, ends in pairwise(stops):
        costs, ways = lattice.ways(starts, costs, ends, margin)
        if not np.isfinite(costs).any():
            return None
        chains.append(ways)
    at = int(costs.argmin())
    parts: list[DubinsPaths] = []
    for ways, stop in zip(reversed(chains), reversed(stops[:-1]), strict=True):
        leg = ways[at]
        parts.insert(0, shortened(shortest_paths(leg[:-1], leg[1:], limits.radius), lattice, margin))
        at = int(np.abs(stop - leg[0]).sum(1).argmin())
    return DubinsPaths.joined(parts)


def shortened(leg: DubinsPaths, lattice: Lattice, margin: float) -> DubinsPaths:
    """Shorten a leg by joints between places on it, where one is free and shorter than that part of the leg."""
    limits = lattice.limits
    for round_number in range(_ROUNDS):
        places = _cut(leg, max(float(leg.length.sum()) / _PLACES, limits.radius / 4) / (1 + round_number))
        poses = np.concatenate([places.start, places.ends[-1:]])
        way = np.concatenate([[0.0], np.cumsum(places.length)])
        i, j = np.triu_indices(len(poses), 2)
        tracks = shortest_paths(poses[i], poses[j], limits.radius)
        rows = np.flatnonzero(tracks.length < way[j] - way[i] - 1e-6)
        rows = rows[limits.free(tracks.take(rows), margin, lattice.map)]
        best, choice = np.full(len(poses), np.inf), np.full(len(poses), -1)
        best[0] = 0.0
        ends = [rows[j[rows] == k] for k in range(len(poses))]
        for k in range(1, len(poses)):
            best[k] = best[k - 1] + places.length[k - 1]
            costs = best[i[ends[k]]] + tracks.length[ends[k]]
            if len(costs) and costs.min() < best[k] - ROUNDING:
                best[k], choice[k] = costs.min(), ends[k][first_least(costs)]
        parts, k = [], len(poses) - 1
        while k > 0:
            row = choice[k]
            parts.append(places.take(np.array([k - 1])) if row < 0 else tracks.take(np.array([row])))
            k = k - 1 if row < 0 else int(i[row])
        leg = DubinsPaths.joined(parts[::-1])
    return leg


def _cut(leg: DubinsPaths, spacing: float) -> DubinsPaths:
    """Cut the tracks of a leg into parts of at most `spacing`."""
    parts = []
    for row, length in enumerate(leg.length.tolist()):
        if length == 0:
            continue
        edges = np.linspace(0, length, max(1, steps_of(length, spacing)) + 1)
        ends = np.cumsum(leg.lengths[row])
        before = np.concatenate([[0.0], ends[:-1]])
        lengths = np.maximum(np.minimum(ends, edges[1:, None]) - np.maximum(before, edges[:-1, None]), 0.0)
        turns = leg.take(np.full(len(edges) - 1, row)).turns
        poses = leg.take(np.array([row])).poses(edges[None, :-1])[0]
        parts.append(DubinsPaths(poses, turns, lengths, leg.radius))
    return DubinsPaths.joined(parts)
