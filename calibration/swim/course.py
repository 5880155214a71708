"""The course of a robot under the flips of a swim, for any robot near one that is simulated.

One robot, the base, is simulated in time steps (`sim.motion.replay`). Its motion in a dwell is that of the
planner's vehicle (`planner.vehicle.vehicle`), lag and arc, and a small rest, which the vehicle leaves out. Other
robots have the rest of the base, twists of their own, solved for directly, and lags by their derivatives from the
nearest robot of which they are known. So what a number changes costs a hundredth of a second. The rest of another
robot has another phase of the disc at each flip, so it counts as noise where it differs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from calibration.swim.measured_swim import MeasuredSwim
from common.arrays import Flags, Floats, Integers
from common.errors import InputError
from planner.vehicle.from_table import mirrored
from planner.vehicle.vehicle import Vehicle, chained, lag_table, resampled
from sim.effects import effect_named, is_effect
from sim.inputs import check_columns
from sim.mechanics import planar
from sim.model.groups import Groups
from sim.model.schedule import Schedule
from sim.motion.replay import stretches
from sim.motion.response import responses
from sim.motion.steady import steady
from sim.solve.march import YAW, X, Y

_TOLERANCE, _MESHES = 1e-3, (4, 6)  # of the curves; differences of them count
_END = 1e-9  # of a dwell
_STEP = 0.02  # of a number, and of the typical size of an effect, for derivatives of lags
_FAR = 0.08  # of `_distance`, from which lags are simulated again
_BROKE = "the simulation of a swim broke down; check the robot and its motor speed"


class Swimming(NamedTuple):
    """A robot as it moves in a swim."""

    vehicle: Vehicle
    columns: Mapping[str, float]  # the motor forward
    time: float  # its unit of time [s]
    length: float  # and of length [m]


class Lags(NamedTuple):
    """Lags of a robot, or their derivatives, as seen for a positive motor; in l and time units."""

    lag: Floats  # (K, T, 3), see `Vehicle`
    rest: Floats  # (T, 3)


class Centre(NamedTuple):
    """A robot whose lags are simulated."""

    columns: Mapping[str, float]  # the motor forward
    lags: dict[int, Lags]  # by the direction of the motor


@dataclass(frozen=True)
class Near:
    """Vehicles of robots near one: their twists are solved for, their lags follow from derivatives at this one.

    Lags take a hundred times as long as steady motions. They are simulated at the robot, and again wherever
    another one is far from all that are known.
    """

    robot: Mapping[str, float]  # columns; the motor forward
    slopes: dict[tuple[str, int], Lags] = field(default_factory=dict)  # by column and direction of the motor
    centres: list[Centre] = field(default_factory=list)

    def swimming(
        self, columns: Mapping[str, Floats], pairs: Integers, time: Floats, length: Floats
    ) -> list[Swimming]:
        """Make P robots.

        Args:
            columns: of B robots.
            pairs: (P, 2) those with the motor forward and reversed.
            time: (P,) units of time [s].
            length: (P,) units of length [m].

        Raises:
            InputError: a motion cannot be found.
        """
        groups = Groups.from_columns(check_columns(columns))
        steadily = steady(groups, stability=False)
        twist = np.stack([steadily.v_z, steadily.v_x, steadily.omega_yr], -1)
        if not np.isfinite(twist).all():
            raise InputError(_BROKE)
        direction = np.sign(columns["omega_bar"]).astype(int)
        twist[direction < 0] *= planar.MIRROR
        forward = {**columns, "omega_bar": np.abs(columns["omega_bar"])}
        robots = [dict(zip(forward, row, strict=True)) for row in np.stack([*forward.values()], 1).tolist()]
        moved = [name for name, column in forward.items() if (column != self._value(name)).any()]
        self._learn([(name, sense) for sense in np.unique(direction).tolist() for name in moved])
        lags = [self._lags(robot, sense) for robot, sense in zip(robots, direction.tolist(), strict=True)]
        return [
            Swimming(_vehicle(twist[pair], [lags[place] for place in pair]), robots[pair[0]], unit, size)
            for pair, unit, size in zip(pairs.tolist(), time.tolist(), length.tolist(), strict=True)
        ]

    def _value(self, name: str) -> float:
        return float(self.robot.get(name, _null(name)))

    def _lags(self, robot: Mapping[str, float], sense: int) -> Lags:
        """Compute lags by the derivatives from the nearest centre; without one nearby, the robot becomes one."""
        near = min(self.centres, key=lambda centre: _distance(centre.columns, robot), default=None)
        if near is None or _distance(near.columns, robot) > _FAR:
            near = Centre(robot, {})
            self.centres.append(near)
        if sense not in near.lags:
            (near.lags[sense],) = _simulated([near.columns], [sense])
        lag, rest = near.lags[sense]
        for name, value in robot.items():
            if change := value - near.columns.get(name, _null(name)):
                slope = self.slopes[name, sense]
                lag, rest = lag + change * slope.lag, rest + change * slope.rest
        return Lags(lag, rest)

    def _learn(self, wanted: Sequence[tuple[str, int]]) -> None:
        """Simulate derivatives of the lags that are not known."""
        wanted = [each for each in wanted if each not in self.slopes]
        if not wanted:
            return
        steps = [_STEP * (_typical(name) if is_effect(name) else self._value(name)) for name, _ in wanted]
        senses = sorted({sense for _, sense in wanted})
        stepped = [
            {**self.robot, name: self._value(name) + step} for (name, _), step in zip(wanted, steps, strict=True)
        ]
        lags = _simulated([*(self.robot for _ in senses), *stepped], [*senses, *(sense for _, sense in wanted)])
        at = dict(zip(senses, lags, strict=False))
        for (name, sense), step, ahead in zip(wanted, steps, lags[len(senses) :], strict=True):
            pairs = zip(ahead, at[sense], strict=True)
            self.slopes[name, sense] = Lags(*((after - before) / step for after, before in pairs))


def _null(name: str) -> float:
    return float(effect_named(name).null) if is_effect(name) else 0.0


def _typical(name: str) -> float:
    return abs(float(effect_named(name).typical - effect_named(name).null))


def _distance(robot: Mapping[str, float], other: Mapping[str, float]) -> float:
    """Compute how far two robots are apart: in the logarithm of a number, or a fortieth of a typical size."""
    return max(
        abs(robot.get(name, _null(name)) - other.get(name, _null(name))) / _typical(name) / 40
        if is_effect(name)
        else abs(math.log(robot[name] / other[name]))
        for name in {*robot, *other}
    )


def _simulated(robots: Sequence[Mapping[str, float]], senses: Sequence[int]) -> list[Lags]:
    """Simulate the lags of B robots, each in one direction of its motor.

    Raises:
        InputError: a flip breaks down.
    """
    names = sorted({name for robot in robots for name in robot})
    columns = {name: np.array([robot.get(name, _null(name)) for robot in robots]) for name in names}
    columns["omega_bar"] = columns["omega_bar"] * np.array(senses)
    curves = responses(Groups.from_columns(check_columns(columns)), tolerance=_TOLERANCE, meshes=_MESHES)
    if curves.failed.any():
        raise InputError(_BROKE)
    tables = lag_table(curves.lag, curves.memory, curves.before), resampled(curves.rest)
    return [Lags(*each) for each in zip(*tables, strict=True)]


def _vehicle(twist: Floats, lags: Sequence[Lags]) -> Vehicle:
    """Make a vehicle of the twists (2, 3) and lags in both directions, as seen for a positive motor."""
    lag, rest = (np.stack(each) for each in zip(*lags, strict=True))
    return Vehicle(mirrored(twist), mirrored(lag), mirrored(rest), np.zeros_like(rest))


@dataclass(frozen=True)
class Moments:
    """Where n poses are in the dwells of a swim."""

    dwell: Integers  # (n,)
    elapsed: Floats  # (n,) since the flip before [s]
    dwells: Floats  # (M,) [s]
    first_direction: int

    @classmethod
    def of(cls, swim: MeasuredSwim, time: Floats) -> Moments:
        """Find times (n,) in a swim; before its start the robot is at rest."""
        dwell = np.clip(np.searchsorted(swim.flips, time, side="right") - 1, 0, len(swim.dwells) - 1)
        return cls(dwell, np.maximum(time - swim.flips[dwell], 0.0), swim.dwells, swim.first_direction)

    @classmethod
    def whole(cls, swim: MeasuredSwim) -> Moments:
        """Take the ends of all dwells."""
        return cls(np.arange(len(swim.dwells)), swim.dwells, swim.dwells, swim.first_direction)

    @cached_property
    def forward(self) -> Flags:
        """Whether the motor turns forward, (n,)."""
        return np.asarray((self.dwell % 2 == 0) == (self.first_direction > 0))

    @property
    def place(self) -> Floats:
        """Dwells since the start, with the share of the present one, (n,)."""
        return np.asarray(self.dwell + np.clip(self.elapsed / self.dwells[self.dwell], 0.0, 1 - _END))

    def changes(self, of: Swimming) -> Floats:
        """Compute the changes of the pose since the flip, (n, 3), in l and rad, of a vehicle."""
        result = np.empty((len(self.dwell), 3))
        elapsed, dwells = self.elapsed / of.time, self.dwells / of.time
        before = dwells[np.maximum(self.dwell - 1, 0)]
        for sense, rows in ((1, self.forward), (-1, ~self.forward)):
            result[rows] = of.vehicle.motion(sense, before[rows], elapsed[rows])
            first = rows & (self.dwell == 0)
            result[first] = of.vehicle.motion(sense, None, elapsed[first])
        return result


@dataclass(frozen=True)
class Base:
    """A robot that is simulated in time steps along a swim, and what its vehicle leaves out."""

    place: Floats  # (S,) dwells since the start, see `Moments.place`
    rest: Floats  # (S, 3), added to the changes of the vehicle, in l and rad

    @classmethod
    def of(cls, swim: MeasuredSwim, robot: Swimming) -> Base:
        """Simulate a robot along a swim."""
        dwells = swim.dwells / robot.time
        schedule = Schedule(robot.columns, swim.first_direction, dwells, (0.0, 0.0, 0.0), robot.time)
        simulated = [each for each in stretches(schedule) if len(each.times)]
        dwell = np.concatenate([np.full(len(each.times), each.dwell) for each in simulated])
        poses = np.concatenate([each.poses[:, [X, Y, YAW]] for each in simulated])
        ends = np.concatenate([np.zeros((1, 3)), poses[np.flatnonzero(np.diff(dwell, append=-1))]])
        elapsed = np.concatenate([each.times for each in simulated]) * robot.time
        at = Moments(dwell, elapsed - (swim.flips - swim.flips[0])[dwell], swim.dwells, swim.first_direction)
        rest = planar.between(ends[dwell], poses) - at.changes(robot)
        marks = np.arange(len(swim.dwells), dtype=float)
        place = np.concatenate([at.place, marks])
        order = np.argsort(place, kind="stable")
        return cls(place[order], np.concatenate([rest, np.zeros((len(marks), 3))])[order])

    def at(self, place: Floats) -> Floats:
        """Interpolate the rest at places (n,), (n, 3)."""
        return np.stack([np.interp(place, self.place, column) for column in self.rest.T], -1)


def course(vehicle: Vehicle, changes: Floats, ends: Floats, at: Moments) -> tuple[Floats, Floats]:
    """Chain the changes of the pose in dwells.

    Args:
        vehicle: of the robot.
        changes: of n poses since the flip before, (n, 3).
        ends: of whole dwells, (M, 3).
        at: where the poses are.

    Returns:
        The poses (n, 3), and those at the starts of the dwells (M, 3), seen from the start of the swim.
    """
    flips = chained(vehicle, np.zeros(3), ends, at.dwells)[:-1]
    return planar.compose(flips[at.dwell], changes), flips
