"""Motions in balance as compiled loops, one robot at a time.

The equations are those of `surrogate.wrench.heads` and `surrogate.wrench.tails`. They are solved by Broyden's
method. Its first derivative holds the network's numbers y fixed, so it needs no evaluation of the network; five or
six evaluations are enough. The table of a single tail has second solutions near the true one. So there the
equations are solved again with the exact first derivative. Of two different solutions that counts whose surge is
nearer to the first guess (linear theory), and the robot is marked: it may be the wrong one. Units: l, μ0 l⁴/EI,
EI/l².
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
from surrogate.wrench.tails import inputs_of_tail, linear_thrust, linear_torque, wrench_terms

STEPS, CORRECTION = 60, 2e-12  # of Broyden's method; the correction is relative
ACCEPTED = 1e-9  # the last of all corrections, where rounding keeps them above CORRECTION
DIFFERENCE, LEAST_SHARE = 1e-6, 1e-3  # steps of finite differences, relative
FIRST_SPIN = 0.6  # ω_t/ω in the first guess
LONGEST = 0.5  # largest relative change of ω_t in one step
_VECTORS = 64  # numbers for the vectors of one robot, before the room of the network
LEFT_OVER, FOUND, SEVERAL = 0, 1, 2  # what a solution ends with
SAME = 1e-6  # two solutions are one, if all velocities agree so
MATRICES = 4  # 4×4 matrices that a solution works in


def solution_room(sizes: Integers) -> int:
    """Return how many numbers `solve` works in with a network."""
    return _VECTORS + room_of(sizes)


@compiled
def solve(numbers: Floats, sizes: Integers, robot: Floats, motion: Floats, room: Floats, matrices: Floats) -> int:
    """Write the motion (5,) of one robot (37,); return LEFT_OVER, FOUND, or SEVERAL if two motions were found.

    Args:
        numbers, sizes: network of the tails, see `surrogate.networks.compiled.Packed`.
        room: to work in, see `solution_room`.
        matrices: to work in, (MATRICES, 4, 4).
    """
    guess, second = room[:5], room[5:10]
    first_guess(robot, guess, matrices)
    for i in range(5):
        motion[i] = guess[i]
    found = _solve(numbers, sizes, robot, motion, room, matrices, False)
    if robot[HEAD_NUMBERS + 4] == 1:
        for i in range(5):
            second[i] = guess[i]
        second_found = _solve(numbers, sizes, robot, second, room, matrices, True)
        nearer = abs(second[1] - guess[1]) < abs(motion[1] - guess[1])
        several = found and second_found and not same_motions(motion, second)
        if second_found and (nearer or not found):
            for i in range(5):
                motion[i] = second[i]
            found = True
        if several:
            return SEVERAL
    return FOUND if found else LEFT_OVER


@compiled
def same_motions(first: Floats, second: Floats) -> bool:
    """Tell whether two solutions (5,) are one."""
    same = True
    for i in range(5):
        same = same and abs(second[i] - first[i]) <= SAME * abs(first[i])
    return same


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
    """Write `surrogate.wrench.tails.INPUTS` of one robot to x (7,), or HEAD_INPUTS after them to x (14,)."""
    beta = np.arctan2(motion[0], motion[2])
    x[0], x[1], x[2], x[3], x[4], x[5], x[6] = inputs_of_tail(
        tail[0], tail[2], tail[3], tail[4], tail[5], motion, beta
    )
    for i in range(7, len(x)):
        x[i] = tail[i - 1]


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
def _solve(
    numbers: Floats, sizes: Integers, robot: Floats, motion: Floats, room: Floats, matrices: Floats, exact: bool
) -> bool:
    """Solve by Broyden's method for one robot, from the motion given; return whether it converged.

    Args:
        motion: first guess, replaced by the result, (5,).
        exact: the first derivative is that of the network, too.
    """
    speed, gain, tail = robot[0], robot[1], robot[HEAD_NUMBERS:]
    x, y, residual, before = room[10 : 10 + sizes[1]], room[24:30], room[30:34], room[34:38]
    step, change, moved, work = room[38:42], room[42:46], room[46:51], room[_VECTORS:]
    slope, inverse = matrices[2], matrices[3]
    inputs_at(tail, motion, x)
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
        if exact:
            inputs_at(tail, moved, x)
            evaluate(numbers, sizes, x, y, work)
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
        inputs_at(tail, motion, x)
        evaluate(numbers, sizes, x, y, work)
        _unbalanced(robot, motion, y, residual)
        for i in range(4):
            change[i] = residual[i] - before[i]
        _update(inverse, step, change, room[51:59])
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
