"""Distances between three robots that cross each other's ways in one tank, replayed in the simulator; ten robots.

Usage: python -m benchmarks fleets [PICTURE]

The third robot must leave its start before the first one passes there, and makes a waiting circle. Then up to ten
robots cross one place, from all sides.

Takes four minutes.
"""

from __future__ import annotations

import time
from itertools import combinations

import numpy as np

from planner.files.pictures import draw_fleet_plan
from planner.jobs.fleet import Member, fleet
from planner.jobs.separation import Places, distances
from planner.planning.plan import plan
from sim.io.files import whole_file
from sim.model.presets import PRESETS
from sim.motion.replay import replay

PATHS = {
    "first": [(-1.0, -3.0), (-1.0, 3.5)],
    "second": [(3.2, -2.8), (3.2, 3.5)],
    "third": [(0.0, 0.0), (6.0, 0.0)],
}
_APART = 0.03  # m
_RADIUS = 6.0  # l, around the place that many cross


def main(picture: str = "docs/fleet.png") -> None:
    robot = PRESETS["paper-control"]
    members = [Member.of(name, plan(np.array(points), robot)) for name, points in PATHS.items()]
    for feedback in (True, False):
        began = time.process_time()
        result = fleet(members, _APART, feedback=feedback)
        print(f"{'with feedback' if feedback else 'open loop'}, {time.process_time() - began:.1f} s of CPU")
        print("\n".join(f"  {line}" for line in result.lines()), flush=True)
    times = np.arange(0.0, result.duration_s, 0.5)
    places = []
    for each in result.scheduled:
        track = replay([each.motion.plan.schedule()])[0]
        columns = [track[name].to_numpy(float) for name in ("x_over_l", "y_over_l", "heading_rad")]
        known, length = track["time_s"].to_numpy(float), robot.tail_length
        poses = np.stack([np.interp(times - each.begin, known, column) for column in columns], 1)
        replayed = Places(each.motion.body, poses * [length, length, 1.0], np.zeros(len(times)))
        away = np.hypot(*(replayed.poses - each.places(times).poses)[:, :2].T)
        largest = float(each.motion.error(np.array([each.motion.duration]))[0])
        print(
            f"  replayed: {100 * away.max():.2f} cm from its place at most; error in place {100 * largest:.2f} cm"
        )
        places.append(replayed)
    least = min(float(distances(*pair).min()) for pair in combinations(places, 2))
    print(f"least distance in the simulator {100 * least:.2f} cm, asked for {100 * _APART:.2f} cm")
    figure = draw_fleet_plan(result)
    with whole_file(picture) as part:
        figure.savefig(part, format="png", dpi=90)
    print(f"-> {picture}")
    for count in (2, 5, 10):
        plans = [plan(path, robot, objective="time") for path in star(count)]
        members = [Member.of(f"robot-{k}", each) for k, each in enumerate(plans)]
        began = time.process_time()
        result = fleet(members, _APART)
        cpu, alone = time.process_time() - began, max(each.seconds.sum() for each in plans) / 60
        print(
            f"{count} robots across one place: timed in {cpu:.1f} s of CPU, the last ends after "
            f"{result.duration_s / 60:.0f} min, alone after {alone:.0f}; {100 * result.sure_m:.2f} cm apart",
            flush=True,
        )


def star(count: int) -> list[np.ndarray]:
    """Make straight paths across a circle; none ends where another begins."""
    begin = np.pi * (2 * np.arange(count) / count + 0.3 / count)
    end = begin + np.pi * (1 + (count % 2 == 0) / count)
    return list(
        _RADIUS * np.stack([[np.cos(begin), np.sin(begin)], [np.cos(end), np.sin(end)]]).transpose(2, 0, 1)
    )
