"""Cost and error of tables of one robot, for each effect of the catalogue at its typical size.

For each robot: the processor time of `surrogate.tabulate.tabulate`, and the error of the net motion that
its table predicts. The net motion is the change of the robot's pose over two equal dwells, one in each direction
of the motor, once earlier dwells are forgotten; first with the motor forwards, then with the motor backwards. The
error is the distance between the two ends over the net distance, or, where it is larger, the difference of the
headings over the angle by which the robot turns in one dwell.

The reference is time steps on two meshes, extrapolated, as the mean over the phases of the disc at the flip. The
steady motion of both sides is that of the direct solution, whose stated error is in the table, too.

Usage: python -m benchmarks robot_tables [EFFECT …]

Takes 5 minutes.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from common.arrays import Floats
from planner.vehicle.from_table import table_vehicle
from sim.effects import catalogue
from sim.mechanics import planar
from sim.mechanics.flow import has_flow
from sim.model.body import Body
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.model.response import DWELLS
from sim.model.robot import Robot
from sim.motion.run import Resolution, SteppedRobot
from sim.motion.settling import steady_state
from sim.motion.stepped_response import steady_twist
from sim.motion.warm import compile_once
from sim.solve.assembly import bodies
from surrogate.robot_table import RobotTable
from surrogate.tabulate import tabulate
from tests.oracles.switching import MEMORY

AT = (8, 13, 18, 22)  # of DWELLS: 0.54, 1.0, 1.9, 3.1
_MESHES = (Resolution(16, 48), Resolution(24, 72))
_MESHES_WITH_FLOW = (Resolution(12, 36), Resolution(16, 48))  # within 0.03 % of the others where there is no flow
_PHASES = 6
_ADAPTS, _WINDOW = 1.0, 1.5  # time units for the mesh to settle, and for the steady twist
_SENSES = (1.0, -1.0)
_VIEW = np.stack([np.ones(3), planar.MIRROR])  # a motion in each direction, seen as for a positive motor


def robots() -> dict[str, Robot]:
    """Return the control robot, plain and with each effect (beside the one that it needs)."""
    base, named = PRESETS["paper-control"], {"none": PRESETS["paper-control"]}
    for name, effect in catalogue().items():
        partner = {effect.beside: catalogue()[effect.beside].typical} if effect.beside else {}
        named[name] = replace(base, effects={**partner, name: effect.typical})
    return named


def both(robot: Robot) -> Groups:
    """Return the robot with its motor forwards and backwards."""
    columns = {name: np.array([value, value]) for name, value in robot.group_values().items()}
    return Groups.from_columns(columns | {"omega_bar": columns["omega_bar"] * _SENSES})


def pairs(changes: Floats) -> Floats:
    """Compose pose changes (2, …, 3) over two dwells, the first in each direction, from those over one dwell."""
    real = changes * _VIEW.reshape(2, *[1] * (changes.ndim - 2), 3)
    return planar.compose(real, real[::-1])


def tabulated(table: RobotTable, robot: Robot) -> tuple[Floats, Floats]:
    """Compute the planner's pose changes (2, D, 3) over one of equal dwells, and steady twists (2, 3)."""
    vehicle = table_vehicle(robot, table)
    dwells = DWELLS[list(AT)]
    changes = np.stack([vehicle.motion(int(sense), dwells, dwells) for sense in _SENSES])
    return changes * _VIEW[:, None], vehicle.twist * _VIEW


def stepped(robot: Robot, twist: Floats) -> Floats:
    """Compute the same pose changes (2, D, 3) by time steps, with the arcs of `twist`."""
    groups = both(robot)
    body, reverse = bodies(groups)[0], bodies(groups.reversed())[0]
    meshes = _MESHES_WITH_FLOW if has_flow(body) else _MESHES
    coarse, fine = (
        np.stack([_lags(body, reverse, groups.N, float(DWELLS[i]), mesh) for i in AT], 1) for mesh in meshes
    )
    a, b = (mesh.edges for mesh in meshes)
    lag = fine + (fine - coarse) * a**2 / (b**2 - a**2)
    return planar.compose(lag, planar.arc(twist[:, None], DWELLS[list(AT)]))


def _lags(body: Body, reverse: Body, tails: int, dwell: float, mesh: Resolution) -> Floats:
    """Compute the lags (2, 3) of equal dwells in each direction, mean over phases of the disc."""
    runs = [
        SteppedRobot(forth, tails, mesh, steady_state(forth, tails, mesh), reverse=back, most_work=np.inf)
        for forth, back in ((body, reverse), (reverse, body))
    ]
    steady_parts = [
        steady_twist(run, tails, sense, adapts=_ADAPTS, window=_WINDOW)
        for run, sense in zip(runs, _SENSES, strict=True)
    ]
    twists, (turn, _) = zip(*steady_parts, strict=True)
    count = 2 * int(np.ceil((1 + MEMORY / dwell) / 2)) + 1
    changes = np.zeros((2, 3))
    for phase in range(_PHASES):
        run = runs[0].copy()
        if phase:
            run.go(turn * phase / _PHASES)
        for flip in range(1, count + 1):  # the second one is forwards again
            run.flip()
            before = run.pose
            run.go(dwell)
            if flip >= count - 1:
                changes[flip % 2] += planar.between(before, run.pose) * _VIEW[flip % 2] / _PHASES
    return planar.compose(changes, planar.inverse(planar.arc(np.array(twists), dwell)))


def main(*effects: str) -> None:
    threadpool_limits(1)
    compile_once()
    tabulate(PRESETS["paper-control"])  # load the machine code
    print(f"{'':24}{'s':>6}{'steady':>8}{'':4}error of the net motion [%], dwells "
          + ", ".join(f"{DWELLS[i]:.2f}" for i in AT))  # fmt: skip
    print(f"{'':24}{'':6}{'[%]':>8}{'':4}{'first forwards':28}{'first backwards':28}")
    for name, robot in robots().items():
        if effects and name not in effects:
            continue
        began = time.process_time()
        table = tabulate(robot)
        spent = time.process_time() - began
        mine, twist = tabulated(table, robot)
        predicted, reference = pairs(mine), pairs(stepped(robot, twist))
        away = np.hypot(*np.moveaxis(predicted - reference, -1, 0)[:2]) / np.hypot(
            *np.moveaxis(reference, -1, 0)[:2]
        )
        turned = np.abs(predicted - reference)[..., 2] / np.abs(twist[:, 2]).mean() / DWELLS[list(AT)]
        error = 100 * np.maximum(away, turned)
        figures = "".join(" ".join(f"{value:6.3f}" for value in row) + " " for row in error)
        stated = 100 * table.errors["omega_yr_bar"]["rms"]
        print(f"{name:24}{spent:6.1f}{stated:8.3f}{'':4}{figures}", flush=True)
