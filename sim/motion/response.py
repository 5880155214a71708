"""Simulate the response of robots to a flip of the motor (`sim.model.response` says what the curves are).

One flip from the steady motion in the other direction gives the response to every dwell. Flips from the shapes
that it passes through give the response after short dwells. Solved for directly (`sim.solve.transient`) where the
steady motion is, on two meshes, extrapolated; by time steps where it is not. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from common.arrays import Floats, Integers
from sim.effects import check_effects, effect_named
from sim.mechanics import planar
from sim.mechanics.geometry import straight
from sim.model.body import PLACES
from sim.model.groups import Groups
from sim.model.response import BEFORE, DWELLS, SETTLED, Responses
from sim.motion.steady import steady
from sim.motion.steady_motion import Steady, net_speeds, twists
from sim.motion.stepped_response import Curves, stepped_response
from sim.solve.assembly import batch, bodies, numbers
from sim.solve.grouping import slices
from sim.solve.march import REVERSED
from sim.solve.phase import at_instants, lags_by_phase
from sim.solve.refinement import OnMesh, coarse_orbits, orbits_on_mesh
from sim.solve.transient import Flip, follow_flips

_SAME = 1.2  # time units from which the memory is constant
MESHES = (6, 9)  # edges
TOLERANCE = 1e-3  # of a time step, in l: see `sim.solve.transient`
_LEAST_INSTANTS = {1: 3, 2: 5}  # by N; with more tails the phase at the flip hardly matters
_KICK = 0.6  # time units after a flip in which its phase acts on the robot's way
_KICK_TIMES = np.geomspace(4e-3, _KICK, 60)
_KICK_TOLERANCE = 1e-4  # of a time step, in l
_OFFSET = 1  # of a robot's numbers


class _Wanted(NamedTuple):
    """What is simulated of every robot."""

    tails: int
    even: bool  # a reversed motor gives the mirror image
    tolerance: float
    before: Floats  # (K,)
    dwells: Floats  # (D,)

    @property
    def times(self) -> Floats:
        """Times at which the lag is simulated, (T,)."""
        return np.unique([np.minimum(self.dwells, end) for end in (SETTLED, _SAME)])

    def until(self, end: float) -> Integers:
        """Return the places of the dwells in `times`, those after `end` at that one, (D,)."""
        return np.searchsorted(self.times, np.minimum(self.dwells, end))


@np.errstate(all="ignore")  # robots that overflow are flagged
def responses(
    groups: Groups,
    motion: Steady | None = None,
    *,
    history: bool = True,
    tolerance: float = TOLERANCE,
    meshes: tuple[int, int] = MESHES,
    extrapolated_memory: bool = False,
    before: Floats = BEFORE,
    dwells: Floats = DWELLS,
) -> Responses:
    """Simulate the response of B robots of one N to a flip of the motor.

    Args:
        groups: robots; the sign of ω̄ is the direction of the motor after the flip.
        motion: the robots' steady motion, if it is at hand.
        history: simulate memory and rest, too; it takes four times as long. Without, both are NaN, and so is the
            net speed of dwells shorter than FORGOTTEN.
        tolerance: on the shape of the tails in one time step, in l; the default leaves 1e-4 to 1e-3 of a turn per
            time unit in the curves.
        meshes: edges of a tail on the two meshes; errors go as 1/n², extrapolated.
        extrapolated_memory: extrapolate the memory, too; it takes half as long again.
        before: dwells before at which the memory is simulated, (K,), increasing.
        dwells: of the curves, (D,), increasing.
    """
    check_effects(groups.effects)
    motion = steady(groups, stability=False) if motion is None else motion
    even = all(effect_named(name).symmetry == "even" for name in groups.effects)
    wanted = _Wanted(groups.N, even, tolerance, before, dwells)
    rows, reverse_rows = numbers(groups), numbers(groups.reversed())
    both = history and extrapolated_memory
    solved = [
        _extrapolated(coarse, fine, meshes, both, row[0] < 0)
        for part in slices(len(rows))
        for row, coarse, fine in zip(
            rows[part], *_on_meshes(rows[part], reverse_rows[part], wanted, meshes, (both, history)), strict=True
        )
    ]
    stepped = np.array([curves is None for curves in solved])
    by_robot = []
    for i, curves in enumerate(solved):
        if curves is None:
            robot = groups.select(np.array([i]))
            body, reverse = bodies(robot)[0], bodies(robot.reversed())[0]
            curves = stepped_response(
                body, groups.N, dwells, before, reverse=reverse, history=history, settled=SETTLED
            )
        by_robot.append(curves)
    lag, memory, rest, spread = (np.array(column) for column in zip(*by_robot, strict=True))
    sense = np.sign(rows[:, PLACES.omega])
    twist = twists(motion.v_z, motion.v_x, motion.omega_yr, sense)
    if not history:
        memory[:], rest[:] = np.nan, np.nan
    speed = net_speeds(twist, lag, memory, before, dwells)
    simulated = (lag, memory, rest) if history else (lag,)
    finite = [np.isfinite(part).reshape(len(part), -1).all(1) for part in simulated]
    failed = ~(np.all(finite, axis=0) & np.isfinite(speed[:, -1]))
    for array in (lag, memory, rest, spread, speed):
        array[failed] = np.nan
    return Responses(lag, memory, rest, spread, speed, failed, stepped, before)


def _on_meshes(
    rows: Floats, reverse_rows: Floats, wanted: _Wanted, meshes: tuple[int, int], history: tuple[bool, bool]
) -> list[list[Curves | None]]:
    """Simulate the curves of B robots on each mesh, with memory and rest where `history` says so."""
    after = orbits_with_phases(rows, wanted.tails, meshes)
    if wanted.even:
        starts = [
            [orbit and orbit._replace(x=mirrored(orbit.x), u=orbit.u[-np.arange(len(orbit.u))]) for orbit in mesh]
            for mesh in after
        ]
    else:
        instants = [[len(orbit.u) if orbit else 1 for orbit in mesh] for mesh in after]
        turned = orbits_with_phases(reverse_rows, wanted.tails, meshes, instants)
        starts = [[orbit and orbit._replace(u=orbit.u * REVERSED) for orbit in mesh] for mesh in turned]
    curves = [
        _on_mesh(rows, reverse_rows, after[mesh], starts[mesh], wanted, history[mesh])
        for mesh in range(len(meshes))
    ]
    if wanted.tails == 2:
        spreads = _spreads(rows, reverse_rows, after[0], starts[0], wanted)
        curves[-1] = [
            one and (None if spread is None else one._replace(spread=spread))
            for one, spread in zip(curves[-1], spreads, strict=True)
        ]
    return curves


def orbits_with_phases(
    rows: Floats, tails: int, meshes: Sequence[int], instants: Sequence[Sequence[int]] | None = None
) -> list[list[OnMesh | None]]:
    """Solve for the orbits of B robots on some meshes; None where there is no solution.

    Args:
        rows: the robots' numbers (`sim.solve.assembly.numbers`), (B, K).
        tails: N.
        meshes: edges of a tail.
        instants: of a turn, for every robot on every mesh; by default as many as the orbit and the response need.

    Returns:
        A list of B orbits for every mesh.
    """
    coarse = coarse_orbits(rows, tails)
    enough = [_enough(len(orbit.u), tails) for orbit in coarse]
    counts = [enough] * len(meshes) if instants is None else instants
    return [orbits_on_mesh(rows, tails, *one) for one in zip(meshes, [coarse] * len(meshes), counts, strict=True)]


def _enough(instants: int, tails: int) -> int:
    """Choose a number of instants, at least as many as an orbit has; odd where the phase at the flip matters."""
    return max(instants, _LEAST_INSTANTS[tails]) | 1 if tails in _LEAST_INSTANTS else instants


def _on_mesh(
    rows: Floats,
    reverse_rows: Floats,
    after: Sequence[OnMesh | None],
    starts: Sequence[OnMesh | None],
    wanted: _Wanted,
    history: bool,
) -> list[Curves | None]:
    """Simulate the curves of B robots on one mesh; memory and rest are zero without `history`.

    Args:
        after: steady motions after the flip.
        starts: steady shapes before the flip, with the velocities right after it.
    """
    flips = _flips(rows, after, starts, SETTLED)
    courses = follow_flips(flips, wanted.times, wanted.tolerance)
    rest = np.zeros((len(wanted.dwells), 3))
    pasts: list[tuple[Floats, Floats] | None]
    pasts = [(np.zeros((len(wanted.before), *rest.shape)), rest)] * len(rows)
    if history:
        solved = [flip if course else None for flip, course in zip(flips, courses, strict=True)]
        same = [course.lag[wanted.until(_SAME)].mean(1) if course else None for course in courses]
        pasts = _histories(solved, _flips_back(solved, reverse_rows, after, starts, wanted), same, wanted)
    curves: list[Curves | None] = []
    for course, past in zip(courses, pasts, strict=True):
        if course is None or past is None:
            curves.append(None)
        else:
            lag = course.lag[wanted.until(SETTLED)]
            # One tail's spread rises and falls with the dwell, faster than the curve can follow.
            spread = np.broadcast_to(np.sqrt(lag.var(1).mean(0)), rest.shape)
            curves.append(Curves(lag.mean(1), *past, spread))
    return curves


def _flips(
    rows: Floats, after: Sequence[OnMesh | None], starts: Sequence[OnMesh | None], until: float
) -> list[Flip | None]:
    """Flip from the steady motions before; arguments as in `_on_mesh`, and the time to follow."""
    return [
        Flip(row, start.x, start.u, orbit.twist, until) if orbit and start else None
        for row, orbit, start in zip(rows, after, starts, strict=True)
    ]


def _spreads(
    rows: Floats,
    reverse_rows: Floats,
    after: Sequence[OnMesh | None],
    starts: Sequence[OnMesh | None],
    wanted: _Wanted,
) -> list[Floats | None]:
    """Compute standard deviations (D, 3) of the lags of B robots over the phase of the disc at the flip.

    Args:
        after, starts: see `_on_mesh`; their instants are all phases of a flip.
    """
    flips = _flips(rows, after, starts, _KICK)
    times, place = np.unique(np.minimum(wanted.dwells, _KICK), return_inverse=True)
    spreads: list[Floats | None] = []
    for i, course in enumerate(follow_flips(flips, _KICK_TIMES, _KICK_TOLERANCE)):
        start, orbit = starts[i], after[i]
        if course is None or start is None or orbit is None:
            spreads.append(None)
            continue
        before = at_instants(batch(reverse_rows[i : i + 1]), start.u * REVERSED)
        swum = at_instants(batch(rows[i : i + 1]), course.velocities)
        lags = lags_by_phase(before, _KICK_TIMES, course.lag[0], swum, wanted.tails, orbit.twist, times)
        spreads.append(lags.std(0)[place])
    return spreads


def _flips_back(
    flips: Sequence[Flip | None],
    reverse_rows: Floats,
    after: Sequence[OnMesh | None],
    starts: Sequence[OnMesh | None],
    wanted: _Wanted,
) -> list[Flip | None]:
    """Flip from the steady motion after the flip; an even robot's flip back is the mirror image of its flip."""
    last = float(wanted.before[-1])
    if wanted.even:
        return [flip and flip._replace(until=last) for flip in flips]
    return [
        Flip(row, orbit.x, orbit.u * REVERSED, start.twist, last) if flip and orbit and start else None
        for flip, row, orbit, start in zip(flips, reverse_rows, after, starts, strict=True)
    ]


