"""Motions in balance, as compiled loops.

The equations are those of `surrogate.tails`. They are solved by Broyden's
method. Its first derivative holds the network's numbers y fixed, so it needs no evaluation of the network; six or
seven evaluations are enough. The robots that have not converged go on together, a block at a time, since a network
takes many robots more quickly than one. Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

import numpy as np

from common.arrays import Flags, Floats
from sim.jit import compiled_fast
from sim.linear.lane_arrays import copy
from surrogate.network import BLOCK, Layers, evaluate
from surrogate.tails import (
    PAIR_INPUTS,
    PLACES,
    SINGLE_INPUTS,
    inputs_of_pair,
    inputs_of_single,
    inputs_of_tail,
    linear_thrust,
    linear_torque,
    wrench_terms,
)

STEPS, CORRECTION = 60, 2e-12  # of Broyden's method; the correction is relative
ACCEPTED = 1e-9  # the last of all corrections, where rounding keeps them above CORRECTION
DIFFERENCE, MIN_SHARE = 1e-6, 1e-3  # steps of finite differences, relative
FIRST_SPIN = 0.6  # ω_t/ω in the first guess
MAX_TURN = 0.5  # largest relative change of ω_t in one step
_CHUNK = 1024  # robots whose states are in use at a time
_SINGLE, _PAIR = len(SINGLE_INPUTS), len(PAIR_INPUTS)


@compiled_fast
def _inputs(robot: Floats, motion: Floats) -> tuple[float, ...]:
    """Return `surrogate.tails.INPUTS` of one robot."""
    beta = np.arctan2(motion[0], motion[2])
    perp, offset, radius = robot[PLACES.perp], robot[PLACES.offset], robot[PLACES.radius]
    return inputs_of_tail(perp, offset, radius, robot[PLACES.number], robot[PLACES.spin_drag], motion, beta)


@compiled_fast
def inputs_at(robot: Floats, motion: Floats, x: Floats) -> None:
    """Write `surrogate.tails.INPUTS` of one robot to x (7,)."""
    for i, value in enumerate(_inputs(robot, motion)):
        x[i] = value


@compiled_fast
def network_inputs_at(robot: Floats, motion: Floats, x: Floats) -> None:
    """Write the inputs of the network of one robot to x: SINGLE_INPUTS (13,), PAIR_INPUTS (11,) or INPUTS (7,)."""
    if len(x) == _SINGLE:
        perp, offset, radius = robot[PLACES.perp], robot[PLACES.offset], robot[PLACES.radius]
        x[0], x[1], x[2], x[3] = inputs_of_single(perp, offset, radius, robot[PLACES.spin_drag], motion[4])
        copy(x[4:], robot[PLACES.head])
    elif len(x) == _PAIR:
        for i, value in enumerate(inputs_of_pair(_inputs(robot, motion), robot[PLACES.head])):
            x[i] = value
    else:
        inputs_at(robot, motion, x)


@compiled_fast
def _residual(robot: Floats, motion: Floats, y: Floats, left: Floats) -> None:
    """Write what is left of the balance of forces for numbers y of the tails to left (4,)."""
    perp, parallel, offset = robot[PLACES.perp], robot[PLACES.parallel], robot[PLACES.offset]
    side, along, turn, force, thrust, torque, squared = wrench_terms(
        perp, parallel, offset, robot[PLACES.number], motion
    )
    resistance = robot[PLACES.resistance]
    left[0] = side + force * y[0]
    left[1] = along + thrust * (y[1] + squared * y[4])
    left[2] = turn + force * y[2]
    left[3] = torque * (y[3] + squared * y[5])
    for i in range(4):
        for j in range(5):
            left[i] -= resistance[5 * i + j] * motion[j]


@compiled_fast
def _eliminate(rows: Floats) -> None:
    """Turn the left square of rows (n, m) into the identity, by Gauss and Jordan's method."""
    count = len(rows)
    for i in range(count):
        pivot = i
        for k in range(i + 1, count):
            if abs(rows[k, i]) > abs(rows[pivot, i]):
                pivot = k
        for j in range(rows.shape[1]):
            rows[i, j], rows[pivot, j] = rows[pivot, j], rows[i, j]
        scale = 1 / rows[i, i]
        for j in range(rows.shape[1]):
            rows[i, j] *= scale
        for k in range(count):
            factor = rows[k, i]
            if k != i:
                for j in range(rows.shape[1]):
                    rows[k, j] -= factor * rows[i, j]


@compiled_fast
def _first_guess(robot: Floats, motion: Floats, rows: Floats) -> None:
    """Write the motion with the torque and thrust of linear theory and the side forces of straight tails."""
    speed, gain, resistance = robot[PLACES.speed], robot[PLACES.gain], robot[PLACES.resistance]
    perp, parallel = robot[PLACES.perp], robot[PLACES.parallel]
    a, number = robot[PLACES.offset], robot[PLACES.number]
    spin, own, disc = FIRST_SPIN * speed, resistance[18], resistance[19]
    for _ in range(3):
        spin = speed * own / (own + gain * (number * perp * a**2 * linear_torque(perp * spin) + disc))
    motion[3], motion[4] = (spin - speed) / gain, spin
    equations = rows[:3, :4]
    for i in range(3):
        for j in range(3):
            equations[i, j] = resistance[5 * i + j]
        equations[i, 3] = -resistance[5 * i + 3] * motion[3] - resistance[5 * i + 4] * spin
    equations[0, 0] += number * perp
    equations[1, 1] += number * parallel
    equations[2, 2] += number * perp / 3
    equations[0, 2] -= number * perp / 2
    equations[2, 0] -= number * perp / 2
    equations[1, 3] += number * (perp - parallel) * spin * a**2 * linear_thrust(perp * spin)
    _eliminate(equations)
    for i in range(3):
        motion[i] = equations[i, 3]


