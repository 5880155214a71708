"""Tours of random places: time against the estimate and against all orders, and distances in the simulator.

Usage: python -m benchmarks tours [PICTURE]

Takes 8 minutes.
"""

from __future__ import annotations

from itertools import pairwise, permutations, product

import numpy as np
from matplotlib.figure import Figure

from benchmarks.pictures import draw_replayed, replayed, save_picture
from planner.jobs.planned_track import pivot_poses
from planner.jobs.tour import tour
from planner.jobs.travel_times import Travel
from planner.paths.distance import distance_to
from planner.paths.obstacles import FreeSpace
from planner.planning.plan import zigzag_drift
from planner.planning.request import PlanRequest
from planner.vehicle.dwell_choice import dwells_for
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from planner.vehicle.zigzag import zigzag
from sim.arrays import Floats
from sim.model.presets import PRESETS

_SIZES = (6, 12, 24)  # places of a tour
_REPLAYED = 6  # tours of as many places are replayed
_SETS = 6  # of places whose orders are all tried
_COURSES = 144  # tried then at each place


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
    try_all_orders(tracked)


def try_all_orders(tracked: TrackedVehicle) -> None:
    """Print by how much tours of five places are slower than the quickest of all orders, at most."""
    worst = dict.fromkeys(product((False, True), repeat=2), -1.0)
    for seed in range(_SETS):
        rng = np.random.default_rng(seed)
        places = rng.choice([2, 4, 8]) * rng.uniform(size=(5, 2))
        times = legs(tracked, places)
        for any_start, back in worst:
            result = tour(places.tolist(), tracked, PlanRequest(objective="time"), any_start=any_start, back=back)
            orders = (
                (*order, *order[: int(back)]) for order in permutations(range(5)) if any_start or not order[0]
            )
            least = min(time_of(order, times) for order in orders)
            worst[any_start, back] = max(worst[any_start, back], result.estimate / least - 1)
    for (any_start, back), slower in worst.items():
        print(f"any start {any_start}, return {back}: {_SETS} tours of five places, time at most {slower:+.2%} "
              f"from the quickest of all orders with {_COURSES} headings", flush=True)  # fmt: skip


def legs(tracked: TrackedVehicle, places: Floats) -> Floats:
    """Compute the times (n, C, n, C) between places with C directions of motion at each."""
    dwell = dwells_for(tracked.vehicle, "time", None)[0]
    straight = zigzag(tracked.vehicle, dwell, tracked.offset)
    drift = zigzag_drift(tracked, straight, dwell)
    courses = np.tile(2 * np.pi * np.arange(_COURSES) / _COURSES, (len(places), 1))
    poses = pivot_poses(places[:, None], courses, tracked, drift).reshape(-1, 3)
    travel = Travel.of(tracked, straight, FreeSpace(), drift, 0.0)
    times = travel.times(np.repeat(poses, len(poses), 0), np.tile(poses, (len(poses), 1)))
    return times.reshape(len(places), _COURSES, len(places), _COURSES)


def time_of(order: tuple[int, ...], times: Floats) -> float:
    """Compute the time of an order of places."""
    total = np.zeros(_COURSES)
    for here, there in pairwise(order):
        total = (total[:, None] + times[here, :, there]).min(0)
    return float(total.min())
