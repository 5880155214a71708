"""Motions in balance as compiled loops, a block of robots at a time.

The method is that of `surrogate.wrench.balance`. The robots of a block take their steps together, so that the
network takes them as one matrix product, and a robot whose motion has been found makes room for the next one.
First all robots are solved with the network in single precision, up to a correction of ROUGH; then, from there and
with the same derivative, in double precision. All other formulas are in double precision. A robot that the last
block would wait for, or whose solution fails, is left to `surrogate.wrench.balance.solve`. No robot's steps depend
on the others of its block. Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.arrays import Floats, Integers
from sim.compiling import compiled
from surrogate.networks.blocks import BLOCK, evaluate_block, evaluate_roughly
from surrogate.networks.elementary import angle_of, arcsinh_of, exp_of, log_of
from surrogate.wrench.balance import (
    CORRECTION,
    DIFFERENCE,
    FIRST_SPIN,
    FOUND,
    LEAST_SHARE,
    LEFT_OVER,
    LONGEST,
    SINGLE,
    STEPS,
)
from surrogate.wrench.heads import HEAD_NUMBERS, RESISTANCE, ROBOT_NUMBERS
from surrogate.wrench.tails import (
    THRUST,
    THRUST_POWER,
    THRUST_SOFT,
    TORQUE_POWER,
    TORQUE_SOFT,
    ratios_of_tail,
    scaled_terms,
)

ROUGH = 1e-3  # last correction in single precision
_ROUGH_STEPS = 12
_FEW = BLOCK // 8  # robots for which a block is not worth its time
STATE = 29  # numbers of a robot between steps: motion, balance before, step, inverse
_MOTION, _BEFORE, _STEP, _INVERSE = ROBOT_NUMBERS, ROBOT_NUMBERS + 5, ROBOT_NUMBERS + 9, ROBOT_NUMBERS + 13
_SIZE = _MOTION + STATE  # rows of a block: robot, state, size of the correction,
_TASK, _TICKS, _X = _SIZE + 1, _SIZE + 2, _SIZE + 3  # which robot, steps taken, inputs of the network,
_Y = _X + SINGLE
_LEFT, _SAVED, _SLOPE = _Y + 6, _Y + 10, _Y + 15  # its answer, balance, a motion, a derivative
LANES = _SLOPE + 16
_TAIL = HEAD_NUMBERS


@compiled
def solve_block_rows(
    numbers: Floats, singles: Any, sizes: Integers, robots: Floats, rows: Integers, states: Floats,
    found: Integers, lanes: Floats, rough: bool,
) -> None:  # fmt: skip
    """Solve for the motions of robots, from linear theory.

    Args:
        numbers, sizes: network of the tails, see `surrogate.networks.compiled.Packed`.
        singles: its numbers in single precision.
        robots: (M, 39), see `surrogate.wrench.heads.pack_robots`.
        rows: (K,), of the robots to solve for.
        states: (K, STATE), written: the motion (5,) first.
        found: (K,), written: FOUND or LEFT_OVER.
        lanes: to work in, (R, BLOCK): LANES and those of the network.
        rough: use single precision first; for networks of one member.
    """
    for begin in range(0, len(rows), BLOCK):
        for b in range(BLOCK):
            _take_robot(robots[rows[min(begin + b, len(rows) - 1)]], lanes, b)
        _first_guesses(lanes)
        _start(numbers, singles, sizes, lanes, rough)
        for b in range(min(BLOCK, len(rows) - begin)):
            found[begin + b] = FOUND
            for i in range(STATE):
                states[begin + b, i] = lanes[_MOTION + i, b]
    if rough:
        _iterate(numbers, singles, sizes, robots, rows, states, found, lanes, True)
    _iterate(numbers, singles, sizes, robots, rows, states, found, lanes, False)


@compiled
def _take_robot(robot: Floats, lanes: Floats, lane: int) -> None:
    """Write a robot to a lane."""
    for i in range(ROBOT_NUMBERS):
        lanes[i, lane] = robot[i]


@compiled
def _iterate(
    numbers: Floats, singles: Any, sizes: Integers, robots: Floats, rows: Integers, states: Floats,
    found: Integers, lanes: Floats, rough: bool,
) -> None:  # fmt: skip
    """Take steps from states that have taken their last one, until the corrections are small."""
    for b in range(BLOCK):
        lanes[_TASK, b] = -1.0
    following, active = 0, 0
    smallest, most = (ROUGH, _ROUGH_STEPS) if rough else (CORRECTION, STEPS)
    y, room = lanes[_Y : _Y + 6], lanes[LANES:]
    x = lanes[_X : _X + sizes[1]]
    while True:
        for b in range(BLOCK):
            if lanes[_TASK, b] < 0:
                while following < len(rows) and found[following] != FOUND:
                    following += 1
                if following < len(rows):
                    _take_robot(robots[rows[following]], lanes, b)
                    for i in range(STATE):
                        lanes[_MOTION + i, b] = states[following, i]
                    lanes[_TASK, b], lanes[_TICKS, b] = following, 0.0
                    following += 1
                    active += 1
        if active == 0:
            return
        if following >= len(rows) and active <= _FEW and len(rows) > _FEW:
            _leave(states, found, lanes, rough)
            return
        _inputs(lanes, x)
        if rough:
            evaluate_roughly(numbers, singles, sizes, x, y, room)
        else:
            evaluate_block(numbers, sizes, x, y, room)
        _balance(lanes)
        _update(lanes)
        _step(lanes)
        for b in range(BLOCK):
            task = int(lanes[_TASK, b])
            if task >= 0:
                size = lanes[_SIZE, b]
                lanes[_TICKS, b] += 1.0
                failed = not (lanes[_MOTION + 4, b] > 0 and np.isfinite(size)) or lanes[_TICKS, b] >= most
                if failed or size < smallest:
                    found[task] = LEFT_OVER if failed else FOUND
                    _put_state(states[task], lanes, b, rough)
                    lanes[_TASK, b] = -1.0
                    active -= 1


@compiled
def _put_state(state: Floats, lanes: Floats, lane: int, rough: bool) -> None:
    """Keep the state of a lane; after a rough solution the derivative is not updated by the first balance."""
    for i in range(STATE):
        state[i] = lanes[_MOTION + i, lane]
    if rough:
        for i in range(4):
            state[_STEP - _MOTION + i] = 0.0


@compiled
def _leave(states: Floats, found: Integers, lanes: Floats, rough: bool) -> None:
    """Put the robots of a block away as they are: after a rough solution they go on, else they are left over."""
    for b in range(BLOCK):
        task = int(lanes[_TASK, b])
        if task >= 0:
            found[task] = FOUND if rough else LEFT_OVER
            _put_state(states[task], lanes, b, rough)


@compiled
def _torque(drag_number: float) -> float:
    """Return `surrogate.wrench.tails.linear_torque`."""
    ratio = drag_number / TORQUE_SOFT
    return exp_of(TORQUE_POWER * log_of(1 + ratio * ratio))


@compiled
def _thrust(drag_number: float) -> float:
    """Return `surrogate.wrench.tails.linear_thrust`."""
    return THRUST * drag_number / (1 + exp_of(THRUST_POWER * log_of(drag_number / THRUST_SOFT)))


@compiled
def _first_guesses(lanes: Floats) -> None:
    """Write the first guesses of `surrogate.wrench.balance`, and the inputs that the motion does not change."""
    for b in range(BLOCK):
        speed, gain = lanes[0, b], lanes[1, b]
        perp, parallel, a = lanes[_TAIL, b], lanes[_TAIL + 1, b], lanes[_TAIL + 2, b]
        number = lanes[_TAIL + 4, b]
        own, disc = lanes[RESISTANCE + 18, b], lanes[RESISTANCE + 19, b]
        spin = FIRST_SPIN * speed
        for _ in range(3):
            torque = number * perp * a * a * _torque(perp * spin)
            spin = speed * own / (own + gain * (torque + disc))
        head_spin = (spin - speed) / gain
        across = number * perp
        p = lanes[RESISTANCE, b] + across
        q = lanes[RESISTANCE + 1, b]
        r = lanes[RESISTANCE + 2, b] - across / 2
        s = lanes[RESISTANCE + 5, b]
        t = lanes[RESISTANCE + 6, b] + number * parallel
        u = lanes[RESISTANCE + 7, b]
        v = lanes[RESISTANCE + 10, b] - across / 2
        w = lanes[RESISTANCE + 11, b]
        z = lanes[RESISTANCE + 12, b] + across / 3
        side = -lanes[RESISTANCE + 3, b] * head_spin - lanes[RESISTANCE + 4, b] * spin
        along = -lanes[RESISTANCE + 8, b] * head_spin - lanes[RESISTANCE + 9, b] * spin
        turn = -lanes[RESISTANCE + 13, b] * head_spin - lanes[RESISTANCE + 14, b] * spin
        along += number * (perp - parallel) * spin * a * a * _thrust(perp * spin)
        first, second, third = t * z - u * w, u * v - s * z, s * w - t * v
        whole = p * first + q * second + r * third
        lanes[_MOTION, b] = (side * first + along * (r * w - q * z) + turn * (q * u - r * t)) / whole
        lanes[_MOTION + 1, b] = (side * second + along * (p * z - r * v) + turn * (r * s - p * u)) / whole
        lanes[_MOTION + 2, b] = (side * third + along * (q * v - p * w) + turn * (p * t - q * s)) / whole
        lanes[_MOTION + 3, b], lanes[_MOTION + 4, b] = head_spin, spin


@compiled
def _start(numbers: Floats, singles: Any, sizes: Integers, lanes: Floats, rough: bool) -> None:
    """Take the first step, with the derivative at the first guess."""
    x, y, room = lanes[_X : _X + sizes[1]], lanes[_Y : _Y + 6], lanes[LANES:]
    _inputs(lanes, x)
    if rough:
        evaluate_roughly(numbers, singles, sizes, x, y, room)
    else:
        evaluate_block(numbers, sizes, x, y, room)
    _balance(lanes)
    for b in range(BLOCK):
        for i in range(4):
            lanes[_BEFORE + i, b] = lanes[_LEFT + i, b]
        for i in range(5):
            lanes[_SAVED + i, b] = lanes[_MOTION + i, b]
    for j in range(4):
        for b in range(BLOCK):
            sideways, surge = abs(lanes[_SAVED, b]), abs(lanes[_SAVED + 1, b])
            yaw, spin = abs(lanes[_SAVED + 2, b]), abs(lanes[_SAVED + 3, b])
            largest = max(max(sideways, surge), max(yaw, spin))
            width = DIFFERENCE * (abs(lanes[_SAVED + j, b]) + LEAST_SHARE * largest)
            lanes[_SIZE, b] = width
            lanes[_MOTION + j, b] += width
            lanes[_MOTION + 4, b] = lanes[0, b] + lanes[1, b] * lanes[_MOTION + 3, b]
        _balance(lanes)
        for i in range(4):
            for b in range(BLOCK):
                lanes[_SLOPE + 4 * i + j, b] = (lanes[_LEFT + i, b] - lanes[_BEFORE + i, b]) / lanes[_SIZE, b]
        for i in range(5):
            for b in range(BLOCK):
                lanes[_MOTION + i, b] = lanes[_SAVED + i, b]
    for i in range(4):
        for b in range(BLOCK):
            lanes[_LEFT + i, b] = lanes[_BEFORE + i, b]
    _invert(lanes)
    _step(lanes)


@compiled
def _inputs(lanes: Floats, x: Floats) -> None:
    """Write `surrogate.wrench.balance.network_inputs_at` to x (F, BLOCK)."""
    if len(x) == SINGLE:
        _single_inputs(lanes, x)
    else:
        _tail_inputs(lanes, x)


@compiled
def _single_inputs(lanes: Floats, x: Floats) -> None:
    """Write `surrogate.wrench.tails.SINGLE_INPUTS`."""
    for b in range(BLOCK):
        perp, offset = lanes[_TAIL, b], lanes[_TAIL + 2, b]
        x[0, b] = log_of(perp * lanes[_MOTION + 4, b])
        x[1, b] = log_of(offset)
        x[2, b] = -log_of(lanes[_TAIL + 3, b])
        x[3, b] = log_of(lanes[_TAIL + 5, b] / (perp * offset * offset))
    for i in range(4, SINGLE):
        for b in range(BLOCK):
            x[i, b] = lanes[_TAIL + 2 + i, b]


@compiled
def _tail_inputs(lanes: Floats, x: Floats) -> None:
    """Write `surrogate.wrench.tails.INPUTS`."""
    for b in range(BLOCK):
        perp, offset, radius = lanes[_TAIL, b], lanes[_TAIL + 2, b], lanes[_TAIL + 3, b]
        motion = (
            lanes[_MOTION, b], lanes[_MOTION + 1, b], lanes[_MOTION + 2, b], 0.0, lanes[_MOTION + 4, b],
        )  # fmt: skip
        drag_number, deflection, surge = ratios_of_tail(perp, offset, motion)
        x[0, b] = log_of(drag_number)
        x[1, b] = log_of(offset)
        x[2, b] = -log_of(radius)
        x[3, b] = arcsinh_of(deflection)
        x[4, b] = angle_of(motion[0], motion[2])
        x[5, b] = arcsinh_of(surge)
        x[6, b] = log_of(lanes[_TAIL + 5, b] / (lanes[_TAIL + 4, b] * perp * offset * offset))


@compiled
def _balance(lanes: Floats) -> None:
    """Write what is left of the balance of forces at the motions, for the network's answer."""
    for b in range(BLOCK):
        perp = lanes[_TAIL, b]
        motion = (
            lanes[_MOTION, b], lanes[_MOTION + 1, b], lanes[_MOTION + 2, b], 0.0, lanes[_MOTION + 4, b],
        )  # fmt: skip
        drag_number = perp * motion[4]
        side, along, turn, force, thrust, torque, squared = scaled_terms(
            perp, lanes[_TAIL + 1, b], lanes[_TAIL + 2, b], lanes[_TAIL + 4, b], motion,
            _thrust(drag_number), _torque(drag_number),
        )  # fmt: skip
        lanes[_LEFT, b] = side + force * lanes[_Y, b]
        lanes[_LEFT + 1, b] = along + thrust * (lanes[_Y + 1, b] + squared * lanes[_Y + 4, b])
        lanes[_LEFT + 2, b] = turn + force * lanes[_Y + 2, b]
        lanes[_LEFT + 3, b] = torque * (lanes[_Y + 3, b] + squared * lanes[_Y + 5, b])
    for i in range(4):
        for j in range(5):
            for b in range(BLOCK):
                lanes[_LEFT + i, b] -= lanes[RESISTANCE + 5 * i + j, b] * lanes[_MOTION + j, b]


