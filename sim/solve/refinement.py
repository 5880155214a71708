"""Number of phases and meshes of an orbit, the limit of its means for n → ∞, and their error.

1. The first solution starts from straight tails on the coarsest mesh. Phases are added until the means stop
   changing. The change from one number of phases to the next is the error of the smaller number.
2. Finer meshes start from the solution before. Rods converge at second order (error c₂/n² + c₄/n⁴ + …), so the
   means on n = 6, 8 and 12 edges are extrapolated to n → ∞. The stated error is the change by the term c₄ plus 3 %
   of the whole change by extrapolation. Over the sweep it is larger than the true error in more than 95 % of the
   rows.

Every result says whether the robot was solved, and if not, why. Left out: whether the orbit is stable
(`sim.motion.stability`). Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled_exactly, formula
from sim.lanes import fma, larger, zeros
from sim.linear.spectral import with_phases
from sim.model.body import Body
from sim.solve.newton import new_workspace, newton
from sim.solve.orbit import (
    FIRST_PHASE,
    largest_force,
    mean_motion,
    residual_on_orbit,
    solve_orbit,
    straight_start,
    turns_forward,
)
from sim.solve.rates import on_orbit

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
FEW, MANY = 3, 12  # phases to begin with; MANY for derivatives, which may depend more on the phase than the motion
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


class Orbit(NamedTuple):
    """One robot's orbit on the three MESHES: shapes x (n, M, 3) and velocities u (P, 4)."""

    ended: int  # SOLVED or why not
    error: float  # estimated relative error of the means
    means: Floats  # (5,): ω_t, ω_h, ω_yr, v_x, v_z of the head's centre; NaN where not solved
    x: tuple[Floats, Floats, Floats]
    u: tuple[Floats, Floats, Floats]


def refined_orbit(body: Body, tails: int, least: int) -> Orbit:
    """Solve for one robot with N tails, on `least` phases or more.

    Returns:
        The orbit; `ended` says why it could not be solved, if so.
    """
    if tails > MOST_PHASES:
        return _unsolved(MANY_PHASES, np.zeros((MESHES[0], tails, 3)), np.zeros((1, 4)))
    ended, error, x, u = _on_coarsest_mesh(body, tails, least)
    orbit = _unsolved(ended, x, u) if ended != SOLVED else _on_finer_meshes(body, error, x, u)
    if orbit.ended != SOLVED and body.nonlocal_terms.tail_contact > _SOFTEST:
        return _by_softer_contact(body, tails, least, orbit)
    return orbit


def _by_softer_contact(body: Body, tails: int, least: int, lost: Orbit) -> Orbit:
    """Solve from the robot's orbit with softer contact, on the same meshes and phases; else return `lost`."""
    terms = body.nonlocal_terms
    soft = body._replace(nonlocal_terms=terms._replace(tail_contact=terms.tail_contact / _SOFTER))
    found = refined_orbit(soft, tails, least)
    if found.ended != SOLVED:
        return lost
    for x, u in zip(found.x, found.u, strict=True):
        _, size = solve_orbit(body, x, u, CORRECTION)
        if not (size < CORRECTION and turns_forward(body, u)):
            return lost
    means = np.array([mean_motion(body, u) for u in found.u])
    limit = extrapolate(means)
    error = difference(_without_last_term(means), limit) + DOUBT * difference(means[2], limit) + PHASE_ERROR
    return Orbit(SOLVED, max(error, found.error), limit, found.x, found.u)


def orbit_on_mesh(body: Body, tails: int, edges: int) -> tuple[bool, Floats, Floats]:
    """Solve for the orbit on a given mesh: whether there is one, x (n, M, 3) and u (P, 4)."""
    if tails > MOST_PHASES:
        return False, np.zeros((edges, tails, 3)), np.zeros((1, 4))
    ended, _, x, u = _on_coarsest_mesh(body, tails, FEW)
    if ended != SOLVED:
        return False, x, u
    x = with_edges(x, body.offset, edges)
    _, size = solve_orbit(body, x, u, CORRECTION)
    return size < CORRECTION and turns_forward(body, u), x, u


def _on_coarsest_mesh(body: Body, tails: int, least: int) -> tuple[int, float, Floats, Floats]:
    """Solve on the coarsest mesh, with `least` phases or more: SOLVED or why not, error of the phases, x and u."""
    terms = body.nonlocal_terms
    plain = body._replace(nonlocal_terms=terms._make([0.0] * len(terms)))
    if terms.tail_contact == 0:
        return _from_straight_tails(body, plain, tails, least)
    plain = plain._replace(nonlocal_terms=plain.nonlocal_terms._replace(tail_contact=terms.tail_contact))
    return _enough_phases(body, plain, *_from_a_slow_motor(plain, tails), tails, least)


