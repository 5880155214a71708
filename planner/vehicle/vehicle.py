"""The robot as a vehicle for the planner: an arc in each direction of the motor, and a memory of the last dwell.

In motor direction σ = ±1 the robot moves on a circle with a constant body twist. A dwell of length T that follows
a dwell of length S moves it by

    E_σ(T | S) = lag_σ(T | S) ∘ arc(twist_σ, T).

The lag is what the tails lose or gain while they turn over (`sim.model.response`). The first dwell starts from
rest and has a lag of its own. The two directions have their own numbers, so left and right turns may differ. On a
schedule the pose changes of the dwells are composed one after another.

Lags are kept at equal steps of T up to SETTLED; after that they are constant. From FORGOTTEN on they do not
depend on the dwell before. Below that, a cubic spline in ln S joins the lengths at which the memory was
simulated. Poses are those of the head's centre. A current moves the robot in the lab: it adds to the position in
proportion to time. Lengths are in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from common.arrays import Floats, Integers
from sim.mechanics import planar
from sim.model.response import BEFORE, DWELLS, FORGOTTEN, SETTLED

SHORTEST = float(DWELLS[0])  # shortest dwell whose response is known
STEP = 0.02  # between the dwells at which lags are kept
TIMES = np.arange(0.0, SETTLED + STEP / 2, STEP)
BEFORE_KNOTS = np.geomspace(BEFORE[0], FORGOTTEN, 33)  # lengths of the dwell before at which lags are kept
_SAMPLES = 8  # of a dwell
_SMOOTH = np.radians(5)  # turn between two samples of a track that looks smooth


@dataclass(frozen=True)
class Vehicle:
    """Twists and lags of both directions; index 0 is σ = +1, index 1 is σ = −1. See the module."""

    twist: Floats  # (2, 3): forward, left, yaw rate
    lag: Floats  # (2, K, T, 3) after dwells of BEFORE_KNOTS: forward, left, heading
    rest: Floats  # (2, T, 3), of a first dwell
    spread: Floats  # (2, T, 3), one-sigma of the lag, over the unknown phase of the disc at the flip
    phase_rate: Floats = field(default_factory=lambda: np.zeros(2))  # (2,), N times the disc's mean spin
    modes: tuple[Mode, ...] = ()  # what is uncertain, each by one standard deviation
    current: Floats = field(default_factory=lambda: np.zeros(2))  # in the lab
    tail_gap: float = 10.0  # in diameters
    least_gap: float = 1.0  # below it the model does not hold, because tails touch

    def lag_after(self, sense: int, before: ArrayLike | None, time: ArrayLike) -> Floats:
        """Interpolate the lag (..., 3) after `time` (...) and a dwell `before` (...); None: from rest."""
        side = 0 if sense > 0 else 1
        if before is not None:
            return interpolated(self.lag[side], before, time)
        return _at(self.rest[side], time)

    def motion(self, sense: int, before: ArrayLike | None, time: ArrayLike) -> Floats:
        """Compute the pose change E_σ(time | before), (..., 3), without the current."""
        twist = self.twist[0 if sense > 0 else 1]
        return planar.compose(self.lag_after(sense, before, time), planar.arc(twist, time))

    def lag_noise(self, sense: int, time: ArrayLike) -> Floats:
        """Return the standard deviation (..., 3) of the lag after `time`, over the disc's phase at the flip."""
        return _at(self.spread[0 if sense > 0 else 1], time)

    def drawn(self, rng: np.random.Generator, size: float = 1.0) -> Vehicle:
        """Draw a vehicle within what is uncertain of this one, times a size."""
        drawn = self
        for mode, z in zip(self.modes, size * rng.standard_normal(len(self.modes)), strict=True):
            drawn = drawn.off_by(mode, z)
        return drawn

    def off_by(self, mode: Mode, z: float = 1.0) -> Vehicle:
        """Return a vehicle that is off by z standard deviations of a mode."""
        lag = self.lag if mode.lag is None else self.lag + z * mode.lag
        return replace(self, twist=self.twist + z * mode.twist, lag=lag, current=self.current + z * mode.current)

    @property
    def yaw_rate(self) -> float:
        """Mean |Ω| of the two directions."""
        return float(np.abs(self.twist[:, 2]).mean())

    @property
    def pivot_distance(self) -> float:
        """a = R sin θ: distance from the pivot to the head's centre.

        Where the two directions differ: with this a, the drift of the pivot is the same on curves of any radius.
        """
        return float(np.abs(self.twist[:, 1]).sum() / np.abs(self.twist[:, 2]).sum())

    @property
    def pivot_radius(self) -> float:
        """R cos θ: turn radius of the pivot, the larger of the two."""
        return float(np.abs(self.twist[:, 0] / self.twist[:, 2]).max())

    @property
    def turn_radius(self) -> float:
        """R_yr/l of the head's centre, the larger of the two."""
        return float((np.hypot(self.twist[:, 0], self.twist[:, 1]) / np.abs(self.twist[:, 2])).max())

    @property
    def speed(self) -> float:
        """Largest speed of the head's centre at constant motor."""
        return float(np.hypot(self.twist[:, 0], self.twist[:, 1]).max())


