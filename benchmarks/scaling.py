"""How the cost grows: robots, edges, tails, threads; and memory a robot.

Exponents are slopes of log time over log size between the ends of each range, one thread, shortest of some runs.

Usage: python -m benchmarks.scaling
"""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.speed import sweep, timed
from sim import direct, elimination, orbit
from sim.batches import available_jobs, steady_columns
from sim.march import TOLERANCE, advance, new_state
from sim.robot import PRESETS, Groups
from sim.tail import HEAD_LENGTH, body_of, new_geometry

BATCHES = (1, 16, 256, 4096, 16384)
EDGES = (6, 12, 24, 48, 96)
TAILS = (2, 3, 4, 6, 8)
STEPS = 200


def control(tails: int) -> np.ndarray:
    """The paper's control robot with N tails, as a row for the compiled loops."""
    values = {**PRESETS["paper-control"].group_values(), "N": float(tails)}
    return np.asarray(direct.bodies(Groups.from_columns({k: np.array([v]) for k, v in values.items()}))[0])


def step_time(tails: int, edges: int) -> float:
    """Seconds for a time step of a steadily turning robot."""
    row = control(tails)
    body, none = body_of(row), np.empty((0, edges, tails, 3))
    state, poses = new_state(tails, edges, body.offset), np.empty((STEPS, 6))

    def run() -> None:
        assert advance(body, row[HEAD_LENGTH], state, 0.02, STEPS, TOLERANCE, poses, none)

    run()
    return timed(run, repeats=5)[0] / STEPS


def correction_time(tails: int, phases: int, edges: int) -> float:
    """Seconds for one Newton correction of the orbit on one mesh."""
    body = body_of(control(tails))
    x, u = direct._start(body, edges, phases, tails)
    matrix = direct.differentiation(phases)

    def run() -> None:
        orbit.newton(body, x.copy(), u.copy(), matrix, 0.0, 10)

    run()
    return timed(run, repeats=5)[0] / 10


def memory(tails: int, phases: int) -> int:
    """Bytes that the direct route works in for one robot, on its finest mesh."""
    n = direct.MESHES[-1]
    system = elimination.new_system(n, phases, 4 * phases // tails, 1)
    return sum(a.nbytes for a in (*system, *new_geometry(n, phases)))


def table(title: str, sizes: tuple[int, ...], times: list[float], unit: float, name: str) -> None:
    slope = np.log(times[-1] / times[0]) / np.log(sizes[-1] / sizes[0])
    print(f"\n{title}: exponent {slope:.2f}")
    print("  " + "".join(f"{size:>10}" for size in sizes))
    print("  " + "".join(f"{t / unit:10.1f}" for t in times) + f"  {name}")


def main() -> None:
    points = sweep(BATCHES[-1])
    steady_columns({k: v[:8] for k, v in points.items()}, title="")  # compile
    step_time(2, 6)
    with threadpool_limits(1):
        spent = []
        for count in BATCHES:
            part = {k: v[:count] for k, v in points.items()}
            spent.append(timed(lambda part=part: steady_columns(part, jobs=1, title=""))[0])  # type: ignore[misc]
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
    one = timed(lambda: steady_columns(part, jobs=1, title=""))[0]
    many = timed(lambda: steady_columns(part, title=""))[0]
    print(f"\nThreads: {available_jobs()} solve {rows} robots {one / many:.2f} times as fast as one")
    print("Memory in work for one robot, whatever the size of the batch:")
    print(
        "  "
        + ", ".join(
            f"N = {n}, {m} phases: {memory(n, m) // 1024} KiB" for n, m in ((2, 6), (2, 10), (5, 5), (8, 8))
        )
    )


if __name__ == "__main__":
    main()
