"""Simulate the response of robots to a flip of the motor (`sim.model.response` says what the curves are).

One flip from the steady motion in the other direction gives the response to every dwell. Flips from the shapes
that it passes through give the response after short dwells. Solved for directly (`sim.solve.transient`) where the
steady motion is, on two meshes, extrapolated; by time steps where it is not. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.effects import catalogue
from sim.linear.spectral import with_phases
from sim.mechanics import planar
from sim.mechanics.geometry import straight
from sim.model.body import Body
from sim.model.groups import Groups
from sim.model.response import BEFORE, DWELLS, SETTLED, Responses
from sim.motion.net_speed import net_speeds, twists
from sim.motion.run import REVERSED
from sim.motion.steady import check_groups, steady
from sim.motion.steady_motion import Steady
from sim.motion.stepped_response import stepped_response
from sim.solve.assembly import bodies, reversed_bodies
from sim.solve.orbit import mean_motion, solve_orbit
from sim.solve.refinement import CORRECTION, orbit_on_mesh
from sim.solve.transient import lag_at, transient

_SAME = 1.2  # time units from which the memory is constant
MESHES = (6, 9)  # edges
TOLERANCE = 1e-3  # of a time step, in l: see `sim.solve.transient`
_LEAST_INSTANTS = {1: 3, 2: 3}  # by N; with more tails the phase at the flip hardly matters


class Curves(NamedTuple):
    """Response of one robot, as in `Responses`."""

    lag: Floats
    memory: Floats
    rest: Floats
    spread: Floats


@np.errstate(all="ignore")  # robots that overflow are flagged
def responses(
    groups: Groups,
    motion: Steady | None = None,
    *,
    history: bool = True,
    before: Floats = BEFORE,
    tolerance: float = TOLERANCE,
    meshes: tuple[int, int] = MESHES,
    extrapolated_memory: bool = False,
) -> Responses:
    """Simulate the response of B robots of one N to a flip of the motor.

    Args:
        groups: robots; the sign of ω̄ is the direction of the motor after the flip.
        motion: the robots' steady motion, if it is at hand.
        history: simulate memory and rest, too; it takes four times as long. Without, both are NaN, and so is the
            net speed of dwells shorter than FORGOTTEN.
        before: T̄ of the dwell before, (K,), increasing, below FORGOTTEN.
        tolerance: on the shape of the tails in one time step, in l; the default leaves 1e-4 to 1e-3 of a turn per
            time unit in the curves.
        meshes: edges of a tail on the two meshes; errors go as 1/n², extrapolated.
        extrapolated_memory: extrapolate the memory, too; it takes half as long again.
    """
    check_groups(groups)
    motion = steady(groups, stability=False) if motion is None else motion
    even = all(catalogue()[name].symmetry == "even" for name in groups.effects)
    robots = bodies(groups)
    by_robot, stepped = [], np.zeros(len(robots), dtype=bool)
    for i, (body, reverse) in enumerate(zip(robots, reversed_bodies(groups), strict=True)):
        curves = _solved(body, reverse, groups.N, even, history, before, tolerance, meshes, extrapolated_memory)
        if curves is None:
            stepped[i] = True
            values = stepped_response(
                body, groups.N, DWELLS, before, reverse=reverse, history=history, settled=SETTLED
            )
            curves = Curves(*values)
        by_robot.append(curves)
    lag, memory, rest, spread = (np.array(column) for column in zip(*by_robot, strict=True))
    sense = np.sign([body.omega for body in robots])
    twist = twists(motion.v_z, motion.v_x, motion.omega_yr, sense)
    if not history:
        memory[:], rest[:] = np.nan, np.nan
    speed = net_speeds(twist, lag, memory, before)
    failed = ~np.isfinite(speed[:, -1])
    for array in (lag, memory, rest, spread, speed):
        array[failed] = np.nan
    return Responses(lag, memory, rest, spread, speed, failed, stepped, before)


def _solved(
    body: Body,
    reverse: Body,
    tails: int,
    even: bool,
    history: bool,
    before: Floats,
    tolerance: float,
    meshes: tuple[int, int],
    extrapolated_memory: bool,
) -> Curves | None:
    """Solve for the curves of one robot by transients; None where its motion or a transient has no solution."""
    a, b = meshes
    both = history and extrapolated_memory
    coarse = _on_mesh(body, reverse, tails, even, a, before, tolerance, history=both)
    if coarse is None:
        return None
    fine = _on_mesh(body, reverse, tails, even, b, before, tolerance, history=history)
    if fine is None:
        return None
    share = a**2 / (b**2 - a**2)
    change = (fine.lag - coarse.lag) * share
    memory = fine.memory + (fine.memory - coarse.memory) * share if both else fine.memory
    mirror = planar.MIRROR if body.omega < 0 else np.ones(3)
    return Curves((fine.lag + change) * mirror, memory * mirror, (fine.rest + change) * mirror, fine.spread)


def _on_mesh(
    body: Body,
    reverse: Body,
    tails: int,
    even: bool,
    edges: int,
    before: Floats,
    tolerance: float,
    *,
    history: bool,
) -> Curves | None:
    """Solve for the curves on one mesh; memory and rest only with `history`."""
    after = orbit_with_phases(body, tails, edges)
    if after is None:
        return None
    x, u, twist = after
    if even:
        start, first = _mirrored(x), u
    else:
        before_flip = orbit_with_phases(reverse, tails, edges, instants=u.shape[0])
        if before_flip is None:
            return None
        reverse_twist = before_flip[2]
        start, first = before_flip[0], before_flip[1] * REVERSED
    none = np.empty(0)
    main = transient(body, start.copy(), first.copy(), twist, SETTLED, none, tolerance)
    if not main.solved:
        return None
    dwells = np.minimum(DWELLS, SETTLED)
    fields = lag_at(main, dwells)
    lag, spread = fields.mean(1), fields.std(1)
    memory, rest = np.zeros((len(before), *lag.shape)), np.zeros_like(lag)
    if not history:
        return Curves(lag, memory, rest, spread)
    if even:
        back = transient(body, start, first.copy(), twist, float(before[-1]), before, tolerance)
    else:
        back = transient(reverse, x.copy(), u * REVERSED, reverse_twist, float(before[-1]), before, tolerance)
    if not back.solved:
        return None
    shapes = np.array([_mirrored(shape) for shape in back.shapes]) if even else back.shapes
    starts = [*shapes, straight(edges, x.shape[1], body.offset)]
    curves = np.empty((len(starts), *lag.shape))
    for i, shape in enumerate(starts):
        until = _SAME if i < len(shapes) else SETTLED
        flip = transient(body, shape, first.copy(), twist, until, none, tolerance)
        if not flip.solved:
            return None
        curves[i] = lag_at(flip, np.minimum(DWELLS, until)).mean(1)
    same = lag_at(main, np.minimum(DWELLS, _SAME)).mean(1)
    return Curves(lag, curves[:-1] - same, curves[-1], spread)


def orbit_with_phases(
    body: Body, tails: int, edges: int, instants: int = 0
) -> tuple[Floats, Floats, Floats] | None:
    """Solve for x (n, M, 3), u (P, 4) and (v_z, h_x, ω_yr) on as many instants a turn as the response needs."""
    solved, x, u = orbit_on_mesh(body, tails, edges)
    if not solved:
        return None
    wanted = instants or max(u.shape[0], _LEAST_INSTANTS.get(tails, 1))
    if tails in _LEAST_INSTANTS and wanted % 2 == 0:
        wanted += 1
    if wanted != u.shape[0]:
        x, u = with_phases(x, tails * wanted), with_phases(u[None], wanted)[0]
        _, size = solve_orbit(body, x, u, CORRECTION)
        if not size < CORRECTION:
            return None
    mean = mean_motion(body, u)
    return x, u, mean[[4, 3, 2]]


def _mirrored(x: Floats) -> Floats:
    """Mirror a robot's shape (n, M, 3), as a reversed motor does."""
    return np.ascontiguousarray(x[:, -np.arange(x.shape[1])] * np.array([1.0, -1.0, 1.0]))
