"""The feasible path nearest to the path as drawn.

A corner cannot be followed. Rounding it cuts it. It is better to swing out before the corner and to cut a little
inside. So the pivot's poses (x_i, y_i, φ_i) minimise

    Σ across_i² + (0.6 along_i)²,   p_i = q_i + a e(φ_i),

with r_i points at equal distances on the path as drawn, and p_i − r_i in components along that path and across it.
Two constraints make the poses feasible: a step has no sideways component, except for the drift; and it turns by at
most κ times its length. Both enter as least squares with large weights; the second only where it is violated.
Further residuals keep steps equal and not too short. The tractrix of the result is checked afterwards.

For the minimax distance, the distances are weighted, and the weights of far points grow from iteration to
iteration in proportion to their distance. Source: Lawson (1961), thesis, UCLA.

A swing around a corner takes time. The pivot moves at about one speed, so time is the length of its track. With a
time weight w, in l², the cost is the mean squared distance plus w times the track's length over that of the drawn
path. With a hindrance, such as obstacles, its residuals and the bending count, too.

Every residual belongs to one pose or to two neighbours. So a Gauss-Newton step is a banded system, and its cost
is linear in the length of the path. On a closed path the last pose is a neighbour of the first one. In the order
0, m − 1, 1, m − 2, … neighbours are at most two places apart, so the system is banded, too. Every block of the
equations is an array over poses or steps: operations on long vectors are fast. Lengths in l.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dpbsv

from common.arrays import Floats, Integers
from planner.paths.path import Path2D, axis_at, resample
from planner.paths.tractrix import STILL, Drift

_SPACING = 0.2  # of the poses, in radii of the pivot's circle
_MOST_POSES = 20_000  # of a path that is not longer than so many times _COARSEST
_COARSEST = 0.075  # spacing in l
_WEIGHTS = (0.3, 3.0, 30.0, 300.0, 1000.0)  # of what the robot cannot do, one stage after another
_ITERATIONS = 20  # in each stage
_ALONG = 0.6  # of distances along the path beside those across: a robot that is late is still on it
_POINTS_A_POSE = 4  # points of the path for each pose, at least
_ROUNDS = 12  # of growing weights
_LEAST = 0.01  # share of the mean weight that every point keeps
_HINDERED = (30.0, 30.0, 30.0, 100.0, 100.0, 300.0, 300.0, 1000.0)  # the same as _WEIGHTS, with a hindrance
_PINNED = 1e6  # weight of the ends of a part of a path
_EVEN = 0.01  # weight of equal steps
_SHORT = 10.0  # weight of steps that are too short
_SHORTEST_STEP = 0.25  # of the steps, as a share of the spacing
_BENDING = 1.0  # l a rad, that a turn counts where there is a hindrance: straighter ways are smoother
Hindrance = Callable[[Floats], tuple[Floats, Floats]]


def nearest_path(
    raw: Path2D,
    pivot_distance: float,
    radius: float,
    *,
    drift: Drift = STILL,
    minimax: bool = False,
    time_weight: float = 0.0,
    apart: float = math.inf,
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
        apart: how far neighbours among its points may be from each other, about.
        progress: called now and then with the share that is done.
    """
    target = resample(raw.polyline(), pose_spacing(raw, radius))
    spacing = raw.length / (len(target) - 1)
    if raw.closed:
        target = target[:-1]
    poses, turn = _start(target, pivot_distance, closed=raw.closed)
    task = PoseProblem(
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
    points = tracked_points(poses, pivot_distance, apart)
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
    task = PoseProblem(
        target, _sides(target, closed=False), shares, pivot_distance, radius, drift, spacing, 0.0, None, hindrance
    )
    for weight in _HINDERED:
        poses = _descend(poses, task, weight)
    return poses


def tracked_points(poses: Floats, pivot_distance: float, apart: float = math.inf) -> Floats:
    """Interpolate between poses (m, 3) of the pivot, and return the points (k, 2) of the tracked point."""
    chords = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    pieces = max(_POINTS_A_POSE, math.ceil(float(chords.mean()) / apart))
    at = np.arange(pieces * (len(poses) - 1) + 1) / pieces
    x, y, heading = (np.interp(at, np.arange(len(poses)), column) for column in poses.T)
    # Between two poses the pivot moves on an arc, which lies off its chord.
    turned = np.append(np.repeat(np.diff(poses[:, 2]), pieces), 0.0)
    chord = np.append(np.repeat(chords, pieces), 0.0)
    off = -turned * chord * (at % 1) * (1 - at % 1) / 2
    points = np.stack([x - off * np.sin(heading), y + off * np.cos(heading)], 1)
    return points + pivot_distance * axis_at(heading)


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
    q = target - pivot_distance * axis_at(heading)
    return np.concatenate([q, heading[:, None]], 1), None if turn is None else float(turn)


def _sides(target: Floats, *, closed: bool) -> Floats:
    """Compute unit vectors along the path, times the weight of such distances, and across it, (m, 2, 2)."""
    if closed:
        moves = np.roll(target, -1, axis=0) - np.roll(target, 1, axis=0)
    else:
        moves = np.gradient(target, axis=0)
    angle = np.arctan2(moves[:, 1], moves[:, 0])
    along, across = axis_at(angle), np.stack([-np.sin(angle), np.cos(angle)], 1)
    return np.stack([_ALONG * along, across], 1)


def _minimax(poses: Floats, task: PoseProblem, told: Callable[[int], object]) -> Floats:
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


def _distances(poses: Floats, task: PoseProblem) -> Floats:
    """Compute the distances (m,) of the tracked point from the target."""
    ahead = task.distance * axis_at(poses[:, 2])
    return np.asarray(np.hypot(*(poses[:, :2] + ahead - task.target).T))


def _descend(poses: Floats, task: PoseProblem, weight: float) -> Floats:
    """Minimise by Gauss-Newton with Levenberg's damping, for one weight of the constraints."""
    damping = 1e-3
    index = indices(len(poses), closed=task.turn is not None)
    system = normal_equations(poses, task, weight)
    for _ in range(_ITERATIONS):
        band, right = sorted_equations(system, index)
        while damping < 1e6:
            step = damped_step(band, right, damping)
            if step is None:
                damping *= 10
                continue
            tried = poses - step.reshape(-1, 3)[index]
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


class PoseProblem(NamedTuple):
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


def whole_lap(poses: Floats, turn: float) -> Floats:
    """Repeat the first pose of a lap at its end."""
    return np.concatenate([poses, poses[:1] + np.array([0.0, 0.0, turn])])


def damped_step(band: Floats, right: Floats, damping: float) -> Floats | None:
    """Solve the damped normal equations (3 m,) in lower band form; None where they are not positive definite."""
    damped = band.copy(order="F")
    damped[0] += damping
    _, step, info = dpbsv(damped, right, lower=1, overwrite_ab=1)
    return step if info == 0 else None


class PoseNormalEquations(NamedTuple):
    """The linearised least squares: cost, and normal equations without damping."""

    cost: float  # sum of squared residuals
    gradient: Floats  # (3, m), half of the cost's
    diagonal: Floats  # (3, 3, m), blocks of the poses; the upper triangle is filled
    across: Floats  # (3, 3, k), blocks of neighbours: row of the first pose, column of the second


def normal_equations(poses: Floats, task: PoseProblem, weight: float) -> PoseNormalEquations:
    """Compute cost and normal equations at poses (m, 3).

    There are k = m − 1 steps on an open path, and m on a closed one. The residuals of a step depend on its forward
    part f, its sideways part g and its turn t. Derivatives by these are chained with those of f, g and t by the
    two poses.
    """
    x, y, heading = poses.T
    gradient, diagonal = np.zeros((3, len(poses))), np.zeros((3, 3, len(poses)))
    cost = _add_distances(poses, task, gradient, diagonal)
    if task.hindrance is not None:
        cost += _add_hindrance(*task.hindrance(poses), weight, gradient, diagonal)
    if task.turn is not None:
        x, y, heading = whole_lap(poses, task.turn).T
    dx, dy, turn = np.diff(x), np.diff(y), np.diff(heading)
    middle = (heading[1:] + heading[:-1]) / 2
    c, s = np.cos(middle), np.sin(middle)
    forward, aside = c * dx + s * dy, c * dy - s * dx
    part = _step_part(forward, aside, turn, (c, s), task, weight)
    # second derivatives by x and y of the step, in the lab
    xx = c * c * part.ff - 2 * c * s * part.fg + s * s * part.gg
    xy = c * s * (part.ff - part.gg) + (c * c - s * s) * part.fg
    yy = s * s * part.ff + 2 * c * s * part.fg + c * c * part.gg
    # by x, y and the mean heading, which adds g dφ to f and −f dφ to g
    swing_f, swing_g = aside / 2, -forward / 2
    by_f, by_g = part.ff * swing_f + part.fg * swing_g, part.fg * swing_f + part.gg * swing_g
    x_swing, y_swing, swing = c * by_f - s * by_g, s * by_f + c * by_g, by_f * swing_f + by_g * swing_g
    # by x, y, mean heading and the turn
    x_turn, y_turn, swing_turn = c * part.ft, s * part.ft, swing_f * part.ft
    first, second = slice(0, len(dx)), np.roll(np.arange(len(poses)), -1)[: len(dx)]
    from_x, from_y = c * part.f - s * part.g, s * part.f + c * part.g
    from_swing = swing_f * part.f + swing_g * part.g
    for at, sign in ((first, -1.0), (second, 1.0)):
        gradient[0, at] += sign * from_x
        gradient[1, at] += sign * from_y
        gradient[2, at] += from_swing + sign * part.t
        diagonal[0, 0, at] += xx
        diagonal[0, 1, at] += xy
        diagonal[1, 1, at] += yy
        diagonal[0, 2, at] += sign * x_swing + x_turn
        diagonal[1, 2, at] += sign * y_swing + y_turn
        diagonal[2, 2, at] += swing + 2 * sign * swing_turn + part.tt
    across = np.array([
        [-xx, -xy, -x_swing - x_turn],
        [-xy, -yy, -y_swing - y_turn],
        [x_swing - x_turn, y_swing - y_turn, swing - part.tt],
    ])  # fmt: skip
    return PoseNormalEquations(cost + part.cost, gradient, diagonal, across)


def _add_distances(poses: Floats, task: PoseProblem, gradient: Floats, diagonal: Floats) -> float:
    """Add the squared distances from the target to the normal equations; return their sum."""
    (along_x, along_y), (across_x, across_y) = np.moveaxis(task.sides, 0, -1)
    x, y, heading = poses.T
    ahead_x, ahead_y = task.distance * np.cos(heading), task.distance * np.sin(heading)
    off_x, off_y = x + ahead_x - task.target[:, 0], y + ahead_y - task.target[:, 1]
    cost = 0.0
    for side_x, side_y in ((along_x, along_y), (across_x, across_y)):
        residual = side_x * off_x + side_y * off_y
        by_heading = side_y * ahead_x - side_x * ahead_y
        weighted = task.shares * residual
        cost += float((weighted * residual).sum())
        derivatives = (side_x, side_y, by_heading)
        for i in range(3):
            gradient[i] += derivatives[i] * weighted
            for j in range(i, 3):
                diagonal[i, j] += task.shares * derivatives[i] * derivatives[j]
    return cost


def _add_hindrance(residual: Floats, slopes: Floats, weight: float, gradient: Floats, diagonal: Floats) -> float:
    """Add residuals (m, r) with derivatives (m, r, 3) to the normal equations; return the sum of their squares."""
    gradient += weight**2 * (slopes * residual[..., None]).sum(1).T
    diagonal += weight**2 * np.moveaxis((slopes[..., None] * slopes[..., None, :]).sum(1), 0, -1)
    return float((weight * residual**2).sum() * weight)


class _StepPart(NamedTuple):
    """What the residuals of the steps add: cost, and derivatives (k,) by forward part, sideways part and turn."""

    cost: float
    f: Floats
    g: Floats
    t: Floats
    ff: Floats
    fg: Floats
    gg: Floats
    ft: Floats
    tt: Floats


def _step_part(
    forward: Floats,
    aside: Floats,
    turn: Floats,
    direction: tuple[Floats, Floats],
    task: PoseProblem,
    weight: float,
) -> _StepPart:
    """Compute what the residuals of the steps add."""
    c, s = direction
    cx, cy = task.drift.current
    slip = (task.drift.sideways - cx * s + cy * c) / (1 + cx * c + cy * s)
    sideways = weight * (aside - slip * forward)
    sense = np.sign(turn)
    over = np.maximum(sense * turn * task.radius - forward, 0.0)  # turns further than it can
    turning, bent = weight**2 * over, weight**2 * (over > 0)
    least = _SHORTEST_STEP * task.spacing
    short = np.maximum(least - forward, 0.0)
    uneven = _EVEN * (forward - task.spacing)
    late = task.time_weight / task.spacing  # times the length
    length = np.maximum(forward, least)
    going = forward >= least
    bending = 0.0 if task.hindrance is None else _BENDING**2
    return _StepPart(
        cost=float((sideways**2 + turning * over + _SHORT**2 * short**2 + uneven**2).sum())
        + float((late * length + bending * turn**2).sum()),
        f=-weight * slip * sideways - turning - _SHORT**2 * short + _EVEN * uneven + late / 2 * going,
        g=weight * sideways,
        t=task.radius * sense * turning + bending * turn,
        ff=weight**2 * slip**2 + bent + _SHORT**2 * (short > 0) + _EVEN**2 + late / 4 * going / length,
        fg=-(weight**2) * slip,
        gg=np.full(len(turn), weight**2),
        ft=-task.radius * sense * bent,
        tt=np.asarray(task.radius**2 * bent + bending, dtype=np.float64),
    )  # fmt: skip


def indices(count: int, *, closed: bool) -> Integers:
    """Order the poses in the system (m,) so that neighbours are near one another."""
    order = np.arange(count)
    if closed:
        order[::2], order[1::2] = np.arange((count + 1) // 2), np.arange(count - 1, (count - 1) // 2, -1)
    index = np.empty(count, dtype=np.int64)
    index[order] = np.arange(count)
    return index


def sorted_equations(system: PoseNormalEquations, index: Integers) -> tuple[Floats, Floats]:
    """Assemble the normal matrix, lower form (band, 3 m), and the right side (3 m,), sorted by `index`."""
    count, first = len(index), index[: system.across.shape[2]]
    second = np.roll(index, -1)[: len(first)]
    later = second > first
    low, high = np.where(later, first, second), np.where(later, second, first)
    width = 3 * int((high - low).max()) + 2
    band = np.zeros((width + 1, count, 3))
    for i in range(3):
        for j in range(3):
            if j >= i:
                band[j - i, index, i] = system.diagonal[i, j]
            # row j of the later pose, column i of the earlier one
            band[3 * (high - low) + j - i, low, i] = np.where(later, system.across[i, j], system.across[j, i])
    right = np.empty((count, 3))
    right[index] = system.gradient.T
    return band.reshape(width + 1, -1), right.reshape(-1)
