"""The course of a robot under the flips of a swim, for any robot near one that is simulated.

One robot, the base, is simulated in time steps (`sim.motion.replay`). Its motion in a dwell is that of the
planner's vehicle (`planner.vehicle.vehicle`), lag and arc, and a small rest, which the vehicle leaves out. Other
robots have the rest of the base, twists of their own, solved for directly, and lags by their derivatives. So what
a number changes costs a hundredth of a second, and the rest falls out of differences.

Lengths in m, times in s, headings in rad.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from calibration.swim.measured_swim import MeasuredSwim
from common.arrays import Flags, Floats, Integers
from common.errors import InputError
from planner.vehicle.vehicle import Vehicle, lag_table, resampled
from sim.effects import effect_named, is_effect
from sim.inputs import check_columns
from sim.mechanics import planar
from sim.model.groups import Groups
from sim.model.robot import Robot
from sim.model.schedule import Schedule
from sim.motion.replay import stretches
from sim.motion.response import responses
from sim.motion.steady import steady
from sim.solve.march import YAW, X, Y

_TOLERANCE, _MESHES = 1e-3, (4, 6)  # of the curves; differences of them count
_SIDES = np.stack([np.ones(3), planar.MIRROR])
_END = 1e-9  # of a dwell
_STEP = 0.02  # of a number, and of the typical size of an effect, for derivatives of lags
_BROKE = "the simulation of a swim broke down; check the robot and its motor speed"


class Lags(NamedTuple):
    """Lags of a robot, or their derivatives, as seen for a positive motor; in l and time units."""

    lag: Floats  # (K, T, 3), see `Vehicle`
    rest: Floats  # (T, 3)


@dataclass(frozen=True)
class Near:
    """Vehicles of robots near one: their twists are solved for, their lags follow from derivatives at this one.

    Curves take a hundred times as long as steady motions, and lags are a small part of a motion.
    """

    robot: Mapping[str, float]  # columns; the motor forward
    known: dict[tuple[str, int], Lags] = field(default_factory=dict)  # "" the robot, by the direction of its motor

    def vehicles(self, columns: Mapping[str, Floats], pairs: Integers) -> list[Vehicle]:
        """Make P vehicles of pairs (P, 2) of B robots, with the motor forward and reversed.

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
        values = {**columns, "omega_bar": np.abs(columns["omega_bar"])}
        changes = {name: column - self._value(name) for name, column in values.items()}
        changes = {name: change for name, change in changes.items() if change.any()}
        senses = np.unique(direction).tolist()
        self._learn([(name, sense) for sense in senses for name in ("", *changes)])
        lags = []
        for place, sense in enumerate(direction.tolist()):
            lag, rest = self.known["", sense]
            for name, change in changes.items():
                if change[place]:
                    slope = self.known[name, sense]
                    lag, rest = lag + change[place] * slope.lag, rest + change[place] * slope.rest
            lags.append(Lags(lag, rest))
        return [_vehicle(twist[pair], [lags[place] for place in pair]) for pair in pairs.tolist()]

    def _value(self, name: str) -> float:
        return float(self.robot.get(name, effect_named(name).null if is_effect(name) else 0.0))

    def _learn(self, wanted: Sequence[tuple[str, int]]) -> None:
        """Simulate the lags of the robot, and their derivatives, that are not known."""
        wanted = [each for each in wanted if each not in self.known]
        if not wanted:
            return
        at_robot = [("", sense) for sense in sorted({sense for _, sense in wanted})]
        every = [*at_robot, *(each for each in wanted if each not in at_robot)]
        names = {*self.robot, *(name for name, _ in wanted if name)}
        columns = {name: np.full(len(every), self._value(name)) for name in names}
        steps = np.zeros(len(every))
        for place, (name, sense) in enumerate(every):
            if name:
                typical = effect_named(name).typical - effect_named(name).null if is_effect(name) else 0.0
                steps[place] = _STEP * abs(typical or columns[name][place])
                columns[name][place] += steps[place]
            columns["omega_bar"][place] *= sense
        curves = responses(Groups.from_columns(check_columns(columns)), tolerance=_TOLERANCE, meshes=_MESHES)
        if curves.failed.any():
            raise InputError(_BROKE)
        lag, rest = lag_table(curves.lag, curves.memory, curves.before), resampled(curves.rest)
        at = {sense: place for place, (name, sense) in enumerate(every) if not name}
        for place, (name, sense) in enumerate(every):
            found = Lags(lag[place], rest[place])
            if name:
                found = Lags(*((table[place] - table[at[sense]]) / steps[place] for table in (lag, rest)))
            self.known[name, sense] = found


