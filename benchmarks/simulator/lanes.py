"""Robots in groups, one in each lane, beside one robot at a time: speed, bits, vector instructions.

1. Steady motions of robots of the sweep: loops for plain numbers, one lane, and groups, processor time in one run.
2. The same for the two transients of a response to a flip, on both meshes.
3. Share of vector instructions among the arithmetic of one Newton correction, from the assembly.

Usage: python -m benchmarks lanes [ROBOTS]

Takes a minute.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.timing import processor_time
from dataset.rows.design import load_design
from sim.lanes import ALONE, GROUP, lanes, zeros
from sim.model.groups import Groups
from sim.motion.flips import Flip, follow_alone, follow_flips
from sim.motion.grouping import group_width
from sim.motion.orbit_groups import orbits_in_groups
from sim.motion.phased_orbits import orbits_with_phases
from sim.motion.response import MESHES, TOLERANCE, mirrored
from sim.solve.assembly import Nonlocal, bodies, numbers
from sim.solve.groups import body_in_lanes
from sim.solve.linearise import linearise
from sim.solve.newton import factor_and_solve, negate, new_workspace
from sim.solve.orbit import FIRST_PHASE
from sim.solve.rates import on_orbit
from sim.solve.refinement import FEW, SOLVED, Orbit, refined_orbit

ROBOTS = 48
REPEATS = 5
TAILS = (2, 3, 4, 5)
_UNTIL = 2.0  # time units that a flip is followed
_COLUMNS = "  N   plain numbers   one lane   groups   plain/groups   one lane/plain   largest difference   same"
_PACKED = re.compile(r"^\s*v?(?:add|sub|mul|div|sqrt|fn?m(?:add|sub)\d*|max|min)pd\b.*([xyz])mm", re.MULTILINE)
_SCALAR = re.compile(r"^\s*v?(?:add|sub|mul|div|sqrt|fn?m(?:add|sub)\d*|max|min)sd\b", re.MULTILINE)


def shortest(work: Callable[[], object]) -> float:
    """Return the shortest processor time of some runs [s]."""
    return min(processor_time(work) for _ in range(REPEATS))


def same(a: Orbit, b: Orbit) -> bool:
    """Compare two orbits bit by bit."""
    pairs = zip([a.means, *a.x, *a.u], [b.means, *b.x, *b.u], strict=True)
    return a.ended == b.ended and all(np.array_equal(p, q, equal_nan=True) for p, q in pairs)


def speeds(count: int) -> None:
    """Print the time of a steady motion by N."""
    print(f"A steady motion, {count} robots of the sweep for each N, groups of {len(group_width())}, microseconds")
    print(_COLUMNS)
    for tails in TAILS:
        groups = robots_of(tails, count)
        robots, packed = bodies(groups), numbers(groups)

        def plainly(robots: Any = robots, tails: int = tails) -> list[Orbit]:
            return [refined_orbit(body, tails, FEW) for body in robots]

        def singly(packed: Any = packed, tails: int = tails) -> list[Orbit]:
            return [orbits_in_groups(packed[i : i + 1], tails, FEW)[0] for i in range(len(packed))]

        def together(packed: Any = packed, tails: int = tails) -> list[Orbit]:
            return orbits_in_groups(packed, tails, FEW)

        wanted, alone, found = plainly(), singly(), together()
        apart = max(
            (float(np.max(np.abs(a.means / b.means - 1))) for a, b in zip(found, wanted, strict=True)
             if a.ended == b.ended == SOLVED), default=np.nan)  # fmt: skip
        equal = all(map(same, alone, found))
        microseconds = [1e6 * shortest(work) / len(groups) for work in (plainly, singly, together)]
        print_row(tails, microseconds, apart, equal)


def print_row(tails: int, times: list[float], apart: float, equal: bool) -> None:
    """Print a row of a table of times."""
    plain, single, together = times
    ratios = f"{plain / together:12.2f}   {single / plain:14.2f}"
    print(f"  {tails}   {plain:13.0f}   {single:8.0f}   {together:6.0f}   {ratios}   {apart:18.1e}   {equal}")


def robots_of(tails: int, count: int) -> Groups:
    """Return robots of the sweep with N tails."""
    points = load_design().with_rows(8 * count).points()
    rows = np.flatnonzero(points["N"] == tails)[:count]
    return Groups.from_columns({name: values[rows] for name, values in points.items()})


def transients(count: int) -> None:
    """Print the time of the transients of a response by N."""
    times = np.linspace(0.2, _UNTIL, 25)
    print(f"\nThe transients of a response to a flip on {' and '.join(map(str, MESHES))} edges, microseconds")
    print(_COLUMNS)
    for tails in TAILS:
        groups = robots_of(tails, count)
        rows = numbers(groups)
        flips = [
            Flip(row, mirrored(orbit.x), orbit.u, orbit.twist, _UNTIL)
            for mesh in orbits_with_phases(rows, tails, MESHES)
            for row, orbit in zip(rows, mesh, strict=True)
            if orbit
        ]

        def plainly(flips: list[Flip] = flips) -> list[Any]:
            return [course and course.lag for flip in flips for course in [follow_alone(flip, times, TOLERANCE)]]

        def singly(flips: list[Flip] = flips) -> list[Any]:
            return [course and course.lag for flip in flips for course in follow_flips([flip], times, TOLERANCE)]

        def together(flips: list[Flip] = flips) -> list[Any]:
            return [course and course.lag for course in follow_flips(flips, times, TOLERANCE)]

        wanted, alone, found = plainly(), singly(), together()
        apart = max(float(np.max(np.abs(a - b))) for a, b in zip(found, wanted, strict=True))
        equal = all(map(np.array_equal, alone, found))
        microseconds = [1e6 * shortest(work) / len(groups) for work in (plainly, singly, together)]
        print_row(tails, microseconds, apart, equal)


def _correction(numbers: Any, x: Any, u: Any, terms: Any, width: Any) -> None:
    """Compute one Newton correction of a group, in place of x."""
    body, x, u = body_in_lanes(lanes(numbers, width), terms), lanes(x, width), lanes(u, width)
    rates = on_orbit(x.shape[1], FIRST_PHASE)
    work = new_workspace(rates, x, u)
    dx, du = zeros(x, x.shape), zeros(u, u.shape)
    linearise(body, rates, x, u, work.room, work.equations)
    negate(work.equations, dx, du)
    factor_and_solve(body, rates, u, work, dx, du)
    x[:] = dx


def assembly(loop: Any, given: Any, done: set[Any]) -> str:
    """Return the assembly of a compiled loop, and of the large loops that it calls (`sim.called_code`)."""
    import numba

    njit: Any = numba.njit
    loop.compile(given)
    text = "\n".join(loop.inspect_asm().values())
    for needed in loop.overloads[given].library._reload_init - done:
        if needed not in done:
            done.add(needed)
            again = njit(error_model="numpy", no_cpython_wrapper=True)(needed.loop.py_func)
            text += assembly(again, needed.types, done)
    return text


def instructions(width: tuple[int, ...]) -> Counter[str]:
    """Count the instructions of double-precision arithmetic in a Newton correction, by kind."""
    from numba import njit, typeof

    from sim.machine_code import compiler_settings

    with compiler_settings():
        loop: Any = njit(error_model="numpy")(_correction)
        terms = Nonlocal(*[0.0] * len(Nonlocal._fields))
        arrays = np.ones((33, len(width))), np.ones((6, 3, 3, len(width))), np.ones((1, 4, len(width)))
        kind: Any = typeof
        given = (*map(kind, arrays), kind(terms), kind(width))
        text = assembly(loop, given, set())
    kinds = Counter(f"{kind}mm" for kind in _PACKED.findall(text))
    kinds["scalar"] = len(_SCALAR.findall(text))
    return kinds


def main(robots: str = str(ROBOTS)) -> None:
    """Print both tables."""
    count = int(robots)
    with threadpool_limits(1), np.errstate(all="ignore"):
        speeds(count)
        transients(count)
    print("\nArithmetic instructions on doubles in the assembly of a Newton correction (assembly and elimination)")
    for name, width in (("one lane", ALONE), ("eight lanes", GROUP)):
        kinds = instructions(width)
        total = sum(kinds.values())
        parts = ", ".join(f"{kind} {number}" for kind, number in sorted(kinds.items()))
        print(f"  {name}: {100 * (total - kinds['scalar']) / max(total, 1):.0f} % packed ({parts})")


if __name__ == "__main__":
    main(*sys.argv[1:])
