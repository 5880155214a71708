"""Direct route to the steady motion: phases, meshes, extrapolation and checks around `sim.orbit`.

For each robot, in compiled loops:

1. From straight tails on the coarsest mesh, with more and more phases until the means stop changing. The change
   from one number of phases to the next is the error of the smaller one.
2. On finer meshes from the solution before. Rods converge at second order (error c₂/n² + c₄/n⁴ + …), so the means
   on n = 6, 8 and 12 edges are extrapolated to n → ∞. The error is put at what the term c₄ changed plus 3 % of
   what extrapolation changed at all: over the sweep's domain that covers the true one in more than 95 % of rows.

The means are means over time, ∫ u dφ/ω_t / ∫ dφ/ω_t. Each row says how it ended: solved, or why not; then time
stepping (`sim.settling`) takes over. The extrapolated means of spins, ω_yr and the velocity of the head's centre
come with `error`, the largest estimated relative error (velocities relative to the speed).
Left out: whether the orbit is stable; see docs/branches.md for where it is not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sim.balance import assemble
from sim.compiling import compiled
from sim.contact import tail_gap
from sim.orbit import imbalance, newton, sensitivity
from sim.robot import Groups
from sim.tail import HEAD_LENGTH, TAIL_RADIUS, Body, body_of, straight, without_beyond

Array = NDArray[np.float64]

MESHES = (6, 8, 12)
SOLVED, NO_START, MANY_PHASES, LOST, BACKWARDS, UNBALANCED = range(6)
REASONS = {
    SOLVED: "",
    NO_START: "Newton's method did not converge from straight tails",
    MANY_PHASES: "the shape changes too much over a revolution",
    LOST: "Newton's method did not converge on a finer mesh",
    BACKWARDS: "the tails stop or turn backwards during a revolution",
    UNBALANCED: "forces are left unbalanced",
}
CORRECTION = 1e-6  # last Newton correction; convergence is quadratic, but stretching is stiff: see BALANCED
ROUGH = 1e-5  # the same on the coarser meshes, where only the means are wanted: it leaves 1e-9 of them
PHASE_ERROR = 1e-4  # relative, in the means
BALANCED = 1e-5  # largest unbalanced force over the largest that an edge carries
WIDTH = 1e-5  # step of the differences that are exact for linear dependence
_DOUBT = 0.03  # share of the extrapolation that counts as error
_SHRINKS = 0.2  # assumed fall of the phase error with the next number of phases, where only one is known
FEW, MANY = 3, 12  # phases to begin with; a derivative may depend on the phase where the motion hardly does
_MOST_PHASES = 48
_MOST_CORRECTIONS = 30


class Orbit(NamedTuple):
    """One robot's orbit on the three MESHES: shapes x (n, M, 3) and velocities u (P, 4)."""

    ended: int  # SOLVED or why not
    error: float  # estimated relative error of the means
    means: Array  # (5,): ω_t, ω_h, ω_yr, v_x, v_z of the head's centre; NaN where not solved
    x: tuple[Array, Array, Array]
    u: tuple[Array, Array, Array]


class Orbits(NamedTuple):
    """Steady motions of B robots; means and slopes of (ω_t, ω_h, ω_yr, v_x, v_z) of the head's centre."""

    means: Array  # (B, 5), NaN where not solved
    slopes: Array  # (B, K, 5): derivatives of the means along K tangents
    error: Array  # (B,) estimated relative error
    ended: NDArray[np.int64]  # (B,) SOLVED or why not
    gap: Array  # (B,) smallest distance between tails over 2 r0


def numbers(groups: Groups) -> Tensor:
    """What makes each robot, in the order of `sim.tail.body_of`, (41, B); differentiable."""
    swimmer = assemble(groups, edges=2)
    rows = [
        groups.omega_bar,
        swimmer.root[0, 0, 0],
        swimmer.axial_stiffness,
        swimmer.zeta_parallel,
        swimmer.zeta_perp,
        swimmer.gain,
        swimmer.head_length,
        swimmer.tail_radius,
        *swimmer.resistance.reshape(20, -1),
        *swimmer.tail_load,
        1 / groups.l_over_R,
        *swimmer.beyond,
    ]
    return torch.stack(rows)