@dataclass(frozen=True)
class Mode:
    """An independent cause of error: what one standard deviation of it adds to a vehicle."""

    name: str  # of the cause
    twist: Floats  # (2, 3)
    lag: Floats | None = None  # (2, K, T, 3), to the lags; None: nothing
    current: Floats = field(default_factory=lambda: np.zeros(2))  # (2,), in l per time unit


def interpolated(table: Floats, before: ArrayLike, time: ArrayLike) -> Floats:
    """Interpolate lags (..., 3) or (..., P, 3) after `time` (...) and a dwell `before` (...).

    Args:
        table: (K, T, 3) or (K, T, P, 3), after dwells of BEFORE_KNOTS, at TIMES.
        before: the dwell before.
        time: since the flip.
    """
    time = np.asarray(time, dtype=float)
    i, share = _step_below(time)
    before = np.clip(np.broadcast_to(before, time.shape), BEFORE_KNOTS[0], BEFORE_KNOTS[-1])
    k = np.clip(np.searchsorted(BEFORE_KNOTS, before, side="right") - 1, 0, len(BEFORE_KNOTS) - 2)
    part = ((before - BEFORE_KNOTS[k]) / (BEFORE_KNOTS[k + 1] - BEFORE_KNOTS[k]))[..., None]
    if table.ndim == 4:
        share, part = share[..., None], part[..., None]
    near = (1 - share) * table[k, i] + share * table[k, i + 1]
    far = (1 - share) * table[k + 1, i] + share * table[k + 1, i + 1]
    return np.asarray((1 - part) * near + part * far)


def _at(table: Floats, time: ArrayLike) -> Floats:
    """Interpolate lags (..., 3) after `time` (...) in a table (T, 3)."""
    i, share = _step_below(np.asarray(time, dtype=float))
    return np.asarray((1 - share) * table[i] + share * table[i + 1])


def _step_below(time: Floats) -> tuple[Integers, Floats]:
    """Find the step of TIMES below `time` (...), and the share (..., 1) of the way to the next one."""
    place = np.minimum(np.maximum(time, 0.0) / STEP, len(TIMES) - 1)
    i = np.minimum(place.astype(int), len(TIMES) - 2)
    return i, (place - i)[..., None]


def resampled(curve: Floats, dwells: Floats = DWELLS) -> Floats:
    """Resample curves (..., D, 3) over dwells (D,) at TIMES, (..., T, 3), by a cubic spline in ln T.

    Below the shortest dwell the curve is a straight line to zero; after SETTLED it is constant.
    """
    places = np.log(np.maximum(TIMES, dwells[0]))
    spline = CubicSpline(np.log(dwells), curve, axis=-2)(places)
    return np.asarray(spline * np.minimum(TIMES / dwells[0], 1.0)[:, None])


def lag_table(lag: Floats, memory: Floats, before: Floats = BEFORE, dwells: Floats = DWELLS) -> Floats:
    """Compute lags (..., K, T, 3) after dwells of BEFORE_KNOTS.

    Args:
        lag: (..., D, 3), a curve of `sim.model.response`.
        memory: (..., B, D, 3), what is added to it after dwells `before`; after shorter ones as after the first.
        before: (B,).
        dwells: (D,).
    """
    knots = np.log(np.append(before, FORGOTTEN))
    known = np.concatenate([memory, np.zeros_like(memory[..., :1, :, :])], -3)
    fine = CubicSpline(knots, known, axis=-3, bc_type=("not-a-knot", "clamped"))(
        np.log(np.maximum(BEFORE_KNOTS, before[0]))
    )
    return resampled(lag[..., None, :, :] + fine, dwells)