def _histories(
    flips: Sequence[Flip | None], back: Sequence[Flip | None], same: Sequence[Floats | None], wanted: _Wanted
) -> list[tuple[Floats, Floats] | None]:
    """Simulate memory (K, D, 3) and rest (D, 3) of B robots; None where a transient has no solution.

    Args:
        flips: from the steady motion.
        back: flips in the other direction.
        same: lag after a long dwell, at DWELLS up to the time from which the memory is constant, (D, 3).
    """
    count = len(wanted.before)
    later: list[Flip | None] = []
    for flip, course in zip(flips, follow_flips(back, wanted.times, wanted.tolerance, wanted.before), strict=True):
        if flip is None or course is None:
            later += [None] * (count + 1)
            continue
        shapes = map(mirrored, course.shapes) if wanted.even else course.shapes
        later += [flip._replace(x=shape, until=_SAME) for shape in shapes]
        later.append(flip._replace(x=straight(flip.x.shape[0], flip.x.shape[1], float(flip.numbers[_OFFSET]))))
    courses = follow_flips(later, wanted.times, wanted.tolerance)
    pasts: list[tuple[Floats, Floats] | None] = []
    for i, lag in enumerate(same):
        *after_short, from_rest = courses[i * (count + 1) : (i + 1) * (count + 1)]
        lags = [course.lag[wanted.until(_SAME)].mean(1) for course in after_short if course]
        if from_rest is None or len(lags) < count:
            pasts.append(None)
        else:
            pasts.append((np.array(lags) - lag, from_rest.lag[wanted.until(SETTLED)].mean(1)))
    return pasts


def _extrapolated(
    coarse: Curves | None, fine: Curves | None, meshes: tuple[int, int], memory_too: bool, mirrored: bool
) -> Curves | None:
    """Extrapolate from two meshes; `mirrored` for a negative motor."""
    if coarse is None or fine is None:
        return None
    a, b = meshes
    share = a**2 / (b**2 - a**2)
    change = (fine.lag - coarse.lag) * share
    memory = fine.memory + (fine.memory - coarse.memory) * share if memory_too else fine.memory
    mirror = planar.MIRROR if mirrored else np.ones(3)
    return Curves((fine.lag + change) * mirror, memory * mirror, (fine.rest + change) * mirror, fine.spread)


def mirrored(x: Floats) -> Floats:
    """Mirror a robot's shape (n, M, 3), as a reversed motor does."""
    return np.ascontiguousarray(x[:, -np.arange(x.shape[1])] * np.array([1.0, -1.0, 1.0]))
