"""Number of phases and meshes of orbits, the limit of their means for n → ∞, and their error.

1. The first solution starts from straight tails on the coarsest mesh. Phases are added until the means stop
   changing. The change from one number of phases to the next is the error of the smaller number.
2. Finer meshes start from the solution before. Rods converge at second order (error c₂/n² + c₄/n⁴ + …), so the
   means on n = 6, 8 and 12 edges are extrapolated to n → ∞. The stated error is the change by the term c₄ plus 3 %
   of the whole change by extrapolation. Over the sweep it is larger than the true error in more than 95 % of the
   rows.

All robots of a batch go through this together. Those that need no more phases leave it, so that none waits for
another one. Every result says whether the robot was solved, and if not, why. Left out: whether the orbit is stable
(`sim.motion.stability`). Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from common.arrays import Flags, Floats
from sim.linear.spectral import with_phases
from sim.model.body import PLACES, Body
from sim.solve.assembly import CONTACT, are_local, batch, row, without_further
from sim.solve.grouping import by_kind
from sim.solve.orbit import mean_motion, residuals_on_orbits, solve_orbits_in_place, straight_starts, turns_forward

MESHES = (6, 8, 12)  # edges a tail
SOLVED, NO_START, MANY_PHASES, LOST, BACKWARDS, UNBALANCED = range(6)
REASONS = {
    SOLVED: "",
    NO_START: "Newton's method did not converge from straight tails",
    MANY_PHASES: "the shape changes too much over a revolution",
    LOST: "Newton's method did not converge on a finer mesh",
    BACKWARDS: "the tails stop or turn backwards during a revolution",
    UNBALANCED: "forces are left unbalanced",
}
FIRST = 1e-2  # limit of the last Newton correction on the fewest phases
CORRECTION = 1e-6  # the same on the finest mesh; stretching is stiff: see BALANCED
ROUGH = 1e-5  # the same on coarser meshes, where only the means are needed: their error is then about 1e-9
BALANCED = 1e-5  # largest unbalanced force over the largest force in an edge
PHASES, PHASES_FOR_SLOPES = 3, 12  # to begin with; derivatives may depend more on the phase
PHASE_ERROR = 1e-4  # relative, in the means
DOUBT = 0.03  # share of the extrapolation that counts as error
_SHRINKS = 0.2  # assumed factor on the phase error with the next number of phases, if only one is known
MOST_PHASES = 48
_A, _B, _C = (1.0 / edges**2 for edges in MESHES)
_OF_COARSE, _OF_MIDDLE = _B * _C / ((_A - _B) * (_A - _C)), _A * _C / ((_B - _A) * (_B - _C))
_OF_FINE, _MORE = _A * _B / ((_C - _A) * (_C - _B)), _C / (_B - _C)
NEXT_CHANGE = (_B - _C) / (_A - _B)  # from the second mesh to the third, over that before: it goes as 1/n²
_SOFTER, _SOFTEST = 5.0, 0.5  # factor from hard contact to softer, and where it ends (EI/l³)
_SLOW, _FASTER, _LEAST_FASTER = 3.0, 1.5, 1.02  # ω̄ to begin with where tails may touch, and factors from there
_START, _SOFT = 1e-3, 0.05  # limit of the last Newton correction on the way, and factor on the contact there


class OrbitOnMeshes(NamedTuple):
    """One robot's orbit on the three MESHES: shapes x (n, M, 3) and velocities u (P, 4)."""

    status: int  # SOLVED or why not
    error: float  # estimated relative error of the means
    means: Floats  # (5,): ω_t, ω_h, ω_yr, v_x, v_z of the head's centre; NaN where not solved
    x: tuple[Floats, Floats, Floats]
    u: tuple[Floats, Floats, Floats]


class Coarse(NamedTuple):
    """One robot's orbit on the coarsest mesh."""

    status: int  # SOLVED or why not
    error: float  # of the means, for its number of phases
    x: Floats  # (n, M, 3)
    u: Floats  # (P, 4)


class OnMesh(NamedTuple):
    """One robot's orbit on one mesh."""

    x: Floats  # (n, M, 3)
    u: Floats  # (P, 4)
    twist: Floats  # (3,): mean v_z, h_x, ω_yr


@np.errstate(all="ignore")  # robots that overflow are flagged
def refined_orbits(rows: Floats, tails: int, least: int) -> list[OrbitOnMeshes]:
    """Solve for B robots with N tails, on `least` phases or more; `status` says which are not solved, and why.

    Args:
        rows: the robots' numbers (`sim.solve.assembly.numbers`), (B, K).
        tails: N.
        least: number of phases to begin with.
    """
    coarse = coarse_orbits(rows, tails, least)
    orbits = [_unsolved(*one) for one in coarse]
    solved = [i for i, one in enumerate(coarse) if one.status == SOLVED]
    for robots in by_kind(solved, lambda i: len(coarse[i].u)):
        for i, orbit in zip(robots, _on_finer_meshes(rows[robots], [coarse[i] for i in robots]), strict=True):
            orbits[i] = orbit
    lost = [i for i, orbit in enumerate(orbits) if orbit.status != SOLVED and rows[i, CONTACT] > _SOFTEST]
    for i, found in zip(lost, _by_softer_contact(rows[lost], tails, least) if lost else [], strict=True):
        orbits[i] = found or orbits[i]
    return orbits


