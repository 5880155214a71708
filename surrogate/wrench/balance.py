"""Motions in balance as compiled loops, one robot at a time.

The equations are those of `surrogate.wrench.heads` and `surrogate.wrench.tails`. They are solved by Broyden's
method. Its first derivative holds the network's numbers y fixed, so it needs no evaluation of the network; five or
six evaluations are enough. The table of a single tail has second solutions near the true one. So there the
equations are solved again with the exact first derivative, and of two different solutions that counts whose surge
is nearer to the first guess (linear theory). Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Flags, Floats
from sim.compiling import compiled
from sim.linear.dense import solve_dense
from surrogate.networks.compiled import Packed, evaluate
from surrogate.wrench.tails import inputs_of_tail, linear_thrust, linear_torque, wrench_terms

STEPS, CORRECTION = 60, 1e-9  # of Broyden's method; the correction is relative
_DIFFERENCE, _LEAST_SHARE = 1e-6, 1e-3  # steps of finite differences, relative
_FIRST_SPIN = 0.6  # ω_t/ω in the first guess
_LONGEST = 0.5  # largest relative change of ω_t in one step


@compiled
def solve_rows(network: Packed, heads: Floats, resistances: Floats, tails: Floats) -> tuple[Floats, Flags]:
    """Solve for (v_x, v_z, ω_yr, ω_h, ω_t), (M, 5), of a positive motor; tell which robots converged, (M,).

    Args:
        network: of the tails.
        heads: |ω| and gain, (M, 2).
        resistances: of the heads, (M, 4, 5).
        tails: columns of `surrogate.wrench.tails.pack_tails`, (M, 13).
    """
    motions, converged = np.empty((len(heads), 5)), np.empty(len(heads), dtype=np.bool_)
    y, guess, second = np.empty(len(network.mean)), np.empty(5), np.empty(5)
    for row in range(len(heads)):
        head, resistance, tail = heads[row], resistances[row], tails[row]
        _first_guess(head, resistance, tail, guess)
        motions[row] = guess
        converged[row] = _solve(network, head, resistance, tail, y, motions[row], False)
        if tail[4] == 1:
            second[:] = guess
            second_found = _solve(network, head, resistance, tail, y, second, True)
            nearer = abs(second[1] - guess[1]) < abs(motions[row, 1] - guess[1])
            if second_found and (nearer or not converged[row]):
                motions[row] = second
                converged[row] = True
    return motions, converged


@compiled
def inverse_rows(matrices: Floats) -> Floats:
    """Invert matrices (M, n, n); numbers that are not finite where there is no inverse."""
    inverses = np.empty_like(matrices)
    for row in range(len(matrices)):
        inverses[row] = np.eye(matrices.shape[1])
        solve_dense(matrices[row].copy(), inverses[row])
    return inverses


@compiled
def inputs_rows(tails: Floats, motions: Floats) -> Floats:
    """Return `surrogate.wrench.tails.tail_inputs`, (M, 7), of tails (M, 13) that move so (M, 5)."""
    x = np.empty((len(tails), 7))
    for row in range(len(tails)):
        inputs_at(tails[row], motions[row], x[row])
    return x


@compiled
def inputs_at(tail: Floats, motion: Floats, x: Floats) -> None:
    """Write `surrogate.wrench.tails.INPUTS` of one robot to x (7,), or HEAD_INPUTS after them to x (14,)."""
    beta = np.arctan2(motion[0], motion[2])
    x[:7] = inputs_of_tail(tail[0], tail[2], tail[3], tail[4], tail[5], motion, beta)
    for i in range(7, len(x)):
        x[i] = tail[i - 1]


@compiled
def _unbalanced(resistance: Floats, tail: Floats, motion: Floats, y: Floats, residual: Floats) -> None:
    """Write `surrogate.wrench.heads.unbalanced` for numbers y of the tails to residual (4,)."""
    side, along, turn, force, thrust, torque, squared = wrench_terms(tail[0], tail[1], tail[2], tail[4], motion)
    residual[0] = side + force * y[0]
    residual[1] = along + thrust * (y[1] + squared * y[4])
    residual[2] = turn + force * y[2]
    residual[3] = torque * (y[3] + squared * y[5])
    for i in range(4):
        for j in range(5):
            residual[i] -= resistance[i, j] * motion[j]


@compiled
def _first_guess(head: Floats, resistance: Floats, tail: Floats, motion: Floats) -> None:
    """Write the motion with the torque and thrust of linear theory and the side forces of straight tails."""
    speed, gain = head[0], head[1]
    perp, parallel, a, number = tail[0], tail[1], tail[2], tail[4]
    spin = _FIRST_SPIN * speed
    for _ in range(3):
        torque = number * perp * a**2 * linear_torque(perp * spin)
        spin = speed * resistance[3, 3] / (resistance[3, 3] + gain * (torque + resistance[3, 4]))
    head_spin = (spin - speed) / gain
    matrix, push = resistance[:3, :3].copy(), np.empty((3, 1))
    matrix[0, 0] += number * perp
    matrix[1, 1] += number * parallel
    matrix[2, 2] += number * perp / 3
    matrix[0, 2] -= number * perp / 2
    matrix[2, 0] -= number * perp / 2
    for i in range(3):
        push[i, 0] = -resistance[i, 3] * head_spin - resistance[i, 4] * spin
    push[1, 0] += number * (perp - parallel) * spin * a**2 * linear_thrust(perp * spin)
    solve_dense(matrix, push)
    motion[:3] = push[:, 0]
    motion[3], motion[4] = head_spin, spin


@compiled
def _solve(
    network: Packed, head: Floats, resistance: Floats, tail: Floats, y: Floats, motion: Floats, exact: bool
) -> bool:
    """Solve by Broyden's method for one robot, from the motion given; return whether it converged.

    Args:
        y: room for the network's numbers, (6,).
        motion: first guess, replaced by the result, (5,).
        exact: the first derivative is that of the network, too.
    """
    x, residual, before = np.empty(len(network.shift)), np.empty(4), np.empty(4)
    step, change, moved = np.empty(4), np.empty(4), np.empty(5)
    slope, inverse = np.empty((4, 4)), np.eye(4)
    inputs_at(tail, motion, x)
    evaluate(network, x, y)
    _unbalanced(resistance, tail, motion, y, residual)
    largest = 0.0
    for j in range(4):
        largest = max(largest, abs(motion[j]))
    for j in range(4):
        width = _DIFFERENCE * (abs(motion[j]) + _LEAST_SHARE * largest)
        moved[:] = motion
        moved[j] += width
        moved[4] = head[0] + head[1] * moved[3]
        if exact:
            inputs_at(tail, moved, x)
            evaluate(network, x, y)
        _unbalanced(resistance, tail, moved, y, before)
        for i in range(4):
            slope[i, j] = (before[i] - residual[i]) / width
    solve_dense(slope, inverse)
    for _ in range(STEPS):
        share = 1.0
        for i in range(4):
            step[i] = 0.0
            for j in range(4):
                step[i] -= inverse[i, j] * residual[j]
        turned = abs(head[1] * step[3]) / motion[4]
        if turned > _LONGEST:
            share = _LONGEST / turned
        for i in range(4):
            step[i] *= share
            motion[i] += step[i]
            before[i] = residual[i]
        motion[4] = head[0] + head[1] * motion[3]
        if not motion[4] > 0:
            return False
        size = max(abs(step[0]), abs(step[1])) / (np.hypot(motion[0], motion[1]) + abs(motion[2]))
        size = max(size, max(abs(step[2] / motion[2]), abs(step[3] / motion[3])))
        if size < CORRECTION:
            return True
        if not np.isfinite(size):
            return False
        inputs_at(tail, motion, x)
        evaluate(network, x, y)
        _unbalanced(resistance, tail, motion, y, residual)
        for i in range(4):
            change[i] = residual[i] - before[i]
        _update(inverse, step, change)
    return False


@compiled
def _update(inverse: Floats, step: Floats, change: Floats) -> None:
    """Update the inverse of the derivative after a step that changed the balance so (Broyden's good update)."""
    predicted, along = np.zeros(4), np.zeros(4)
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