def _vehicle(twist: Floats, lags: Sequence[Lags]) -> Vehicle:
    """Make a vehicle of the twists (2, 3) and lags in both directions, as seen for a positive motor."""
    lag, rest = (np.stack(each) for each in zip(*lags, strict=True))
    sides = _SIDES[:, None]
    return Vehicle(twist * _SIDES, lag * sides[:, None], rest * sides, np.zeros_like(rest))


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
        dwells = np.diff(swim.flips)
        dwell = np.clip(np.searchsorted(swim.flips, time, side="right") - 1, 0, len(dwells) - 1)
        return cls(dwell, np.maximum(time - swim.flips[dwell], 0.0), dwells, swim.first_direction)

    @classmethod
    def whole(cls, swim: MeasuredSwim) -> Moments:
        """Take the ends of all dwells."""
        dwells = np.diff(swim.flips)
        return cls(np.arange(len(dwells)), dwells, dwells, swim.first_direction)

    @cached_property
    def forward(self) -> Flags:
        """Whether the motor turns forward, (n,)."""
        return np.asarray((self.dwell % 2 == 0) == (self.first_direction > 0))

    @property
    def place(self) -> Floats:
        """Dwells since the start, with the share of the present one, (n,)."""
        return np.asarray(self.dwell + np.clip(self.elapsed / self.dwells[self.dwell], 0.0, 1 - _END))

    def changes(self, vehicle: Vehicle, time: float, length: float) -> Floats:
        """Compute the changes of the pose since the flip, (n, 3), of a vehicle with its units."""
        result = np.empty((len(self.dwell), 3))
        elapsed, dwells = self.elapsed / time, self.dwells / time
        before = dwells[np.maximum(self.dwell - 1, 0)]
        for sense, rows in ((1, self.forward), (-1, ~self.forward)):
            result[rows] = vehicle.motion(sense, before[rows], elapsed[rows])
            first = rows & (self.dwell == 0)
            result[first] = vehicle.motion(sense, None, elapsed[first])
        result[:, :2] *= length
        return result


@dataclass(frozen=True)
class Base:
    """A robot that is simulated in time steps along a swim, and what its vehicle leaves out."""

    place: Floats  # (S,) dwells since the start, see `Moments.place`
    rest: Floats  # (S, 3), added to the changes of the vehicle [m, rad]
    slopes: Mapping[str, Floats] = field(default_factory=dict)  # by the size of an effect, (S, 3)

    @classmethod
    def of(cls, swim: MeasuredSwim, robot: Robot, vehicle: Vehicle) -> Base:
        """Simulate a robot along a swim."""
        time, length = robot.time_scale, robot.tail_length
        schedule = Schedule(
            robot.group_values(), swim.first_direction, np.diff(swim.flips) / time, (0.0, 0.0, 0.0), time, length
        )
        simulated = [each for each in stretches(schedule) if len(each.times)]
        dwell = np.concatenate([np.full(len(each.times), each.dwell) for each in simulated])
        poses = np.concatenate([each.poses[:, [X, Y, YAW]] for each in simulated]) * [length, length, 1.0]
        ends = np.concatenate([np.zeros((1, 3)), poses[np.flatnonzero(np.diff(dwell, append=-1))]])
        elapsed = np.concatenate([each.times for each in simulated]) * time - (swim.flips - swim.flips[0])[dwell]
        at = Moments(dwell, elapsed, schedule.dwells * time, swim.first_direction)
        rest = planar.between(ends[dwell], poses) - at.changes(vehicle, time, length)
        marks = np.arange(len(swim.flips) - 1.0)
        place = np.concatenate([at.place, marks])
        order = np.argsort(place, kind="stable")
        return cls(place[order], np.concatenate([rest, np.zeros((len(marks), 3))])[order])

    def at(self, place: Floats, sizes: Mapping[str, Any]) -> Floats:
        """Interpolate the rest at places (n,), (n, 3), with effects of some sizes above their null."""
        rest = self.rest
        for name, slope in self.slopes.items():
            rest = rest + sizes.get(name, 0.0) * slope
        return np.stack([np.interp(place, self.place, column) for column in rest.T], -1)

    def with_slope(self, name: str, size: float, other: Base) -> Base:
        """Learn the slope by an effect from the same robot with that effect."""
        return replace(self, slopes={**self.slopes, name: (other.at(self.place, {}) - self.rest) / size})


def course(changes: Floats, ends: Floats, at: Moments) -> tuple[Floats, Floats]:
    """Chain the changes of the pose in dwells.

    Args:
        changes: of n poses since the flip before, (n, 3).
        ends: of whole dwells, (M, 3).
        at: where the poses are.

    Returns:
        The poses (n, 3), and those at the starts of the dwells (M, 3), seen from the start of the swim.
    """
    heading = np.cumsum(ends[:, 2])
    moves = planar.turn(ends[:, :2], heading - ends[:, 2])
    flips = np.concatenate([np.zeros((1, 3)), np.column_stack([np.cumsum(moves, 0), heading])])[:-1]
    return planar.compose(flips[at.dwell], changes), flips
