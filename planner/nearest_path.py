"""The path that the robot can follow and that stays nearest to the path as drawn.

A corner cannot be followed. Rounding it cuts it. It is better to swing out before the corner and to cut a little
inside. So the pivot's poses (x_i, y_i, φ_i) are found that minimise

    Σ |p_i − r_i|²,   p_i = q_i + a e(φ_i),

with r_i points at equal distances on the path as drawn. Two things hold the poses to what the robot can do: a step
has no sideways part, except for the drift; and it turns by at most κ times its length. Both enter as least squares
with large weights; the second only where it is broken. The tractrix of the result is checked afterwards.

For the smallest largest distance (minimax), the distances get weights, and those of far points grow from round to
round in proportion to their distance. Source: Lawson (1961), thesis, UCLA.

Every residual belongs to one pose or to two neighbours. So a Gauss-Newton step is a banded system, and its cost
is linear in the length of the path. A closed path is solved with a stretch of the next lap at both ends. Lengths
in l.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, solveh_banded

from planner.path import Path2D, resample
from planner.tractrix import STILL, Drift
from sim.arrays import Floats

_SPACING = 0.2  # of the poses, in radii of the pivot's circle
_MOST_POSES = 20_000
_WEIGHTS = (0.3, 3.0, 30.0, 300.0, 1000.0)  # of what the robot cannot do, one stage after another
_ITERATIONS = 20  # in each stage
_EVEN = 0.01  # weight of equal steps
_SHORTEST_STEP = 0.25  # of the steps, as a share of the spacing
_OVERLAP = 6.0  # pivot distances of the next lap, for closed paths
_BAND = 5
_PIECES = 4  # points of the path for each pose
_ROUNDS = 12  # of growing weights
_LEAST = 0.01  # share of the mean weight that every point keeps


def nearest_path(
    raw: Path2D, pivot_distance: float, radius: float, *, drift: Drift = STILL, minimax: bool = False
) -> Path2D:
    """The path of the tracked point that is nearest to `raw` among those that the robot can follow.

    Args:
        raw: the path as drawn.
        pivot_distance: from the pivot to the tracked point; at least 0.
        radius: smallest radius of the pivot's track.
        drift: what carries the robot off its heading.
        minimax: nearest by the largest distance, not by the root mean square.
    """
    spacing = max(_SPACING * radius, raw.length / _MOST_POSES)
    target = resample(raw.polyline(), spacing)
    lap = len(target) - 1
    if raw.closed:
        extra = min(lap, math.ceil(_OVERLAP * max(pivot_distance, radius) / spacing))
        target = np.concatenate([target[lap - extra : lap], target, target[1 : extra + 1]])
    task = _Task(target, np.ones(len(target)), pivot_distance, radius, drift, spacing)
    poses = _start(target, pivot_distance)
    for weight in _WEIGHTS:
        poses = _descend(poses, task, weight)
    if minimax:
        poses = _minimax(poses, task)
    if raw.closed:
        poses = poses[extra : extra + lap + 1]
    at = np.arange(_PIECES * (len(poses) - 1) + 1) / _PIECES
    x, y, heading = (np.interp(at, np.arange(len(poses)), column) for column in poses.T)
    # Between two poses the pivot moves on an arc, which lies off its chord.
    turn = np.append(np.repeat(np.diff(poses[:, 2]), _PIECES), 0.0)
    chord = np.append(np.repeat(np.hypot(*np.diff(poses[:, :2], axis=0).T), _PIECES), 0.0)
    off = -turn * chord * (at % 1) * (1 - at % 1) / 2
    found = np.stack([x - off * np.sin(heading), y + off * np.cos(heading)], 1)
    found += pivot_distance * np.stack([np.cos(heading), np.sin(heading)], 1)
    return Path2D.of(found[:-1] if raw.closed else found, closed=raw.closed)


def _start(target: Floats, pivot_distance: float) -> Floats:
    """Poses (m, 3) along the target, headings smoothed over about a pivot distance."""
    moves = np.diff(target, axis=0)
    length = np.hypot(moves[:, 0], moves[:, 1])
    going = length > 1e-9 * length.max()
    tangent = np.unwrap(np.arctan2(moves[going, 1], moves[going, 0]))
    tangent = np.interp(np.arange(len(target)), np.flatnonzero(going), tangent)
    spacing = float(length[going].mean())
    reach = max(int(0.5 * pivot_distance / spacing), 1)
    kernel = np.ones(2 * reach + 1) / (2 * reach + 1)
    padded = np.concatenate([np.full(reach, tangent[0]), tangent, np.full(reach, tangent[-1])])
    heading = np.convolve(padded, kernel, mode="valid")
    q = target - pivot_distance * np.stack([np.cos(heading), np.sin(heading)], 1)
    return np.concatenate([q, heading[:, None]], 1)


class _Task(NamedTuple):
    """What stays the same while the poses are sought."""

    target: Floats  # (m, 2), points on the path as drawn
    shares: Floats  # (m,), how much the distance of each point counts
    distance: float  # from the pivot to the tracked point
    radius: float  # smallest of the pivot's track
    drift: Drift
    spacing: float  # of the target's points


def _minimax(poses: Floats, task: _Task) -> Floats:
    """Poses whose largest distance from the target is small."""
    best, shares = poses, task.shares
    for _ in range(_ROUNDS):
        away = _distances(poses, task)
        shares = shares * away
        shares = np.maximum(shares / shares.mean(), _LEAST)
        poses = _descend(poses, task._replace(shares=shares), _WEIGHTS[-1])
        if _distances(poses, task).max() < _distances(best, task).max():
            best = poses
    return best


def _distances(poses: Floats, task: _Task) -> Floats:
    """Of the tracked point from the target, (m,)."""
    ahead = task.distance * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], 1)
    return np.asarray(np.hypot(*(poses[:, :2] + ahead - task.target).T))


def _descend(poses: Floats, task: _Task, weight: float) -> Floats:
    """Gauss-Newton with Levenberg's damping, for one weight of the constraints."""
    damping = 1e-3
    residual, single, pair = _system(poses, task, weight)
    cost = float((residual[0] ** 2).sum() + (residual[1] ** 2).sum())
    for _ in range(_ITERATIONS):
        band, right = _normal(residual, single, pair)
        while damping < 1e6:
            damped = band.copy()
            damped[_BAND] += damping
            try:
                step = solveh_banded(damped, right, check_finite=False).reshape(-1, 3)
            except LinAlgError:
                damping *= 10
                continue
            tried = poses - step
            system = _system(tried, task, weight)
            new = float((system[0][0] ** 2).sum() + (system[0][1] ** 2).sum())
            if new < cost:
                break
            damping *= 6
        else:
            return poses
        gained = cost - new
        poses, cost = tried, new
        residual, single, pair = system
        damping = max(damping / 5, 1e-9)
        if gained < 1e-3 * cost:
            break
    return poses