@dataclass(frozen=True)
class Switches:
    """First direction and dwell times; poses of the head's centre at the flips and the end."""

    first_direction: int  # of the motor, +1 or −1
    dwells: Floats  # (M,)
    poses: Floats  # (M + 1, 3)


class Rollout(NamedTuple):
    """What a vehicle does on a schedule of M dwells."""

    changes: Floats  # (M, 3), of the pose in each dwell
    flips: Floats  # (M + 1, 3), poses of the head's centre at the flips and the end
    poses: Floats  # (M samples + 1, 3), of the head's centre at equal times within each dwell
    track: Floats  # (M samples + 1, 2), of the tracked point


def roll_out(vehicle: Vehicle, switches: Switches, offset: float = 0.0, *, samples: int = _SAMPLES) -> Rollout:
    """Predict poses on a schedule, and the track of the point that is `offset` ahead of the head's centre."""
    times = switches.dwells[:, None] * np.arange(1, samples + 1) / samples
    changes = _pose_changes(vehicle, switches.first_direction, None, switches.dwells, times)
    flips = chained(vehicle, switches.poses[0], changes[:, -1], switches.dwells)
    within = planar.compose(flips[:-1, None], changes)
    within[..., :2] += vehicle.current * times[..., None]
    poses = np.concatenate([flips[:1], within.reshape(-1, 3)])
    track = planar.compose(poses, np.array([offset, 0.0, 0.0]))[:, :2]
    return Rollout(changes[:, -1], flips, poses, track)


def smooth_track(vehicle: Vehicle, switches: Switches, offset: float) -> Floats:
    """Predict the track of the tracked point (S, 2) for pictures: a sample every 5°, at least 8 a dwell."""
    times = np.maximum(np.ceil(np.abs(np.diff(switches.poses[:, 2])) / (_SAMPLES * _SMOOTH)), 1).astype(int)
    most = int(times.max())
    fine = roll_out(vehicle, switches, offset, samples=_SAMPLES * most).track
    wanted = np.arange(_SAMPLES * most) % (most // times)[:, None] == 0  # of each dwell, without its end
    return np.concatenate([fine[:-1][wanted.ravel()], fine[-1:]])


def flips_after(vehicle: Vehicle, switches: Switches, kept: int, last: Floats) -> Floats:
    """Predict the poses (B, K, 3) at the flips where dwells (B, K) follow the first `kept` ones of a schedule."""
    sense, before = switches.first_direction * (-1) ** kept, switches.dwells[kept - 1] if kept else None
    changes = _pose_changes(vehicle, sense, before, last, last[..., None])[..., 0, :]
    return chained(vehicle, switches.poses[kept], changes, last)[:, 1:]


def _pose_changes(vehicle: Vehicle, sense: int, before: float | None, dwells: Floats, times: Floats) -> Floats:
    """Predict the pose changes (..., M, K, 3) of dwells (..., M), the first one in direction `sense`.

    Args:
        vehicle: who carries them out.
        sense: direction of the first dwell.
        before: length of the dwell before the first one; None: from rest.
        dwells: their lengths.
        times: (..., M, K), since the flip before each.
    """
    first = np.full_like(dwells[..., :1], dwells.flat[0] if before is None else before)
    earlier = np.concatenate([first, dwells[..., :-1]], -1)[..., None] + np.zeros_like(times)
    changes = np.empty((*times.shape, 3))
    for k, direction in enumerate((sense, -sense)):
        changes[..., k::2, :, :] = vehicle.motion(direction, earlier[..., k::2, :], times[..., k::2, :])
    if before is None:
        changes[..., 0, :, :] = vehicle.motion(sense, None, times[..., 0, :])
    return changes


def chained(vehicle: Vehicle, start: Floats, changes: Floats, dwells: Floats) -> Floats:
    """Compose poses (..., M + 1, 3) from a start and the pose changes (..., M, 3) of dwells (..., M)."""
    heading = start[2] + np.cumsum(changes[..., 2], -1)
    moves = planar.turn(changes[..., :2], heading - changes[..., 2]) + vehicle.current * dwells[..., None]
    poses = np.concatenate([start[:2] + np.cumsum(moves, -2), heading[..., None]], -1)
    return np.concatenate([np.broadcast_to(start, (*poses.shape[:-2], 1, 3)), poses], -2)