def bodies(groups: Groups) -> Array:
    """Robots as rows of numbers for the compiled loops, (B, 41)."""
    return np.ascontiguousarray(numbers(groups).detach().cpu().numpy().T)


@compiled
def differentiation(phases: int) -> Array:
    """d/dφ of the trigonometric interpolant on M equal phases, (M, M). Source: Trefethen (2000), ch. 3."""
    matrix = np.zeros((phases, phases))
    for i in range(phases):
        for j in range(phases):
            if i != j:
                half = (i - j) * np.pi / phases
                denominator = np.tan(half) if phases % 2 == 0 else np.sin(half)
                matrix[i, j] = 0.5 * (-1.0) ** (i - j) / denominator
    return matrix


@compiled
def interpolation(phases: int, at: Array) -> Array:
    """Values of the trigonometric interpolant on M equal phases from 0 at phases `at` (F,), (F, M)."""
    matrix = np.zeros((len(at), phases))
    for i in range(len(at)):
        for j in range(phases):
            away = at[i] - 2 * np.pi * j / phases
            total = 1.0
            for k in range(1, (phases + 1) // 2):
                total += 2 * np.cos(k * away)
            if phases % 2 == 0:
                total += np.cos(phases // 2 * away)
            matrix[i, j] = total / phases
    return matrix


@compiled
def with_phases(a: Array, wanted: int) -> Array:
    """A periodic array (K, M, c) at `wanted` phases."""
    matrix = interpolation(a.shape[1], 2 * np.pi * np.arange(wanted) / wanted)
    out = np.zeros((a.shape[0], wanted, a.shape[2]))
    for k in range(a.shape[0]):
        for i in range(wanted):
            for j in range(a.shape[1]):
                for c in range(a.shape[2]):
                    out[k, i, c] += matrix[i, j] * a[k, j, c]
    return out


@compiled
def with_edges(x: Array, offset: float, wanted: int) -> Array:
    """Free nodes (n, M, 3) moved to a mesh of `wanted` edges: cubic interpolation in the arc length."""
    n, phases, _ = x.shape
    out = np.zeros((wanted, phases, 3))
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


@compiled
def means(body: Body, u: Array, head_length: float) -> Array:
    """(ω_t, ω_h, ω_yr, v_x, v_z) of the head's centre, means over time."""
    total, time = np.zeros(5), 0.0
    for p in range(u.shape[0]):
        share = 1 / (body.omega + body.gain * u[p, 3])
        time += share
        total[1] += share * u[p, 3]
        total[2] += share * u[p, 2]
        total[3] += share * (u[p, 0] + u[p, 2] * head_length / 2)
        total[4] += share * u[p, 1]
    total /= time
    total[0] = body.omega + body.gain * total[1]
    return total


@compiled
def difference(a: Array, b: Array) -> float:
    """Largest relative difference of two sets of means; velocities relative to the speed."""
    speed = np.hypot(b[3], b[4])
    change = np.abs(a - b)
    rates = max(change[0] / abs(b[0]), change[1] / abs(b[1]), change[2] / abs(b[2]))
    return max(rates, max(change[3], change[4]) / speed)


@compiled
def _turns_forward(body: Body, u: Array) -> bool:
    return bool(np.all((body.omega + body.gain * u[:, 3]) * body.omega > 0))


@compiled
def _start(body: Body, n: int, phases: int, tails: int) -> tuple[Array, Array]:
    """Straight tails on a robot that shares the motor's speed between head and tails."""
    u = np.zeros((phases // tails, 4))
    u[:, 3] = -0.3 * body.omega
    return straight(n, phases, body.offset), u


@compiled
def _more_phases(tails: int, phases: int) -> int:
    """The next number of phases to try: a multiple of N, about half as many again."""
    return tails * max(phases // tails + 1, int(np.ceil(1.4 * phases / tails)))


@compiled
def _enough_phases(body: Body, tails: int, head_length: float, least: int) -> tuple[int, float, Array, Array]:
    """How the coarsest mesh ended, the error that its phases leave, x and u; with `least` phases or more."""
    n = MESHES[0]
    phases = tails * int(np.ceil(2 / tails))
    x, u = _start(body, n, phases, tails)
    _, size = newton(without_beyond(body), x, u, differentiation(phases), 1e-2, _MOST_CORRECTIONS)
    if not size < 1e-2:
        return NO_START, np.nan, x, u
    phases = tails * int(np.ceil(least / tails))
    x, u = with_phases(x, phases), with_phases(u.reshape(1, -1, 4), phases // tails)[0]
    _, size = newton(body, x, u, differentiation(phases), ROUGH, _MOST_CORRECTIONS)
    if not size < ROUGH:
        return NO_START, np.nan, x, u
    before, change = means(body, u, head_length), np.inf
    while phases <= _MOST_PHASES:
        wanted = _more_phases(tails, phases)
        x_more, u_more = with_phases(x, wanted), with_phases(u.reshape(1, -1, 4), wanted // tails)[0]
        _, size = newton(body, x_more, u_more, differentiation(wanted), ROUGH, _MOST_CORRECTIONS)
        if not size < ROUGH:
            return MANY_PHASES, np.nan, x, u
        after = means(body, u_more, head_length)
        last, change = change, difference(before, after)
        if change <= PHASE_ERROR:
            return SOLVED, change, x, u
        fall = _SHRINKS if not np.isfinite(last) else min(max(change / last, 0.05), 1.0)
        x, u, phases, before = x_more, u_more, wanted, after
        if change * fall <= PHASE_ERROR:
            return SOLVED, change * fall, x, u
    return MANY_PHASES, np.nan, x, u


@compiled
def solve(row: Array, tails: int, least: int) -> Orbit:
    """One robot with N tails; its numbers from `bodies`; on `least` phases or more."""
    body, head_length = body_of(row), row[HEAD_LENGTH]
    ended, error, x, u = _enough_phases(body, tails, head_length, least)
    matrix = differentiation(x.shape[1])
    xs, us = (x, x, x), (u, u, u)
    for i in (1, 2):
        n, coarse = MESHES[i], MESHES[i - 1]
        x, u = with_edges(xs[1], body.offset, n), us[1].copy()
        if i == 2:  # extrapolate the change from mesh to mesh as 1/n²
            more = (1 / coarse**2 - 1 / n**2) / (1 / MESHES[0] ** 2 - 1 / coarse**2)
            x += more * (x - with_edges(xs[0], body.offset, n))
            u += more * (us[1] - us[0])
        wanted = CORRECTION if i == 2 else ROUGH
        balanced = ended != SOLVED
        for _ in range(2):
            if balanced:
                break
            _, size = newton(body, x, u, matrix, wanted, _MOST_CORRECTIONS)
            if not size < wanted:
                ended = LOST
                break
            balanced = i == 1 or imbalance(body, x, u, matrix) < BALANCED
            wanted *= 1e-3  # slow motors: all forces are small
        if ended == SOLVED and not balanced:
            ended = UNBALANCED
        xs = (xs[0], x, x) if i == 1 else (xs[0], xs[1], x)
        us = (us[0], u, u) if i == 1 else (us[0], us[1], u)
    if ended == SOLVED and not _turns_forward(body, u):
        ended = BACKWARDS
    if ended != SOLVED:
        return Orbit(ended, np.nan, np.full(5, np.nan), xs, us)
    found = np.empty((3, 5))
    for i in range(3):
        found[i] = means(body, us[i], head_length)
    limit = extrapolate(found)
    error += difference(without_last_term(found), limit) + _DOUBT * difference(found[2], limit)
    return Orbit(SOLVED, error, limit, xs, us)


@compiled
def extrapolate(found: Array) -> Array:
    """Limit for n → ∞ of values on MESHES, (3, K), whose errors go as c₂/n² + c₄/n⁴."""
    a, b, c = 1.0 / MESHES[0] ** 2, 1.0 / MESHES[1] ** 2, 1.0 / MESHES[2] ** 2
    return (
        found[0] * (b * c) / ((a - b) * (a - c))
        + found[1] * (a * c) / ((b - a) * (b - c))
        + found[2] * (a * b) / ((c - a) * (c - b))
    )


@compiled
def without_last_term(found: Array) -> Array:
    """The same from the two finer meshes, with c₂/n² alone."""
    b, c = 1.0 / MESHES[1] ** 2, 1.0 / MESHES[2] ** 2
    return (found[2] * b - found[1] * c) / (b - c)


@compiled
def _smallest_gap(x: Array, offset: float, tails: int, radius: float) -> float:
    """Smallest gap between tails over a revolution; tail j is tail 0 a j-th part of a turn later."""
    x = with_phases(x, 2 * x.shape[1])
    spacing = x.shape[1] // tails
    shape, smallest = np.empty((x.shape[0], tails, 3)), np.inf
    for m in range(spacing):
        for j in range(tails):
            shape[:, j] = x[:, m + j * spacing]
        smallest = min(smallest, tail_gap(shape, offset, radius))
    return smallest


def solve_all(rows: Array, tails: int, tangents: Array | None = None, *, phases: int = FEW) -> Orbits:
    """Steady motions of robots with N tails, and their derivatives.

    Args:
        rows: (B, 41), from `bodies`.
        tails: N.
        tangents: (B, K, 41), directions in which the means are to be differentiated (none by default); their size
            sets the step of differences that are exact for linear dependence.
        phases: to begin with.
    """
    slopes = np.full((len(rows), 0 if tangents is None else tangents.shape[1], 5), np.nan)
    means_, error, ended, gap = [], [], [], []
    for i, row in enumerate(rows):
        orbit = solve(row, tails, phases)
        solved = orbit.ended == SOLVED
        means_.append(orbit.means)
        error.append(orbit.error)
        ended.append(orbit.ended)
        gap.append(_smallest_gap(orbit.x[2], row[1], tails, row[TAIL_RADIUS]) if solved else np.nan)
        if solved and tangents is not None:
            slopes[i] = _slopes(row, tangents[i], orbit)
    return Orbits(np.array(means_), slopes, np.array(error), np.array(ended), np.array(gap))


def _slopes(row: Array, tangents: Array, orbit: Orbit) -> Array:
    """Derivatives of the extrapolated means along `tangents`, (K, 5)."""
    moved = np.stack([row - WIDTH * tangents, row + WIDTH * tangents], 1)  # (K, 2, 41)
    found = np.empty((3, len(tangents), 5))
    for i, (x, u) in enumerate(zip(orbit.x, orbit.u, strict=True)):
        changes = sensitivity(body_of(row), moved.reshape(-1, row.size), WIDTH, x, u, differentiation(x.shape[1]))
        for k, change in enumerate(changes):
            ends = [
                means(body_of(robot), u + sign * WIDTH * change, robot[HEAD_LENGTH])
                for sign, robot in zip((-1, 1), moved[k], strict=True)
            ]
            found[i, k] = (ends[1] - ends[0]) / (2 * WIDTH)
    return extrapolate(found.reshape(3, -1)).reshape(-1, 5)


@compiled
def on_mesh(row: Array, tails: int, edges: int) -> tuple[bool, Array, Array]:
    """The orbit on a mesh of one's own: whether there is one, x (n, M, 3) and u (P, 4)."""
    body = body_of(row)
    ended, _, x, u = _enough_phases(body, tails, row[HEAD_LENGTH], FEW)
    if ended != SOLVED:
        return False, x, u
    x = with_edges(x, body.offset, edges)
    _, size = newton(body, x, u, differentiation(x.shape[1]), CORRECTION, _MOST_CORRECTIONS)
    return size < CORRECTION and _turns_forward(body, u), x, u