def stacked(orbits: Iterable[OrbitOnMeshes], mesh: int) -> tuple[Floats, Floats]:
    """Stack the shapes (B, n, M, 3) and velocities (B, P, 4) of B orbits with equal phases on a mesh, 0 to 2."""
    x, u = zip(*((orbit.x[mesh], orbit.u[mesh]) for orbit in orbits), strict=True)
    return np.array(x), np.array(u)


def refined_orbit(body: Body, tails: int, least: int) -> OrbitOnMeshes:
    """Solve for one robot as `refined_orbits` does."""
    return refined_orbits(row(body), tails, least)[0]


def _unsolved(status: int, error: float, x: Floats, u: Floats) -> OrbitOnMeshes:
    return OrbitOnMeshes(status, np.nan, np.full(5, np.nan), (x, x, x), (u, u, u))


def _by_softer_contact(rows: Floats, tails: int, least: int) -> list[OrbitOnMeshes | None]:
    """Solve from the robots' orbits with softer contact, on the same meshes and phases; None where that fails."""
    soft = rows.copy()
    soft[:, CONTACT] /= _SOFTER
    starts = refined_orbits(soft, tails, least)
    orbits: list[OrbitOnMeshes | None] = [None] * len(rows)
    solved = [i for i, orbit in enumerate(starts) if orbit.status == SOLVED]
    for robots in by_kind(solved, lambda i: len(starts[i].u[0])):
        given, found = rows[robots], np.ones(len(robots), bool)
        xs, us = zip(*(stacked([starts[i] for i in robots], mesh) for mesh in range(len(MESHES))), strict=True)
        for x, u in zip(xs, us, strict=True):
            found &= _solved_forward(given, x, u, found)
        limit, error = _limit_and_error(batch(given), us)
        error += PHASE_ERROR
        for at, i in enumerate(robots):
            if found[at]:
                shapes, velocities = (tuple(part[at] for part in parts) for parts in (xs, us))
                orbits[i] = OrbitOnMeshes(
                    SOLVED, max(float(error[at]), starts[i].error), limit[at], shapes, velocities
                )
    return orbits


def _solved_forward(rows: Floats, x: Floats, u: Floats, going: Flags) -> Flags:
    """Solve in place; tell where that succeeded and the tails turn with the motor at all phases, (B,)."""
    sizes = solve_orbits_in_place(rows, x, u, CORRECTION, going)
    return np.asarray((sizes < CORRECTION) & turns_forward(batch(rows), u))


@np.errstate(all="ignore")  # robots that overflow are flagged
def orbits_on_mesh(
    rows: Floats, tails: int, edges: int, coarse: Sequence[Coarse], instants: Sequence[int] | None = None
) -> list[OnMesh | None]:
    """Solve for the orbits of B robots on a mesh; None where there is no solution.

    Args:
        rows: the robots' numbers, (B, K).
        tails: N.
        edges: of a tail.
        coarse: the orbits on the coarsest mesh, as `coarse_orbits` returns them.
        instants: of a turn, P, for each robot; by default those of its orbit on the coarsest mesh.
    """
    orbits: list[OnMesh | None] = [None] * len(rows)
    wanted = [len(one.u) for one in coarse] if instants is None else instants
    solved = [i for i, one in enumerate(coarse) if one.status == SOLVED]
    for robots in by_kind(solved, lambda i: (len(coarse[i].u), wanted[i])):
        given, count = rows[robots], wanted[robots[0]]
        x = with_edges(np.stack([coarse[i].x for i in robots]), batch(given).offset, edges)
        u = np.stack([coarse[i].u for i in robots])
        found = _solved_forward(given, x, u, np.ones(len(robots), bool))
        if count != u.shape[1]:
            x, u = with_phases(x, tails * count), with_phases(u, count)
            found = solve_orbits_in_place(given, x, u, CORRECTION, found) < CORRECTION
        twists = mean_motion(batch(given), u)[:, [4, 3, 2]]
        for at, i in enumerate(robots):
            if found[at]:
                orbits[i] = OnMesh(x[at], u[at], twists[at])
    return orbits


