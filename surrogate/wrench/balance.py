"""Motions in balance as compiled loops, one robot at a time.

The equations are those of `surrogate.wrench.heads` and `surrogate.wrench.tails`. They are solved by Broyden's
method. Its first derivative holds the network's numbers y fixed, so it needs no evaluation of the network; five or
six evaluations are enough. Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.arrays import Floats, Integers
from sim.compiling import compiled
from sim.linear.dense import solve_dense
from sim.object_code import COUNT, FLOATS, array_at, kept
from surrogate.networks.compiled import evaluate, room_of
from surrogate.wrench.heads import HEAD_NUMBERS, RESISTANCE
from surrogate.wrench.tails import (
    SINGLE_INPUTS,
    inputs_of_single,
    inputs_of_tail,
    linear_thrust,
    linear_torque,
    wrench_terms,
)

STEPS, CORRECTION = 60, 2e-12  # of Broyden's method; the correction is relative
ACCEPTED = 1e-9  # the last of all corrections, where rounding keeps them above CORRECTION
DIFFERENCE, LEAST_SHARE = 1e-6, 1e-3  # steps of finite differences, relative
FIRST_SPIN = 0.6  # ω_t/ω in the first guess
LONGEST = 0.5  # largest relative change of ω_t in one step
SINGLE = len(SINGLE_INPUTS)
_VECTORS = 49  # numbers for the vectors of one robot, before the room of the network
LEFT_OVER, FOUND = 0, 1  # what a solution ends with
MATRICES = 4  # 4×4 matrices that a solution works in


def solution_room(sizes: Integers) -> int:
    """Return how many numbers `solve` works in with a network."""
    return _VECTORS + room_of(sizes)


def inverses_of(matrices: Floats) -> Floats:
    """Invert matrices (M, n, n); numbers that are not finite where there is no inverse."""
    size = matrices.shape[1]
    inverses = np.empty_like(matrices, order="C")
    inverse_rows(len(matrices), size, np.array(matrices, order="C"), inverses)
    return inverses


@kept(COUNT, COUNT, FLOATS, FLOATS)
def inverse_rows(count: int, size: int, matrices: Any, inverses: Any) -> None:
    """Write the inverses of matrices (M, n, n), which are overwritten."""
    matrix, inverse = array_at(matrices, (count, size, size)), array_at(inverses, (count, size, size))
    for row in range(count):
        for i in range(size):
            for j in range(size):
                inverse[row, i, j] = 1.0 if i == j else 0.0
        solve_dense(matrix[row], inverse[row])


@compiled
def inputs_at(tail: Floats, motion: Floats, x: Floats) -> None:
    """Write `surrogate.wrench.tails.INPUTS` of one robot to x (7,)."""
    beta = np.arctan2(motion[0], motion[2])
    x[0], x[1], x[2], x[3], x[4], x[5], x[6] = inputs_of_tail(
        tail[0], tail[2], tail[3], tail[4], tail[5], motion, beta
    )


@compiled
def network_inputs_at(tail: Floats, motion: Floats, x: Floats) -> None:
    """Write the inputs of the network of one robot to x: SINGLE_INPUTS to x (13,), else INPUTS to x (7,)."""
    if len(x) == SINGLE:
        x[0], x[1], x[2], x[3] = inputs_of_single(tail[0], tail[2], tail[3], tail[5], motion[4])
        for i in range(4, SINGLE):
            x[i] = tail[i + 2]
    else:
        inputs_at(tail, motion, x)


@compiled
def _unbalanced(robot: Floats, motion: Floats, y: Floats, residual: Floats) -> None:
    """Write `surrogate.wrench.heads.unbalanced` for numbers y of the tails to residual (4,)."""
    tail = robot[HEAD_NUMBERS:]
    side, along, turn, force, thrust, torque, squared = wrench_terms(tail[0], tail[1], tail[2], tail[4], motion)
    residual[0] = side + force * y[0]
    residual[1] = along + thrust * (y[1] + squared * y[4])
    residual[2] = turn + force * y[2]
    residual[3] = torque * (y[3] + squared * y[5])
    for i in range(4):
        for j in range(5):
            residual[i] -= robot[RESISTANCE + 5 * i + j] * motion[j]


@compiled
def first_guess(robot: Floats, motion: Floats, matrices: Floats) -> None:
    """Write the motion with the torque and thrust of linear theory and the side forces of straight tails."""
    speed, gain, tail = robot[0], robot[1], robot[HEAD_NUMBERS:]
    resistance = robot[RESISTANCE : RESISTANCE + 20]  # four rows of five
    perp, parallel, a, number = tail[0], tail[1], tail[2], tail[4]
    spin = FIRST_SPIN * speed
    for _ in range(3):
        torque = number * perp * a**2 * linear_torque(perp * spin)
        spin = speed * resistance[18] / (resistance[18] + gain * (torque + resistance[19]))
    head_spin = (spin - speed) / gain
    matrix, push = matrices[0, :3, :3], matrices[1, :3, :1]
    for i in range(3):
        for j in range(3):
            matrix[i, j] = resistance[5 * i + j]
        push[i, 0] = -resistance[5 * i + 3] * head_spin - resistance[5 * i + 4] * spin
    matrix[0, 0] += number * perp
    matrix[1, 1] += number * parallel
    matrix[2, 2] += number * perp / 3
    matrix[0, 2] -= number * perp / 2
    matrix[2, 0] -= number * perp / 2
    push[1, 0] += number * (perp - parallel) * spin * a**2 * linear_thrust(perp * spin)
    solve_dense(matrix, push)
    for i in range(3):
        motion[i] = push[i, 0]
    motion[3], motion[4] = head_spin, spin


@compiled
def solve(numbers: Floats, sizes: Integers, robot: Floats, motion: Floats, room: Floats, matrices: Floats) -> bool:
    """Write the motion (5,) of one robot (39,); return whether the method converged.

    Args:
        numbers, sizes: network of the tails, see `surrogate.networks.compiled.Packed`.
        room: to work in, see `solution_room`.
        matrices: to work in, (MATRICES, 4, 4).
    """
    speed, gain, tail = robot[0], robot[1], robot[HEAD_NUMBERS:]
    x, y, residual, before = room[: sizes[1]], room[14:20], room[20:24], room[24:28]
    step, change, moved, work = room[28:32], room[32:36], room[36:41], room[_VECTORS:]
    slope, inverse = matrices[2], matrices[3]
    first_guess(robot, motion, matrices)
    network_inputs_at(tail, motion, x)
    evaluate(numbers, sizes, x, y, work)
    _unbalanced(robot, motion, y, residual)
    largest = 0.0
    for j in range(4):
        largest = max(largest, abs(motion[j]))
    for j in range(4):
        width = DIFFERENCE * (abs(motion[j]) + LEAST_SHARE * largest)
        for i in range(5):
            moved[i] = motion[i]
        moved[j] += width
        moved[4] = speed + gain * moved[3]
        _unbalanced(robot, moved, y, before)
        for i in range(4):
            slope[i, j] = (before[i] - residual[i]) / width
            inverse[i, j] = 1.0 if i == j else 0.0
    solve_dense(slope, inverse)
    size = np.inf
    for _ in range(STEPS):
        share = 1.0
        for i in range(4):
            step[i] = 0.0
            for j in range(4):
                step[i] -= inverse[i, j] * residual[j]
        turned = abs(gain * step[3]) / motion[4]
        if turned > LONGEST:
            share = LONGEST / turned
        for i in range(4):
            step[i] *= share
            motion[i] += step[i]
            before[i] = residual[i]
        motion[4] = speed + gain * motion[3]
        if not motion[4] > 0:
            return False
        size = max(abs(step[0]), abs(step[1])) / (np.hypot(motion[0], motion[1]) + abs(motion[2]))
        size = max(size, max(abs(step[2] / motion[2]), abs(step[3] / motion[3])))
        if size < CORRECTION:
            return True
        if not np.isfinite(size):
            return False
        network_inputs_at(tail, motion, x)
        evaluate(numbers, sizes, x, y, work)
        _unbalanced(robot, motion, y, residual)
        for i in range(4):
            change[i] = residual[i] - before[i]
        _update(inverse, step, change, room[41:49])
    return size < ACCEPTED


@compiled
def _update(inverse: Floats, step: Floats, change: Floats, room: Floats) -> None:
    """Update the inverse of the derivative after a step that changed the balance so (Broyden's good update)."""
    predicted, along = room[:4], room[4:8]
    for i in range(4):
        predicted[i] = along[i] = 0.0
    for i in range(4):
        for j in range(4):
            predicted[i] += inverse[i, j] * change[j]
            along[j] += step[i] * inverse[i, j]
    size = 0.0
    for i in range(4):
        size += along[i] * change[i]
    if size != 0:
        for i in range(4):
            for j in range(4):
                inverse[i, j] += (step[i] - predicted[i]) * along[j] / size
