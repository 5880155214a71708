"""All steady motions of robots with several, along the motor's speed: a table and a picture.

The robots are those of `robustness` that reach another motion from rest (docs/steady-motions.md), by their row.

Usage: python -m benchmarks branches [ROW …]

Takes 25 minutes.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from benchmarks.simulator.robustness import robots
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.io.files import whole_file
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.batches import one_thread
from sim.motion.branch_report import draw_branches, special_rows, summary
from sim.motion.branches import find_branches
from sim.motion.swept_input import SweptInput

_ROBOTS, _ROWS = 4096, ("3620", "2571")
_RANGE = (0.1, 1.3)  # of the robot's own motor speed


def robot_of(columns: Mapping[str, Floats], row: int) -> Robot:
    """Make a robot with the groups of a row; its tails and its fluid are those of the paper's control example."""
    groups = {name: float(values[row]) for name, values in columns.items()}
    base = PRESETS["paper-control"]
    radius = base.tail_length / groups["l_over_R"]
    return replace(
        base,
        name=f"row {row} of robustness, N = {groups['N']:.0f}",
        tails=int(groups["N"]),
        head_radius=radius,
        head_length=groups["L_over_R"] * radius,
        tail_radius=base.tail_length / groups["l_over_r0"],
        C_t=groups["C_t"],
        C_r=groups["C_r"],
        C_yr=groups["C_yr"],
    ).with_motor(groups["omega_bar"])


def main(*rows: str) -> None:
    for row in rows:
        if not row.isdecimal() or int(row) >= _ROBOTS:
            raise InputError(f"no row {row!r} of robustness; give whole numbers from 0 to {_ROBOTS - 1}")
    columns = robots(_ROBOTS)
    for row in rows or _ROWS:
        robot = robot_of(columns, int(row))
        low, high = (share * robot.omega_bar for share in _RANGE)
        swept = SweptInput(robot, "omega_bar", low, high)
        with one_thread():
            result = find_branches(swept, progress=lambda line: print(f"  {line}", file=sys.stderr, flush=True))
        print(f"\n{robot.name}: ω̄ = {low:.1f} to {high:.1f}; {summary(result)}")
        for place, kind, value, yaw, growth in special_rows(result):
            print(f"  branch {place}: {kind:16} at ω̄ = {value:6}, yaw rate {yaw}, growth {growth}")
        s = (robot.omega_bar - low) / (high - low)
        print(f"  at ω̄ = {robot.omega_bar:.1f}, interpolated:")
        for number, branch in enumerate(result.branches, 1):
            for motion in branch.at(s):
                print(
                    f"    branch {number} (tails {'alike' if branch.alike else 'not alike'}): ω_yr = "
                    f"{motion.means[2]:.2f}, ω_t = {motion.means[0]:.2f}, growth {motion.leading.growth:.3f}"
                )
        stepped = [m for m in (*result.up, *result.down) if m.settled and np.isfinite(m.means).all()]
        known = sum(any(b.has(m.s, m.means) for b in result.branches) for m in stepped)
        print(f"  of {len(stepped)} settled motions of the slow sweeps {known} are on a branch, to 3 %")
        with whole_file(f"docs/branches-{row}.png") as part:
            draw_branches(result).savefig(part, format="png", dpi=110)
