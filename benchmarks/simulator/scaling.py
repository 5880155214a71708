"""Growth of the cost with robots, edges, tails and threads; memory a robot.

Exponents are slopes of log time over log size between the ends of each range, one thread, shortest of some runs.

Usage: python -m benchmarks scaling

Takes 2 minutes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.simulator.speed import sweep
from benchmarks.timing import timed
from sim.model.body import Body
from sim.model.presets import PRESETS
from sim.motion.batches import available_jobs, steady_columns
from sim.solve.assembly import bodies
from sim.solve.march import TOLERANCE, advance, new_state
from sim.solve.newton import new_workspace, newton
from sim.solve.orbit import FIRST_PHASE, straight_start
from sim.solve.rates import on_orbit
from sim.solve.refinement import MESHES

BATCHES = (1, 16, 256, 4096, 16384)
EDGES = (6, 12, 24, 48, 96)
TAILS = (2, 3, 4, 6, 8)
STEPS = 200


def control(tails: int) -> Body:
    """Return the paper's control robot with N tails, for the compiled loops."""
    return bodies(replace(PRESETS["paper-control"], tails=tails).groups())[0]


def step_time(tails: int, edges: int) -> float:
    """Measure the seconds of a time step of a steadily turning robot."""
    body, none = control(tails), np.empty((0, edges, tails, 3))
    state, poses = new_state(tails, edges, body.offset), np.empty((STEPS, 6))

    def run() -> None:
        assert advance(body, state, 0.02, STEPS, TOLERANCE, poses, none)

    run()
    return timed(run, repeats=5)[0] / STEPS


def correction_time(tails: int, phases: int, edges: int) -> float:
    """Measure the seconds of one Newton correction of the orbit on one mesh."""
    body, rates = control(tails), on_orbit(phases, FIRST_PHASE)
    x, u = straight_start(body, edges, phases, tails)
    work = new_workspace(rates, x, u)
    count = newton(body, rates, x.copy(), u.copy(), work, 0.0)[0]  # as many as there may be

    def run() -> None:
        newton(body, rates, x.copy(), u.copy(), work, 0.0)

    return timed(run, repeats=5)[0] / count


def memory(tails: int, phases: int) -> int:
    """Count the bytes that the direct route works in for one robot, on its finest mesh."""
    x, u = straight_start(control(tails), MESHES[-1], phases, tails)
    work = new_workspace(on_orbit(phases, FIRST_PHASE), x, u)
    return _size(work)


def _size(part: object) -> int:
    """Count the bytes of all arrays in nested tuples."""
    return part.nbytes if isinstance(part, np.ndarray) else sum(map(_size, part))  # type: ignore[call-overload]


def table(title: str, sizes: tuple[int, ...], times: list[float], unit: float, name: str) -> None:
    slope = np.log(times[-1] / times[0]) / np.log(sizes[-1] / sizes[0])
    print(f"\n{title}: exponent {slope:.2f}")
    print("  " + "".join(f"{size:>10}" for size in sizes))
    print("  " + "".join(f"{t / unit:10.1f}" for t in times) + f"  {name}")


def main() -> None:
    points = sweep(BATCHES[-1])
    steady_columns({k: v[:8] for k, v in points.items()}, stability=False, title="")  # compile
    step_time(2, 6)
    with threadpool_limits(1):
        spent = []
        for count in BATCHES:
            part = {k: v[:count] for k, v in points.items()}
            spent.append(timed(lambda part=part: steady_columns(part, jobs=1, stability=False, title=""))[0])  # type: ignore[misc]
        table("Steady operating points, robots in a batch", BATCHES, spent, 1e-3, "ms")
        each = [t / n for t, n in zip(spent, BATCHES, strict=True)]
        print("  " + "".join(f"{1e6 * t:10.0f}" for t in each) + "  µs a robot")
        steps = [step_time(2, n) for n in EDGES]
        table("A time step, edges a tail (N = 2)", EDGES, steps, 1e-6, "µs")
        corrections = [correction_time(2, 6, n) for n in EDGES]
        table("A Newton correction of the orbit, edges a tail (N = 2, 6 phases)", EDGES, corrections, 1e-6, "µs")
        table("A time step, tails (16 edges)", TAILS, [step_time(n, 16) for n in TAILS], 1e-6, "µs")
        phases = tuple(n * max(1, -(-4 // n)) for n in TAILS)
        orbits = [correction_time(n, m, 12) for n, m in zip(TAILS, phases, strict=True)]
        table(f"A Newton correction of the orbit, tails (phases {phases})", TAILS, orbits, 1e-6, "µs")
    rows = BATCHES[-2]
    part = {k: v[:rows] for k, v in points.items()}
    alone = timed(lambda: steady_columns(part, jobs=1, stability=False, title=""))[0]
    many = timed(lambda: steady_columns(part, stability=False, title=""))[0]
    print(f"\nThreads: {available_jobs()} solve {rows} robots {alone / many:.2f} times as fast as one")
    print("Memory in work for one robot, whatever the size of the batch:")
    print(
        "  "
        + ", ".join(
            f"N = {n}, {m} phases: {memory(n, m) // 1024} KiB" for n, m in ((2, 6), (2, 10), (5, 5), (8, 8))
        )
    )
