"""Plans that arrive later and later: duration against the wish, errors, and tracks in the simulator.

Usage: python -m benchmarks arrival [PICTURE]

Takes 3 minutes.
"""

from __future__ import annotations

from matplotlib.figure import Figure

from planner.files.tracking_error import tracking_error
from planner.jobs.arrival_plan import plan_arrival
from planner.paths.path import Path2D
from planner.planning.picture import REPLAYED
from planner.planning.plan import make_plan
from planner.planning.request import PlanRequest
from planner.vehicle.tracked_point import tracked_vehicle
from sim.io.files import whole_file
from sim.model.presets import PRESETS
from sim.motion.replay import replay

_PATH = Path2D.of([[0.0, 0.0], [2.5, 0.0], [4.5, 1.5]])
_SHARES = (1.0, 1.4, 3.0)  # of the time of the fastest plan


def main(picture: str = "docs/arrival.png") -> None:
    robot = PRESETS["paper-control"]
    tracked = tracked_vehicle(robot, None, "head_centre", None)
    fastest = float(make_plan(_PATH, tracked, PlanRequest(objective="time")).seconds.sum())
    figure = Figure(figsize=(4 * len(_SHARES), 3.4), layout="constrained")
    print(f"{'wish':>9}{'late':>8}{'dwell':>8}{'flips':>7}{'circles':>9}{'stated':>9}{'replayed':>10}")
    for axes, share in zip(figure.subplots(1, len(_SHARES)), _SHARES, strict=True):
        plan = plan_arrival(_PATH, tracked, PlanRequest(), share * fastest)
        (track,) = replay([plan.schedule()])
        plan.plot(axes)
        error = tracking_error(plan.to_dict(), track)
        axes.plot(*(100 * robot.tail_length * error.track.T), color=REPLAYED, lw=0.8, label="replayed")
        axes.set_title(f"{float(plan.seconds.sum()) / 60:.1f} min", fontsize=10)
        axes.legend(fontsize=7, frameon=False)
        swing = plan.declared.swing
        circles = "" if swing is None else swing.circles
        wish = share * fastest
        late = float(plan.seconds.sum()) - wish
        print(f"{wish:8.0f}s{late:7.1f}s{plan.minimum_dwell:8.2f}{len(plan.dwells):7d}{circles:>9}", end="")
        print(f"{plan.stated_error:9.3f}{error.largest:10.3f}", flush=True)
    with whole_file(picture) as part:
        figure.savefig(part, format="png", dpi=110)
    print(f"-> {picture}")