def _system(poses: Floats, task: _Task, weight: float) -> tuple[tuple[Floats, Floats], Floats, Floats]:
    """Residuals of poses (m, 2) and of steps (m − 1, 4); derivatives (m, 2, 3) and (m − 1, 4, 6)."""
    target, shares, distance, radius, drift, spacing = task
    count, root = len(poses), np.sqrt(shares)
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    own = root[:, None] * (poses[:, :2] + distance * np.stack([c, s], 1) - target)
    single = np.zeros((count, 2, 3))
    single[:, 0, 0] = single[:, 1, 1] = root
    single[:, 0, 2], single[:, 1, 2] = -distance * s * root, distance * c * root
    move = np.diff(poses[:, :2], axis=0)
    turn = np.diff(poses[:, 2])
    middle = (poses[1:, 2] + poses[:-1, 2]) / 2
    c, s = np.cos(middle), np.sin(middle)
    forward, aside = c * move[:, 0] + s * move[:, 1], c * move[:, 1] - s * move[:, 0]
    cx, cy = drift.current
    way = 1 + cx * c + cy * s
    slip = (drift.sideways - cx * s + cy * c) / way
    steps, pair = np.zeros((count - 1, 4)), np.zeros((count - 1, 4, 6))

    def put(row: int, along: Floats, across: Floats, turning: Floats) -> None:
        """Derivatives of a residual by forward part, sideways part and turn of the step."""
        dx, dy = along * c - across * s, along * s + across * c
        swing = (along * aside - across * forward) / 2
        pair[:, row, 0], pair[:, row, 1], pair[:, row, 2] = -dx, -dy, swing - turning
        pair[:, row, 3], pair[:, row, 4], pair[:, row, 5] = dx, dy, swing + turning

    one, none = np.ones(count - 1), np.zeros(count - 1)
    broken: Floats
    steps[:, 0] = weight * (aside - slip * forward)
    put(0, np.asarray(-weight * slip, dtype=np.float64), weight * one, none)
    sense = np.sign(turn)
    over = sense * turn * radius - forward
    broken = np.asarray(weight * (over > 0), dtype=np.float64)
    steps[:, 1] = broken * over
    put(1, -broken, none, np.asarray(broken * sense * radius, dtype=np.float64))
    short = _SHORTEST_STEP * spacing - forward
    broken = np.asarray(10.0 * (short > 0), dtype=np.float64)
    steps[:, 2] = broken * short
    put(2, -broken * one, none, none)
    steps[:, 3] = _EVEN * (forward - spacing)
    put(3, _EVEN * one, none, none)
    return (own, steps), single, pair


def _normal(residual: tuple[Floats, Floats], single: Floats, pair: Floats) -> tuple[Floats, Floats]:
    """The banded normal matrix (6, 3 m), upper form, and the right side (3 m,)."""
    own, steps = residual
    count = len(own)
    right = np.einsum("kri,kr->ki", single, own)
    both = np.einsum("kri,kr->ki", pair, steps)
    right[:-1] += both[:, :3]
    right[1:] += both[:, 3:]
    diagonal = np.einsum("kri,krj->kij", single, single)
    blocks = np.einsum("kri,krj->kij", pair, pair)
    diagonal[:-1] += blocks[:, :3, :3]
    diagonal[1:] += blocks[:, 3:, 3:]
    across = blocks[:, :3, 3:]
    band = np.zeros((_BAND + 1, count, 3))
    for i in range(3):
        for j in range(i, 3):
            band[_BAND + i - j, :, j] = diagonal[:, i, j]
        for j in range(3):
            row = _BAND + i - (3 + j)
            band[row, 1:, j] = across[:, i, j]
    return band.reshape(_BAND + 1, -1), right.reshape(-1)
