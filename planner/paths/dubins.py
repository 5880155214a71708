"""Shortest tracks of bounded curvature between poses: Dubins' words.

A car that only drives forward, with least turn radius R, gets from one pose to another on the shortest way by one
of six words of three segments: LSL, RSR, LSR, RSL, RLR, LRL (L: left arc, R: right arc, S: straight). Source:
Dubins (1957); formulas as in Shkel and Lumelsky, "Classification of the Dubins set" (2001). Poses are x, y,
course. All functions take arrays of poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from common.arrays import Floats, Integers
from planner.paths.path import steps_of

TURNS = np.array([[1, 0, 1], [-1, 0, -1], [1, 0, -1], [-1, 0, 1], [-1, 1, -1], [1, -1, 1]])
_CIRCLE = 2 * np.pi
ROUNDING = 1e-9


class DubinsPaths(NamedTuple):
    """M paths of three segments each."""

    start: Floats  # (M, 3), poses
    turns: Integers  # (M, 3), of the segments: +1 left, 0, −1
    lengths: Floats  # (M, 3), of the segments
    radius: float  # of all arcs

    @property
    def length(self) -> Floats:
        """Lengths (M,)."""
        return np.asarray(self.lengths.sum(-1))

    @property
    def total(self) -> float:
        """Length of paths that follow each other."""
        return float(self.lengths.sum())

    @property
    def ends(self) -> Floats:
        """Poses (M, 3) at the ends."""
        return self.poses(self.length[:, None])[:, 0]

    def take(self, rows: Integers) -> DubinsPaths:
        return DubinsPaths(self.start[rows], self.turns[rows], self.lengths[rows], self.radius)

    @staticmethod
    def joined(parts: Sequence[DubinsPaths]) -> DubinsPaths:
        start, lengths = (np.concatenate([getattr(part, name) for part in parts]) for name in ("start", "lengths"))
        return DubinsPaths(start, np.concatenate([part.turns for part in parts]), lengths, parts[0].radius)

    def poses(self, way: Floats) -> Floats:
        """Compute poses (M, K, 3) after ways (M, K) along the tracks; beyond the end, that of the end."""
        pose = np.repeat(self.start[:, None], way.shape[1], 1)
        remaining = way
        for i in range(3):
            length = self.lengths[:, i, None]
            part = np.clip(remaining, 0.0, length)
            remaining = remaining - length
            pose = _moved(pose, self.turns[:, i, None] / self.radius, part)
        return pose

    def chain(self, spacing: float) -> Floats:
        """Sample poses (m, 3) of paths that follow each other, at most `spacing` apart, courses without jumps."""
        parts = [self.start[:1]]
        for row, length in enumerate(self.length.tolist()):
            if length > 0:
                way = np.linspace(0, length, max(1, steps_of(length, spacing)) + 1)[None, 1:]
                parts.append(self.take(np.array([row])).poses(way)[0])
        poses = np.concatenate(parts)
        poses[:, 2] = np.unwrap(poses[:, 2])
        return poses


def segment_lengths(start: Floats, goal: Floats, radius: float) -> Floats:
    """Compute the lengths (..., 6, 3) of the segments of all words; infinite where a word does not exist."""
    move = (goal[..., :2] - start[..., :2]) / radius
    d, direction = np.hypot(move[..., 0], move[..., 1]), np.arctan2(move[..., 1], move[..., 0])
    a, b = start[..., 2] - direction, goal[..., 2] - direction
    sa, sb, ca, cb, cab = np.sin(a), np.sin(b), np.cos(a), np.cos(b), np.cos(a - b)
    lengths = np.full((*d.shape, 6, 3), np.inf)

    def put(word: int, exists: Floats, t: Floats, p: Floats, q: Floats) -> None:
        for i, part in enumerate((_turn(t), p, _turn(q))):
            lengths[..., word, i] = np.where(exists, part, np.inf)

    for word, side in ((0, 1.0), (1, -1.0)):
        square = 2 + d**2 - 2 * cab + side * 2 * d * (sa - sb)
        angle = np.arctan2(side * (cb - ca), d + side * (sa - sb))
        p = np.sqrt(np.maximum(square, 0.0))
        put(word, square >= -ROUNDING, side * (angle - a), p, side * (b - angle))
    for word, side in ((2, 1.0), (3, -1.0)):
        square = d**2 - 2 + 2 * cab + side * 2 * d * (sa + sb)
        p = np.sqrt(np.maximum(square, 0.0))
        angle = np.arctan2(-side * (ca + cb), d + side * (sa + sb)) - np.arctan2(-side * 2.0, p)
        put(word, square >= -ROUNDING, side * (angle - a), p, side * (angle - b))
    for word in (4, 5):
        put(word, *_three_arcs(d, a, b, float(TURNS[word, 1])))
    return lengths * radius


def _three_arcs(d: Floats, a: Floats, b: Floats, side: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Return where a word of three arcs exists, and its three angles.

    Args:
        d: distance of the poses, in radii.
        a, b: courses at start and goal, from the direction of the goal.
        side: to which the middle arc turns: 1 left, −1 right.
    """
    sa, sb, ca, cb = np.sin(a), np.sin(b), np.cos(a), np.cos(b)
    cosine = (6 - d**2 + 2 * np.cos(a - b) + side * 2 * d * (sa - sb)) / 8
    p = _CIRCLE - np.arccos(np.clip(cosine, -1.0, 1.0))
    t = side * a - np.arctan2(ca - cb, d - side * (sa - sb)) + p / 2
    return np.abs(cosine) <= 1, t, p, side * (a - b) - t + p


def shortest_paths(start: Floats, goal: Floats, radius: float) -> DubinsPaths:
    """Find the shortest paths between M pairs of poses (M, 3)."""
    lengths = segment_lengths(start, goal, radius)
    best = first_least(lengths.sum(-1))
    return DubinsPaths(start, TURNS[best], lengths[np.arange(len(best)), best], radius)


def first_least(values: Floats) -> Integers:
    """Find the first of the least values (..., n), whichever of them rounding makes the smallest."""
    return np.asarray((values <= values.min(-1, keepdims=True) + ROUNDING).argmax(-1))


def _turn(angle: Floats) -> Floats:
    """Reduce an angle to [0, 2π); a whole turn that comes from rounding is none."""
    angle = angle % _CIRCLE
    return np.asarray(np.where(angle > _CIRCLE - ROUNDING, 0.0, angle))


def _moved(pose: Floats, curvature: Floats, way: Floats) -> Floats:
    angle = curvature * way
    chord = way * np.sinc(angle / _CIRCLE)
    course = pose[..., 2] + angle / 2
    return np.stack(
        [pose[..., 0] + chord * np.cos(course), pose[..., 1] + chord * np.sin(course), pose[..., 2] + angle], -1
    )
