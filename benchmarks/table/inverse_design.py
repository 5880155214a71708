"""Inverse design with the look-up table, checked by the simulator.

Targets are motions that the simulator found for random robots of the domain with two tails and more. The table is
asked which robots move so, and each robot that it gives is simulated. For the design problem the lengths of tails
and head, the number of tails and the motor's speed are free.

Usage: python -m benchmarks inverse_design [TARGETS]

Takes 2 minutes.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import torch

from sim.arrays import Floats
from sim.io.errors import InputError
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.model.response import DWELLS
from sim.model.robot import Robot
from sim.motion.batches import steady_columns
from sim.motion.response import responses
from surrogate.input_ranges import BOUNDS, COEFFICIENTS, ROBOT
from surrogate.table.inverse import design, inverse
from surrogate.table.lookup import OUTSIDE, Lookup
from surrogate.table.model_file import load
from surrogate.training.simulated import Simulated, as_reached, drawn
from surrogate.training.train import with_radius

KINDS = {  # free inputs, and the outputs that are given
    "which C's give these spins, yaw rates and speeds": (COEFFICIENTS, ("omega_t_bar", "omega_yr_bar", "v_z")),
    "which motor speed gives this yaw rate": (("omega_bar",), ("omega_yr_bar",)),
    "which tail and head give this radius and speed": (("l_over_R", "L_over_R"), ("R_yr_over_l", "v_z")),
}
_SEED, _DRAWN = 77, 256
_MET = 1e-3  # a target is met where no output misses it by more, relative
_SOLVED = 1e-6  # misfit of a solution of the table's equations
_AT = 13  # of DWELLS: T̄ of the design, 1.0
RADIUS, RPM = 0.9, (20.0, 200.0)  # of the design: largest R_yr/l, motor
LENGTHS = np.linspace(0.07, 0.15, 9)  # m, of the tails


def targets(lookup: Lookup, count: int) -> Simulated:
    """Simulated robots inside the table's domain, with two tails and more that do not touch."""
    rows = as_reached(drawn(_DRAWN, _SEED, wide=False))
    inside = ~lookup.query(rows.robots, flag=True)[OUTSIDE]
    good = inside & (rows.robots["N"] > 1) & (rows.motion["tail_gap"] >= 1)
    return rows.at(np.flatnonzero(good)[:count])


def backwards(lookup: Lookup, rows: Simulated, title: str) -> None:
    """Solve for the free inputs, simulate every solution, and print how far it is from its target."""
    free, given = KINDS[title]
    truth = with_radius(rows.motion)
    robots = {name: values for name, values in rows.robots.items() if name in ROBOT}
    began = time.process_time()
    found = inverse(lookup, robots, {n: truth[n] for n in given}, {n: BOUNDS[n] for n in free})
    spent = time.process_time() - began
    solved = np.flatnonzero((found.misfit < _SOLVED) & ~found.outside.astype(bool))
    target = found.target[solved]
    own = {n: values[target] for n, values in robots.items()} | {n: v[solved] for n, v in found.inputs.items()}
    simulated = steady_columns(own, title="")
    missed = np.max([np.abs(simulated[n] / truth[n][target] - 1) for n in given], axis=0)
    missed[~np.asarray(simulated["converged"], dtype=bool)] = np.inf
    best = np.full(len(rows), np.inf)
    np.minimum.at(best, target, missed)
    away = np.full(len(rows), np.inf)
    np.minimum.at(away, target, np.max([np.abs(own[n] / rows.robots[n][target] - 1) for n in free], axis=0))
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


def designed(lookup: Lookup, robot: Robot) -> dict[str, float]:
    """Of one tail length and N: head length and motor speed for the highest net speed; outputs of the table."""
    groups = robot.group_values()
    low, high = (robot.time_scale * rpm * 2 * np.pi / 60 for rpm in RPM)
    bounds = {
        "omega_bar": (max(low, BOUNDS["omega_bar"][0]), min(high, BOUNDS["omega_bar"][1])),
        "L_over_R": BOUNDS["L_over_R"],
    }
    limits = {"R_yr_over_l": (0.0, RADIUS), "tail_gap": (1.0, np.inf)}
    return design(lookup, groups | {"dwell_bar": DWELLS[_AT]}, bounds, best="net_speed_bar", limits=limits)


def fastest(lookup: Lookup) -> None:
    """For every N the fastest allowed robot, beside the simulator."""
    base = PRESETS["paper-control"]
    print(f"\ndesign: highest net speed at dwells of {DWELLS[_AT]:.2f}, R_yr at most {RADIUS:g} l, tails apart")
    print(f"{'N':>3}{'l cm':>7}{'L cm':>7}{'rpm':>7}{'mm/s':>8}{'simulated':>11}{'R/l':>8}{'simulated':>11}"
          f"{'gap':>7}{'simulated':>11}")  # fmt: skip
    began = time.process_time()
    for tails in range(2, 9):
        best: tuple[float, Robot, dict[str, float]] | None = None
        for length in LENGTHS:
            robot = replace(base, tails=tails, tail_length=float(length))
            try:
                found = designed(lookup, robot)
            except InputError:
                continue
            speed = 1e3 * found["net_speed_bar"] * robot.tail_length / robot.time_scale
            if best is None or speed > best[0]:
                best = speed, robot, found
        if best is None:
            print(f"{tails:3d}   no robot keeps the limits")
            continue
        speed, robot, found = best
        columns = {n: np.array([found[n]]) for n in ROBOT if n in found}
        motion = steady_columns(columns, title="")
        net = _first(responses(Groups.from_columns(columns)).net_speed[:, _AT])
        unit = 1e3 * robot.tail_length / robot.time_scale
        head, rpm = found["L_over_R"] * robot.head_radius, found["omega_bar"] / robot.time_scale * 30 / np.pi
        print(f"{tails:3d}{100 * robot.tail_length:7.1f}{100 * head:7.1f}{rpm:7.0f}{speed:8.3f}{unit * net:11.3f}"
              f"{found['R_yr_over_l']:8.4f}{_first(motion['R_yr_over_l']):11.4f}{found['tail_gap']:7.2f}"
              f"{_first(motion['tail_gap']):11.2f}", flush=True)  # fmt: skip
    print(f"{time.process_time() - began:.0f} s for {7 * len(LENGTHS)} tail lengths and numbers of tails")


def _first(values: Floats) -> float:
    return float(values[0])


def main(count: str = "100") -> None:
    torch.set_num_threads(1)
    lookup = load()
    rows = targets(lookup, int(count))
    for title in KINDS:
        backwards(lookup, rows, title)
    fastest(lookup)
