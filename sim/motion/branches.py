"""All steady motions of a robot that can be found along an input, which are stable, and where they meet.

1. Newton's method from straight tails finds orbits at some values of the input.
2. Time steps find the motions that a robot reaches: from rest at some values, and in slow sweeps up and down
   (`sim.motion.swept_input`).
3. Each motion found is followed along the input in both directions, around folds (`sim.motion.continuation`): as
   an orbit if the tails move alike (`sim.motion.tails_alike`), else as a fixed point of the map over a turn of the
   disc (`sim.motion.revolution`).
4. Where a motion is unstable, it is perturbed and stepped in time. What it ends in is followed as well.

A motion whose means are those of a branch, to 3 %, is on that branch, if its tails move alike as there. Folds are
located where the input turns back; Hopf points and period doublings where the growth of small perturbations
changes its sign.

Left out: motions that none of these searches meets, and motions whose shape does not repeat after a turn of the
disc. Time steps show the latter, as unsettled. All is computed on one mesh of 12 edges. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.io.errors import InputError
from sim.motion.continuation import Equations, Point, first_point, follow, locate
from sim.motion.revolution import Revolutions
from sim.motion.shapes import state_from_orbit
from sim.motion.stability import FOLD, Leading, leading_exponent
from sim.motion.swept_input import SweptInput, SweptState, from_rest, perturbed, settled_from, slow_sweep
from sim.motion.tails_alike import EDGES, TailsAlike, orbit_from_turn
from sim.solve.march import State
from sim.solve.refinement import difference

STEPS_OF_A_SWEEP = 24
_STARTS = 9  # values of the input at which Newton's method and time steps start from straight tails
_MOST_ALIKE, _MOST_OTHER = 200, 30  # points of a branch in each direction
_MOST_BRANCHES = 12
_END = 1e-6  # distance in s at which a point is the end of the range
_SAME = 0.03  # relative difference of the means up to which motions are one
_KICK = 0.03  # perturbation of an unstable motion, of the tips, in l

Progress = Callable[[str], None]


class Motion(NamedTuple):
    """One steady motion on a branch."""

    s: float  # place in the range of the input, 0 to 1
    means: Floats  # (5,): ω_t, ω_h, ω_yr, v_x, v_z of the head's centre
    leading: Leading
    kind: str = ""  # FOLD, DOUBLING or HOPF where one was located

    @property
    def stable(self) -> bool:
        """Whether small perturbations decay."""
        return self.leading.growth < 0


@dataclass(frozen=True)
class Branch:
    """A curve of steady motions, in the order along it."""

    alike: bool  # the tails move alike
    motions: list[Motion]

    @property
    def special(self) -> list[Motion]:
        """The folds, period doublings and Hopf points."""
        return [motion for motion in self.motions if motion.kind]

    def has(self, s: float, means: Floats) -> bool:
        """Tell whether a motion is on this branch."""
        for one, next_one in pairwise(self.motions):
            low, high = min(one.s, next_one.s) - _END, max(one.s, next_one.s) + _END
            if low <= s <= high:
                share = 0.5 if one.s == next_one.s else np.clip((s - one.s) / (next_one.s - one.s), 0, 1)
                if difference(one.means + share * (next_one.means - one.means), means) < _SAME:
                    return True
        return any(m.s == s and difference(m.means, means) < _SAME for m in self.motions)

    def at(self, s: float) -> list[Motion]:
        """Interpolate the motions of this branch at s."""
        found = []
        for one, next_one in pairwise(self.motions):
            if (one.s - s) * (next_one.s - s) < 0 or next_one.s == s:
                share = (s - one.s) / (next_one.s - one.s)
                means = one.means + share * (next_one.means - one.means)
                growth = one.leading.growth + share * (next_one.leading.growth - one.leading.growth)
                found.append(Motion(s, means, Leading(growth, one.leading.turns, one.leading.tails)))
        return found


@dataclass(frozen=True)
class Branches:
    """Everything that was found along an input."""

    swept: SweptInput
    branches: list[Branch]
    up: list[SweptState]
    down: list[SweptState]
    incomplete: bool = False  # more branches were begun than are followed

    def at(self, s: float) -> list[Motion]:
        """List the steady motions at a place of the range, interpolated between points of the branches."""
        return [motion for branch in self.branches for motion in branch.at(s)]


@dataclass
class _Search:
    """The branches so far."""

    swept: SweptInput
    tails: int
    alike: TailsAlike
    progress: Progress
    branches: list[Branch] = field(default_factory=list)
    starts: list[tuple[Equations, Floats]] = field(default_factory=list)  # of each branch: not yet probed points
    probed: int = 0

    def knows(self, s: float, means: Floats, alike: bool) -> bool:
        """Tell whether a motion, whose tails move alike or not, is on a branch."""
        return any(branch.has(s, means) for branch in self.branches if branch.alike == alike)

    @property
    def full(self) -> bool:
        """Whether no more branches are begun."""
        return len(self.branches) >= _MOST_BRANCHES


def find_branches(
    swept: SweptInput, *, steps: int = STEPS_OF_A_SWEEP, progress: Progress = lambda _: None
) -> Branches:
    """Find the steady motions of a robot along an input.

    Args:
        swept: the robot and the range of its input.
        steps: values of the input at which the slow sweeps stop, both ends included; at least 2.
        progress: called with a line for each thing that was found.

    Raises:
        InputError: there is no steady motion in the range.
    """
    if steps < 2:
        raise InputError(f"{steps} steps of a sweep; give at least 2")
    tails = swept.groups_at(0.0).N
    with np.errstate(all="ignore"):
        search = _Search(swept, tails, TailsAlike(swept.body_at, tails), progress)
        places = np.linspace(0.0, 1.0, steps)
        for s in np.linspace(0.0, 1.0, _STARTS):
            _from_straight_tails(search, float(s))
        up = _stepped(search, "up", places)
        down = _stepped(search, "down", places[::-1], up[-1] if up and up[-1].s == 1 else None)
        resting = (from_rest(swept.body_at, tails, float(s), EDGES) for s in np.linspace(0.0, 1.0, _STARTS)[1:])
        for motion in (*up, *down, *resting):
            if motion is not None:
                _from_time_steps(search, motion)
        _from_unstable_motions(search)
    if not search.branches and not up and not down:
        raise InputError(
            f"no steady motion was found from {swept.low:g} to {swept.high:g}; the tails may not complete a turn"
        )
    return Branches(swept, search.branches, up, down, search.full)


def _stepped(search: _Search, way: str, places: Floats, start: SweptState | None = None) -> list[SweptState]:
    """Sweep slowly through `places`."""
    found = list(slow_sweep(search.swept.body_at, search.tails, map(float, places), EDGES, start))
    settled = sum(motion.settled for motion in found)
    search.progress(f"slow sweep {way}: settled at {settled} of {len(places)} values")
    return found


def _from_straight_tails(search: _Search, s: float) -> None:
    """Follow the orbit that Newton's method finds from straight tails, unless it is known."""
    y = search.alike.start(s)
    if y is not None and not search.full and not search.knows(s, search.alike.means(y), True):
        _follow_both_ways(search, search.alike, y, alike=True)