@compiled
def _step(lanes: Floats) -> None:
    """Take a step with the inverse of the derivative; keep the balance before it, and the correction's size."""
    for b in range(BLOCK):
        p, q, r, s = lanes[_LEFT, b], lanes[_LEFT + 1, b], lanes[_LEFT + 2, b], lanes[_LEFT + 3, b]
        for i in range(4):
            at = _INVERSE + 4 * i
            lanes[_STEP + i, b] = -(
                lanes[at, b] * p + lanes[at + 1, b] * q + lanes[at + 2, b] * r + lanes[at + 3, b] * s
            )
        turned = abs(lanes[1, b] * lanes[_STEP + 3, b]) / lanes[_MOTION + 4, b]
        share = LONGEST / turned if turned > LONGEST else 1.0
        for i in range(4):
            lanes[_BEFORE + i, b] = lanes[_LEFT + i, b]
            lanes[_STEP + i, b] *= share
            lanes[_MOTION + i, b] += lanes[_STEP + i, b]
        lanes[_MOTION + 4, b] = lanes[0, b] + lanes[1, b] * lanes[_MOTION + 3, b]
        sideways, surge, yaw = lanes[_MOTION, b], lanes[_MOTION + 1, b], lanes[_MOTION + 2, b]
        size = max(abs(lanes[_STEP, b]), abs(lanes[_STEP + 1, b]))
        size /= np.sqrt(sideways * sideways + surge * surge) + abs(yaw)
        turning = max(abs(lanes[_STEP + 2, b] / yaw), abs(lanes[_STEP + 3, b] / lanes[_MOTION + 3, b]))
        lanes[_SIZE, b] = max(size, turning)


