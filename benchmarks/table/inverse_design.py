"""Inverse design with the look-up table, checked by the simulator.

Targets are motions that the simulator found for random robots of the domain with two tails and more. The table is
asked which robots move so, and each robot that it gives is simulated.

Usage: python -m benchmarks inverse_design [TARGETS]

Takes one minute.
"""

from __future__ import annotations

import time

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.table.shipped_table import as_reached
from sim.motion.batches import steady_columns
from surrogate.input_ranges import BOUNDS, COEFFICIENTS, ROBOT
from surrogate.table.inverse import inverse
from surrogate.table.lookup import NeuralTable
from surrogate.table.model_file import load
from surrogate.table.quick_query import OUTSIDE
from surrogate.training.simulated import SimulatedRobots, draw_robots
from surrogate.training.train import with_radius

KINDS = {  # free inputs, and the outputs that are given
    "which C's give these spins, yaw rates and speeds": (COEFFICIENTS, ("omega_t_bar", "omega_yr_bar", "v_z")),
    "which motor speed gives this yaw rate": (("omega_bar",), ("omega_yr_bar",)),
    "which tail and head give this radius and speed": (("l_over_R", "L_over_R"), ("R_yr_over_l", "v_z")),
}
_SEED, _DRAWN = 77, 256
_MET = 1e-3  # a target is met where no output misses it by more, relative
_SOLVED = 1e-6  # misfit of a solution of the table's equations


def targets(lookup: NeuralTable, count: int) -> SimulatedRobots:
    """Simulate robots inside the table's domain, with two tails and more that do not touch."""
    rows = as_reached(draw_robots(_DRAWN, _SEED, wide=False))
    inside = ~lookup.query(rows.robots, flag=True)[OUTSIDE]
    good = inside & (rows.robots["N"] > 1) & (rows.motion["tail_gap"] >= 1)
    return rows.at(np.flatnonzero(good)[:count])


def backwards(lookup: NeuralTable, rows: SimulatedRobots, title: str) -> None:
    """Solve for the free inputs, simulate every solution, and print how far it is from its target."""
    free, wanted = KINDS[title]
    truth = with_radius(rows.motion)
    robots = {name: values for name, values in rows.robots.items() if name in ROBOT}
    began = time.process_time()
    solutions = inverse(lookup, robots, {n: truth[n] for n in wanted}, {n: BOUNDS[n] for n in free})
    spent = time.process_time() - began
    solved = np.flatnonzero((solutions.misfit < _SOLVED) & ~solutions.outside.astype(bool))
    target = solutions.target[solved]
    robots_found = {n: values[target] for n, values in robots.items()} | {
        n: v[solved] for n, v in solutions.inputs.items()
    }
    simulated = steady_columns(robots_found, title="")
    missed = np.max([np.abs(simulated[n] / truth[n][target] - 1) for n in wanted], axis=0)
    missed[~np.asarray(simulated["converged"], dtype=bool)] = np.inf
    best = np.full(len(rows), np.inf)
    np.minimum.at(best, target, missed)
    away = np.full(len(rows), np.inf)
    np.minimum.at(
        away, target, np.max([np.abs(robots_found[n] / rows.robots[n][target] - 1) for n in free], axis=0)
    )
    known = np.isfinite(best)
    figures = [*np.quantile(missed[np.isfinite(missed)], (0.5, 0.95)), missed[np.isfinite(missed)].max()]
    print(f"{title}: {len(rows)} targets, {1e3 * spent / len(rows):.0f} ms each")
    print(f"  solved {known.sum()}, {len(solved)} solutions, {np.isinf(missed).sum()} of them not steady when "
          "simulated")  # fmt: skip
    near, nearly = np.mean(best < _MET), np.mean(best < 10 * _MET)
    print(f"  a solution that the simulator confirms to {100 * _MET:g} %: {near:.0%} of targets; to "
          f"{1000 * _MET:g} %: {nearly:.0%}")  # fmt: skip
    print("  off the target when simulated, all solutions, median, 95 %, worst: "
          + ", ".join(f"{100 * f:.3g} %" for f in figures))  # fmt: skip
    print(f"  nearest solution from the robot that the target was made with, median, 95 %: "
          f"{100 * np.median(away[known]):.2g} %, {100 * np.quantile(away[known], 0.95):.2g} %")  # fmt: skip


def main(count: str = "100") -> None:
    threadpool_limits(1)
    lookup = load()
    rows = targets(lookup, int(count))
    for title in KINDS:
        backwards(lookup, rows, title)
