"""Routes around obstacles: Dijkstra's algorithm on a lattice of poses that are joined by Dubins tracks.

The lattice has poses at equal distances, with equal steps of the course. Each is joined to its neighbours by the
shortest track of bounded curvature, if the robot's body is free along it. Start and goal are joined to nearby
poses in the same way. The search is resolution-complete: a route with some clearance is found on a sufficiently
fine lattice. Lengths in l.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from planner.goal.dubins import DubinsPaths, shortest_paths
from planner.paths.obstacles import Footprint, FreeSpace, Map
from planner.paths.tractrix import Drift
from sim.arrays import Flags, Floats, Integers

_RANGE = 3  # of the joints between poses, in spacings
_DETOUR = 1.15  # joints that are longer than this, beside the straight way or the turn, are left out
_LINK = 2.5  # radii: poses within this distance are joined to start and goal
_LONGEST_LINK = 4.0  # radii
_STEP = 0.05  # l, between the places where a track is checked
_BLOCK = 200_000  # poses that are checked at once
_CELLS = 12  # of the map, for each spacing
_MOST_POSES = 400_000


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
            count = max(2, math.ceil(float(length[order[0]]) / step) + 1)
            rows = order[: max(1, _BLOCK // (2 * count))]
            rows = rows[length[rows] <= max(2 * length[rows[0]], 4 * step)]
            order = order[len(rows) :]
            count = max(2, math.ceil(float(length[rows[-1]]) / step) + 1)
            way = np.linspace(0, 1, count) * length[rows, None]
            poses = tracks.take(rows).poses(way)
            result[rows] = (self.clearance(poses, space) >= margin).all(1)
        return result


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
        self._table = self._split()
        grid = np.stack(np.meshgrid(x, y, self.course, indexing="ij"), -1)
        self.poses = grid.reshape(-1, 3)  # index (ix ny + iy) courses + k
        self._edges = self._join()

    def _join(self) -> tuple[Integers, Integers, Floats, Floats]:
        """Join poses by edges: from, to, length, clearance."""
        (nx, ny), n = self._shape, self.courses
        index = np.arange(nx * ny).reshape(nx, ny) * n
        steps = np.arange(-_RANGE, _RANGE + 1)
        i, j, k = (part.ravel() for part in np.meshgrid(steps, steps, np.arange(n), indexing="ij"))
        goals = np.stack([i * self.spacing, j * self.spacing, self.course[k]], 1)
        start, end, length, clearances = [], [], [], []
        for start_course in range(n):
            tracks = shortest_paths(
                np.repeat([[0.0, 0.0, self.course[start_course]]], len(goals), 0), goals, self.limits.radius
            )
            turn = np.abs((self.course[k] - self.course[start_course] + math.pi) % (2 * math.pi) - math.pi)
            least = np.maximum(np.hypot(goals[:, 0], goals[:, 1]), self.limits.radius * turn)
            rows = np.flatnonzero((tracks.length <= _DETOUR * least) & (tracks.length > 0))
            for row in rows.tolist():
                di, dj = int(i[row]), int(j[row])
                a = slice(max(0, -di), nx - max(0, di)), slice(max(0, -dj), ny - max(0, dj))
                b = slice(max(0, di), nx + min(0, di)), slice(max(0, dj), ny + min(0, dj))
                if not index[a].size:
                    continue
                clearance = self._clearance(tracks.take(np.array([row])))[a].ravel()
                good = np.flatnonzero(clearance > 0)
                start.append(index[a].ravel()[good] + start_course)
                end.append(index[b].ravel()[good] + int(k[row]))
                length.append(np.full(len(good), tracks.length[row]))
                clearances.append(clearance[good])
        return np.concatenate(start), np.concatenate(end), np.concatenate(length), np.concatenate(clearances)

    def _clearance(self, track: DubinsPaths) -> Floats:
        """Bound the clearance (nx, ny) along the track of one joint from below, by its place in the lattice."""
        count = max(2, math.ceil(float(track.length[0]) / _STEP) + 1)
        poses = track.poses(np.linspace(0, track.length, count).T)[0]
        heading = poses[:, 2] - self.limits.drift.slip_along(poses[:, 2])
        centres = self.limits.body.centres(np.stack([poses[:, 0], poses[:, 1], heading], 1)).reshape(-1, 2)
        offsets = np.rint(centres / self.map.step).astype(int) + self._pad * _CELLS
        (nx, ny) = self._shape
        room = np.full(self._shape, np.inf, dtype=np.float32)
        for (i, j), (pi, pj) in zip(*_distinct(offsets), strict=True):
            np.minimum(room, self._table[pi, pj, i : i + nx, j : j + ny], out=room)
        return np.asarray(room, dtype=float) - self.limits.body.radius - self.map.slack

    def _split(self) -> NDArray[np.float32]:
        """Split the map's table by the place between two poses of the lattice, (cells, cells, ., .)."""
        table = self.map.table.astype(np.float32)
        rows, columns = len(table) // _CELLS, len(table.T) // _CELLS
        parts = table[: rows * _CELLS, : columns * _CELLS].reshape(rows, _CELLS, columns, _CELLS)
        return np.ascontiguousarray(parts.transpose(1, 3, 0, 2))

    def ways(self, starts: Floats, costs: Floats, goals: Floats, margin: float) -> tuple[Floats, list[Floats]]:
        """Find the shortest ways from any of the starts (S, 3), with initial costs, to each of the goals (G, 3).

        The body keeps `margin` on all of them.

        Returns:
            costs (G,), infinite where there is no way, and the poses (n, 3) on each way, ends included; the first
            one is the start.
        """
        count, s, g = len(self.poses), len(starts), len(goals)
        source = count + s + g
        open_ = self._edges[3] >= margin
        edges = [(self._edges[0][open_], self._edges[1][open_], self._edges[2][open_])]
        for index, pose in enumerate(starts):
            if np.isfinite(costs[index]):
                near, length = self._links(pose, margin, True)
                edges.append((np.full(len(near), count + index), near, length))
                edges.append((np.array([source]), np.array([count + index]), np.array([costs[index] + 1e-9])))
        for index, pose in enumerate(goals):
            near, length = self._links(pose, margin, False)
            edges.append((near, np.full(len(near), count + s + index), length))
        start, end, length = (np.concatenate([part[i] for part in edges]) for i in range(3))
        graph = csr_array((length, (start, end)), shape=(source + 1, source + 1))
        distance, before = dijkstra(graph, indices=np.array([source]), return_predecessors=True)
        poses = np.concatenate([self.poses, starts, goals])
        ways = []
        for index in range(g):
            chain, at = [], count + s + index
            while at >= 0 and at != source:
                chain.append(at)
                at = int(before[0, at])
            ways.append(poses[chain[::-1]])
        return distance[0, count + s : source], ways

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
        return near[rows], tracks.length[rows]


def _distinct(offsets: Integers) -> tuple[list[list[int]], list[list[int]]]:
    """Split offsets (n, 2) in cells into whole steps and remainders, each pair once."""
    once = np.unique(offsets[:, 0] * 2**32 + offsets[:, 1])
    pairs = np.stack([once >> 32, once & (2**32 - 1)], 1)
    return (pairs // _CELLS).tolist(), (pairs % _CELLS).tolist()
