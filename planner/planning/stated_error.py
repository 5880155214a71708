"""The errors of a plan: distances of the predicted track from declared and drawn path, stated errors.

*Stated error*: 95 % of vehicles drawn at random within the uncertainty stay within this distance of the declared
path when they carry out the schedule open-loop. Where a calibration could not tell several robots apart, that
holds for each of them. Uncertain are the modes of the vehicle (held-out errors of the
look-up table, covariance of a calibration, current) and the phase of the disc at the first flip. Deviations from
the predicted poses are of first order in all of them: a mode changes twists, lags or the current, so in each dwell
it changes the move and the turn, and a turn tilts everything that comes later. The motion within a revolution of
the disc is added.

The lag after a flip varies with the phase φ of the disc at that flip: N waves in a turn, with the standard
deviation `Vehicle.spread`. The motor's speed tells how far the disc turns from flip to flip, so only the first
phase is unknown, and where in the wave it lies. The lags of each direction thus vary as A cos Nφ + B sin Nφ, with
independent A and B of mean 0 and variance 1: two modes for each direction. Where φ comes back at every second
flip, as with equal dwells, these errors add up; elsewhere they average out.

*Stated error with feedback*, of what `tracking.tracker` does with the poses of a camera: the robot is
within it in 95 % of the time, from the start of the path. The zigzag is uniform between ±A, where 0.95 A is the
distance that it keeps in 95 % of the time. The tracker adds a normal error of variance

    (ZIGZAG A₉₅)² + (PLACE n)²/(m + 4) + (COURSE D)²,

n the standard deviation of a measured place, m the number of poses on STRETCH of the path, and D the way that the
robot makes until a pose has come in: what is uncertain of its course, currents above all, acts so far. The four
numbers were chosen so that the statement holds for 95 % of random robots, paths and cameras; `python -m benchmarks
feedback_error` measures it on others. A pose that is older than KEPT dwells is of no use; the error is then that
of the open loop.

Random numbers come from a counter, so that another program can draw the same ones. Number n of seed s is Φ⁻¹(u)
with u = (h + ½)/2³² and a 32-bit hash h of (s, n), which is a bijection in n. Φ⁻¹ is algorithm AS 241 (PPND16)
without its branch for u < e⁻²⁵, which does not occur. Sources: Wichura, Appl. Stat. 37, 477 (1988); constants of
the hash: Wellons, hash-prospector (2018). Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from common.arrays import Floats, Integers
from planner.paths.distance import distance_to, nearest
from planner.paths.path import Path2D
from planner.paths.units import Scales
from planner.planning.declare import FeasiblePath
from planner.planning.request import Camera
from planner.progress import ERRORS, ProgressCallback, tell
from planner.vehicle.tracked_point import TrackedVehicle
from planner.vehicle.vehicle import Mode, Rollout, Switches, Vehicle, interpolated, roll_out
from sim.mechanics import planar

LEVEL = 0.95
WOBBLE = 0.002  # l; what the disc's revolutions move the body, which the vehicle averages
_DRAWS = 400
_LAP_DRAWS = 1000
_BLOCKS = 300  # places along the schedule where deviations are drawn
WITHIN = (1.96, 1.645)  # standard deviations on both sides that hold 95 % of a normal and of a uniform variable
BELOW = (1.645, 1.559)  # the same for the upper side alone
KEPT = 12  # dwells that the tracker remembers for late poses
ZIGZAG = 0.4
PLACE = 5.0
COURSE = 0.085  # rad
STRETCH = 0.3  # l
_WEYL, _FIRST, _SECOND = 0x9E3779B9, 0x21F0AAAD, 0x735A2D97
_MIDDLE = (  # numerator and denominator, in powers of 0.180625 − (u − ½)²
    (3.387132872796366608, 133.14166789178437745, 1971.5909503065514427, 13731.693765509461125,
     45921.953931549871457, 67265.770927008700853, 33430.575583588128105, 2509.0809287301226727),
    (1.0, 42.313330701600911252, 687.1870074920579083, 5394.1960214247511077,
     21213.794301586595867, 39307.89580009271061, 28729.085735721942674, 5226.495278852545925),
)  # fmt: skip
_TAIL = (  # in powers of √(−ln min(u, 1 − u)) − 1.6
    (1.42343711074968357734, 4.6303378461565452959, 5.7694972214606914055, 3.64784832476320460504,
     1.27045825245236838258, 0.24178072517745061177, 0.0227238449892691845833, 7.7454501427834140764e-4),
    (1.0, 2.05319162663775882187, 1.6763848301838038494, 0.68976733498510000455,
     0.14810397642748007459, 0.0151986665636164571966, 5.475938084995344946e-4, 1.05075007164441684324e-9),
)  # fmt: skip


@dataclass(frozen=True)
class PlanErrors:
    """The predicted track, its distances from the two paths, and what is stated for uncertain robots [l]."""

    track: Floats  # (S, 2): predicted tracked point, several samples a dwell
    distance: Floats  # (S,), of the track from the declared path
    dwells: Floats  # (M,)
    declared: Floats  # (m, 2), the declared path
    drawn: Path2D  # the path as drawn
    stated: float  # holds for 95 % of the robots that the model's uncertainty allows, open loop
    guaranteed: float | None  # bound for a robot without errors, however long the path; None: not known
    closure: float | None  # from the end of the track to the beginning of a closed path
    table_share: float = 1.0  # of the look-up table in the variance of the deviations

    @property
    def predicted_rms(self) -> float:
        """Distance of the track from the declared path, root mean square over time."""
        return rms_in_time(self.distance, self.dwells)

    @property
    def predicted_max(self) -> float:
        """Largest distance of the track from the declared path."""
        return float(self.distance.max())

    @property
    def drawn_rms(self) -> float:
        """Distance of the track from the path as drawn, root mean square over time."""
        return rms_in_time(self._from_drawn, self.dwells)

    @property
    def drawn_max(self) -> float:
        """Largest distance of the track from the path as drawn."""
        return float(self._from_drawn.max())

    @cached_property  # a plan that is only compared with others does not need it
    def _from_drawn(self) -> Floats:
        path = self.drawn.polyline()
        same = np.array_equal(path, self.declared)
        return self.distance if same else distance_to(path, self.track)


def plan_errors(
    tracked: TrackedVehicle,
    drawn: Path2D,
    declared: FeasiblePath,
    switches: Switches,
    *,
    guaranteed: float | None,
    seed: int,
    progress: ProgressCallback | None = None,
) -> PlanErrors:
    """Compute the errors of a schedule.

    Args:
        tracked: the vehicle and its tracked point.
        drawn: the path as drawn.
        declared: the path that the vehicle follows.
        switches: the schedule.
        guaranteed: bound on the error without uncertainty, if there is one.
        seed: of the random robots.
        progress: called now and then with the share that is done.
    """
    path = declared.reference.p
    rollout, predicted, growth = carried_out(tracked, tracked.robot, path, switches, drawn.closed, progress)
    stated = stated_error(growth, predicted, seed=seed)
    for other in tracked.alternatives:
        _, theirs, their_growth = carried_out(other, tracked.robot, path, switches, drawn.closed)
        length = other.robot.length_scale / tracked.robot.length_scale
        stated = max(stated, length * stated_error(their_growth, theirs, seed=seed))
    return PlanErrors(
        track=rollout.track,
        distance=predicted.distance,
        dwells=switches.dwells,
        declared=path,
        drawn=drawn,
        stated=stated,
        guaranteed=guaranteed,
        closure=float(np.linalg.norm(rollout.track[-1] - path[0])) if drawn.closed else None,
        table_share=_table_share(tracked.vehicle, growth),
    )


def carried_out(
    swims: TrackedVehicle,
    planned: Scales,
    path: Floats,
    switches: Switches,
    closed: bool,
    progress: ProgressCallback | None = None,
) -> tuple[Rollout, Predicted, ErrorGrowth]:
    """Predict what a robot does on a schedule of any robot, in its own units: track, deviations, their growth.

    Args:
        swims: the robot that carries it out, from the same place and with the same seconds.
        planned: the robot for which the schedule was made, in whose units it is, and the path.
        path: (m, 2), from which the track deviates.
        switches: the schedule.
        closed: the path ends at its start.
        progress: called now and then.
    """
    length = planned.length_scale / swims.robot.length_scale
    dwells = planned.time_scale / swims.robot.time_scale * switches.dwells
    theirs = Switches(switches.first_direction, dwells, switches.poses * [length, length, 1.0])
    rollout = roll_out(swims.vehicle, theirs, swims.offset)
    predicted = predicted_error(length * path, rollout.track, closed=closed)
    return rollout, predicted, error_growth(swims.vehicle, theirs, rollout, progress)


def _table_share(vehicle: Vehicle, growth: ErrorGrowth) -> float:
    """Return the share of the look-up table's modes in the squared deviations along a schedule."""
    squares = (growth.deviation**2).sum((0, 2))
    of_table = sum(float(squares[p]) for p, mode in enumerate(vehicle.modes) if mode.name.startswith("table: "))
    return of_table / max(float(squares.sum()), 1e-300)


