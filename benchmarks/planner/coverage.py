"""Coverage of four regions: share and time as planned, and share in the simulator.

Usage: python -m benchmarks coverage [REPLAYS] [PICTURE]

The first REPLAYS plans are replayed.

Takes 10 minutes.
"""

from __future__ import annotations

import time

from matplotlib.figure import Figure

from benchmarks.pictures import draw_replayed, replayed, save_picture
from planner.jobs.cover import cover
from planner.jobs.region import Field, share_covered
from planner.paths.obstacles import Circle, FreeSpace, Polygon
from planner.planning.request import PlanRequest
from planner.vehicle.tracked_point import tracked_vehicle
from sim.model.presets import PRESETS

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


def main(replays: str = "4", picture: str = "docs/coverage.png") -> None:
    tracked = tracked_vehicle(PRESETS["paper-control"], None, "head_centre", None)
    figure = Figure(figsize=(4 * len(_CASES), 4), layout="constrained")
    print(f"{'region':18}{'lanes':>6}{'share':>8}{'sure':>8}{'replayed':>10}{'time':>8}{'bound':>8}{'s':>6}")
    for k, (axes, (name, field, space)) in enumerate(zip(figure.subplots(1, len(_CASES)), _CASES, strict=True)):
        began = time.process_time()
        swept = cover(field, _WIDTH, tracked, PlanRequest(), space)
        spent = time.process_time() - began
        swept.plot(axes)
        found = ""
        if k < int(replays):
            track = replayed(swept.plan)
            draw_replayed(axes, swept.plan, track, 0.6)
            found = f"{share_covered(field, track, _WIDTH):.1%}"
        print(f"{name:18}{len(swept.lanes):6d}{swept.share:8.1%}{swept.sure:8.1%}{found:>10}"
              f"{swept.plan.duration:8.0f}{swept.bound:8.0f}{spent:6.1f}", flush=True)  # fmt: skip
    save_picture(figure, picture)
