"""Tours of random places: time against the estimate and against other orders, and distances in the simulator.

Usage: python -m benchmarks tours [PICTURE]

Takes 5 minutes.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from benchmarks.pictures import draw_replayed, replayed, save_picture
from planner.jobs.tour import tour
from planner.paths.distance import distance_to
from planner.planning.request import PlanRequest
from planner.vehicle.tracked_point import tracked_vehicle
from sim.model.presets import PRESETS

_SIZES = (6, 12, 24)  # places of a tour
_REPLAYED = 6  # tours of as many places are replayed


def main(picture: str = "docs/tours.png") -> None:
    tracked = tracked_vehicle(PRESETS["paper-control"], None, "head_centre", None)
    figure = Figure(figsize=(4 * len(_SIZES), 4), layout="constrained")
    print(f"{'places':>7}{'seed':>5}{'time':>9}{'estimate':>10}{'gap':>7}{'off, predicted':>16}{'replayed':>10}")
    for axes, count in zip(figure.subplots(1, len(_SIZES)), _SIZES, strict=True):
        for seed in range(3):
            places = np.random.default_rng(seed).uniform(0, 2 * np.sqrt(count), (count, 2))
            result = tour(places.tolist(), tracked, PlanRequest(objective="time" if seed else "error"))
            off = ""
            if seed == 0:
                result.plot(axes)
            if seed == 0 and count == _REPLAYED:
                track = replayed(result.plan)
                draw_replayed(axes, result.plan, track)
                axes.legend(fontsize=7, frameon=False)
                off = f"{distance_to(track, places).max():10.3f}"
            print(f"{count:7d}{seed:5d}{result.plan.duration:9.0f}{result.estimate:10.0f}{result.gap:7.1%}"
                  f"{result.distance.max():16.3f}{off}", flush=True)  # fmt: skip
    save_picture(figure, picture)
