"""The stated error with feedback: what `planner.tracking.tracker` does with the poses of a camera.

The robot is within it in 95 % of the time, from the start of the path. The zigzag is uniform between ±A, where
0.95 A is the distance that it keeps in 95 % of the time. The tracker adds a normal error of variance

    (ZIGZAG A₉₅)² + (PLACE n)²/(m + 4) + (COURSE D)²,

n the standard deviation of a measured place, m the number of poses on STRETCH of the path, and D the way that the
robot makes until a pose has come in: what is uncertain of its course, currents above all, acts so far. The four
numbers were chosen so that the statement holds for 95 % of random robots, paths and cameras; `python -m benchmarks
feedback_error` measures it on others. A pose that is older than KEPT dwells is of no use; the error is then that
of the open loop. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math

import numpy as np

from planner.planning.camera import Camera
from sim.arrays import Floats

WITHIN = (1.96, 1.645)  # standard deviations on both sides that hold 95 % of a normal and of a uniform variable
BELOW = (1.645, 1.559)  # the same for the upper side alone
KEPT = 12  # dwells that the tracker remembers for late poses
ZIGZAG = 0.4
PLACE = 5.0
COURSE = 0.085  # rad
STRETCH = 0.3  # l


def feedback_error(
    distance: Floats, dwells: Floats, net_speed: float, time_scale: float, camera: Camera, stated: float
) -> float:
    """Compute the stated error with feedback.

    Args:
        distance: of the predicted track from the declared path, (M s + 1,), sampled s times in each dwell.
        dwells: (M,).
        net_speed: of straight motion.
        time_scale: the unit of time [s].
        camera: what measures the poses.
        stated: error of the open loop.
    """
    delay, received = camera.delay_s / time_scale, 1 - camera.lost
    if delay * len(dwells) > KEPT * dwells.sum() or received <= 0:
        return stated
    gap = camera.every_s / (time_scale * received)
    zigzag = _in_time(distance, dwells)
    poses = STRETCH / (net_speed * gap)
    place, course = PLACE * camera.noise[0] / math.sqrt(poses + 4), COURSE * net_speed * (delay + gap)
    spread = math.sqrt((ZIGZAG * zigzag) ** 2 + place**2 + course**2)
    return bound(-zigzag / 0.95, zigzag / 0.95, spread)


def bound(first: float, last: float, spread: float) -> float:
    """Bound in 95 % of all cases what is uniform between two values, with a normal error of deviation `spread`.

    The quantile of the sum lies between those of its parts: it goes with the cube of the uniform part of the
    variance, within 0.013 standard deviations. Far from zero only one side counts.
    """
    middle, uniform = abs(first + last) / 2, (first - last) * (first - last) / 12
    variance = uniform + spread * spread
    share, deviation = uniform / max(variance, 1e-30), math.sqrt(variance)
    share *= share * share
    within, below = ((normal + share * (even - normal)) * deviation for normal, even in (WITHIN, BELOW))
    return max(within, middle + below)


def _in_time(distance: Floats, dwells: Floats) -> float:
    """Return the distance within which a track is in 95 % of the time."""
    samples = (len(distance) - 1) // len(dwells)
    order = np.argsort(distance[1:], kind="stable")
    spent = np.cumsum(np.repeat(dwells / samples, samples)[order])
    return float(distance[1:][order][min(int(np.searchsorted(spent, 0.95 * spent[-1])), len(order) - 1)])
