"""How the errors of a vehicle grow along a schedule: deviations from the predicted poses, to first order.

A mode of the vehicle changes its twists, its lags or the current. In each dwell it changes the move and the turn;
a turn tilts everything that comes later.

The lag after a flip also varies with the phase φ of the disc at that flip: N waves in a turn, with the standard
deviation `Vehicle.spread`. The motor's speed tells how far the disc turns from flip to flip, so only the first
phase is unknown, and where in the wave it lies. The lags of each direction thus vary as A cos Nφ + B sin Nφ, with
independent A and B of mean 0 and variance 1: two modes for each direction. Where φ comes back at every second
flip, as with equal dwells, these errors add up; elsewhere they average out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planner.vehicle.rollout import Rollout, Switches
from planner.vehicle.vehicle import Mode, Vehicle, interpolated
from sim.arrays import Floats, Integers
from sim.mechanics import planar


class ErrorGrowth(NamedTuple):
    """Deviations of one standard deviation of each of P modes at E flips, the first and the last among them.

    The modes are those of the vehicle, and then four of the disc's phase.
    """

    flips: Integers  # (E,), their numbers; the last one is the end of the schedule
    deviation: Floats  # (E, P, 2), from the predicted position
    turned: Floats  # (E, P), of the heading


def error_growth(vehicle: Vehicle, switches: Switches, rollout: Rollout, flips: Integers) -> ErrorGrowth:
    """Propagate the modes of a vehicle, and those of its disc's phase, to some flips of a schedule.

    Args:
        vehicle: with its modes and its spread.
        switches: the schedule.
        rollout: what the vehicle does on it.
        flips: their numbers (E,), increasing, from 0 to that of all dwells.
    """
    dwells, count = switches.dwells, len(switches.dwells)
    side = (np.arange(count) + (switches.first_direction < 0)) % 2
    moves_predicted, poses = rollout.changes, rollout.poses
    circle = planar.arc(vehicle.twist[side], dwells)
    lag = planar.compose(moves_predicted, planar.inverse(circle))
    steps = np.diff(poses[:, :2], axis=0)
    of_phase = _phase_lags(vehicle, side, dwells)
    modes = [*vehicle.modes, *(Mode("phase of the disc", np.zeros((2, 3))) for _ in of_phase)]
    lags = [*_mode_lags(vehicle, side, dwells), *of_phase]
    deviation, turned = np.zeros((len(flips), len(modes), 2)), np.zeros((len(flips), len(modes)))
    for p, mode in enumerate(modes):
        arc = planar.arc((vehicle.twist + mode.twist)[side], dwells) if mode.twist.any() else circle
        change = planar.compose(lag + lags[p], arc) - moves_predicted
        heading = np.concatenate([[0.0], np.cumsum(change[:, 2])])
        moves = planar.turn(change[:, :2], poses[:-1, 2]) + mode.current * dwells[:, None]
        moves += heading[:-1, None] * np.stack([-steps[:, 1], steps[:, 0]], 1)
        position = np.concatenate([np.zeros((1, 2)), np.cumsum(moves, 0)])
        deviation[:, p], turned[:, p] = position[flips], heading[flips]
    return ErrorGrowth(flips, deviation, turned)


def _phase_lags(vehicle: Vehicle, side: Integers, dwells: Floats) -> list[Floats]:
    """Return what the four modes of the disc's phase add to the lags (M, 3) of the dwells (M,)."""
    turned = np.cumsum(vehicle.phase_rate[side] * dwells)
    phase = np.concatenate([[0.0], turned[:-1]])  # N φ at the flip before each dwell, from that of the first one
    added = []
    for index in (0, 1):
        spread = np.zeros((len(dwells), 3))
        spread[side == index] = vehicle.lag_noise(1 - 2 * index, dwells[side == index])
        added += [spread * np.cos(phase)[:, None], spread * np.sin(phase)[:, None]]
    return added


def _mode_lags(vehicle: Vehicle, side: Integers, dwells: Floats) -> list[Floats | float]:
    """Return what each mode adds to the lags (M, 3) of the dwells (M,) in directions `side` (M,)."""
    before = np.concatenate([dwells[:1], dwells[:-1]])
    with_lag = [p for p, mode in enumerate(vehicle.modes) if mode.lag is not None]
    added: list[Floats | float] = [0.0] * len(vehicle.modes)
    if not with_lag:
        return added
    lags = np.empty((len(dwells), len(with_lag), 3))
    for index in (0, 1):
        tables = np.stack([vehicle.modes[p].lag[index] for p in with_lag], 2)  # type: ignore[index]
        lags[side == index] = interpolated(tables, before[side == index], dwells[side == index])
    for place, p in enumerate(with_lag):
        added[p] = lags[:, place]
    return added