def _from_time_steps(search: _Search, motion: SweptState) -> None:
    """Follow the motion in which time steps ended, unless it is known."""
    if not motion.settled or search.full:
        return
    family = Revolutions(search.swept.body_at, search.tails, EDGES, motion.steps)
    turn = family.timed(motion.state, motion.s, motion.time, shapes=True)
    orbit = None if turn is None else orbit_from_turn(turn, search.alike.instants)
    if search.knows(motion.s, motion.means, orbit is not None):
        return
    if orbit is not None:
        y = search.alike.pack(*orbit, motion.s)
        if _follow_both_ways(search, search.alike, y, alike=True):
            return
    _follow_both_ways(search, family, family.start(motion.state, motion.s, motion.time), alike=False)


def _from_unstable_motions(search: _Search) -> None:
    """Perturb an unstable motion of each stretch, and follow what time steps end in."""
    while search.probed < len(search.starts):
        equations, y = search.starts[search.probed]
        search.probed += 1
        start = _state(search, equations, y)
        if start is not None:
            state, time = start
            kicked = perturbed(state, _KICK, search.probed)
            _from_time_steps(search, settled_from(search.swept.body_at, search.tails, float(y[-1]), kicked, time))


def _state(search: _Search, equations: Equations, y: Floats) -> tuple[State, float] | None:
    """Return the state at disc phase 0 of a motion, and the time of a turn."""
    if isinstance(equations, Revolutions):
        turn = equations.at(y)
        return None if turn is None else (equations.state(y), turn.time)
    x, u = search.alike.unpack(y)
    state = state_from_orbit(search.swept.body_at(float(y[-1])), x, u)
    return state, 2 * np.pi / abs(float(search.alike.means(y)[0]))


