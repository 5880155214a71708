"""Clearance of the robot's body on paths with obstacles in their way, replayed in the simulator.

Usage: python -m benchmarks kept_clear [CASES] [FIRST SEED] [PICTURE]

Each case is a random closed curve with two obstacles on it.

Takes 10 minutes.
"""

from __future__ import annotations

import time

import numpy as np

from benchmarks.pictures import draw_replayed, save_picture
from planner.files.tracking_error import tracking_error
from planner.jobs.clear_plan import plan_clear
from planner.paths.obstacles import Circle, Footprint, FreeSpace, Polygon, Region
from planner.paths.path import Path2D
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.vehicle.tracked_point import tracked_vehicle
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.motion.replay import replay


def random_case(rng: np.random.Generator) -> tuple[Path2D, FreeSpace]:
    """Return a closed curve of about 2 l radius, and a circle and a box on it."""
    angle = 2 * np.pi * np.arange(400) / 400
    radius = np.full(400, 2.2)
    for k in (2, 3):
        radius += rng.normal(0, 0.35 / k) * np.cos(k * angle + rng.uniform(0, 6))
    points = radius[:, None] * np.stack([1.3 * np.cos(angle), np.sin(angle)], 1)
    first = int(rng.integers(400))
    (x, y), (u, v) = points[[first, (first + int(rng.integers(150, 250))) % 400]] + rng.normal(0, 0.2, (2, 2))
    width, height = rng.uniform(0.1, 0.4, 2).tolist()
    box = [[u - width, v - height], [u + width, v - height], [u + width, v + height], [u - width, v + height]]
    regions: tuple[Region, ...] = (Circle(float(x), float(y), float(rng.uniform(0.2, 0.5))), Polygon.of(box))
    return Path2D.of(points, closed=True), FreeSpace(regions)


def main(cases: str = "12", first: str = "0", picture: str = "docs/kept-clear.png") -> None:
    robot = PRESETS["paper-control"]
    tracked, rows = tracked_vehicle(robot, None, "head_centre", None), []
    shown: list[tuple[Plan, Floats]] = []
    print(f" seed{'path':>8}{'dwells':>8}{'ways':>6}{'margin':>8}{'stated':>8}{'found':>8}{'predicted':>11}"
          f"{'replayed':>10}{'s':>7}")  # fmt: skip
    for seed in range(int(first), int(first) + int(cases)):
        path, space = random_case(np.random.default_rng(seed))
        began = time.process_time()
        try:
            plan = plan_clear(path, tracked, PlanRequest(), space)
        except InputError as none:
            print(f"{seed:5d} {none}", flush=True)
            continue
        spent = time.process_time() - began
        kept = plan.kept_clear
        assert kept is not None
        track = replay([plan.schedule()])[0]
        poses = np.stack([track[name].to_numpy(float) for name in ("x_over_l", "y_over_l", "heading_rad")], 1)
        clearance = float(Footprint.of(robot, 0.0).clearance(poses, space).min())
        error = tracking_error(plan.to_dict(), track)
        rows.append((clearance, error.largest <= error.stated))
        shown.append((plan, error.track))
        print(f"{seed:5d}{path.length:8.2f}{len(plan.dwells):8d}{len(kept.detours):6d}{kept.margin:8.3f}"
              f"{plan.stated_error:8.3f}{error.largest:8.3f}{kept.clearance:11.3f}{clearance:10.3f}{spent:7.1f}",
              flush=True)  # fmt: skip
    clear, held = np.array(rows).T
    print(f"\n{len(rows)} replays: smallest room {clear.min():.3f} l; {np.sum(clear <= 0):.0f} touch; "
          f"{held.sum():.0f} within the stated error")  # fmt: skip
    _draw(shown[:4], picture)


def _draw(shown: list[tuple[Plan, Floats]], picture: str) -> None:
    """Draw plans with their replayed tracks side by side."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4 * len(shown), 3.6), layout="constrained")
    for axes, (plan, track) in zip(figure.subplots(1, len(shown), squeeze=False)[0], shown, strict=True):
        plan.plot(axes)
        draw_replayed(axes, plan, track)
    figure.axes[0].legend(fontsize=7, frameon=False, loc="center")
    save_picture(figure, picture)
