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

import numpy as np

from planner.paths.path import Path2D, resample
from planner.paths.pose_equations import (
    Hindrance,
    Task,
    damped_step,
    normal_equations,
    places,
    sorted_equations,
    whole_lap,
)
from planner.paths.tractrix import STILL, Drift
from sim.arrays import Floats

_SPACING = 0.2  # of the poses, in radii of the pivot's circle
_MOST_POSES = 20_000  # of a path that is not longer than so many times _COARSEST
_COARSEST = 0.075  # spacing in l
_WEIGHTS = (0.3, 3.0, 30.0, 300.0, 1000.0)  # of what the robot cannot do, one stage after another
_ITERATIONS = 20  # in each stage
_ALONG = 0.6  # of distances along the path beside those across: a robot that is late is still on it
_POINTS_A_POSE = 4  # points of the path for each pose
_ROUNDS = 12  # of growing weights
_LEAST = 0.01  # share of the mean weight that every point keeps
_HINDERED = (30.0, 30.0, 30.0, 100.0, 100.0, 300.0, 300.0, 1000.0)  # the same as _WEIGHTS, with a hindrance
_PINNED = 1e6  # weight of the ends of a part of a path


def nearest_path(
    raw: Path2D,
    pivot_distance: float,
    radius: float,
    *,
    drift: Drift = STILL,
    minimax: bool = False,
    time_weight: float = 0.0,
    progress: Callable[[float], object] | None = None,
) -> Path2D:
    """Find the path of the tracked point that is nearest to `raw` among those that the robot can follow.

    Args:
        raw: the path as drawn.
        pivot_distance: from the pivot to the tracked point; at least 0.
        radius: smallest radius of the pivot's track.
        drift: what carries the robot off its heading.
        minimax: nearest by the largest distance, not by the root mean square.
        time_weight: what time counts beside the distance, w of the module [l²].
        progress: called now and then with the share that is done.
    """
    target = resample(raw.polyline(), pose_spacing(raw, radius))
    spacing = raw.length / (len(target) - 1)
    if raw.closed:
        target = target[:-1]
    poses, turn = _start(target, pivot_distance, closed=raw.closed)
    task = Task(
        target, _sides(target, closed=raw.closed), np.ones(len(target)), pivot_distance, radius, drift, spacing,
        time_weight, turn,
    )  # fmt: skip
    stages = len(_WEIGHTS) + (_ROUNDS if minimax else 0)

    def told(stage: int) -> None:
        if progress is not None:
            progress(stage / stages)

    for stage, weight in enumerate(_WEIGHTS):
        told(stage)
        poses = _descend(poses, task, weight)
    if minimax:
        poses = _minimax(poses, task, told)
    if turn is not None:
        poses = whole_lap(poses, turn)
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
    task = Task(
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


def pose_spacing(raw: Path2D, radius: float) -> float:
    """Return the spacing of the poses by which the nearest path is sought, for the smallest turn radius."""
    return max(_SPACING * radius, min(raw.length / _MOST_POSES, _COARSEST))


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


def _minimax(poses: Floats, task: Task, told: Callable[[int], object]) -> Floats:
    """Find poses whose largest distance from the target is small."""
    best, shares = poses, task.shares
    for stage in range(_ROUNDS):
        told(len(_WEIGHTS) + stage)
        away = _distances(poses, task)
        shares = shares * away
        shares = np.maximum(shares / shares.mean(), _LEAST)
        poses = _descend(poses, task._replace(shares=shares), _WEIGHTS[-1])
        if _distances(poses, task).max() < _distances(best, task).max():
            best = poses
    return best


def _distances(poses: Floats, task: Task) -> Floats:
    """Compute the distances (m,) of the tracked point from the target."""
    ahead = task.distance * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], 1)
    return np.asarray(np.hypot(*(poses[:, :2] + ahead - task.target).T))


def _descend(poses: Floats, task: Task, weight: float) -> Floats:
    """Minimise by Gauss-Newton with Levenberg's damping, for one weight of the constraints."""
    damping = 1e-3
    place = places(len(poses), closed=task.turn is not None)
    system = normal_equations(poses, task, weight)
    for _ in range(_ITERATIONS):
        band, right = sorted_equations(system, place)
        while damping < 1e6:
            step = damped_step(band, right, damping)
            if step is None:
                damping *= 10
                continue
            tried = poses - step.reshape(-1, 3)[place]
            candidate = normal_equations(tried, task, weight)
            if candidate.cost < system.cost:
                break
            damping *= 6
        else:
            return poses
        gained = system.cost - candidate.cost
        poses, system = tried, candidate
        damping = max(damping / 5, 1e-9)
        if gained < 1e-3 * system.cost:
            break
    return poses