def _from_a_slow_motor(plain: Body, tails: int) -> tuple[Floats, Floats]:
    """Guess the orbit on the coarsest mesh, for a robot without other non-local effects than contact.

    Contact decides on which side of each other the tails lie. So the guess comes from a slow motor, at which the
    tails are apart. The motor is made faster step by step, with a softer contact.
    """
    terms = plain.nonlocal_terms
    soft = plain._replace(nonlocal_terms=terms._replace(tail_contact=_SOFT * terms.tail_contact))
    speed = min(_SLOW / abs(plain.omega), 1.0)
    factor, slow = _FASTER, soft._replace(omega=speed * plain.omega)
    x, u = straight_start(slow, MESHES[0], fewest_phases(tails), tails)
    _, size = solve_orbit(slow, x, u, _START)
    while size < _START and speed < 1 and factor > _LEAST_FASTER:
        factor = min(factor, 1 / speed)
        x_more, u_more = x.copy(), factor * u
        _, larger = solve_orbit(soft._replace(omega=speed * factor * plain.omega), x_more, u_more, _START)
        if larger < _START:
            x, u, speed = x_more, u_more, speed * factor
        else:
            factor = np.sqrt(factor)
    return x, u


@compiled_exactly
def fewest_phases(tails: int) -> int:
    """Choose two phases or more, a multiple of N."""
    return tails * int(np.ceil(2 / tails))


@compiled_exactly
def _from_straight_tails(body: Body, plain: Body, tails: int, least: int) -> tuple[int, float, Floats, Floats]:
    """Solve as `_enough_phases` does, from straight tails."""
    x, u = straight_start(plain, MESHES[0], fewest_phases(tails), tails)
    return _enough_phases(body, plain, x, u, tails, least)


@compiled_exactly
def _unsolved(ended: int, x: Floats, u: Floats) -> Orbit:
    return Orbit(ended, np.nan, np.full(5, np.nan), (x, x, x), (u, u, u))


@compiled_exactly
def _on_finer_meshes(body: Body, error: float, x: Floats, u: Floats) -> Orbit:
    """Solve on all MESHES, from the orbit on the coarsest, and extrapolate; `error` is that of the phases."""
    xs, us = (x, x, x), (u, u, u)
    rates = on_orbit(x.shape[1], FIRST_PHASE)
    for i in (1, 2):
        n = MESHES[i]
        x, u = with_edges(xs[1], body.offset, n), us[1].copy()
        wanted = ROUGH
        if i == 2:
            x += NEXT_CHANGE * (x - with_edges(xs[0], body.offset, n))
            u += NEXT_CHANGE * (us[1] - us[0])
            wanted = CORRECTION
        work = new_workspace(rates, x, u)
        ended = UNBALANCED
        for _ in range(2):
            _, size = newton(body, rates, x, u, work, wanted)
            if not size < wanted:
                ended = LOST
                break
            if i == 1 or _is_balanced(body, x, u):
                ended = SOLVED
                break
            wanted *= 1e-3  # slow motors: all forces are small
        if ended != SOLVED:
            return _unsolved(ended, x, u)
        xs = (xs[0], x, x) if i == 1 else (xs[0], xs[1], x)
        us = (us[0], u, u) if i == 1 else (us[0], us[1], u)
    if not turns_forward(body, u):
        return _unsolved(BACKWARDS, x, u)
    means = np.empty((3, 5))
    for i in range(3):
        means[i] = mean_motion(body, us[i])
    limit = extrapolate(means)
    error += difference(_without_last_term(means), limit) + DOUBT * difference(means[2], limit)
    return Orbit(SOLVED, error, limit, xs, us)


@compiled_exactly
def _is_balanced(body: Body, x: Floats, u: Floats) -> bool:
    """Tell whether the unbalanced forces are small compared with the forces in the edges."""
    r, t = residual_on_orbit(body, x, u)
    return bool(max(np.max(np.abs(r)), np.max(np.abs(t))) < BALANCED * largest_force(body, x))