class ErrorGrowth(NamedTuple):
    """Deviations of one standard deviation of each of P modes at E flips, the first and the last among them.

    The modes are those of the vehicle, and then four of the disc's phase.
    """

    flips: Integers  # (E,), their numbers; the last one is the end of the schedule
    deviation: Floats  # (E, P, 2), from the predicted position
    turned: Floats  # (E, P), of the heading


def error_growth(
    vehicle: Vehicle, switches: Switches, rollout: Rollout, progress: ProgressCallback | None = None
) -> ErrorGrowth:
    """Propagate the modes of a vehicle, and those of its disc's phase, to some _BLOCKS flips of its rollout."""
    dwells, count = switches.dwells, len(switches.dwells)
    flips = np.unique(np.linspace(0, count, min(count, _BLOCKS) + 1).astype(int))
    side = (np.arange(count) + (switches.first_direction < 0)) % 2
    moves_predicted, poses = rollout.changes, rollout.flips
    circle = planar.arc(vehicle.twist[side], dwells)
    lag = planar.compose(moves_predicted, planar.inverse(circle))
    steps = np.diff(poses[:, :2], axis=0)
    of_phase = _phase_lags(vehicle, side, dwells)
    modes = [*vehicle.modes, *(Mode("phase of the disc", np.zeros((2, 3))) for _ in of_phase)]
    lags = [*_mode_lags(vehicle, side, dwells), *of_phase]
    deviation, turned = np.zeros((len(flips), len(modes), 2)), np.zeros((len(flips), len(modes)))
    for p, mode in enumerate(modes):
        tell(progress, ERRORS, p / len(modes))
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
    for index, p in enumerate(with_lag):
        added[p] = lags[:, index]
    return added


