"""Tracks of robots that swim a plan open loop, as a camera sees them.

The truth is the replay of the schedule with all its time steps. At each flip a kick may move the robot and what it
does later, rigidly. A current carries it along in the lab. The camera follows a marker, has a scale of its own,
and adds noise to x, y and heading: white, and slow (Ornstein-Uhlenbeck).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pandas as pd

from common.arrays import Flags, Floats
from planner.planning.plan import Plan
from sim.mechanics import planar
from sim.model.robot import Robot
from sim.model.schedule import Schedule
from sim.motion.replay import stretches
from sim.motion.run import Resolution
from sim.solve.march import YAW, X, Y
from tests.shared import shared

Spans = tuple[tuple[float, float], ...]  # begin and end of each [s], the motor starts at 0


class CameraNoise(NamedTuple):
    """What a camera adds to places [m] and headings [rad], as standard deviations, and how often it looks."""

    every: float = 0.5  # s between pictures
    white: tuple[float, float] = (3e-4, math.radians(0.5))  # of x, as of y; of the heading
    slow: tuple[float, float] = (3e-4, math.radians(0.5))
    memory: float = 10.0  # s, of the slow part

    def draw(self, time: Floats, rng: np.random.Generator) -> Floats:
        """Draw noise (n, 3) of x, y and heading."""
        white, slow = (np.array([place, place, heading]) for place, heading in (self.white, self.slow))
        kept = np.exp(-np.diff(time, prepend=-np.inf) / self.memory)[:, None]
        part = np.sqrt(1 - kept**2) * rng.standard_normal((len(time), 3))
        for later in range(1, len(time)):
            part[later] += kept[later] * part[later - 1]
        return np.asarray(white * rng.standard_normal((len(time), 3)) + slow * part)


class Swum(NamedTuple):
    """What a robot did."""

    times: Floats  # (K,) [s]
    poses: Floats  # (K, 3) of the head's centre [m, rad], the heading without jumps
    flips: Floats  # (M + 1,) [s]: start, M − 1 flips, end

    def at(self, time: Floats) -> Floats:
        """Interpolate poses at times (n,)."""
        return np.stack([np.interp(time, self.times, each) for each in self.poses.T], 1)

    def carried(self, kicks: Floats) -> Floats:
        """Compute the rigid motion (M, 3) that kicks (M − 1, 3) at the flips, in the robot's frame, add to it."""
        motion = [np.zeros(3)]
        for there, kick in zip(self.at(self.flips[1:-1]), kicks, strict=True):
            moved = planar.compose(planar.compose(there, kick), planar.inverse(there))
            motion.append(planar.compose(motion[-1], moved))
        return np.array(motion)


def swum(truth: Robot, plan: Plan, resolution: Resolution | None = None) -> Swum:
    """Simulate a robot that swims a plan of any robot; mesh and step by default as of a replay."""
    schedule, length, second = plan.schedule(truth), truth.length_scale, truth.time_scale
    times, moved = _replayed(schedule, resolution)
    poses = planar.compose(np.array(schedule.start), moved) * [length, length, 1.0]
    return Swum(second * times, poses, second * np.append(0.0, np.cumsum(schedule.dwells)))


@shared
def _replayed(schedule: Schedule, resolution: Resolution | None) -> tuple[Floats, Floats]:
    """Return the times (K,) of a replay, and x, y and yaw (K, 3) at them."""
    parts = list(stretches(schedule, resolution=resolution))
    times = np.concatenate([[0.0], *(part.times for part in parts)])
    return times, np.concatenate([np.zeros((1, 6)), *(part.poses for part in parts)])[:, [X, Y, YAW]]


def make_track(
    truth: Robot, plan: Plan, *, seed: int, camera: CameraNoise | None = None,
    resolution: Resolution | None = None, kick: tuple[float, float] = (0.0, 0.0),
    current: tuple[float, float] = (0.0, 0.0), later_current: tuple[float, float] | None = None,
    marker: tuple[float, float, float] = (0.0, 0.0, 0.0), scale: float = 1.0, clock: float = 0.0,
    rest: tuple[float, float] = (0.0, 0.0), lost: Spans = (), frozen: Spans = (), turned: Spans = (),
    outliers: float = 0.0,
) -> pd.DataFrame:  # fmt: skip
    """Make the track of a robot that swims a plan open loop, as a camera sees it.

    Args:
        truth: the robot; seconds and metres of the plan stay.
        plan: of any robot.
        seed: of kicks, noise and outliers.
        camera: its noise, and how often it looks; default: `CameraNoise()`.
        resolution: as of `swum`.
        kick: standard deviations of a step at each flip: along x and y [m], of the heading [rad].
        current: of the fluid, along x and y of the lab [m/s], from the first picture to the last.
        later_current: the same from half of the schedule on; default: as before.
        marker: what is followed, ahead of the head's centre and left of it [m], and askew of its heading [rad].
        scale: of the camera, a factor on places about the origin.
        clock: what the camera's clock shows when the motor starts [s].
        rest: time for which the camera looks at the robot before the motor starts and after it stops [s].
        lost: spans without pictures.
        frozen: spans in which the last picture before them is repeated.
        turned: spans in which the heading is seen turned by 180°.
        outliers: share of pictures with a wrong pose, up to 10 cm away along x and y, and turned at random.

    Returns:
        time_s, x_cm, y_cm, heading_deg from −180 to 180, and direction of the motor, 0 where it rests.
    """
    rng, swim = np.random.default_rng(seed), swum(truth, plan, resolution)
    end, kicks = swim.flips[-1], rng.standard_normal((len(swim.flips) - 2, 3)) * [kick[0], kick[0], kick[1]]
    camera = camera or CameraNoise()
    time = np.arange(-rest[0], end + rest[1] + 1e-9, camera.every)
    dwell = np.clip(np.searchsorted(swim.flips, time, side="right") - 1, 0, len(kicks))
    seen = planar.compose(swim.carried(kicks)[dwell], swim.at(time))
    later = np.maximum(time - end / 2, 0.0)
    seen[:, :2] += np.outer(time + rest[0] - later, current) + np.outer(later, later_current or current)
    seen = planar.compose(seen, np.array(marker)) * [scale, scale, 1.0] + camera.draw(time, rng)
    seen[:, 2] += np.pi * _within(time, turned)
    wrong = rng.random(len(time)) < outliers
    seen[wrong] += rng.uniform(-1, 1, (wrong.sum(), 3)) * [0.1, 0.1, np.pi]
    for span in frozen:
        seen[_within(time, (span,))] = seen[time < span[0]][-1]
    columns = {
        "time_s": time + clock, "x_cm": 100 * seen[:, 0], "y_cm": 100 * seen[:, 1],
        "heading_deg": np.degrees((seen[:, 2] + np.pi) % (2 * np.pi) - np.pi),
        "direction": plan.first_direction * (-1) ** dwell * ((time >= 0) & (time < end)),
    }  # fmt: skip
    return pd.DataFrame(columns)[~_within(time, lost)].reset_index(drop=True)


def _within(time: Floats, spans: Spans) -> Flags:
    """Tell which times (n,) are in any of the spans."""
    return np.array([(time >= begin) & (time < end) for begin, end in spans]).any(0) | np.zeros(len(time), bool)
