"""Planar rigid motion: poses and twists in the plane seen from above.

A pose is (x, y, ψ): position, and heading ψ counter-clockwise from x (docs/reference/signs.md). A twist is
(forward, left, yaw rate) in the body frame. Constant for a time T, it moves the body along an arc:

    p(T) = ( sin Ω T/Ω   −(1 − cos Ω T)/Ω ; (1 − cos Ω T)/Ω   sin Ω T/Ω ) (v_forward, v_left),  ψ = Ω T.

The robot's surge v_z is forward and its sway v_x is left (yaw takes e_z towards e_x). Arrays are (..., 3).
Source: exponential map of SE(2), e.g. Murray, Li, Sastry (1994), ch. 2.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from common.arrays import Floats
from sim.jit import formula

Poses = Floats  # (..., 3)
POSE = tuple[float, float, float]  # one, in plain numbers

MIRROR = np.array([1.0, -1.0, -1.0])  # reflection about the body's axis: what a reversed motor does


def turn(vector: Floats, angle: ArrayLike) -> Floats:
    """Rotate plane vectors (..., 2) by angle [rad] (...)."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vector[..., 0], vector[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], -1)


def compose(first: Poses, then: Poses) -> Poses:
    """Compute the pose reached by `then`, given in the frame of `first`."""
    first, then = np.broadcast_arrays(first, then)
    moved = first[..., :2] + turn(then[..., :2], first[..., 2])
    return np.concatenate([moved, first[..., 2:] + then[..., 2:]], -1)


def inverse(pose: Poses) -> Poses:
    """Invert `pose`: compose(pose, inverse(pose)) is no motion."""
    back = -turn(pose[..., :2], -pose[..., 2])
    return np.concatenate([back, -pose[..., 2:]], -1)


def between(start: Poses, end: Poses) -> Poses:
    """Return `end` seen from `start`: compose(start, between(start, end)) = end."""
    return compose(inverse(start), end)


def arc(twist: Poses, time: ArrayLike) -> Poses:
    """Compute the pose after holding `twist` (..., 3) for `time` (...)."""
    time = np.asarray(time, dtype=float)
    angle = twist[..., 2] * time
    half = angle / 2
    # sin Ω T/Ω and (1 − cos Ω T)/Ω through sinc: exact for Ω → 0.
    along = time * np.sinc(angle / np.pi)
    across = time * np.sinc(half / np.pi) * np.sin(half)
    forward, left = twist[..., 0], twist[..., 1]
    return np.stack([along * forward - across * left, across * forward + along * left, angle], -1)


def net_speed(twist: Poses, lag: Poses, dwell: ArrayLike) -> Floats:
    """Compute the net speed of a zigzag with equal dwells (...), each a `lag` (..., 3) and then an arc of `twist`.

    The second dwell is the mirror image of the first, since a reversed motor mirrors the motion.
    """
    numbers: Any = (*np.moveaxis(lag, -1, 0), *np.moveaxis(twist, -1, 0), np.asarray(dwell))
    speeds: Floats = zigzag_speed(*numbers)
    return speeds


@formula
def zigzag_speed(ahead: Any, aside: Any, turned: Any, forward: Any, left: Any, yaw_rate: Any, dwell: Any) -> Any:
    """Return the net speed of a zigzag from the numbers of lag and twist, see `net_speed`.

    A dwell and its mirror image, p + Rot(ψ) M p, are 2 |p · (cos ψ/2, sin ψ/2)|; on an arc p is a chord.
    """
    half, turn = yaw_rate * dwell / 2, turned / 2
    along = dwell * np.sinc(half / np.pi) * (forward * np.cos(turn) - left * np.sin(turn))
    return np.abs(ahead * np.cos(turn + half) + aside * np.sin(turn + half) + along) / dwell


@formula
def slip(sideways: Any, current_x: Any, current_y: Any, heading: Any) -> Any:
    """Return the angle from a heading to the direction of motion.

    The robot goes along the heading at speed 1, `sideways` to the left of it, and with a current in the lab.
    """
    c, s = np.cos(heading), np.sin(heading)
    return np.arctan2(sideways - current_x * s + current_y * c, 1 + current_x * c + current_y * s)
