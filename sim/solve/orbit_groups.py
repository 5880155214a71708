"""Orbits of many robots, in groups with a robot in each lane: `sim.solve.refinement` for local effects.

1. Phases are added on the coarsest mesh until the means stop changing. Each time, the robots that need more phases
   form new groups, so that none waits for another one.
2. Robots with the same number of phases form groups for the finer meshes.

Each robot goes through the same steps as alone, so its numbers do not depend on the group, to the last bit. A
robot that is left over alone has one lane; fewer than W leave lanes empty, where the last robot is repeated.
Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sim.arrays import Floats, Integers
from sim.compiling import compiled_exactly
from sim.lanes import ALONE, choose, lane, lanes, larger, less, somewhere, zeros
from sim.linear.spectral import with_phases
from sim.mechanics.balance import tail_spin
from sim.model.body import Body
from sim.solve.groups import body_in_lanes, largest_entry, newton_in_lanes, take_lane
from sim.solve.linearise import linearise
from sim.solve.newton import Workspace, new_workspace
from sim.solve.orbit import FIRST_PHASE, HEAD_SHARE, mean_motion
from sim.solve.rates import Rates, on_orbit
from sim.solve.refinement import (
    BACKWARDS,
    BALANCED,
    CORRECTION,
    DOUBT,
    FIRST,
    LOST,
    MANY_PHASES,
    MESHES,
    MOST_PHASES,
    NEXT_CHANGE,
    NO_START,
    PHASE_ERROR,
    ROUGH,
    SOLVED,
    UNBALANCED,
    difference,
    fewest_phases,
    limit,
    limit_of_two,
    more_phases,
    next_change,
    with_edges,
)

_OFFSET = 1  # row of the numbers of a robot with its offset


class Found(NamedTuple):
    """What is found of B robots; row i of x holds n M 3 numbers of robot i, row i of u 4 P."""

    ended: Integers  # (B,): SOLVED or why not
    phases: Integers  # (B,): M
    result: Floats  # (6, B): error, and the five means
    x: tuple[Floats, Floats, Floats]  # on MESHES
    u: tuple[Floats, Floats, Floats]


class OnMesh(NamedTuple):
    """Orbits of a group on one mesh."""

    x: Floats  # (n, M, 3, W)
    u: Floats  # (P, 4, W)
    means: Floats  # (5, W), see `sim.solve.orbit.mean_motion`
    solved: Floats  # (W,), 1 or 0


class _Start(NamedTuple):
    """The last solution of each robot on the coarsest mesh, rows as in `Found`."""

    x: Floats
    u: Floats


@compiled_exactly
def on_all_meshes(numbers: Floats, terms: Any, tails: int, order: Integers, found: Found, wide: Any) -> None:
    """Solve on the finer meshes, and extrapolate, for the robots that `on_coarsest_mesh` has solved for."""
    done = np.zeros(len(order), dtype=np.bool_)
    group, count = np.empty(len(wide), np.int64), 0
    for first in range(len(order)):
        phases = found.phases[order[first]]
        count = 0
        for at in range(first, len(order)):
            robot = order[at]
            if found.ended[robot] == SOLVED and not done[robot] and found.phases[robot] == phases:
                done[robot] = True
                group[count] = robot
                count += 1
                if count == len(wide):
                    _finer(numbers, terms, tails, group[:count], found, wide)
                    count = 0
        if count == 1:
            _finer(numbers, terms, tails, group[:1], found, ALONE)
        elif count > 1:
            _finer(numbers, terms, tails, group[:count], found, wide)


@compiled_exactly
def on_coarsest_mesh(
    numbers: Floats, terms: Any, tails: int, least: int, order: Integers, found: Found, wide: Any
) -> None:
    """Add phases until the means of each robot stop changing; fill the first mesh of `found`.

    Args:
        numbers: of B robots with N tails and local effects, (K, B), in the order of `sim.solve.assembly.numbers`.
        terms: numbers of the non-local effects, all zero.
        tails: N.
        least: number of phases to begin with.
        order: (B,), the robots, similar ones beside each other.
        found: filled; its rows have room for more phases than any orbit has.
        wide: width of the groups, see `sim.lanes`.
    """
    n, left = MESHES[0], len(order)
    going = order.copy()
    before = phases = fewest_phases(tails)
    now = _Start(np.empty_like(found.x[0]), np.empty_like(found.u[0]))
    more = _Start(np.empty_like(found.x[0]), np.empty_like(found.u[0]))
    _straight_starts(numbers, n, phases, tails, now)
    means, changes, sizes = np.zeros((5, len(order))), np.full(len(order), np.nan), np.empty(len(order))
    wanted, solved = FIRST, -1
    while True:
        at = 0
        while at < left:
            end = min(at + len(wide), left)
            if end == at + 1:
                _on_phases(numbers, terms, tails, going[at:end], now, before, more, phases, wanted, sizes, ALONE)
            else:
                _on_phases(numbers, terms, tails, going[at:end], now, before, more, phases, wanted, sizes, wide)
            at = end
        solved += 1
        still = 0
        for i in range(left):
            robot = going[i]
            size, body = sizes[robot], body_in_lanes(numbers[:, robot].copy(), terms)
            converged = size < wanted
            if _goes_on(body, tails, robot, solved, converged, now, before, more, phases, means, changes, found):
                going[still] = robot
                still += 1
        left = still
        if left == 0 or phases > MOST_PHASES:
            break
        now, more = more, now
        before = phases
        if solved == 0:
            wanted, phases = ROUGH, tails * int(np.ceil(least / tails))
        else:
            phases = more_phases(tails, phases)


@compiled_exactly
def _goes_on(
    body: Body, tails: int, robot: int, solved: int, converged: bool, now: _Start, before: int, more: _Start,
    phases: int, means: Floats, changes: Floats, found: Found,
) -> bool:  # fmt: skip
    """Tell whether a robot needs more phases; if not, or if it cannot be solved, fill its part of `found`."""
    if not converged:
        found.ended[robot] = NO_START if solved < 2 else MANY_PHASES
        return False
    if solved == 0:
        return True
    found.ended[robot] = MANY_PHASES
    instants = phases // tails
    new_means = mean_motion(body, more.u[robot, : 4 * instants].copy().reshape((instants, 4)))
    if solved > 1:
        last, change = changes[robot], difference(means[:, robot].copy(), new_means)
        changes[robot] = change
        if change <= PHASE_ERROR:
            return _keep(found, robot, now, before, tails, change)
        to_come = next_change(last, change)
        if to_come <= PHASE_ERROR:
            return _keep(found, robot, more, phases, tails, to_come)
    means[:, robot] = new_means
    return True


@compiled_exactly
def _keep(found: Found, robot: int, start: _Start, phases: int, tails: int, error: float) -> bool:
    """Keep the orbit of a robot on the coarsest mesh; return false, for it needs no more phases."""
    found.ended[robot], found.phases[robot], found.result[0, robot] = SOLVED, phases, error
    found.x[0][robot, : MESHES[0] * phases * 3] = start.x[robot, : MESHES[0] * phases * 3]
    found.u[0][robot, : 4 * (phases // tails)] = start.u[robot, : 4 * (phases // tails)]
    return False


@compiled_exactly
def _straight_starts(numbers: Floats, n: int, phases: int, tails: int, start: _Start) -> None:
    """Guess as `sim.solve.orbit.straight_start` does."""
    for robot in range(numbers.shape[1]):
        x, u = start.x[robot], start.u[robot]
        for k in range(n):
            for m in range(phases):
                at = 3 * (k * phases + m)
                x[at], x[at + 1], x[at + 2] = numbers[_OFFSET, robot], 0.0, -(k + 1) / n
        for p in range(phases // tails):
            u[4 * p], u[4 * p + 1], u[4 * p + 2], u[4 * p + 3] = 0.0, 0.0, 0.0, -HEAD_SHARE * numbers[0, robot]


@compiled_exactly
def _on_phases(
    numbers: Floats, terms: Any, tails: int, group: Integers, now: _Start, before: int, more: _Start, phases: int,
    wanted: float, sizes: Floats, width: Any,
) -> None:  # fmt: skip
    """Solve for a group on the coarsest mesh and a number of phases, from its solution on the number before."""
    n, given = MESHES[0], np.empty((numbers.shape[0], len(width)))
    x, u = np.empty((n, before, 3, len(width))), np.empty((before // tails, 4, len(width)))
    for i in range(len(width)):
        given[:, i] = numbers[:, group[min(i, len(group) - 1)]]
    _take(now.x, group, x)
    _take(now.u, group, u)
    rows = lanes(given, width)
    body, rates = body_in_lanes(rows, terms), on_orbit(phases, FIRST_PHASE)
    in_x, in_u = lanes(x, width), lanes(u, width)
    x_more = with_phases(in_x, phases)
    u_more = with_phases(in_u.reshape((1, in_u.shape[0], 4)), phases // tails)[0]
    out = np.empty((1, len(width)))
    lanes(out, width)[0] = newton_in_lanes(
        body, rates, x_more, u_more, new_workspace(rates, x_more, u_more), wanted, less(abs(rows[0]), np.inf)
    )
    _give(more.x, group, x_more)
    _give(more.u, group, u_more)
    for i in range(len(group)):
        sizes[group[i]] = out[0, i]


@compiled_exactly
def _take(rows: Floats, group: Integers, out: Floats) -> None:
    """Fill an array (…, W) with the rows of a group; the last one is repeated."""
    width = out.shape[-1]
    flat = out.reshape((out.size // width, width))
    for i in range(width):
        row = rows[group[min(i, len(group) - 1)]]
        for j in range(len(flat)):
            flat[j, i] = row[j]


@compiled_exactly
def _give(rows: Floats, group: Integers, values: Floats) -> None:
    """Fill the rows of a group from an array of vectors."""
    for i in range(len(group)):
        take_lane(rows[group[i], : values.size], values, i)


@compiled_exactly
def _finer(numbers: Floats, terms: Any, tails: int, group: Integers, found: Found, width: Any) -> None:
    """Solve for a group with the same number of phases on all meshes."""
    count, phases = len(width), found.phases[group[0]]
    instants = phases // tails
    given, out = np.empty((numbers.shape[0], count)), np.empty((7, count))
    for i in range(count):
        robot = group[min(i, len(group) - 1)]
        given[:, i] = numbers[:, robot]
        out[1, i] = found.result[0, robot]
    x, u = np.empty((MESHES[0], phases, 3, count)), np.empty((instants, 4, count))
    _take(found.x[0], group, x)
    _take(found.u[0], group, u)
    vectors = lanes(given, width), lanes(out, width), lanes(x, width), lanes(u, width)
    x1, x2, u1, u2 = _on_finer_meshes(*vectors, terms)
    _give(found.x[1], group, x1)
    _give(found.x[2], group, x2)
    _give(found.u[1], group, u1)
    _give(found.u[2], group, u2)
    for i in range(len(group)):
        found.ended[group[i]] = int(out[0, i])
        found.result[:, group[i]] = out[1:, i]


@compiled_exactly
def _on_finer_meshes(
    numbers: Floats, result: Floats, x0: Floats, u0: Floats, terms: Any
) -> tuple[Floats, Floats, Floats, Floats]:
    """Solve on all meshes for a group with M phases, and extrapolate.

    Args:
        numbers: of the robots, (K,).
        result: (7,): error of the phases in entry 1. Filled: SOLVED or why not, error, and the five means.
        x0, u0: on the coarsest mesh, (n, M, 3) and (P, 4).
        terms: as in `on_coarsest_mesh`.

    Returns:
        x (n, M, 3) on the two finer meshes and u (P, 4) on them.
    """
    body = body_in_lanes(numbers, terms)
    rates = on_orbit(x0.shape[1], FIRST_PHASE)
    _, b, c = MESHES
    x1, u1, u2 = with_edges(x0, body.offset, b), zeros(u0, u0.shape), zeros(u0, u0.shape)
    u1[:] = u0
    going = less(abs(numbers[0]), np.inf)
    size = newton_in_lanes(body, rates, x1, u1, new_workspace(rates, x1, u1), ROUGH, going)
    going = less(size, ROUGH)
    lost = 1 - going
    x2 = with_edges(x1, body.offset, c)
    coarser = with_edges(x0, body.offset, c)
    _extrapolate(x2, x2, coarser)
    _extrapolate(u2, u1, u0)
    work = new_workspace(rates, x2, u2)
    wanted, unbalanced = CORRECTION, going
    for _ in range(2):
        size = newton_in_lanes(body, rates, x2, u2, work, wanted, unbalanced)
        lost = choose(unbalanced * (1 - less(size, wanted)), 1.0, lost)
        unbalanced = unbalanced * (1 - lost)
        unbalanced = unbalanced * (1 - _balanced(body, rates, x2, u2, work))
        if not somewhere(unbalanced):
            break
        wanted *= 1e-3  # slow motors: all forces are small
    ended = choose(lost, 1.0 * LOST, choose(unbalanced, 1.0 * UNBALANCED, 1.0 * SOLVED))
    for p in range(u2.shape[0]):
        backwards = (1 - less(0.0, tail_spin(body, u2[p]) * body.omega)) * (1 - less(0.0, ended))
        ended = choose(backwards, 1.0 * BACKWARDS, ended)
    coarse, middle, fine = mean_motion(body, u0), mean_motion(body, u1), mean_motion(body, u2)
    limits, of_two = zeros(numbers, (5,)), zeros(numbers, (5,))
    for i in range(5):
        limits[i], of_two[i] = limit(coarse[i], middle[i], fine[i]), limit_of_two(middle[i], fine[i])
    failed = less(0.0, ended)
    result[0] = ended
    error = result[1] + difference(of_two, limits) + DOUBT * difference(fine, limits)
    result[1] = choose(failed, np.nan, error)
    for i in range(5):
        result[2 + i] = choose(failed, np.nan, limits[i])
    return x1, x2, u1, u2


@compiled_exactly
def _extrapolate(out: Floats, a: Floats, b: Floats) -> None:
    """Extrapolate from two meshes, b and then a, to the next one."""
    flat, first, second = out.reshape(out.size), a.reshape(a.size), b.reshape(b.size)
    for i in range(len(flat)):
        flat[i] = first[i] + NEXT_CHANGE * (first[i] - second[i])


@compiled_exactly
def _balanced(body: Body, rates: Rates, x: Floats, u: Floats, work: Workspace) -> Any:
    """Tell where the unbalanced forces are small compared with the forces in the edges, as 1 or 0."""
    linearise(body, rates, x, u, work.room, work.equations)
    left = larger(largest_entry(work.equations.r), largest_entry(work.equations.t))
    return less(left, BALANCED * largest_entry(work.room.geometry.force))


@compiled_exactly
def on_mesh(
    numbers: Floats, terms: Any, tails: int, x: Floats, u: Floats, edges: int, instants: int, width: Any
) -> OnMesh:
    """Solve for a group on a mesh and a number of instants, from its orbits on the coarsest mesh.

    Args:
        numbers, terms, tails, width: as in `on_coarsest_mesh`, (K, W).
        x, u: on the coarsest mesh, (n, M, 3, W) and (P, 4, W).
        edges: wanted.
        instants: wanted.
    """
    body = body_in_lanes(lanes(numbers, width), terms)
    start, velocities = lanes(x, width), lanes(u, width)
    phases = tails * instants
    count = len(width)
    found = OnMesh(
        np.empty((edges, phases, 3, count)), np.empty((instants, 4, count)), np.empty((5, count)), np.empty(count)
    )
    moved = with_edges(start, body.offset, edges)
    going = _corrected(body, moved, velocities, less(abs(body.omega), np.inf))
    for p in range(velocities.shape[0]):
        going = going * less(0.0, tail_spin(body, velocities[p]) * body.omega)
    new_x, new_u, means = lanes(found.x, width), lanes(found.u, width), lanes(found.means, width)
    if velocities.shape[0] == instants:
        new_x[:], new_u[:] = moved, velocities
    else:
        new_x[:] = with_phases(moved, phases)
        new_u[:] = with_phases(velocities.reshape((1, velocities.shape[0], 4)), instants)[0]
        going = _corrected(body, new_x, new_u, going)
    mean = mean_motion(body, new_u)
    for i in range(5):
        means[i] = mean[i]
    for i in range(count):
        found.solved[i] = lane(going, i)
    return found


@compiled_exactly
def _corrected(body: Body, x: Floats, u: Floats, going: Any) -> Any:
    """Solve in place, where `going` is 1; return where that succeeded."""
    rates = on_orbit(x.shape[1], FIRST_PHASE)
    size = newton_in_lanes(body, rates, x, u, new_workspace(rates, x, u), CORRECTION, going)
    return going * less(size, CORRECTION)
