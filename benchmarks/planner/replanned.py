"""The rest of a path of robots that were moved, replayed in the simulator.

Usage: python -m benchmarks replanned [PICTURE]

In each case a robot follows a part of its plan, and is then put elsewhere at rest.

Takes 2 minutes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.pictures import draw_replayed, replayed, save_picture
from planner.jobs.clear_plan import plan_clear
from planner.jobs.cover import cover
from planner.jobs.region import Field
from planner.paths.distance import distance_to
from planner.paths.obstacles import Circle, FreeSpace, Polygon
from planner.paths.path import Path2D, polygon
from planner.planning.plan import make_plan
from planner.planning.planned import Plan
from planner.planning.request import PlanRequest
from planner.tracking.rest import Rest, rest_of
from planner.vehicle.tracked_point import tracked_vehicle
from sim.arrays import Floats
from sim.model.presets import PRESETS

TRACKED = tracked_vehicle(PRESETS["paper-control"], None, "head_centre", None)
QUICK = PlanRequest(objective="time")


class Case(NamedTuple):
    """A plan, the share of its dwells that is followed, and where the robot is then put: x, y [l], heading."""

    title: str
    plan: Callable[[], Plan]
    share: float
    pose: tuple[float, float, float]


def _around_a_rock() -> Plan:
    line = Path2D.of([[0.0, 0.0], [6.0, 0.0]])
    return plan_clear(line, TRACKED, QUICK, FreeSpace((Circle(3.0, 0.2, 0.5),)))


def _lanes() -> Plan:
    field = Field(Polygon.of([[0, 0], [3, 0], [3, 2], [0, 2]]), ())
    return cover(field, 0.5, TRACKED, QUICK, FreeSpace()).plan


CASES = (
    Case("a square", lambda: make_plan(polygon(4, 3.0), TRACKED, QUICK), 0.45, (0.6, 0.2, 2.0)),
    Case("around a rock", _around_a_rock, 0.25, (3.2, -1.2, 3.0)),
    Case("coverage", _lanes, 0.55, (3.4, 2.6, 0.5)),
)


def main(picture: str = "docs/replanned.png") -> None:
    figure = Figure(figsize=(12, 4.2), layout="constrained")
    print(f"{'':16}{'dwells':>8}{'followed':>10}{'way':>7}{'left out':>10}{'stated':>8}{'replayed':>10}{'end':>7}")
    for case, axes in zip(CASES, figure.subplots(1, len(CASES)).tolist(), strict=True):
        plan = case.plan()
        count = round(case.share * len(plan.dwells))
        times = np.concatenate([[0.0], np.cumsum(plan.dwells[:count])])
        rest = rest_of(plan, np.append(times, times[-1] + 10), np.vstack([plan.poses[: count + 1], case.pose]))
        track = replayed(rest.plan)
        largest = float(distance_to(rest.plan.reference, track).max())
        end = float(np.hypot(*(track[-1] - plan.reference[-1])))
        print(f"{case.title:16}{len(rest.plan.dwells):8d}{rest.followed:10.2f}{rest.way:7.2f}{rest.left_out:10.2f}"
              f"{rest.plan.stated_error:8.3f}{largest:10.3f}{end:7.3f}", flush=True)  # fmt: skip
        _draw(axes, case.title, plan.track[: 8 * count + 1], rest, track)  # eight samples a dwell
    save_picture(figure, picture)


def _draw(axes: Axes, title: str, before: Floats, rest: Rest, track: Floats) -> None:
    """Draw the track so far, the rest as planned, and the rest as replayed, on axes in cm."""
    cm = 100 * rest.plan.robot.tail_length
    if rest.plan.kept_clear is not None:
        from planner.planning.picture import draw_regions

        draw_regions(axes, rest.plan.kept_clear.free_space, rest.plan.robot.tail_length)
    axes.plot(*(cm * before.T), color="0.6", lw=2.5, label="followed so far")
    axes.plot(*(cm * rest.plan.reference.T), color="black", lw=1.2, ls="--", label="way back and rest of the path")
    draw_replayed(axes, rest.plan, track, 1.0)
    x, y, heading = rest.plan.start
    axes.plot(cm * x, cm * y, "o", color="#c8452f", ms=6, label="here the robot was put")
    axes.annotate("", (cm * (x + 0.5 * np.cos(heading)), cm * (y + 0.5 * np.sin(heading))), (cm * x, cm * y),
                  arrowprops={"arrowstyle": "->", "color": "#c8452f", "lw": 1.5})  # fmt: skip
    axes.set_aspect("equal")
    axes.set_title(title)
    axes.set_xlabel("x [cm]")
    axes.set_ylabel("y [cm]")
    if title == CASES[0].title:
        axes.legend(fontsize=8, frameon=False, loc="center")


if __name__ == "__main__":
    main()