@compiled
def _update(lanes: Floats) -> None:
    """Update the inverse of the derivative after a step (Broyden's good update); none after a step of zero."""
    for b in range(BLOCK):
        p, q = lanes[_LEFT, b] - lanes[_BEFORE, b], lanes[_LEFT + 1, b] - lanes[_BEFORE + 1, b]
        r, s = lanes[_LEFT + 2, b] - lanes[_BEFORE + 2, b], lanes[_LEFT + 3, b] - lanes[_BEFORE + 3, b]
        size = 0.0
        for j in range(4):
            column = 0.0
            for i in range(4):
                column += lanes[_STEP + i, b] * lanes[_INVERSE + 4 * i + j, b]
            lanes[_SLOPE + j, b] = column
        size = (
            lanes[_SLOPE, b] * p + lanes[_SLOPE + 1, b] * q + lanes[_SLOPE + 2, b] * r + lanes[_SLOPE + 3, b] * s
        )
        factor = 0.0 if size == 0 else 1 / size
        for i in range(4):
            at = _INVERSE + 4 * i
            predicted = lanes[at, b] * p + lanes[at + 1, b] * q + lanes[at + 2, b] * r + lanes[at + 3, b] * s
            missing = (lanes[_STEP + i, b] - predicted) * factor
            for j in range(4):
                lanes[at + j, b] += missing * lanes[_SLOPE + j, b]