@compiled_exactly
def _enough_phases(
    body: Body, plain: Body, x: Floats, u: Floats, tails: int, least: int
) -> tuple[int, float, Floats, Floats]:
    """Solve on the coarsest mesh, with `least` phases or more: SOLVED or why not, error of the phases, x and u.

    The first solution, from x and u, is a rough one for the robot without its non-local effects (`plain`), on the
    fewest phases. Then phases are added, each time from the solution before, until the means stop changing.
    """
    phases = x.shape[1]
    means, change, robot, wanted = np.zeros(5), np.nan, plain, FIRST
    solved = -1  # numbers of phases that the robot itself was solved on, less one
    while True:
        x_more, u_more = with_phases(x, phases), with_phases(u.reshape(1, -1, 4), phases // tails)[0]
        rates = on_orbit(phases, FIRST_PHASE)
        work = new_workspace(rates, x_more, u_more)
        _, size = newton(robot, rates, x_more, u_more, work, wanted)
        if not size < wanted:
            return NO_START if solved < 1 else MANY_PHASES, np.nan, x, u
        solved += 1
        if solved == 0:
            x, u, robot, wanted = x_more, u_more, body, ROUGH
            phases = tails * int(np.ceil(least / tails))
            continue
        new_means = mean_motion(body, u_more)
        if solved > 1:
            last, change = change, difference(means, new_means)
            if change <= PHASE_ERROR:
                return SOLVED, change, x, u
            to_come = next_change(last, change)
            if to_come <= PHASE_ERROR:
                return SOLVED, to_come, x_more, u_more
        x, u, means = x_more, u_more, new_means
        if phases > MOST_PHASES:
            return MANY_PHASES, np.nan, x, u
        phases = more_phases(tails, phases)


@compiled_exactly
def next_change(last: float, change: float) -> float:
    """Estimate the change of the means with the next number of phases from the last two; `last` may be NaN."""
    fall = _SHRINKS if not np.isfinite(last) else min(max(change / last, 0.05), 1.0)
    return change * fall


@compiled_exactly
def more_phases(tails: int, phases: int) -> int:
    """Choose the next number of phases to try: a multiple of N, about half as many again."""
    return tails * max(phases // tails + 1, int(np.ceil(1.4 * phases / tails)))


@compiled_exactly
def with_edges(x: Floats, offset: float, wanted: int) -> Floats:
    """Move free nodes (n, M, 3) to a mesh of `wanted` edges: cubic interpolation in the arc length."""
    n, phases, _ = x.shape
    out = zeros(x, (wanted, phases, 3))
    for k in range(wanted):
        place = (k + 1) * n / wanted
        first = min(max(int(np.floor(place)) - 1, 0), n - 3)
        for i in range(first, first + 4):
            weight = 1.0
            for j in range(first, first + 4):
                if j != i:
                    weight *= (place - j) / (i - j)
            for m in range(phases):
                for c in range(3):
                    node = x[i - 1, m, c] if i > 0 else (offset if c == 0 else 0.0)
                    out[k, m, c] += weight * node
    return out


@compiled_exactly
def difference(a: Floats, b: Floats) -> Any:
    """Compute the largest relative difference of two sets of means (5,); velocities relative to the speed."""
    speed = np.sqrt(b[3] * b[3] + b[4] * b[4])
    rates = larger(abs((a[0] - b[0]) / b[0]), larger(abs((a[1] - b[1]) / b[1]), abs((a[2] - b[2]) / b[2])))
    return larger(rates, larger(abs(a[3] - b[3]), abs(a[4] - b[4])) / speed)


@compiled_exactly
def extrapolate(found: Floats) -> Floats:
    """Limit for n → ∞ of values on MESHES, (3, K), whose errors go as c₂/n² + c₄/n⁴."""
    values = np.empty(found.shape[1])
    for i in range(len(values)):
        values[i] = limit(found[0, i], found[1, i], found[2, i])
    return values


@formula
def limit(coarse: Any, middle: Any, fine: Any) -> Any:
    """Compute the limit of one value on MESHES."""
    return fma(_OF_COARSE, coarse, fma(_OF_MIDDLE, middle, _OF_FINE * fine))


@formula
def limit_of_two(middle: Any, fine: Any) -> Any:
    """Extrapolate from the two finer meshes, with c₂/n² alone."""
    return fma(_MORE, fine - middle, fine)


@compiled_exactly
def _without_last_term(found: Floats) -> Floats:
    """Extrapolate values on MESHES, (3, K), from the two finer meshes."""
    values = np.empty(found.shape[1])
    for i in range(len(values)):
        values[i] = limit_of_two(found[1, i], found[2, i])
    return values
