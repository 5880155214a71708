"""Balance, matrix and corrections of one robot, in the first of the lanes that the simulator has for a group."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from common.arrays import Floats
from sim.jit import compiled
from sim.lanes import lanes, width
from sim.linear.chains import Chains
from sim.model.body import Body
from sim.solve.assembly import row
from sim.solve.grouping import InLanes, group_of, in_groups, robots_in_lanes
from sim.solve.linearise import linearise
from sim.solve.newton import factor_and_solve, new_workspace, newton
from sim.solve.rates import Rates
from sim.solve.residual import fill_residual, new_scratch


class Plain(NamedTuple):
    """What `sim.solve.rates.Rates` says, in plain numbers; `start` is empty on an orbit."""

    rate: float
    phase: float
    differentiation: Floats
    start: Floats


def _stacked(*arrays: Floats) -> list[Floats]:
    """Fill all lanes with the same arrays."""
    return [in_groups(np.asarray(array, float)[None])[0] for array in arrays]


def residual(body: Body, rates: Plain, x: Floats, u: Floats, noise: float = 0.0) -> tuple[Floats, Floats]:
    """Compute r (n, M, 3) and t (P, 4); `noise` fills the scratch arrays before."""
    r, t = _stacked(x, u)
    parts = _stacked([rates.rate, rates.phase], rates.start, x, u)
    _fill(robots_in_lanes(row(body)), rates.differentiation, *parts, noise, r, t)
    return r[..., 0], t[..., 0]


@compiled
def _fill(
    robots: InLanes, by_phase: Floats, pair: Floats, start: Floats, x: Floats, u: Floats, noise: float, r: Floats,
    t: Floats,
) -> None:  # fmt: skip
    v, at_x, at_u = lanes(pair), lanes(x), lanes(u)
    rates = Rates(v[0], v[1], by_phase, lanes(start))
    scratch = new_scratch(at_x, at_u)
    for values in (scratch.around.flow, scratch.around.drag, scratch.x_dot, scratch.by_spin):
        values[:] = noise
    scratch.around.moment[:], scratch.around.wrench[:] = noise, noise
    body, wanted = group_of(robots, 0)
    fill_residual(body, rates, at_x, at_u, wanted, scratch, lanes(r), lanes(t))


class NewtonEquations(NamedTuple):
    """Newton's equations of one robot."""

    chains: Chains
    resistance: Floats
    r: Floats
    t: Floats
    dx: Floats  # solution for the given right-hand side
    du: Floats


def linear(body: Body, rates: Plain, x: Floats, u: Floats, dx: Floats, du: Floats) -> NewtonEquations:
    """Linearise at x and u, and solve for the right-hand side dx, du."""
    n, columns, instants = x.shape[0], x.shape[1], len(u)
    blocks = [np.zeros((n, columns, 3, 3))] * 5
    shapes = [*blocks, np.zeros((n, columns, 4, 3)), np.zeros((2, columns, 4, 3)), np.zeros((instants, 4, 4))]
    chains, equations = Chains(*_stacked(*shapes, np.zeros((4, 4)))), _stacked(blocks[0], x, u)
    parts = _stacked([rates.rate, rates.phase], rates.start, x, u, dx, du)
    _linear(robots_in_lanes(row(body)), rates.differentiation, *parts, chains, *equations)
    first = [np.ascontiguousarray(part[..., 0]) for part in (*chains, *equations, *parts[-2:])]
    return NewtonEquations(Chains(*first[:9]), *first[9:])


@compiled
def _linear(
    robots: InLanes, by_phase: Floats, pair: Floats, start: Floats, x: Floats, u: Floats, dx: Floats, du: Floats,
    chains: Chains, resistance: Floats, r: Floats, t: Floats,
) -> None:  # fmt: skip
    v, at_x, at_u = lanes(pair), lanes(x), lanes(u)
    rates = Rates(v[0], v[1], by_phase, lanes(start))
    body, work = group_of(robots, 0)[0], new_workspace(rates, at_x, at_u)
    linearise(body, rates, at_x, at_u, work.scratch, work.equations)
    found = work.equations.chains
    for out, block in (
        (chains.diagonal, found.diagonal), (chains.lower, found.lower), (chains.upper, found.upper),
        (chains.lower2, found.lower2), (chains.upper2, found.upper2), (chains.border, found.border),
        (chains.foot, found.foot), (resistance, work.equations.resistance),
    ):  # fmt: skip
        lanes(out)[:] = block
    lanes(chains.corner)[:] = found.corner
    lanes(r)[:], lanes(t)[:] = work.equations.r, work.equations.t
    factor_and_solve(body, rates, at_u, work, lanes(dx), lanes(du))


def corrections(body: Body, rates: Plain, x: Floats, u: Floats, tolerance: float) -> tuple[int, float]:
    """Improve x (n, M, 3) and u (P, 4) in place; return the number of corrections and the size of the last one."""
    pair, start, at_x, at_u = _stacked([rates.rate, rates.phase], rates.start, x, u)
    robots, sizes = robots_in_lanes(row(body)), np.empty((1, width()))
    count = _newton(robots, rates.differentiation, pair, start, at_x, at_u, tolerance, sizes)
    x[:], u[:] = at_x[..., 0], at_u[..., 0]
    return int(count), float(sizes[0, 0])


@compiled
def _newton(
    robots: InLanes, by_phase: Floats, pair: Floats, start: Floats, x: Floats, u: Floats, tolerance: float,
    sizes: Floats,
) -> int:  # fmt: skip
    v, at_x, at_u = lanes(pair), lanes(x), lanes(u)
    rates = Rates(v[0], v[1], by_phase, lanes(start))
    body, going = group_of(robots, 0)
    count, size = newton(body, rates, at_x, at_u, new_workspace(rates, at_x, at_u), tolerance, going)
    lanes(sizes)[0] = size
    return count
