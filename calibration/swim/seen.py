"""Poses of a swim that can be used: without outliers and turned headings, and with whole turns counted.

Outliers lie apart from lines that bend at the flips: the place x + i y and the axis exp(2 i ψ) are linear in time
between knots, which are the flips, and more within a long dwell. The values at the knots are fitted by the least
sum of distances, which a few wrong poses do not move (weights 1/distance, again and again).

A motor turns the robot by Ω D(t), D(t) = ∫ direction dt. What is left of the heading changes little from pose to
pose: where it jumps by half a turn, front and rear are exchanged; whole turns are the camera's. A jump of another
size is a gap in which the robot turned, or the motor flipped, unseen.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import solveh_banded

from calibration.swim.flips import Motor
from common.arrays import Complex, Flags, Floats
from common.errors import InputError
from common.units import format_time

_FAR = 12.0  # usual distances from the lines; noise and the robot's lag keep within 7
_MOST = 0.1  # share of outliers
_ROUNDS = 10
_JUMP = 4.0  # median turns
_QUARTER = math.pi / 2


def outliers(time: Floats, poses: Floats, motor: Motor) -> Flags:
    """Tell which poses (n, 3) jump away and back; n times [s].

    Raises:
        InputError: they are many.
    """
    dwells = np.diff(motor.flips)
    pieces = np.maximum(np.rint(dwells / np.median(dwells)), 1).astype(int)
    knots = np.interp(np.arange(pieces.sum() + 1), np.append(0, np.cumsum(pieces)), motor.flips)
    # The lines go through as many poses as there are knots: the usual distance is the median of the others.
    usual, far = min((1 + len(knots) / len(time)) / 2, 1 - _MOST), np.zeros(len(time), bool)
    for values in (poses[:, 0] + 1j * poses[:, 1], np.exp(2j * poses[:, 2])):
        distance = _distances(time, values, knots)
        far |= distance > _FAR * np.quantile(distance, usual)
    if far.mean() > _MOST:
        raise InputError(
            f"{far.sum()} of {len(far)} poses jump away from the others (the first at {time[far][0]:g} s), or the "
            "motor flips at other times; check how the robot was tracked"
        )
    return far


def _distances(time: Floats, values: Complex, knots: Floats) -> Floats:
    """Return how far values (n,) are from a line that bends at knots (K,)."""
    piece = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(knots) - 2)
    share = (time - knots[piece]) / np.diff(knots)[piece]
    values, weight = values - values[len(values) // 2], np.ones(len(time))

    def sums(left: Floats, right: Floats) -> Floats:
        return np.asarray(np.bincount(piece, left, len(knots)) + np.bincount(piece + 1, right, len(knots)))

    for _ in range(_ROUNDS):
        one, two = weight * (1 - share), weight * share
        diagonal, beside = sums(one * (1 - share), two * share), np.bincount(piece, one * share, len(knots))
        bands = np.stack([np.append(0.0, beside[:-1]), diagonal + 1e-9 * diagonal.max()])  # knots without poses
        sides = np.stack([sums(one * part, two * part) for part in (values.real, values.imag)], 1)
        at = solveh_banded(bands, sides) @ [1, 1j]
        distance = np.abs(values - (1 - share) * at[piece] - share * at[piece + 1])
        weight = 1 / np.maximum(distance, max(float(np.median(distance)), 1e-12))
    return distance


def told(time: Floats, wrong: Flags, what: str) -> list[str]:
    """Say how many poses (n,) are left out, and when the first was."""
    many = int(wrong.sum())
    return [f"{many} of {len(time)} poses {what} (the first at {time[wrong][0]:g} s); left out"] if many else []


def continuous(time: Floats, heading: Floats, motor: Motor) -> tuple[Floats, Flags, list[str]]:
    """Count the turns of headings (n,) [rad]; return them without jumps, which are used, and what was left out.

    Raises:
        InputError: the robot turns too far between two poses, or to the other side than its motor makes it.
    """
    steps, motion = np.diff(time), np.diff(motor.turned(time))
    shortest, usual = np.diff(motor.flips).min(), np.median(steps)
    turn = np.remainder(np.diff(heading) + math.pi, math.tau) - math.pi
    near = (steps <= 2 * usual) & (np.abs(turn) <= _JUMP * np.median(np.abs(turn)))
    rate = float(turn[near] @ motion[near]) / float(motion[near] @ motion[near] or math.inf)
    if abs(rate) * usual > _QUARTER:
        raise InputError("the robot turns by half a turn or more between two poses; take more pictures per second")
    if rate < 0:
        raise InputError(
            "the robot turns to the other side than its motor makes it (seen from above, direction 1 turns to the "
            "left): change the signs of y_cm and heading_deg if y points down, or that of direction"
        )
    jump = np.remainder(np.diff(heading) - rate * motion + math.pi, math.tau) - math.pi
    long = steps > max(shortest, 2 * usual)
    exchanged = ~long & (np.abs(jump) > _QUARTER)
    jump -= math.pi * np.sign(jump) * exchanged
    begin, end = motor.unseen.T
    blind = np.searchsorted(begin, time[1:]) > np.searchsorted(end, time[:-1], side="right")
    most = np.where(blind, min(_QUARTER, rate * shortest), _QUARTER)  # two flips would change it by twice that
    most[blind & (np.diff(np.searchsorted(motor.flips, time)) > 0)] = 0.0  # a flip at an unknown time, or three
    cuts = np.flatnonzero(long & (np.abs(jump) >= most)) + 1
    ends = np.array([0, *cuts, len(time)])
    part = int(np.argmax(np.diff(ends)))
    inside = np.zeros(len(time), bool)
    inside[ends[part] : ends[part + 1]] = True
    side = np.append(0, np.cumsum(exchanged)) % 2
    front = int(side[inside].mean() > 0.5)
    turned = side != front
    whole = heading[0] + math.pi * front + np.append(0.0, np.cumsum(rate * motion + jump))
    said = told(time[inside], turned[inside], "are turned by half a turn")
    if len(cuts):
        first, last = time[inside][[0, -1]]
        said.append(
            f"in {len(cuts)} gaps (the first at {time[cuts[0] - 1]:g} s) the robot turned, or its motor flipped, "
            f"unseen; kept is the longest part, {format_time(first)} to {format_time(last)}"
        )
    return whole, inside & ~turned, said
