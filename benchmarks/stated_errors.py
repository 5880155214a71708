"""Do the stated errors of plans hold? Random robots and paths, replayed in the simulator by a robot that differs.

Every robot has a table of its own. The robot that swims is drawn from the covariance of the coefficients that the
planner is told. A stated error must hold in 95 % of the plans.

Usage: python -m benchmarks.stated_errors [PLANS] [FIRST SEED]
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np
import torch

from planner import Path2D, circle, plan, polygon
from planner.check import tracking_error
from planner.knowledge import COEFFICIENTS, Knowledge
from planner.record import plan_record
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.replay import replay
from surrogate.tabulate import tabulate

SIGMA = 0.01  # of ln C


def random_robot(rng: np.random.Generator) -> Robot:
    """A robot of the look-up table's domain."""
    base = PRESETS["paper-control"]
    length = base.tail_length
    radius = length / rng.uniform(4, 9)
    robot = replace(
        base,
        tails=int(rng.integers(2, 6)),
        C_t=rng.uniform(1.5, 5),
        C_r=rng.uniform(1.2, 3.5),
        C_yr=rng.uniform(1, 6),
        head_radius=radius,
        head_length=radius * rng.uniform(2.5, 5),
        tail_radius=length / rng.uniform(20, 45),
    )
    if rng.random() < 0.3:
        robot = replace(robot, effects={"left_right_bias": float(rng.uniform(-0.3, 0.3))})
    return robot.with_motor(float(np.exp(rng.uniform(np.log(5), np.log(80)))))


def random_path(rng: np.random.Generator, radius: float) -> Path2D:
    """A path of 6 to 15 turn radii: a smooth curve, a polygon, a circle or a zigzag."""
    kind = rng.integers(4)
    length = radius * rng.uniform(6, 15)
    if kind == 0:
        return circle(length / 2 / np.pi)
    if kind == 1:
        corners = int(rng.integers(3, 7))
        return polygon(corners, max(length / corners, 3 * radius))
    if kind == 2:
        turns = np.cumsum(rng.uniform(-1.5, 1.5, 6))
        return Path2D.of(np.cumsum(length / 6 * np.stack([np.cos(turns), np.sin(turns)], 1), 0), closed=False)
    s = np.linspace(0, length, 800)
    waves = rng.normal(size=(5, 1)) * np.sin(
        rng.uniform(0.2, 0.8, (5, 1)) / radius * s + rng.uniform(0, 6, (5, 1))
    )
    heading = np.cumsum(0.5 / radius * np.tanh(waves.sum(0) / 2)) * (s[1] - s[0])
    return Path2D.of(np.cumsum((s[1] - s[0]) * np.stack([np.cos(heading), np.sin(heading)], 1), 0), closed=False)


def main() -> None:
    torch.set_num_threads(1)
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    knowledge = Knowledge(COEFFICIENTS, SIGMA**2 * np.eye(3))
    rows: list[tuple[float, ...]] = []
    print(f"{'seed':>5}{'N':>3}{'omega':>7}{'flips':>7}{'ms/flip':>9}{'stated':>9}{'wrong':>9}{'/':>6}"
          f"{'exact':>9}{'rms':>9}{'floor':>9}")  # fmt: skip
    for seed in range(first, first + count):
        rng = np.random.default_rng(seed)
        robot = random_robot(rng)
        try:
            table = tabulate(robot)
            own = plan(circle(4.0), robot, lookup=table).vehicle.turn_radius
            path = random_path(rng, own)
            began = time.process_time()
            result = plan(path, robot, lookup=table, knowledge=knowledge)
            spent = 1000 * (time.process_time() - began) / len(result.dwells)
        except InputError as refused:
            print(f"{seed:5d} refused: {refused}")
            continue
        moved = {name: getattr(robot, name) * np.exp(SIGMA * rng.normal()) for name in COEFFICIENTS}
        record = plan_record(result)
        try:
            wrong, right = (
                tracking_error(record, replay([result.schedule(one)])[0])
                for one in (replace(robot, **moved), robot)
            )
        except InputError as failed:
            print(f"{seed:5d} not replayed: {failed}")
            continue
        rows.append((wrong.largest / result.stated_error, right.rms, result.zigzag_rms, right.largest))
        print(f"{seed:5d}{robot.tails:3d}{robot.omega_bar:7.1f}{len(result.dwells):7d}{spent:9.3f}"
              f"{result.stated_error:9.4f}{wrong.largest:9.4f}{rows[-1][0]:6.2f}{right.largest:9.4f}{right.rms:9.4f}"
              f"{result.zigzag_rms:9.4f}", flush=True)  # fmt: skip
    table_ = np.array(rows)
    print(f"\n{len(rows)} plans: stated error holds in {100 * np.mean(table_[:, 0] <= 1):.1f} %; stated/actual "
          f"{np.median(1 / table_[:, 0]):.2f} at the median")  # fmt: skip
    print(f"exact robot: rms/floor {np.median(table_[:, 1] / table_[:, 2]):.2f} at the median, "
          f"{np.quantile(table_[:, 1] / table_[:, 2], 0.95):.2f} at 95 %; rms {np.median(table_[:, 1]):.4f} l "
          f"at the median, {np.quantile(table_[:, 1], 0.95):.4f} at 95 %")  # fmt: skip


if __name__ == "__main__":
    main()