@compiled
def _invert(lanes: Floats) -> None:
    """Write the inverses of the derivatives, by their minors."""
    for b in range(BLOCK):
        a0, a1, a2, a3 = lanes[_SLOPE, b], lanes[_SLOPE + 1, b], lanes[_SLOPE + 2, b], lanes[_SLOPE + 3, b]
        b0, b1, b2, b3 = lanes[_SLOPE + 4, b], lanes[_SLOPE + 5, b], lanes[_SLOPE + 6, b], lanes[_SLOPE + 7, b]
        c0, c1, c2, c3 = lanes[_SLOPE + 8, b], lanes[_SLOPE + 9, b], lanes[_SLOPE + 10, b], lanes[_SLOPE + 11, b]
        d0, d1, d2, d3 = lanes[_SLOPE + 12, b], lanes[_SLOPE + 13, b], lanes[_SLOPE + 14, b], lanes[_SLOPE + 15, b]
        s0, s1, s2 = a0 * b1 - b0 * a1, a0 * b2 - b0 * a2, a0 * b3 - b0 * a3
        s3, s4, s5 = a1 * b2 - b1 * a2, a1 * b3 - b1 * a3, a2 * b3 - b2 * a3
        m5, m4, m3 = c2 * d3 - d2 * c3, c1 * d3 - d1 * c3, c1 * d2 - d1 * c2
        m2, m1, m0 = c0 * d3 - d0 * c3, c0 * d2 - d0 * c2, c0 * d1 - d0 * c1
        factor = 1 / (s0 * m5 - s1 * m4 + s2 * m3 + s3 * m2 - s4 * m1 + s5 * m0)
        lanes[_INVERSE, b] = (b1 * m5 - b2 * m4 + b3 * m3) * factor
        lanes[_INVERSE + 1, b] = (a2 * m4 - a1 * m5 - a3 * m3) * factor
        lanes[_INVERSE + 2, b] = (d1 * s5 - d2 * s4 + d3 * s3) * factor
        lanes[_INVERSE + 3, b] = (c2 * s4 - c1 * s5 - c3 * s3) * factor
        lanes[_INVERSE + 4, b] = (b2 * m2 - b0 * m5 - b3 * m1) * factor
        lanes[_INVERSE + 5, b] = (a0 * m5 - a2 * m2 + a3 * m1) * factor
        lanes[_INVERSE + 6, b] = (d2 * s2 - d0 * s5 - d3 * s1) * factor
        lanes[_INVERSE + 7, b] = (c0 * s5 - c2 * s2 + c3 * s1) * factor
        lanes[_INVERSE + 8, b] = (b0 * m4 - b1 * m2 + b3 * m0) * factor
        lanes[_INVERSE + 9, b] = (a1 * m2 - a0 * m4 - a3 * m0) * factor
        lanes[_INVERSE + 10, b] = (d0 * s4 - d1 * s2 + d3 * s0) * factor
        lanes[_INVERSE + 11, b] = (c1 * s2 - c0 * s4 - c3 * s0) * factor
        lanes[_INVERSE + 12, b] = (b1 * m1 - b0 * m3 - b2 * m0) * factor
        lanes[_INVERSE + 13, b] = (a0 * m3 - a1 * m1 + a2 * m0) * factor
        lanes[_INVERSE + 14, b] = (d1 * s1 - d0 * s3 - d2 * s0) * factor
        lanes[_INVERSE + 15, b] = (c0 * s3 - c1 * s1 + c2 * s0) * factor