@dataclass(frozen=True)
class Predicted:
    """The predicted track against the declared path."""

    distance: Floats  # (K,), of every point of the track
    signed: Floats  # (K,), left positive
    normal: Floats  # (K, 2), to the left of the path
    closed: bool

    @property
    def largest(self) -> float:
        return float(self.distance.max())


def rms_in_time(distance: Floats, dwells: Floats) -> float:
    """Compute the rms over time of distances (M s + 1,), sampled s times in each dwell (M,), as `trace` does."""
    each = (distance[1:].reshape(len(dwells), -1) ** 2).mean(1)
    return float(np.sqrt((each * dwells).sum() / dwells.sum()))


def predicted_error(declared: Floats, track: Floats, *, closed: bool) -> Predicted:
    """Compute the distances of a track (K, 2) from the declared path (m, 2)."""
    distance, segment, share = nearest(declared, track)
    edge = np.diff(declared, axis=0)[segment]
    tangent = edge / np.maximum(np.hypot(*edge.T), 1e-300)[:, None]
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], 1)
    foot = declared[segment] + share[:, None] * edge
    signed = ((track - foot) * normal).sum(1)
    return Predicted(distance, signed, normal, closed)


def stated_error(growth: ErrorGrowth, predicted: Predicted, *, seed: int = 0) -> float:
    """Compute the quantile LEVEL of the largest distance from the declared path [l], over random vehicles.

    Args:
        growth: of the errors, between blocks of the schedule.
        predicted: distances of the predicted track from the path.
        seed: of the random draws.
    """
    edges = growth.flips
    low, high, normal = _extremes(predicted, edges, (len(predicted.distance) - 1) // int(edges[-1]))
    moved = deviations_open_loop(growth, seed)
    across = np.einsum("dki,ki->dk", moved, normal)
    worst = np.maximum(np.abs(high + across), np.abs(low + across))
    if not predicted.closed:  # past the end of an open path
        tangent = np.array([normal[-1, 1], -normal[-1, 0]])
        beyond = np.maximum(moved[:, -1] @ tangent, 0.0)
        worst[:, -1] = np.hypot(worst[:, -1], beyond)
    return float(np.quantile(worst.max(1), LEVEL)) + WOBBLE


def deviations_open_loop(growth: ErrorGrowth, seed: int = 0) -> Floats:
    """Draw deviations of the place (D, E − 1, 2) at the ends of the blocks."""
    blocks, modes, _ = growth.deviation[1:].shape
    z = normals(seed, 0, _DRAWS * modes).reshape(_DRAWS, modes)
    flat = np.moveaxis(growth.deviation[1:], 1, 0).reshape(modes, 2 * blocks)
    return np.asarray((z @ flat).reshape(_DRAWS, blocks, 2))


def _extremes(predicted: Predicted, edges: Integers, samples: int) -> tuple[Floats, Floats, Floats]:
    """Find lowest and highest signed distance in each block, (E − 1,), and the normal at its end, (E − 1, 2)."""
    signed = np.copysign(predicted.distance, predicted.signed)
    starts = edges[:-1] * samples
    low, high = np.minimum.reduceat(signed, starts), np.maximum.reduceat(signed, starts)
    return low, high, predicted.normal[edges[1:] * samples]


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


def drift_of_a_lap(tracked: TrackedVehicle, switches: Switches, seed: int) -> tuple[float, float]:
    """Compute the quantiles LEVEL of how far robots are from the vehicle after a lap, and of their turn."""
    rollout = roll_out(tracked.vehicle, switches, tracked.offset)
    growth = error_growth(tracked.vehicle, switches, rollout)
    modes = growth.deviation.shape[1]
    drawn = normals(seed, 0, _LAP_DRAWS * modes).reshape(_LAP_DRAWS, modes)
    moved, turned = drawn @ growth.deviation[-1], drawn @ growth.turned[-1]
    return float(np.quantile(np.hypot(*moved.T), LEVEL)), float(np.quantile(np.abs(turned), LEVEL))


@lru_cache(maxsize=8)  # plans ask for the same numbers again and again
def normals(seed: int, first: int, count: int) -> Floats:
    """Draw the numbers `first` to `first + count − 1` of a seed, (count,)."""
    number = np.arange(first + 1, first + count + 1, dtype=np.uint32)
    hashed = _mixed(_mixed(number * np.uint32(_WEYL)) ^ _mixed(np.array([(seed + 1) % 2**32], dtype=np.uint32)))
    drawn = quantile((hashed + 0.5) / 2.0**32)
    drawn.flags.writeable = False
    return drawn


def _mixed(x: np.ndarray) -> np.ndarray:
    x = (x ^ (x >> np.uint32(16))) * np.uint32(_FIRST)
    x = (x ^ (x >> np.uint32(15))) * np.uint32(_SECOND)
    return x ^ (x >> np.uint32(15))


def quantile(u: Floats) -> Floats:
    """Compute Φ⁻¹(u), (count,), for e⁻²⁵ ≤ u ≤ 1 − e⁻²⁵."""
    q = u - 0.5
    tail = np.abs(q) > 0.425
    r = np.sqrt(-np.log(np.minimum(u, 1.0 - u)[tail])) - 1.6
    z = q * _polynomial(_MIDDLE[0], s := 0.180625 - q * q) / _polynomial(_MIDDLE[1], s)
    z[tail] = np.copysign(_polynomial(_TAIL[0], r) / _polynomial(_TAIL[1], r), q[tail])
    return np.asarray(z)


def _polynomial(powers: tuple[float, ...], r: Floats) -> Floats:
    total = np.full_like(r, powers[-1])
    for power in powers[-2::-1]:
        total = total * r + power
    return total
