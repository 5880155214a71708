"""The feasible path nearest to the path as drawn.

A corner cannot be followed. Rounding it cuts it. It is better to swing out before the corner and to cut a little
inside. So the pivot's poses (x_i, y_i, φ_i) minimise

    Σ across_i² + (0.6 along_i)²,   p_i = q_i + a e(φ_i),

with r_i points at equal distances on the path as drawn, and p_i − r_i in components along that path and across it.
Two constraints make the poses feasible: a step has no sideways component, except for the drift; and it turns by at
most κ times its length. Both enter as least squares with large weights; the second only where it is violated. The
tractrix of the result is checked afterwards.

For the minimax distance, the distances are weighted, and the weights of far points grow from iteration to
iteration in proportion to their distance. Source: Lawson (1961), thesis, UCLA.

A swing around a corner takes time. The pivot moves at about one speed, so time is the length of its track. With a
time weight w, in l², the cost is the mean squared distance plus w times the track's length over that of the drawn
path.

Every residual belongs to one pose or to two neighbours. So a Gauss-Newton step is a banded system, and its cost
is linear in the length of the path. On a closed path the last pose is a neighbour of the first one. In the order
0, m − 1, 1, m − 2, … neighbours are at most two places apart, so the system is banded, too. Lengths in l.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from planner.paths.path import Path2D, resample
from planner.paths.tractrix import STILL, Drift
from sim.arrays import Floats, Integers

_SPACING = 0.2  # of the poses, in radii of the pivot's circle
_MOST_POSES = 20_000
_WEIGHTS = (0.3, 3.0, 30.0, 300.0, 1000.0)  # of what the robot cannot do, one stage after another
_ITERATIONS = 20  # in each stage
_EVEN = 0.01  # weight of equal steps
_ALONG = 0.6  # of distances along the path beside those across: a robot that is late is still on it
_SHORTEST_STEP = 0.25  # of the steps, as a share of the spacing
_POINTS_A_POSE = 4  # points of the path for each pose
_ROUNDS = 12  # of growing weights
_LEAST = 0.01  # share of the mean weight that every point keeps
_HINDERED = (30.0, 30.0, 30.0, 100.0, 100.0, 300.0, 300.0, 1000.0)  # the same as _WEIGHTS, with a hindrance
_BENDING = 1.0  # l a rad, that a turn counts where there is a hindrance: straighter ways are smoother
_PINNED = 1e6  # weight of the ends of a part of a path

Hindrance = Callable[[Floats], tuple[Floats, Floats]]


def nearest_path(
    raw: Path2D,
    pivot_distance: float,
    radius: float,
    *,
    drift: Drift = STILL,
    minimax: bool = False,
    time_weight: float = 0.0,
) -> Path2D:
    """Find the path of the tracked point that is nearest to `raw` among those that the robot can follow.

    Args:
        raw: the path as drawn.
        pivot_distance: from the pivot to the tracked point; at least 0.
        radius: smallest radius of the pivot's track.
        drift: what carries the robot off its heading.
        minimax: nearest by the largest distance, not by the root mean square.
        time_weight: what time counts beside the distance, w of the module [l²].
    """
    target = resample(raw.polyline(), max(_SPACING * radius, raw.length / _MOST_POSES))
    spacing = raw.length / (len(target) - 1)
    if raw.closed:
        target = target[:-1]
    poses, turn = _start(target, pivot_distance, closed=raw.closed)
    task = _Task(
        target, _sides(target, closed=raw.closed), np.ones(len(target)), pivot_distance, radius, drift, spacing,
        time_weight, turn,
    )  # fmt: skip
    for weight in _WEIGHTS:
        poses = _descend(poses, task, weight)
    if minimax:
        poses = _minimax(poses, task)
    if turn is not None:
        poses = _whole_lap(poses, turn)
    points = tracked_points(poses, pivot_distance)
    return Path2D.of(points[:-1] if raw.closed else points, closed=raw.closed)


def nearest_poses(
    poses: Floats,
    target: Floats,
    pivot_distance: float,
    radius: float,
    *,
    drift: Drift = STILL,
    shares: Floats,
    hindrance: Hindrance,
) -> Floats:
    """Move poses (m, 3) of the pivot as near to points (m, 2) as the robot can follow and a hindrance allows.

    The tracked point stays where it is at the first and at the last pose.

    Args:
        poses: x, y and heading, on the same side of every obstacle as the result.
        target: where the tracked point should be.
        pivot_distance: from the pivot to the tracked point; at least 0.
        radius: smallest radius of the pivot's track.
        drift: what carries the robot off its heading.
        shares: (m,), how much the distance of each point counts.
        hindrance: residuals (m, r) of poses, zero where they are allowed, and derivatives (m, r, 3).
    """
    shares = np.concatenate([[_PINNED], shares[1:-1], [_PINNED]])
    spacing = float(np.hypot(*np.diff(poses[:, :2], axis=0).T).mean())
    task = _Task(
        target, _sides(target, closed=False), shares, pivot_distance, radius, drift, spacing, 0.0, None, hindrance
    )
    for weight in _HINDERED:
        poses = _descend(poses, task, weight)
    return poses


def tracked_points(poses: Floats, pivot_distance: float) -> Floats:
    """Interpolate between poses (m, 3) of the pivot, and return the points (k, 2) of the tracked point."""
    at = np.arange(_POINTS_A_POSE * (len(poses) - 1) + 1) / _POINTS_A_POSE
    x, y, heading = (np.interp(at, np.arange(len(poses)), column) for column in poses.T)
    # Between two poses the pivot moves on an arc, which lies off its chord.
    turned = np.append(np.repeat(np.diff(poses[:, 2]), _POINTS_A_POSE), 0.0)
    chord = np.append(np.repeat(np.hypot(*np.diff(poses[:, :2], axis=0).T), _POINTS_A_POSE), 0.0)
    off = -turned * chord * (at % 1) * (1 - at % 1) / 2
    points = np.stack([x - off * np.sin(heading), y + off * np.cos(heading)], 1)
    return points + pivot_distance * np.stack([np.cos(heading), np.sin(heading)], 1)


def _start(target: Floats, pivot_distance: float, *, closed: bool) -> tuple[Floats, float | None]:
    """Begin with poses (m, 3) along the target, headings smoothed over a pivot distance; and the turn of a lap."""
    moves = np.diff(target, axis=0, append=target[:1]) if closed else np.diff(target, axis=0)
    length = np.hypot(moves[:, 0], moves[:, 1])
    going = length > 1e-9 * length.max()
    tangent = np.unwrap(np.arctan2(moves[going, 1], moves[going, 0]))
    turn = tangent[-1] - tangent[0] + math.remainder(tangent[0] - tangent[-1], 2 * math.pi) if closed else None
    tangent = np.interp(np.arange(len(target)), np.flatnonzero(going), tangent)
    spacing = float(length[going].mean())
    reach = max(min(int(0.5 * pivot_distance / spacing), len(target) // 2), 1)
    kernel = np.ones(2 * reach + 1) / (2 * reach + 1)
    before, after = np.full(reach, tangent[0]), np.full(reach, tangent[-1])
    if turn is not None:
        before, after = tangent[-reach:] - turn, tangent[:reach] + turn
    heading = np.convolve(np.concatenate([before, tangent, after]), kernel, mode="valid")
    q = target - pivot_distance * np.stack([np.cos(heading), np.sin(heading)], 1)
    return np.concatenate([q, heading[:, None]], 1), None if turn is None else float(turn)


def _sides(target: Floats, *, closed: bool) -> Floats:
    """Compute unit vectors along the path, times the weight of such distances, and across it, (m, 2, 2)."""
    if closed:
        moves = np.roll(target, -1, axis=0) - np.roll(target, 1, axis=0)
    else:
        moves = np.gradient(target, axis=0)
    angle = np.arctan2(moves[:, 1], moves[:, 0])
    along, across = np.stack([np.cos(angle), np.sin(angle)], 1), np.stack([-np.sin(angle), np.cos(angle)], 1)
    return np.stack([_ALONG * along, across], 1)


def _whole_lap(poses: Floats, turn: float) -> Floats:
    """Repeat the first pose of a lap at its end."""
    return np.concatenate([poses, poses[:1] + np.array([0.0, 0.0, turn])])


class _Task(NamedTuple):
    """What stays the same while the poses are sought."""

    target: Floats  # (m, 2), points on the path as drawn
    sides: Floats  # (m, 2, 2), along the path, times the share that such distances count; and across it
    shares: Floats  # (m,), how much the distance of each point counts
    distance: float  # from the pivot to the tracked point
    radius: float  # smallest of the pivot's track
    drift: Drift
    spacing: float  # of the target's points
    time_weight: float  # of the length of the pivot's track
    turn: float | None  # of the heading in a lap; None: an open path
    hindrance: Hindrance | None = None  # what else the robot cannot do


def _minimax(poses: Floats, task: _Task) -> Floats:
    """Find poses whose largest distance from the target is small."""
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
    """Compute the distances (m,) of the tracked point from the target."""
    ahead = task.distance * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], 1)
    return np.asarray(np.hypot(*(poses[:, :2] + ahead - task.target).T))


def _descend(poses: Floats, task: _Task, weight: float) -> Floats:
    """Minimise by Gauss-Newton with Levenberg's damping, for one weight of the constraints."""
    from scipy.linalg import LinAlgError, solveh_banded  # slow to import, and only tight places need it

    damping = 1e-3
    place = _places(len(poses), closed=task.turn is not None)
    residual, single, pair = _system(poses, task, weight)
    cost = float((residual[0] ** 2).sum() + (residual[1] ** 2).sum())
    for _ in range(_ITERATIONS):
        band, right = _normal(residual, single, pair, place)
        while damping < 1e6:
            damped = band.copy()
            damped[-1] += damping
            try:
                step = solveh_banded(damped, right, check_finite=False).reshape(-1, 3)[place]
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
    """Compute residuals of poses (m, r) and of steps (k, 5), and derivatives (m, r, 3) and (k, 5, 6).

    There are k = m − 1 steps on an open path, and m on a closed one.
    """
    target, sides, shares, distance, radius, drift, spacing, time_weight, lap, hindrance = task
    root = np.sqrt(shares)
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    sides = root[:, None, None] * sides
    pose_residual = np.einsum("kri,ki->kr", sides, poses[:, :2] + distance * np.stack([c, s], 1) - target)
    single = np.concatenate([sides, (sides @ (distance * np.stack([-s, c], 1))[..., None])], -1)
    if hindrance is not None:
        broken, slopes = hindrance(poses)
        pose_residual = np.concatenate([pose_residual, weight * broken], 1)
        single = np.concatenate([single, weight * slopes], 1)
    if lap is not None:
        poses = _whole_lap(poses, lap)
    move = np.diff(poses[:, :2], axis=0)
    turn = np.diff(poses[:, 2])
    middle = (poses[1:, 2] + poses[:-1, 2]) / 2
    c, s = np.cos(middle), np.sin(middle)
    forward, aside = c * move[:, 0] + s * move[:, 1], c * move[:, 1] - s * move[:, 0]
    cx, cy = drift.current
    way = 1 + cx * c + cy * s
    slip = (drift.sideways - cx * s + cy * c) / way
    kinds = 5 if hindrance is None else 6
    steps, pair = np.zeros((len(move), kinds)), np.zeros((len(move), kinds, 6))

    def put(row: int, forward_part: Floats, sideways_part: Floats, turning: Floats) -> None:
        """Store a residual's derivatives by forward part, sideways part and turn of the step."""
        dx, dy = forward_part * c - sideways_part * s, forward_part * s + sideways_part * c
        swing = (forward_part * aside - sideways_part * forward) / 2
        pair[:, row, 0], pair[:, row, 1], pair[:, row, 2] = -dx, -dy, swing - turning
        pair[:, row, 3], pair[:, row, 4], pair[:, row, 5] = dx, dy, swing + turning

    ones, zeros = np.ones(len(move)), np.zeros(len(move))
    steps[:, 0] = weight * (aside - slip * forward)
    put(0, np.asarray(-weight * slip, dtype=np.float64), weight * ones, zeros)
    sense = np.sign(turn)
    over = sense * turn * radius - forward
    broken = np.asarray(weight * (over > 0), dtype=np.float64)
    steps[:, 1] = broken * over
    put(1, -broken, zeros, np.asarray(broken * sense * radius, dtype=np.float64))
    short = _SHORTEST_STEP * spacing - forward
    broken = np.asarray(10.0 * (short > 0), dtype=np.float64)
    steps[:, 2] = broken * short
    put(2, -broken * ones, zeros, zeros)
    steps[:, 3] = _EVEN * (forward - spacing)
    put(3, _EVEN * ones, zeros, zeros)
    length = np.maximum(forward, _SHORTEST_STEP * spacing)
    steps[:, 4] = np.sqrt(time_weight / spacing * length)
    put(4, np.asarray(steps[:, 4] / (2 * length) * (length == forward), dtype=np.float64), zeros, zeros)
    if hindrance is not None:
        steps[:, 5] = _BENDING * turn
        put(5, zeros, zeros, _BENDING * ones)
    return (pose_residual, steps), single, pair


