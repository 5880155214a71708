"""A clamped rod that bends under its weight: time and error of Newton's method here, and of dismech-newton.

The heavy elastica at w l³/EI = 39.24, whose tip is at 0.2871 l along the clamp and 0.8934 l below it. Here it is
the tail of a robot whose head is held and whose motor stands still, with a weight that grows in SHARES shares. The
other program's rod falls by implicit Euler steps until it rests; it is compared where it is installed
(`pip install dismech-newton`).

Usage: python -m benchmarks heavy_rod

Takes 10 seconds; with dismech-newton, 30 seconds.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from benchmarks.common import heading, row
from common.arrays import Floats
from tests.sim.robots import control, first_body, solve_orbit, straight_start

TIP = np.array([0.2871, 0.8934])  # of the boundary-value problem θ'' = −α (1 − s) cos θ
ALPHA = 39.24
EDGES = (12, 24, 48)
SHARES = 10
_STEP, _STEPS = 0.1, 200  # of dismech-newton, in √(m l³/EI)


def ours(edges: int) -> Floats:
    """Return the tip, along and below the clamp."""
    body = first_body(control(1, N=1, l_over_r0=500.0))._replace(omega=0.0)
    body.resistance[:, :4] += 1e9 * np.eye(4)
    x, u = straight_start(body, edges, 1, 1)
    u[:] = 0.0
    for share in np.linspace(0, 1, SHARES + 1)[1:]:
        size = solve_orbit(body._replace(tail_load=(0.0, -share * ALPHA, 0.0)), x, u, 1e-9)
        assert size < 1e-9
    tip = x[-1, 0] - [body.offset, 0.0, 0.0]
    return np.array([-tip[2], np.hypot(tip[0], tip[1])])


def falling(edges: int) -> Callable[[], Floats]:
    """Prepare a rod of dismech-newton; its clamp is in the middle of its first edge, which is fixed."""
    newton: Any = import_module("newton")
    dismech: Any = import_module("dismech_newton")
    edge, radius, weight = 1 / (edges - 0.5), 0.01, ALPHA / 9.81
    builder = newton.ModelBuilder(gravity=-9.81)
    rod = newton.Rod.create_straight((0, 0, 0), (1, 0, 0), edges * edge, segment_count=edges, radius=radius)
    kinds = newton.ModelBuilder.ShapeConfig(density=weight / (np.pi * radius**2))
    stiffness = {"stretch_stiffness": 4e4 / edge, "bend_stiffness": 1 / edge, "twist_stiffness": 1 / edge}
    bodies = dismech.DiSMechSolver.add_rod(builder, rod, cfg=kinds, collide=False, **stiffness)
    dismech.DiSMechSolver.fix_segment(builder, bodies[0])
    model = builder.finalize(device="cpu")
    solver = dismech.DiSMechSolver(model, exact=True)

    def run() -> Floats:
        now, later = model.state(), model.state()
        for state in (now, later):
            dismech.flatten_state(state)
        for _ in range(_STEPS):
            solver.step(now, later, None, None, _STEP)
            now, later = later, now
        tip = now.particle_q.numpy()[-1]
        return np.array([tip[0] - edge / 2, -tip[2]])

    return run


def main() -> None:
    print(heading("program", "edges", "tip", "off by [%]", "processor time [ms]"))
    programs: list[tuple[str, Callable[[int], Callable[[], Floats]]]]
    programs = [("softflagella", lambda edges: partial(ours, edges))]
    if find_spec("dismech_newton"):
        programs.append(("dismech-newton", falling))
    for name, prepare in programs:
        for edges in EDGES:
            work = prepare(edges)
            work()  # compile
            began = time.process_time()
            tip = work()
            spent = 1e3 * (time.process_time() - began)
            off = ", ".join(f"{value:.2g}" for value in 100 * np.abs(tip / TIP - 1))
            print(row(name, edges, f"{tip[0]:.4f}, {tip[1]:.4f}", off, f"{spent:.3g}"))
