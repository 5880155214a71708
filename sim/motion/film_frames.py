"""The robot at equal times of a schedule, simulated: poses, bent tails, and the motor's direction.

Lengths are in l, times in μ0 l⁴/EI. Tails are seen from above.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sim.arrays import Floats, Integers
from sim.io.errors import InputError
from sim.mechanics import planar
from sim.model.schedule import Schedule
from sim.motion.replay import run_at_rest
from sim.motion.run import Run
from sim.solve.march import PHASE, YAW, X, Y


class Frames(NamedTuple):
    """What a camera above the tank sees, F times."""

    times: Floats  # (F,)
    poses: Floats  # (F, 3): x, y and heading of the head's centre
    tails: Floats  # (F, N, n + 1, 2): each from its clamp to its tip
    directions: Integers  # (F,): of the motor, +1 or −1
    track: Floats  # (K, 3): time, x and y of the head's centre at every step


def film_frames(schedule: Schedule, times: Floats, *, progress: Callable[[int], object] | None = None) -> Frames:
    """Simulate a schedule and note the robot at times that increase, (F,).

    Raises:
        InputError: the schedule cannot be simulated.
    """
    run = run_at_rest(schedule)
    head_length = schedule.robot["L_over_R"] / schedule.robot["l_over_R"]
    poses, tails, directions = [], [], []
    track = [np.zeros((1, 3))]
    now, direction = 0.0, schedule.first_direction
    ends = np.cumsum(schedule.dwells)
    dwell_of_frame = np.minimum(np.searchsorted(ends, times, side="right"), len(ends) - 1)
    for index, dwell_end in enumerate(ends.tolist()):
        if index:
            run.flip()
            direction = -direction
        for end in (*times[dwell_of_frame == index].tolist(), None):
            until = dwell_end if end is None else end
            if until > now:
                steps, moved = run.go(until - now)
                track.append(np.column_stack([now + steps, moved[:, [X, Y]]]))
                now = until
            if run.failed:
                raise InputError(f"the simulation failed in dwell {index + 1} of the schedule")
            if end is not None:
                pose = planar.compose(np.array(schedule.start), run.state.pose[[X, Y, YAW]])
                poses.append(pose)
                tails.append(_from_above(_in_body_frame(run), pose, head_length))
                directions.append(direction)
        if progress is not None:
            progress(1)
    path = np.concatenate(track)
    x, y, heading = schedule.start
    path[:, 1:] = planar.turn(path[:, 1:], heading) + np.array([x, y])
    return Frames(times, np.array(poses), np.array(tails), np.array(directions), path)


def _in_body_frame(run: Run) -> Floats:
    """Turn each tail with the disc: (N, n + 1, 3), from the frames of the clamps to that of the body."""
    shape = run.state.x
    count = shape.shape[1]
    root = np.zeros((1, count, 3))
    root[:, :, 0] = run.body.offset
    nodes = np.concatenate([root, shape]).transpose(1, 0, 2)
    turn = run.state.pose[PHASE] + 2 * np.pi * np.arange(count)[:, None] / count
    cos, sin = np.cos(turn), np.sin(turn)
    return np.stack([cos * nodes[..., 0] - sin * nodes[..., 1], sin * nodes[..., 0] + cos * nodes[..., 1],
                     nodes[..., 2]], -1)  # fmt: skip


def _from_above(points: Floats, pose: Floats, head_length: float) -> Floats:
    """Place points (…, 3) of the body frame, whose origin is the disc's centre, in the lab: (…, 2)."""
    forward, left = points[..., 2] - head_length / 2, points[..., 0]
    return np.asarray(pose[:2] + planar.turn(np.stack([forward, left], -1), pose[2]))
