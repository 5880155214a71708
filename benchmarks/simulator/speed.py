"""Speed of the simulator on one thread, compared with scipy's BDF and PyElastica in the same run.

1. Whole robot, a steady operating point: the direct route against scipy's BDF on the same equations.
2. One clamped rotating filament, a simulated second: time stepping against PyElastica (if it is installed).
3. Operating points a second over the sweep's domain, on one thread and on all.

Usage: python -m benchmarks speed

Takes 3 minutes.
"""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.simulator.bdf_solver import settle_plainly
from benchmarks.timing import timed
from dataset.rows.design import load_design
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.motion.batches import available_jobs, steady_columns
from sim.motion.steady import steady
from sim.solve.assembly import bodies
from sim.solve.march import TOLERANCE, advance, new_state
from tests.reference.cases import FILAMENT
from tests.sim.robots import single_filament

ROBOTS = 5
POINTS = 2048
OMEGA = 8.0  # rad/s, of the filament
SECONDS = 4.0
ELEMENTS, EDGES = 20, 5
LARGEST_STEP = 5e-5  # s, PyElastica: twice as long blows up
STEP = 0.06  # time units, ours


def sweep(rows: int) -> dict[str, np.ndarray]:
    return load_design().with_rows(rows).points()


def robots() -> None:
    points = sweep(ROBOTS)
    print("\nA steady operating point of the whole robot, one thread")
    print("  N  motor speed   scipy BDF [s]   direct [ms]   ratio   apart (16 edges there)")
    ratios = []
    for i in range(ROBOTS):
        groups = Groups.from_columns({name: values[i : i + 1] for name, values in points.items()})
        quick, motion = timed(lambda groups=groups: steady(groups, stability=False), repeats=5)  # type: ignore[misc]
        slow, reference = timed(lambda groups=groups: settle_plainly(groups))  # type: ignore[misc]
        apart = abs(reference[1] / motion.omega_yr[0] - 1)
        ratios.append(slow / quick)
        speed = float(groups.omega_bar)
        line = f"  {groups.N}  {speed:11.1f}   {slow:13.1f}   {1e3 * quick:11.2f}   {ratios[-1]:5.0f}"
        print(f"{line}   yaw rate {100 * apart:.2f} %")
    print(f"  smallest ratio {min(ratios):.0f}, geometric mean {np.exp(np.mean(np.log(ratios))):.0f}")


def filament() -> None:
    robot = PRESETS["paper-control"]
    unit = robot.bending_stiffness / robot.tail_length**2
    thrust, moment = FILAMENT[OMEGA]
    bar = OMEGA * robot.time_scale
    offset = 0.016 / robot.tail_length
    _, groups = single_filament(2, bar, robot.tail_length / robot.tail_radius, offset)
    body = bodies(groups)[0]
    body.resistance[:, :4] += 1e9 * np.eye(4)  # the disc is held
    count = int(np.ceil(SECONDS / robot.time_scale / STEP))

    def march() -> np.ndarray:
        state = new_state(1, EDGES, body.offset)
        poses, none = np.empty((count, 6)), np.empty((0, EDGES, 1, 3))
        assert advance(body, state, STEP, count, TOLERANCE, poses, none)
        return np.asarray(1e9 * state.u)  # what holds the disc is what the fluid does

    spent, wrench = timed(march, repeats=20)
    ours = spent / SECONDS
    print(f"\nOne clamped filament, {OMEGA:g} rad/s, {SECONDS:g} s from rest, one thread; error of thrust, moment")
    errors = abs(wrench[1]) * unit / thrust - 1, abs(wrench[3]) * unit * robot.tail_length / moment - 1
    print(
        f"  here, {EDGES} edges: {1e6 * ours:.0f} µs a second, {100 * errors[0]:+.1f} %, {100 * errors[1]:+.1f} %"
    )
    try:
        from benchmarks.simulator import elastica
    except ImportError:
        print("  PyElastica is not installed (pip install -e '.[bench]'): no comparison")
        return
    force, torque, theirs = elastica.filament(OMEGA, elements=ELEMENTS, step=LARGEST_STEP, seconds=SECONDS)
    print(
        f"  PyElastica, {ELEMENTS} elements, step {LARGEST_STEP:g} s: {theirs:.2f} s a second, "
        f"{100 * (force / thrust - 1):+.1f} %, {100 * (torque / moment - 1):+.1f} %"
    )
    print(f"  ratio {theirs / ours:.0f}")


def throughput() -> None:
    points = sweep(POINTS)
    print(f"\n{POINTS} steady operating points over the sweep's domain")
    for jobs in sorted({1, available_jobs()}):
        spent, columns = timed(lambda jobs=jobs: steady_columns(points, jobs=jobs, stability=False, title=""))  # type: ignore[misc]
        direct_rows = int((columns["method"] == "direct").sum())
        print(f"  {jobs} threads: {POINTS / spent:6.0f} a second ({direct_rows} solved directly)")
    error = 100 * columns["error"]
    print(f"  error that rows state of themselves: median {np.median(error):.3f} %, largest {error.max():.2f} %")


def main() -> None:
    steady_columns(sweep(8), stability=False, title="")  # compile
    with threadpool_limits(1):
        robots()
        filament()
    throughput()