def _follow_both_ways(search: _Search, equations: Equations, y: Floats, *, alike: bool) -> bool:
    """Add the branch through y, and remember a point of each unstable stretch; false if it is lost."""
    first = first_point(equations, y, 1.0)
    if first is None or not equations.is_valid(first.y):
        return False
    start = _motion(search, equations, first)
    if search.knows(start.s, start.means, alike):
        return True
    most = _MOST_ALIKE if alike else _MOST_OTHER
    parts = []
    for direction in (-1.0, 1.0):
        begin = Point(first.y, direction * first.tangent)
        parts.append(list(_followed(search, equations, begin, start, most)))
    backward, forward = parts
    whole = [*reversed(backward), (first, start), *forward]
    search.branches.append(Branch(alike, [motion for _, motion in whole]))
    stretch: list[Point] = []
    for point, motion in [*whole, (first, start._replace(leading=Leading(-1.0, 0.0, 1)))]:
        if motion.leading.growth > 0:
            stretch.append(point)
        elif stretch:
            search.starts.append((equations, stretch[len(stretch) // 2].y))
            stretch = []
    search.progress(
        f"branch {len(search.branches)}: tails {'alike' if alike else 'not alike'}, {len(whole)} points, "
        f"{sum(bool(motion.kind) for _, motion in whole)} of them special"
    )
    return True


def _followed(
    search: _Search, equations: Equations, first: Point, start: Motion, most: int
) -> Iterator[tuple[Point, Motion]]:
    """Follow a branch in one direction, with the special points between its points."""
    here, motion = first, start
    for point in follow(equations, first, most):
        next_motion = _motion(search, equations, point)
        folded = False
        if here.turns * point.turns < 0:
            fold = locate(equations, here, point, lambda p: p.turns)
            if fold is not None:
                folded = True
                yield fold, _motion(search, equations, fold)._replace(kind=FOLD)
        if motion.leading.growth * next_motion.leading.growth < 0:
            crossing = locate(equations, here, point, lambda p: _motion(search, equations, p).leading.growth)
            if crossing is not None:
                located = _motion(search, equations, crossing)
                if not (folded and located.leading.kind == FOLD):
                    yield crossing, located._replace(kind=located.leading.kind)
        yield point, next_motion
        here, motion = point, next_motion


def _motion(search: _Search, equations: Equations, point: Point) -> Motion:
    """Compute the means and the stability of a point."""
    if isinstance(equations, Revolutions):
        turn = equations.at(point.y)
        means = np.full(5, np.nan) if turn is None else turn.means
        return Motion(point.s, means, equations.leading(point.y))
    x, u = search.alike.unpack(point.y)
    body = search.swept.body_at(point.s)
    return Motion(point.s, search.alike.means(point.y), leading_exponent(body, search.tails, x, u))
