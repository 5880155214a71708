"""The physics in one picture: tails, thrust, torque and yaw rate against motor speed.

Tails over a revolution at low and high motor speed; N = 2 to 5, with linear theory beside them.

Usage: python -m benchmarks physics [OUT.png]

Takes 20 seconds.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.shapes import tails_over_a_revolution
from sim.motion.steady import steady
from sim.reference.linear_theory import linear_motion

COLOURS = {2: "#2a7fba", 3: "#3a9d5d", 4: "#e08a1e", 5: "#c8452f"}
SPEEDS = np.geomspace(0.5, 110.0, 60)
FRAMES = 24
ROBOT = PRESETS["paper-control"]


def draw_tails(axes: Any, robot: Robot, title: str) -> None:
    """Draw one tail over a revolution in the body frame, seen from above; colour runs with the disc's phase."""
    _, tails = tails_over_a_revolution(robot, FRAMES)
    radius, length = robot.head_radius / robot.tail_length, robot.head_length / robot.tail_length
    axes.fill([0, length, length, 0], [-radius, -radius, radius, radius], color="#dfe5ea")
    for frame in range(FRAMES):
        x, z = tails[frame, 0, :, 0], tails[frame, 0, :, 2]
        axes.plot(z, x, color=colormaps["twilight_shifted"](frame / FRAMES), lw=1.3)
    axes.set_aspect("equal")
    axes.set_xlim(-1.05, 0.25)
    axes.set_title(title, fontsize=9)
    axes.set_xlabel("z / l", fontsize=8)
    axes.set_ylabel("x / l", fontsize=8)
    axes.tick_params(labelsize=7)


def robots(tails: int) -> Groups:
    """Return the paper's control robot with N tails at every speed."""
    values = replace(ROBOT, tails=tails).group_values()
    columns = {name: np.full(len(SPEEDS), value) for name, value in values.items()}
    return Groups.from_columns({**columns, "omega_bar": SPEEDS})


def curves(tails: int) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], np.ndarray]:
    """Compute simulated and linear thrust, torque and yaw rate over SPEEDS, and where tails are apart."""
    groups = robots(tails)
    motion = steady(groups)
    R = 1 / float(groups.l_over_R[0])
    drag = 6 * math.pi * float(groups.C_t[0]) * R  # steady: what drags the head is the net thrust on it
    spin_drag = 8 * math.pi * float(groups.C_r[0]) * R**3
    simulated = {"thrust": drag * motion.v_z, "torque": spin_drag * np.abs(motion.omega_h), "yaw": motion.omega_yr}
    theory = [linear_motion(groups.select(np.array([i]))) for i in range(len(SPEEDS))]
    linear = {
        "thrust": np.array([drag * t.v_z for t in theory]),
        "torque": np.array([t.torque for t in theory]),
        "yaw": np.array([t.omega_yr for t in theory]),
    }
    return simulated, linear, motion.tail_gap >= 1


def main(out: str = "docs/physics.png") -> None:
    figure = Figure(figsize=(12, 6.2))
    grid = figure.add_gridspec(2, 6, height_ratios=(1, 2), hspace=0.3, wspace=1.0)
    slow, fast = ROBOT, replace(ROBOT.with_motor(100.0), C_yr=6.0)
    draw_tails(figure.add_subplot(grid[0, :3]), slow, "$\\bar\\omega$ = 10: nearly a fixed shape, turning")
    draw_tails(figure.add_subplot(grid[0, 3:]), fast, "$\\bar\\omega$ = 100, $C_{yr}$ = 6: it changes as it turns")
    panels = {
        "thrust": ("net thrust on the head / (EI/$l^2$)", figure.add_subplot(grid[1, :2])),
        "torque": ("torque of the tails / (EI/l)", figure.add_subplot(grid[1, 2:4])),
        "yaw": ("yaw rate $\\bar\\omega_{yr}$", figure.add_subplot(grid[1, 4:])),
    }
    for tails, colour in COLOURS.items():
        simulated, linear, apart = curves(tails)
        for name, (_, axes) in panels.items():
            axes.plot(SPEEDS, np.where(apart, simulated[name], np.nan), color=colour, lw=2.0, label=f"N = {tails}")
            axes.plot(SPEEDS, simulated[name], color=colour, lw=0.7)
            axes.plot(SPEEDS, linear[name], color=colour, lw=0.9, ls="--")
    for label, axes in panels.values():
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("motor speed $\\bar\\omega$", fontsize=8)
        axes.set_title(label, fontsize=9)
        axes.tick_params(labelsize=7)
        axes.grid(alpha=0.25, which="both", lw=0.4)
    title = "dashed: linear theory\nthin: tails touch"
    panels["thrust"][1].legend(fontsize=7, frameon=False, title=title, title_fontsize=7)
    figure.savefig(out, dpi=110, bbox_inches="tight")
    print(f"-> {out}")