def orbit_on_mesh(body: Body, tails: int, edges: int) -> tuple[bool, Floats, Floats]:
    """Solve for the orbit of one robot on a given mesh: whether there is one, x (n, M, 3) and u (P, 4)."""
    coarse = coarse_orbits(row(body), tails)
    found = orbits_on_mesh(row(body), tails, edges, coarse)[0]
    return (False, coarse[0].x, coarse[0].u) if found is None else (True, found.x, found.u)


@np.errstate(all="ignore")  # robots that overflow are flagged
def coarse_orbits(rows: Floats, tails: int, least: int = PHASES) -> list[Coarse]:
    """Solve for B robots on the coarsest mesh; arguments as of `refined_orbits`.

    The first solution is a rough one for the robots without non-local effects other than contact, on the fewest
    phases. Then phases are added, each time from the solution before, until the means stop changing.
    """
    phases = fewest_phases(tails)
    none = np.zeros((MESHES[0], tails, 3)), np.zeros((1, 4))
    found = [Coarse(MANY_PHASES, np.nan, *none)] * len(rows)
    if tails > MOST_PHASES or not len(rows):
        return found
    going = np.lexsort((np.abs(rows[:, PLACES.omega]), ~are_local(rows)))  # similar robots share groups
    numbers = without_further(rows)
    x, u = straight_starts(numbers[going], MESHES[0], phases, tails)
    begin = tails * -(-least // tails)
    touching = numbers[going, CONTACT] != 0
    if touching.any():
        x[touching], u[touching] = _from_a_slow_motor(numbers[going][touching], x[touching], u[touching], tails)
    at_once = phases == begin and bool((numbers == rows).all())  # a rough solution is then on the way
    wanted, solved = (ROUGH, 0) if at_once else (FIRST, -1)  # numbers of phases used for the robots, less one
    means, change = np.empty(0), np.full(len(going), np.nan)
    while len(going):
        new_x, new_u = with_phases(x, phases), with_phases(u, phases // tails)
        converged = solve_orbits_in_place(numbers[going], new_x, new_u, wanted) < wanted
        status = NO_START if solved < 1 else MANY_PHASES
        for i in going[~converged]:
            found[i] = found[i]._replace(status=status)
        solved += 1
        more = converged
        if solved == 0:
            numbers, wanted, phases, change = rows, ROUGH, begin, change[more]
        else:
            new_means = mean_motion(batch(rows[going]), new_u)
            last, change = change, difference(means, new_means) if solved > 1 else np.full(len(going), np.nan)
            enough, to_come = change <= PHASE_ERROR, _next_change(last, change)
            soon = ~enough & (to_come <= PHASE_ERROR)
            for at in np.flatnonzero(converged & (enough | soon)).tolist():
                error, orbit = (change, (x, u)) if enough[at] else (to_come, (new_x, new_u))
                found[going[at]] = Coarse(SOLVED, float(error[at]), *(part[at].copy() for part in orbit))
            more = converged & ~(enough | soon)
            if phases > MOST_PHASES:
                break
            phases = more_phases(tails, phases)
            means, change = new_means[more], change[more]
        going, x, u = going[more], new_x[more], new_u[more]
    return found


def _from_a_slow_motor(rows: Floats, x: Floats, u: Floats, tails: int) -> tuple[Floats, Floats]:
    """Guess orbits on the coarsest mesh, of robots without other non-local effects than contact.

    Contact decides on which side of each other the tails lie. So the guess comes from a slow motor, at which the
    tails are apart. The motor is made faster step by step, with a softer contact.

    Args:
        x, u: straight tails, (B, n, M, 3) and (B, P, 4).
    """
    omega, soft = rows[:, PLACES.omega], rows.copy()
    soft[:, CONTACT] *= _SOFT
    speed, factor = np.minimum(_SLOW / np.abs(omega), 1.0), np.full(len(rows), _FASTER)
    soft[:, PLACES.omega] = speed * omega
    x, u = x.copy(), u * speed[:, None, None]
    sizes = solve_orbits_in_place(soft, x, u, _START)
    going = np.flatnonzero((sizes < _START) & (speed < 1))
    while len(going):
        factor[going] = np.minimum(factor[going], 1 / speed[going])
        faster = soft[going]
        faster[:, PLACES.omega] = speed[going] * factor[going] * omega[going]
        new_x, new_u = x[going], factor[going, None, None] * u[going]
        solved = solve_orbits_in_place(faster, new_x, new_u, _START) < _START
        done, failed = going[solved], going[~solved]
        x[done], u[done] = new_x[solved], new_u[solved]
        speed[done] *= factor[done]
        factor[failed] = np.sqrt(factor[failed])
        going = going[(speed[going] < 1) & (factor[going] > _LEAST_FASTER)]
    return x, u


def fewest_phases(tails: int) -> int:
    """Choose two phases or more, a multiple of N."""
    return tails * -(-2 // tails)


def more_phases(tails: int, phases: int) -> int:
    """Choose the next number of phases to try: a multiple of N, about half as many again."""
    return tails * max(phases // tails + 1, int(np.ceil(1.4 * phases / tails)))


def _next_change(last: Floats, change: Floats) -> Floats:
    """Estimate the changes of the means with the next number of phases from the last two; `last` may be NaN."""
    fall = np.minimum(np.maximum(change / last, 0.05), 1.0)
    return change * np.where(np.isfinite(last), fall, _SHRINKS)


def _on_finer_meshes(rows: Floats, coarse: Sequence[Coarse]) -> list[OrbitOnMeshes]:
    """Solve on all MESHES for robots with the same number of phases, and extrapolate."""
    body, (_, b, c) = batch(rows), MESHES
    x0, u0 = np.array([one.x for one in coarse]), np.array([one.u for one in coarse])
    x1, u1 = with_edges(x0, body.offset, b), u0.copy()
    lost = ~(solve_orbits_in_place(rows, x1, u1, ROUGH) < ROUGH)
    x2, u2 = with_edges(x1, body.offset, c), u1 + NEXT_CHANGE * (u1 - u0)
    x2 += NEXT_CHANGE * (x2 - with_edges(x0, body.offset, c))
    wanted, unbalanced = CORRECTION, ~lost
    for _ in range(2):
        sizes = solve_orbits_in_place(rows, x2, u2, wanted, unbalanced)
        lost |= unbalanced & ~(sizes < wanted)
        unbalanced &= ~lost & ~_are_balanced(rows, x2, u2)
        if not unbalanced.any():
            break
        wanted *= 1e-3  # slow motors: all forces are small
    status = np.where(lost, LOST, np.where(unbalanced, UNBALANCED, BACKWARDS))
    status[~lost & ~unbalanced & turns_forward(body, u2)] = SOLVED
    limit, error = _limit_and_error(body, (u0, u1, u2))
    error += [one.error for one in coarse]
    return [
        OrbitOnMeshes(SOLVED, float(error[i]), limit[i], (x0[i], x1[i], x2[i]), (u0[i], u1[i], u2[i]))
        if status[i] == SOLVED
        else _unsolved(int(status[i]), np.nan, x2[i], u2[i])
        for i in range(len(rows))
    ]


def _limit_and_error(robots: Body, velocities: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Extrapolate the means of orbits with velocities (B, P, 4) on each of MESHES, and estimate the error (B,)."""
    means = mean_motion(robots, np.array(velocities))
    limit, limit_of_two = extrapolate(means), means[2] + _MORE * (means[2] - means[1])
    return limit, difference(limit_of_two, limit) + DOUBT * difference(means[2], limit)


def _are_balanced(rows: Floats, x: Floats, u: Floats) -> Flags:
    """Tell where the unbalanced forces are small compared with the forces in the edges, (B,)."""
    r, t, force = residuals_on_orbits(rows, x, u)
    left = np.maximum(np.abs(r).max((1, 2, 3)), np.abs(t).max((1, 2)))
    return np.asarray(left < BALANCED * force)


@cache
def _weights(given: int, wanted: int) -> Floats:
    """Interpolate in the arc length from nodes 0..n to free nodes of another mesh, by cubics: (n', n + 1)."""
    weights = np.zeros((wanted, given + 1))
    for k in range(wanted):
        place = (k + 1) * given / wanted
        first = min(max(int(np.floor(place)) - 1, 0), given - 3)
        for i in range(first, first + 4):
            others = [j for j in range(first, first + 4) if j != i]
            weights[k, i] = np.prod([(place - j) / (i - j) for j in others])
    return weights


def with_edges(x: Floats, offset: Any, wanted: int) -> Floats:
    """Move free nodes (…, n, M, 3) to a mesh of `wanted` edges: cubic interpolation in the arc length.

    Args:
        offset: of the clamps, (…,).
    """
    *batch, n, phases, _ = x.shape
    weights = _weights(n, wanted)
    nodes = (weights[:, 1:] @ x.reshape(*batch, n, 3 * phases)).reshape(*batch, wanted, phases, 3)
    nodes[..., 0] += weights[:, :1] * np.reshape(offset, (*batch, 1, 1))
    return nodes


def difference(a: Floats, b: Floats) -> Any:
    """Compute the largest relative difference of means (…, 5); velocities relative to the speed."""
    away, speed = np.abs(a - b), np.hypot(b[..., 3], b[..., 4])
    return np.maximum((away / np.abs(b))[..., :3].max(-1), away[..., 3:].max(-1) / speed)


def extrapolate(found: Floats) -> Floats:
    """Limit for n → ∞ of values on MESHES, (3, …), whose errors go as c₂/n² + c₄/n⁴."""
    return np.asarray(_OF_COARSE * found[0] + (_OF_MIDDLE * found[1] + _OF_FINE * found[2]))
