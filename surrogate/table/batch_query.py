"""A query of many robots as one compiled loop over blocks of them.

The steps and the answers are those of `surrogate.table.compiled_query`, to 1e-12. What takes most of the time of
a robot alone, networks, monomials and weights of the intervals, is done for a block of robots at once.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.arrays import Floats, Integers
from sim.compiling import compiled
from sim.object_code import COUNT, FLOATS, INTEGERS, array_at, kept
from surrogate.networks.blocks import BLOCK, evaluate_block
from surrogate.table.compiled_query import (
    ANSWERS,
    ASSEMBLED,
    GROUPS,
    INPUT,
    MOTION,
    NOT_LEARNED,
    NOVELTY,
    REASON,
    WIDTH_FEATURES,
    WITH_DWELL,
    WITH_WIDTHS,
    assemble,
    judged,
    products_at,
    put_half_width,
    put_response,
    put_steady,
    response_inputs,
    scaled_features,
    support_numbers,
)
from surrogate.table.errors import OUTPUTS
from surrogate.table.flat_table import (
    DESIGN,
    GAP,
    LAG,
    MEMORY,
    NETWORK,
    SUPPORT,
    WIDTHS,
    WRENCH,
)
from surrogate.table.support import novelty_block
from surrogate.wrench.balance import LEFT_OVER, MATRICES, SINGLE, inputs_at, network_inputs_at
from surrogate.wrench.balance_blocks import STATE
from surrogate.wrench.heads import HEAD_NUMBERS, ROBOT_NUMBERS
from surrogate.wrench.motions import solve_many

_OUTPUTS = len(OUTPUTS)
# Rows of a block: inputs of networks, and of the wrench's own; answers; share of the gap; part of the domain;
# logarithms of widths; what else is worked in.
_X, _OWN, _ANSWER = 0, 15, 15 + SINGLE
_SHARE = _ANSWER + ANSWERS
_PART, _LOGARITHM, _WORK = _SHARE + 1, _SHARE + 2, _SHARE + 2 + _OUTPUTS
BLOCK_ROWS = _WORK  # and those of novelty, design, or terms with a network


@kept(
    FLOATS, INTEGERS, COUNT, COUNT, FLOATS, INTEGERS, COUNT, COUNT, FLOATS, FLOATS, FLOATS, COUNT, FLOATS,
    FLOATS, INTEGERS, FLOATS, COUNT, FLOATS, COUNT, FLOATS,
)  # fmt: skip
def query_blocks(
    numbers: Any, places: Any, many: int, several: int, singles: Any, chosen: Any, some: int, count: int,
    groups: Any, robots: Any, dwells: Any, wanted: int, answers: Any,
    states: Any, found: Any, lanes: Any, lane_space: int,
    room: Any, space: int, matrices: Any,
) -> None:  # fmt: skip
    """Write the answers (M, ANSWERS) for some of M robots, whose tails have one network.

    Args:
        numbers, places: `surrogate.table.flat_table.FlatTable`, so many numbers and so many places.
        singles: the numbers in single precision.
        chosen: indices of the robots, so many.
        groups, robots, dwells, wanted: of all robots, see `surrogate.table.compiled_query.query_rows`.
        states, found: to work in, (K, STATE) and (K,).
        lanes: to work in, so many rows of BLOCK.
        room, matrices: to work in, as for one robot.
    """
    table, at, rows = array_at(numbers, many), array_at(places, several), array_at(chosen, some)
    group, robot = array_at(groups, (GROUPS, count)), array_at(robots, (count, ROBOT_NUMBERS))
    dwell, answer = array_at(dwells, count), array_at(answers, (count, ANSWERS))
    state, flags, block = (
        array_at(states, (some, STATE)),
        array_at(found, some),
        array_at(lanes, (lane_space, BLOCK)),
    )
    work, squares = array_at(room, space), array_at(matrices, (MATRICES, 4, 4))
    if not wanted & ASSEMBLED:
        for k in range(some):
            assemble(group[:, rows[k]], robot[rows[k]])
    kind = int(min(robot[rows[0], HEAD_NUMBERS + 4], 3.0)) - 1
    sizes, support = at[WRENCH + NETWORK * kind : WRENCH + NETWORK * (kind + 1)], at[SUPPORT + kind]
    for k in range(some):
        flags[k] = LEFT_OVER
        for i in range(5):
            state[k, i] = np.nan
    if sizes[0] >= 0:
        solve_many(
            table, array_at(singles, (many + 1) // 2), sizes, robot, rows, state, flags, block, work, squares
        )
    for begin in range(0, some, BLOCK):
        for b in range(BLOCK):
            k = min(begin + b, some - 1)
            _put_motion(robot[rows[k]], state[k, :5], block[:, b])
        if sizes[0] >= 0 and support >= 0:
            for b in range(BLOCK):
                k = min(begin + b, some - 1)
                network_inputs_at(robot[rows[k], HEAD_NUMBERS:], state[k, :5], block[_OWN : _OWN + sizes[1], b])
            novelty_block(
                table[support : support + support_numbers(kind)], products_at(at, kind),
                block[_OWN : _OWN + sizes[1]], block[_ANSWER + NOVELTY], block[_WORK:],
            )  # fmt: skip
        evaluate_block(
            table, at[GAP : GAP + NETWORK], block[_X : _X + 8], block[_SHARE : _SHARE + 1], block[_WORK:]
        )
        for b in range(BLOCK):
            k = min(begin + b, some - 1)
            lane = block[_ANSWER:_SHARE, b]
            lane[REASON] = NOT_LEARNED
            if sizes[0] >= 0 and support >= 0:
                lane[REASON] = judged(table, at, group[:, rows[k]], lane, lane[NOVELTY], flags[k] != LEFT_OVER)
            put_steady(robot[rows[k]], lane, block[_SHARE, b])
        if wanted & WITH_DWELL:
            _responses(table, at, robot, rows[begin:], dwell, block, work)
        if wanted & WITH_WIDTHS:
            _half_widths(table, at, robot, rows[begin:], block)
        for b in range(min(BLOCK, some - begin)):
            for i in range(ANSWERS):
                answer[rows[begin + b], i] = block[_ANSWER + i, b]


@compiled
def _put_motion(robot: Floats, motion: Floats, lane: Floats) -> None:
    """Write motion and inputs of the networks to the answer of a robot, and the inputs to those of the block."""
    x = lane[_X : _X + 8]
    inputs_at(robot[HEAD_NUMBERS:], motion, x[:7])
    x[7] = np.log(robot[HEAD_NUMBERS + 4])
    for i in range(5):
        lane[_ANSWER + MOTION + i] = motion[i]
    for i in range(7):
        lane[_ANSWER + INPUT + i] = x[i]
    lane[_ANSWER + NOVELTY] = 0.0


@compiled
def _responses(
    table: Floats, places: Integers, robots: Floats, rows: Integers, dwells: Floats, block: Floats, room: Floats
) -> None:
    """Write net speeds and lags of the robots of a block."""
    components, shifts = places[LAG + 2], places[MEMORY + 2]
    for b in range(BLOCK):
        response_inputs(robots[rows[min(b, len(rows) - 1)]], block[_ANSWER:_SHARE, b], block[_X : _X + 15, b])
    x, work = block[_X : _X + 15], block[_WORK + components + shifts :]
    evaluate_block(table, places[LAG : LAG + NETWORK], x, block[_WORK : _WORK + components], work)
    terms = block[_WORK + components : _WORK + components + shifts]
    evaluate_block(table, places[MEMORY : MEMORY + NETWORK], x, terms, work)
    for b in range(BLOCK):
        row = rows[min(b, len(rows) - 1)]
        put_response(
            table, places, robots[row], dwells[row], block[_ANSWER:_SHARE, b],
            block[_WORK : _WORK + components + shifts, b], room,
        )  # fmt: skip


@compiled
def _half_widths(table: Floats, places: Integers, robots: Floats, rows: Integers, block: Floats) -> None:
    """Write the half-widths of the robots of a block."""
    design = block[_WORK : _WORK + DESIGN]
    features = design[1 : 1 + WIDTH_FEATURES]
    for b in range(BLOCK):
        design[0, b] = 1.0
        block[_PART, b] = scaled_features(
            table, places, robots[rows[min(b, len(rows) - 1)]], block[_ANSWER:_SHARE, b], features[:, b]
        )
    place = 1 + WIDTH_FEATURES
    for i in range(WIDTH_FEATURES):
        for j in range(i, WIDTH_FEATURES):
            first, second, product = features[i], features[j], design[place]
            for b in range(BLOCK):
                product[b] = first[b] * second[b]
            place += 1
    for k in range(_OUTPUTS):
        begin, logarithm = places[WIDTHS + k], block[_LOGARITHM + k]
        for b in range(BLOCK):
            logarithm[b] = 0.0
        if begin >= 0:
            for i in range(DESIGN):
                row, weight = design[i], table[begin + i]
                for b in range(BLOCK):
                    logarithm[b] += weight * row[b]
        for b in range(BLOCK):
            lane, part = block[_ANSWER:_SHARE, b], int(block[_PART, b])
            put_half_width(table, begin, k, lane, logarithm[b], part)
