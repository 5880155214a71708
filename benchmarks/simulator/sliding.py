"""Sliding speed of tails that touch, on orbits with contact.

Friction, or a film of fluid between tails, acts on this speed. It is stated over the speed of the clamps, ω_t a:
that is what drag on the tails acts on.

Usage: python -m benchmarks sliding

Takes half a minute.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.markdown import heading, row
from sim.arrays import Floats
from sim.linear.spectral import differentiation
from sim.mechanics.balance import tail_spin
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.solve.assembly import bodies
from sim.solve.refinement import FEW, SOLVED, refined_orbit

MEASURED = replace(PRESETS["paper-measured"], effects={"tail_contact": 1.0})
OTHERS = ((3, 0.15, 143.66), (4, 0.13, 143.66), (5, 0.11, 143.66), (5, 0.13, 100.0), (4, 0.11, 200.0))
NEAR = 1.15  # distance over 2 r0 below which tails count as touching


def sliding(robot: Robot) -> Floats:
    """Compute the speed of each touching pair of nodes along each other over ω_t a, at all phases."""
    body, tails = bodies(robot.groups())[0], robot.tails
    orbit = refined_orbit(body, tails, FEW)
    assert orbit.ended == SOLVED
    x, u = orbit.x[2], orbit.u[2]
    phases = x.shape[1]
    spin = np.array([tail_spin(body, now) for now in u])
    x_dot = np.einsum("ml,klc->kmc", differentiation(phases), x) * np.tile(spin, tails)[:, None]
    angle = 2 * np.pi / tails
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    speeds = []
    for m in range(phases):
        after = (m + phases // tails) % phases  # the next tail now is this one there
        apart = x[:, None, m] - (x[:, after] @ turn.T)[None]
        distance = np.linalg.norm(apart, axis=-1)
        for i, j in np.argwhere(distance < NEAR * 2 * body.tail_radius):
            normal = apart[i, j] / distance[i, j]
            speed = x_dot[i, m] - turn @ x_dot[j, after]
            speeds.append(np.linalg.norm(speed - normal * (speed @ normal)))
    return np.array(speeds) / (abs(spin.mean()) * body.offset)


def main() -> None:
    robots = [MEASURED]
    for tails, length, rpm in OTHERS:
        robots.append(replace(MEASURED, tails=tails, tail_length=length, motor_speed=rpm * np.pi / 30))
    print(heading("N", "l [cm]", "motor [rpm]", "sliding speed over ω_t a: median, largest"))
    for robot in robots:
        speeds, rpm = sliding(robot), robot.motor_speed * 30 / np.pi
        said = f"{100 * np.median(speeds):.1f} %, {100 * speeds.max():.1f} %" if len(speeds) else "none touch"
        print(row(robot.tails, f"{100 * robot.tail_length:.0f}", f"{rpm:.0f}", said))
