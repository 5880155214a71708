"""Coverage of four regions: share and time as planned, and share in the simulator.

Usage: python -m benchmarks coverage [REPLAYED] [PICTURE]

The first REPLAYED plans are replayed.

Takes 10 minutes.
"""

from __future__ import annotations

import time

from matplotlib.figure import Figure

from planner.jobs.cover import cover
from planner.jobs.region import Field, share_covered
from planner.paths.obstacles import Circle, FreeSpace, Polygon
from planner.planning.picture import REPLAYED
from planner.planning.request import PlanRequest
from planner.vehicle.tracked_point import tracked_vehicle
from sim.io.files import whole_file
from sim.model.presets import PRESETS
from sim.motion.replay import replay

_BOX = Polygon.of([[0, 0], [4, 0], [4, 3], [0, 3]])
_ROCK = Circle(2, 1.5, 0.3)
_BENT = Polygon.of([[0.0, 0.0], [5.0, 0.0], [5.0, 1.5], [2.5, 2.0], [2.0, 4.0], [0.0, 3.5]])
_WALLS = Polygon.of([[-2.5, -2.5], [6.5, -2.5], [6.5, 5.5], [-2.5, 5.5]])
_CASES = (
    ("rectangle", Field(_BOX), FreeSpace()),
    ("rock and walls", Field(_BOX, (_ROCK,)), FreeSpace((_ROCK,), _WALLS)),
    ("bent, with a hole", Field(_BENT, (Circle(1.5, 1.5, 0.5),)), FreeSpace()),
    ("disc", Field(Circle(0, 0, 2)), FreeSpace()),
)
_WIDTH = 0.5  # l


def main(replayed: str = "4", picture: str = "docs/coverage.png") -> None:
    robot = PRESETS["paper-control"]
    tracked = tracked_vehicle(robot, None, "head_centre", None)
    figure = Figure(figsize=(4 * len(_CASES), 4), layout="constrained")
    print(f"{'region':18}{'lanes':>6}{'share':>8}{'sure':>8}{'replayed':>10}{'time':>8}{'bound':>8}{'s':>6}")
    for k, (axes, (name, field, space)) in enumerate(zip(figure.subplots(1, len(_CASES)), _CASES, strict=True)):
        began = time.process_time()
        swept = cover(field, _WIDTH, tracked, PlanRequest(), space)
        spent = time.process_time() - began
        swept.plot(axes)
        found = ""
        if k < int(replayed):
            track = replay([swept.plan.schedule()])[0][["x_over_l", "y_over_l"]].to_numpy(float)
            axes.plot(*(100 * robot.tail_length * track.T), color=REPLAYED, lw=0.6, label="replayed")
            found = f"{share_covered(field, track, _WIDTH):.1%}"
        print(f"{name:18}{len(swept.lanes):6d}{swept.share:8.1%}{swept.sure:8.1%}{found:>10}"
              f"{swept.plan.duration:8.0f}{swept.bound:8.0f}{spent:6.1f}", flush=True)  # fmt: skip
    with whole_file(picture) as part:
        figure.savefig(part, format="png", dpi=110)
    print(f"-> {picture}")