@compiled_fast
def _first_inverse(robot: Floats, motion: Floats, y: Floats, left: Floats, inverse: Floats, room: Floats) -> None:
    """Write the inverse of the derivative of the balance with y fixed, by differences; `room` is (6, 8)."""
    rows, moved, after, largest = room[:4], room[4, :5], room[5, :4], 0.0
    for j in range(4):
        largest = max(largest, abs(motion[j]))
    for j in range(4):
        width = DIFFERENCE * (abs(motion[j]) + MIN_SHARE * largest)
        copy(moved, motion)
        moved[j] += width
        moved[4] = robot[PLACES.speed] + robot[PLACES.gain] * moved[3]
        _residual(robot, moved, y, after)
        for i in range(4):
            rows[i, j] = (after[i] - left[i]) / width
            rows[i, 4 + j] = 1.0 if i == j else 0.0
    _eliminate(rows)
    for i in range(4):
        copy(inverse[i], rows[i, 4:])


@compiled_fast
def _update(inverse: Floats, step: Floats, before: Floats, left: Floats, room: Floats) -> None:
    """Update the inverse of the derivative after a step (Broyden's good update); `room` is (6, 8)."""
    change, predicted, along, size = room[0], room[1], room[2], 0.0
    for i in range(4):
        change[i], predicted[i], along[i] = left[i] - before[i], 0.0, 0.0
    for i in range(4):
        for j in range(4):
            predicted[i] += inverse[i, j] * change[j]
            along[j] += step[i] * inverse[i, j]
    for i in range(4):
        size += along[i] * change[i]
    if size != 0:
        for i in range(4):
            for j in range(4):
                inverse[i, j] += (step[i] - predicted[i]) * along[j] / size


@compiled_fast
def _take_step(robot: Floats, motion: Floats, left: Floats, inverse: Floats, step: Floats) -> float:
    """Take a step, and return the size of the correction; NaN if the tails no longer turn with the motor."""
    for i in range(4):
        step[i] = 0.0
        for j in range(4):
            step[i] -= inverse[i, j] * left[j]
    turned = abs(robot[PLACES.gain] * step[3]) / motion[4]
    share = MAX_TURN / turned if turned > MAX_TURN else 1.0
    for i in range(4):
        step[i] *= share
        motion[i] += step[i]
    motion[4] = robot[PLACES.speed] + robot[PLACES.gain] * motion[3]
    size = max(abs(step[0]), abs(step[1])) / (np.hypot(motion[0], motion[1]) + abs(motion[2]))
    size = max(size, max(abs(step[2] / motion[2]), abs(step[3] / motion[3])))
    return size if motion[4] > 0 else np.nan


@compiled_fast
def _solve(network: Layers, robots: Floats, motion: Floats, found: Flags) -> None:
    """Write the motions of robots, and which were found."""
    count, inputs = len(robots), network.first.shape[2]
    left, step, inverse = np.empty((count, 4)), np.empty((count, 4)), np.empty((count, 4, 4))
    x, y, room, before = np.empty((BLOCK, inputs)), np.empty((BLOCK, 6)), np.empty((6, 8)), np.empty(4)
    going = np.arange(count)
    for row in range(count):
        _first_guess(robots[row], motion[row], room)
    for turn in range(STEPS):
        remaining = 0
        for begin in range(0, len(going), BLOCK):
            block = going[begin : begin + BLOCK]  # robots that go on are put in front, so not before they are read
            for k, row in enumerate(block):
                network_inputs_at(robots[row], motion[row], x[k])
            evaluate(network, x[: len(block)], y[: len(block)])
            for k, row in enumerate(block):
                copy(before, left[row])
                _residual(robots[row], motion[row], y[k], left[row])
                if turn == 0:
                    _first_inverse(robots[row], motion[row], y[k], left[row], inverse[row], room)
                else:
                    _update(inverse[row], step[row], before, left[row], room)
                size = _take_step(robots[row], motion[row], left[row], inverse[row], step[row])
                found[row] = size < ACCEPTED
                if CORRECTION <= size < np.inf:
                    going[remaining] = row
                    remaining += 1
        going = going[:remaining]
        if remaining == 0:
            break


@compiled_fast
def solve(network: Layers, robots: Floats) -> tuple[Floats, Flags]:
    """Return (v_x, v_z, ω_yr, ω_h, ω_t) for a positive motor, (M, 5), and which were found, (M,).

    Args:
        network: of the tails.
        robots: (M, ROBOT_NUMBERS), see `surrogate.tails.pack_robots`.
    """
    motion, found = np.empty((len(robots), 5)), np.empty(len(robots), dtype=np.bool_)
    for begin in range(0, len(robots), _CHUNK):
        end = begin + _CHUNK
        _solve(network, robots[begin:end], motion[begin:end], found[begin:end])
    return motion, found
