"""Normal equations of a pivot's poses near a path: the least squares of `planner.paths.nearest_feasible`.

The residuals are the distances of the tracked point from the path, and for every step between two poses its
sideways part, the turn that is too tight, a length that is too short or uneven, and the time; with a hindrance its
residuals and the bending, too. Every block of the equations is an array over poses or steps: operations on long
vectors are fast. Lengths in l.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from planner.paths.tractrix import Drift
from sim.arrays import Floats, Integers

_EVEN = 0.01  # weight of equal steps
_SHORT = 10.0  # weight of steps that are too short
_SHORTEST_STEP = 0.25  # of the steps, as a share of the spacing
_BENDING = 1.0  # l a rad, that a turn counts where there is a hindrance: straighter ways are smoother

Hindrance = Callable[[Floats], tuple[Floats, Floats]]


class Task(NamedTuple):
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
    from scipy.linalg.lapack import dpbsv  # slow to import, and only tight places need it

    damped = band.copy(order="F")
    damped[0] += damping
    _, step, info = dpbsv(damped, right, lower=1, overwrite_ab=1)
    return step if info == 0 else None


class NormalEquations(NamedTuple):
    """The linearised least squares: cost, and normal equations without damping."""

    cost: float  # sum of squared residuals
    gradient: Floats  # (3, m), half of the cost's
    diagonal: Floats  # (3, 3, m), blocks of the poses; the upper triangle is filled
    across: Floats  # (3, 3, k), blocks of neighbours: row of the first pose, column of the second


def normal_equations(poses: Floats, task: Task, weight: float) -> NormalEquations:
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
    return NormalEquations(cost + part.cost, gradient, diagonal, across)


def _add_distances(poses: Floats, task: Task, gradient: Floats, diagonal: Floats) -> float:
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
    forward: Floats, aside: Floats, turn: Floats, direction: tuple[Floats, Floats], task: Task, weight: float
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


def places(count: int, *, closed: bool) -> Integers:
    """Order the poses in the system (m,) so that neighbours are near one another."""
    order = np.arange(count)
    if closed:
        order[::2], order[1::2] = np.arange((count + 1) // 2), np.arange(count - 1, (count - 1) // 2, -1)
    place = np.empty(count, dtype=np.int64)
    place[order] = np.arange(count)
    return place


def sorted_equations(system: NormalEquations, place: Integers) -> tuple[Floats, Floats]:
    """Assemble the normal matrix, lower form (band, 3 m), and the right side (3 m,), sorted by `place`."""
    count, first = len(place), place[: system.across.shape[2]]
    second = np.roll(place, -1)[: len(first)]
    later = second > first
    low, high = np.where(later, first, second), np.where(later, second, first)
    width = 3 * int((high - low).max()) + 2
    band = np.zeros((width + 1, count, 3))
    for i in range(3):
        for j in range(3):
            if j >= i:
                band[j - i, place, i] = system.diagonal[i, j]
            # row j of the later pose, column i of the earlier one
            band[3 * (high - low) + j - i, low, i] = np.where(later, system.across[i, j], system.across[j, i])
    right = np.empty((count, 3))
    right[place] = system.gradient.T
    return band.reshape(width + 1, -1), right.reshape(-1)
