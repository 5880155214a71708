"""Settling: time stepping from rest until the motion is steady.

A robot starts from rest with straight tails and is stepped in time (`sim.march`). From time SETTLED on, means over
whole revolutions of the disc are compared with those of the revolutions before; it is converged when all of them
agree to DRIFT, and given up, flagged, at LONGEST. Every row is averaged over at least one whole revolution: with
N = 2 a fraction of a revolution biases ω_yr. A row whose Newton iteration fails is tried once more with half the
step.

This is the reference for the direct route (`sim.direct`), and finds the branch that straight tails reach from
rest, whether or not the tails move alike on it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from sim import direct
from sim.contact import tail_gap
from sim.march import PHASE, SURGE, SWAY, YAW, State
from sim.motion import STEPPING, Steady
from sim.resolution import Resolution
from sim.robot import Groups
from sim.run import Run
from sim.tail import TAIL_RADIUS, body_of

Floats = NDArray[np.float64]

SETTLED = 1.5  # time units before the first mean
LONGEST = 12.0  # give up then, or as soon after as one mean over whole revolutions is known
DRIFT = 2e-4  # relative change between consecutive means that counts as converged
_WINDOW = 0.5  # shortest averaging time
_CHUNK = 0.25  # time units between two looks at the means
_MEANS = [PHASE, YAW, SWAY, SURGE]
_GAP_SHAPES = 12  # shapes of the last revolution in which the gap between tails is measured


@dataclass(frozen=True)
class Settled:
    """How one robot ended."""

    means: Floats  # (4,): ω_t, ω_yr, v_x, v_z of the head's centre; NaN where failed
    drift: float
    converged: bool
    failed: bool
    gap: float
    state: State


def settle(groups: Groups, *, resolution: Resolution | None = None) -> Steady:
    """Step robots of one N from rest until their motion is steady.

    Args:
        groups: the robots; ω̄ may have either sign.
        resolution: mesh and step; by default what each robot needs.
    """
    rows = direct.bodies(groups)
    ended = []
    for row in rows:
        chosen = resolution or Resolution.fitting(row[0])
        found = settle_one(row, groups.N, chosen)
        ended.append(settle_one(row, groups.N, chosen.refined()) if found.failed else found)
    means = np.array([e.means for e in ended]).T
    failed = np.array([e.failed for e in ended])
    converged = np.array([e.converged for e in ended])
    drifts = [f"still drifting by {e.drift:.1e} a revolution" for e in ended]
    notes = np.where(failed, "Newton's method did not converge in a time step", np.where(converged, "", drifts))
    return Steady(
        omega_t=means[0],
        omega_h=(means[0] - rows[:, 0]) / np.array([body_of(row).gain for row in rows]),
        omega_yr=means[1],
        v_x=means[2],
        v_z=means[3],
        tail_gap=np.array([e.gap for e in ended]),
        error=np.full(len(rows), np.nan),
        converged=converged,
        failed=failed,
        method=np.full(len(rows), STEPPING),
        note=notes,
    )


def settle_one(row: Floats, tails: int, resolution: Resolution) -> Settled:
    """Step one robot (a row of `sim.direct.bodies`) from rest until its motion is steady."""
    run = Run(row, tails, resolution)
    dt = run.time_step
    count = math.ceil(_CHUNK / dt)
    poses = [np.zeros((1, 6))]
    lost = Settled(np.full(4, np.nan), np.nan, False, True, np.nan, run.state)
    while True:
        poses.append(run.steps(count, dt * count)[0])
        if run.failed:
            return lost
        time = dt * count * (len(poses) - 1)
        if time < SETTLED:
            continue
        track = np.concatenate(poses)
        means, drift, known = _means(np.arange(len(track)) * dt, track, row[0], tails)
        converged = known and drift < DRIFT
        if converged or (known and time > LONGEST) or time > 8 * LONGEST:
            break
    turn = max(_GAP_SHAPES, math.ceil(2 * np.pi / (abs(means[0]) * dt))) if known else _GAP_SHAPES
    _, shapes = run.steps(turn, dt * turn, shapes=turn)
    if run.failed:
        return lost
    some = shapes[:: max(1, turn // _GAP_SHAPES)]
    gap = min(tail_gap(shape, run.body.offset, row[TAIL_RADIUS]) for shape in some)
    return Settled(means, drift, converged, False, gap, run.state)


def _means(time: NDArray[Any], poses: Floats, omega: float, tails: int) -> tuple[Floats, float, bool]:
    """Rates (4,) over the last whole revolutions, their drift, and whether they are known.

    The drift compares the last window with the one before it; where one revolution outlasts the
    transient, with the same window an N-th of a revolution earlier, scaled up to a whole window.
    """
    phase = poses[:, PHASE] * np.sign(omega)
    unknown = np.full(4, np.nan), np.inf, False
    first = np.flatnonzero(np.diff(phase) <= 0).max(initial=-1) + 1  # from here on the disc only turns forward
    end, turn = phase[-1], 2 * np.pi
    speed = max(end / time[-1], 1e-6)
    window = turn * max(1, math.ceil(_WINDOW * speed / turn))
    shift = window / tails if window / speed > SETTLED else window
    oldest = end - shift - window
    if oldest < phase[first] or len(phase) - first < 4:
        return unknown
    start = max(first, int(np.searchsorted(phase, oldest)) - 4)
    table = np.column_stack([time, poses[:, _MEANS]])[start:]
    marks = CubicSpline(phase[start:], table)([end, end - window, end - shift, oldest])
    if marks[3, 0] < SETTLED:
        return unknown
    latest, before = _rates(marks[1], marks[0]), _rates(marks[3], marks[2])
    speed_scale = np.hypot(latest[2], latest[3])
    scale = np.array([abs(omega), abs(latest[1]), speed_scale, speed_scale])
    return latest, float((np.abs(latest - before) / scale).max() * window / shift), True


def _rates(start: Floats, end: Floats) -> Floats:
    difference = end - start
    return np.asarray(difference[1:] / difference[0])
