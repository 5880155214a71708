"""Motions in balance of many robots whose tails have one network."""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.arrays import Flags, Floats, Integers
from sim.compiling import compiled
from sim.object_code import COUNT, FLOATS, INTEGERS, array_at, kept
from surrogate.networks.blocks import BLOCK, block_room, in_single_precision
from surrogate.networks.compiled import Packed
from surrogate.wrench.balance import FOUND, LEFT_OVER, MATRICES, solution_room, solve
from surrogate.wrench.balance_blocks import LANES, STATE, solve_block_rows
from surrogate.wrench.heads import ROBOT_NUMBERS


def solve_robots(network: Packed, robots: Floats) -> tuple[Floats, Flags]:
    """Solve for (v_x, v_z, ω_yr, ω_h, ω_t), (M, 5), of a positive motor; tell which robots converged, (M,).

    Args:
        network: of the tails.
        robots: (M, 39), see `surrogate.wrench.heads.pack_robots`.
    """
    count, singles = len(robots), in_single_precision(network.numbers)
    states, converged = np.empty((count, STATE)), np.empty(count, dtype=np.int64)
    rows, lanes = np.arange(count), np.empty((lane_rows(network.sizes), BLOCK))
    room = np.empty(solution_room(network.sizes))
    solve_rows(
        network.numbers, singles, network.sizes, len(network.numbers), count, robots, rows, states, converged,
        lanes, len(lanes), room, len(room), np.empty((MATRICES, 4, 4)),
    )  # fmt: skip
    return np.ascontiguousarray(states[:, :5]), converged != LEFT_OVER


def lane_rows(sizes: Integers) -> int:
    """Return how many rows of BLOCK numbers `solve_many` works in."""
    return LANES + block_room(sizes)


@kept(
    FLOATS, FLOATS, INTEGERS, COUNT, COUNT, FLOATS, INTEGERS, FLOATS, INTEGERS, FLOATS, COUNT, FLOATS, COUNT,
    FLOATS,
)  # fmt: skip
def solve_rows(
    numbers: Any, singles: Any, sizes: Any, many: int, count: int, robots: Any, rows: Any, states: Any,
    converged: Any, lanes: Any, lane_space: int, room: Any, space: int, matrices: Any,
) -> None:  # fmt: skip
    """Write the motions of robots (M, 39) to the first columns of states (M, STATE), and what they ended with.

    Args:
        numbers, sizes: network of the tails, see `surrogate.networks.compiled.Packed`, so many numbers.
        singles: the same in single precision.
        rows: 0 to M − 1.
        lanes, room, matrices: to work in.
    """
    solve_many(
        array_at(numbers, many), array_at(singles, (many + 1) // 2), array_at(sizes, 6),
        array_at(robots, (count, ROBOT_NUMBERS)), array_at(rows, count), array_at(states, (count, STATE)),
        array_at(converged, count), array_at(lanes, (lane_space, BLOCK)), array_at(room, space),
        array_at(matrices, (MATRICES, 4, 4)),
    )  # fmt: skip


@compiled
def solve_many(
    numbers: Floats, singles: Floats, sizes: Integers, robots: Floats, rows: Integers, states: Floats,
    found: Integers, lanes: Floats, room: Floats, matrices: Floats,
) -> None:  # fmt: skip
    """Solve for the motions of robots in blocks, and alone for those that are left over.

    Args:
        numbers, sizes, singles: see `solve_rows`.
        robots: (M, 39).
        rows: (K,), of the robots to solve for, which have one network.
        states: (K, STATE), written: the motion (5,) first.
        found: (K,), written: what the solutions ended with, see `surrogate.wrench.balance`.
        lanes, room, matrices: to work in.
    """
    rough = sizes[5] == 1
    solve_block_rows(numbers, singles.view(np.float32), sizes, robots, rows, states, found, lanes, rough)
    for k in range(len(rows)):
        if found[k] != FOUND:
            converged = solve(numbers, sizes, robots[rows[k]], states[k, :5], room, matrices)
            found[k] = FOUND if converged else LEFT_OVER
