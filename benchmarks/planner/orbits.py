"""Laps and orbits: sizes, drift a lap as stated, and three laps in the simulator.

Usage: python -m benchmarks orbits [PICTURE]

Takes 3 minutes.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from planner.jobs.hold import hold
from planner.jobs.laps import looped
from planner.paths.path import Path2D
from planner.planning.picture import REPLAYED
from planner.planning.plan import make_plan
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.vehicle.tracked_point import tracked_vehicle
from sim.io.files import whole_file
from sim.model.presets import PRESETS
from sim.motion.replay import replay

_LAPS = 3


def main(picture: str = "docs/orbits.png") -> None:
    robot = PRESETS["paper-control"]
    tracked = tracked_vehicle(robot, None, "head_centre", None)
    request = PlanRequest(objective="flips")
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    eight = Path2D(np.stack([2 * np.sin(angle), 1.2 * np.sin(2 * angle)], 1), True)
    plan = looped(make_plan(eight, tracked, request))
    held = hold((0.0, 0.0), tracked, request)
    figure = Figure(figsize=(9, 4), layout="constrained")
    print(f"{'':>8}{'flips':>7}{'lap':>9}{'drift a lap, stated':>21}{'in the simulator':>18}")
    left, right = figure.subplots(1, 2)
    _replay(plan, "eight", plan.plot(left))
    _replay(held.plan, "hold", held.plot(right))
    for axes in (left, right):
        axes.legend(fontsize=7, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.15), ncol=3)
    print("\n".join(held.lines()))
    with whole_file(picture) as part:
        figure.savefig(part, format="png", dpi=110)
    print(f"-> {picture}")


def _replay(plan: Plan, name: str, axes: Axes) -> None:
    """Replay some laps, draw them, and print how far the pose after the last one is from that after the first."""
    (track,) = replay([plan.schedule(laps=_LAPS)])
    places = track[["x_over_l", "y_over_l"]].to_numpy(float)
    axes.plot(*(100 * plan.robot.tail_length * places.T), color=REPLAYED, lw=0.6, label="replayed")
    times = track["time_bar"].to_numpy(float)
    first = places[int(np.abs(times - plan.duration).argmin())]
    drift = float(np.hypot(*(places[-1] - first))) / (_LAPS - 1)
    seconds = plan.duration * plan.robot.time_scale
    assert plan.lap is not None
    print(f"{name:>8}{len(plan.dwells):7d}{seconds:8.0f}s{plan.lap.drift:21.4f}{drift:18.4f}", flush=True)