def _places(count: int, *, closed: bool) -> Integers:
    """Order the poses in the system (m,) so that neighbours are near one another."""
    order = np.arange(count)
    if closed:
        order[::2], order[1::2] = np.arange((count + 1) // 2), np.arange(count - 1, (count - 1) // 2, -1)
    place = np.empty(count, dtype=np.int64)
    place[order] = np.arange(count)
    return place


def _normal(
    residual: tuple[Floats, Floats], single: Floats, pair: Floats, place: Integers
) -> tuple[Floats, Floats]:
    """Assemble the normal matrix, upper form (band, 3 m), and the right side (3 m,), sorted by `place`."""
    pose_residual, step_residual = residual
    count, first = len(pose_residual), np.arange(len(step_residual))
    second = (first + 1) % count
    right = np.einsum("kri,kr->ki", single, pose_residual)
    from_steps = np.einsum("kri,kr->ki", pair, step_residual)
    right[first] += from_steps[:, :3]
    right[second] += from_steps[:, 3:]
    diagonal = np.einsum("kri,krj->kij", single, single)
    blocks = np.einsum("kri,krj->kij", pair, pair)
    diagonal[first] += blocks[:, :3, :3]
    diagonal[second] += blocks[:, 3:, 3:]
    low, high = np.minimum(place[first], place[second]), np.maximum(place[first], place[second])
    across = np.where((place[first] < place[second])[:, None, None], blocks[:, :3, 3:], blocks[:, 3:, :3])
    width = 3 * int((high - low).max()) + 2
    band = np.zeros((width + 1, count, 3))
    for i in range(3):
        for j in range(3):
            if j >= i:
                band[width + i - j, place, j] = diagonal[:, i, j]
            band[width + i - j - 3 * (high - low), high, j] = across[:, i, j]
    sorted_right = np.empty_like(right)
    sorted_right[place] = right
    return band.reshape(width + 1, -1), sorted_right.reshape(-1)
