"""The course of a robot under the flips of a swim.

The motion in a dwell is that of the planner's vehicle (`planner.vehicle.vehicle`), lag and arc, with its lag from
the first pictures after a flip on. So what a number changes costs a hundredth of a second, where time steps take
seconds. What the vehicle leaves out is the phase of the disc at each flip, which nobody knows after some turns: it
counts as random steps.
"""

from __future__ import annotations

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
from sim.model.response import BEFORE, DWELLS
from sim.motion.response import responses
from sim.motion.steady import steady

_TOLERANCE, _MESHES = 3e-4, (4, 6)  # of the curves: at 1e-3 they are rough in the numbers of a robot
_DWELLS = np.concatenate([np.geomspace(0.02, DWELLS[0], 8)[:-1], DWELLS])  # a camera sees tails turn over
_STEP = 0.1  # of `_size`, for slopes of lags; what time steps leave in them is larger than their curvature
_FAR = 0.1  # of `_distance`, from which slopes are simulated again
_LONGER = 1.25  # a unit of time than that of the robot as given
_LEAST_KNOTS = 3  # of the memory
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


_Columns = tuple[tuple[str, float], ...]  # of a robot, sorted; the motor forward, effects that work


@dataclass(frozen=True)
class Vehicles:
    """Makes vehicles of robots: their twists are solved for, their lags simulated.

    Lags take longer than steady motions, so what was simulated is kept. For derivatives, the lags of robots close
    to one are its own, and their slopes times the change. Slopes are simulated at a robot not far away.
    """

    before: Floats = field(default_factory=BEFORE.copy)  # dwells before, at which the memory is simulated
    known: dict[tuple[_Columns, int], Lags] = field(default_factory=dict)  # by robot, direction
    slopes: dict[tuple[_Columns, str, int], Lags] = field(default_factory=dict)  # by robot, column, direction
    centres: list[_Columns] = field(default_factory=list)  # robots of slopes

    @classmethod
    def of(cls, swims: Sequence[MeasuredSwim], time: float) -> Vehicles:
        """Make them for the dwells of swims; `time` is the unit of time of one robot, those of others are near."""
        shortest = min(float(swim.dwells[:-1].min(initial=np.inf)) for swim in swims) / time
        least = int(np.searchsorted(BEFORE, shortest / _LONGER, side="right")) - 1
        return cls(BEFORE[min(max(least, 0), len(BEFORE) - _LEAST_KNOTS) :])

    def swimming(
        self, columns: Mapping[str, Floats], pairs: Integers, time: Floats, length: Floats, *, close: bool
    ) -> list[Swimming]:
        """Make P robots.

        Args:
            columns: of B robots.
            pairs: (P, 2) those with the motor forward and reversed.
            time: (P,) units of time [s].
            length: (P,) units of length [m].
            close: all are close to the first.

        Raises:
            InputError: a motion cannot be found.
        """
        steadily = steady(Groups.from_columns(check_columns(columns)), stability=False)
        twist = np.stack([steadily.v_z, steadily.v_x, steadily.omega_yr], -1)
        if not np.isfinite(twist).all():
            raise InputError(_BROKE)
        directions = np.sign(columns["omega_bar"]).astype(int)
        twist[directions < 0] *= planar.MIRROR
        forward = {**columns, "omega_bar": np.abs(columns["omega_bar"])}
        robots = [dict(zip(forward, row, strict=True)) for row in np.stack([*forward.values()], 1).tolist()]
        wanted = [(_at_work(robot), sense) for robot, sense in zip(robots, directions.tolist(), strict=True)]
        lags = self._lags(wanted, robots[pairs[0, 0]] if close else None)
        return [
            Swimming(_vehicle(twist[pair], [lags[place] for place in pair]), robots[pair[0]], unit, size)
            for pair, unit, size in zip(pairs.tolist(), time.tolist(), length.tolist(), strict=True)
        ]

    def _lags(self, wanted: Sequence[tuple[_Columns, int]], first: Mapping[str, float] | None) -> list[Lags]:
        """Find the lags of robots, each in one direction of its motor; with a `first`, all are close to it.

        Raises:
            InputError: a flip breaks down.
        """
        near = [robot if first is None else _at_work(first) for robot, _ in wanted]
        simulated = self._simulated([(robot, sense) for robot, (_, sense) in zip(near, wanted, strict=True)])
        changes = [_change(robot, other) for robot, (other, _) in zip(near, wanted, strict=True)]
        centre = self._centre(near[0])
        moved = [
            {name: (centre, name, sense) for name in change}
            for change, (_, sense) in zip(changes, wanted, strict=True)
        ]
        self._learn([*dict.fromkeys(key for keys in moved for key in keys.values())])
        return [
            Lags(*(
                part + sum(change[name] * self.slopes[key][place] for name, key in keys.items())
                for place, part in enumerate(lags)
            ))
            for lags, change, keys in zip(simulated, changes, moved, strict=True)
        ]  # fmt: skip

    def _simulated(self, wanted: Sequence[tuple[_Columns, int]]) -> list[Lags]:
        """Simulate the lags of robots, each in one direction of its motor, unless they are known."""
        wanted = [(robot, 1 if _even(robot) else sense) for robot, sense in wanted]
        if new := [each for each in dict.fromkeys(wanted) if each not in self.known]:
            robots = [dict(robot) for robot, _ in new]
            names = sorted({name for robot in robots for name in robot})
            columns = {name: np.array([robot.get(name, _null(name)) for robot in robots]) for name in names}
            columns["omega_bar"] = columns["omega_bar"] * np.array([sense for _, sense in new])
            groups = Groups.from_columns(check_columns(columns))
            curves = responses(groups, tolerance=_TOLERANCE, meshes=_MESHES, before=self.before, dwells=_DWELLS)
            if curves.failed.any():
                raise InputError(_BROKE)
            tables = lag_table(curves.lag, curves.memory, self.before, _DWELLS), resampled(curves.rest, _DWELLS)
            self.known.update((each, Lags(*of)) for each, *of in zip(new, *tables, strict=True))
        return [self.known[each] for each in wanted]

    def _centre(self, robot: _Columns) -> _Columns:
        """Find the robot whose slopes hold for another; if none is near, it is this one."""
        near = min(self.centres, key=lambda other: _distance(other, robot), default=None)
        if near is None or _distance(near, robot) > _FAR:
            self.centres.append(near := robot)
        return near

    def _learn(self, wanted: Sequence[tuple[_Columns, str, int]]) -> None:
        """Simulate those slopes that are not known, by robot, column and direction of the motor."""
        new = [key for key in wanted if key not in self.slopes]
        values = [dict(centre).get(name, _null(name)) for centre, name, _ in new]
        steps = [_step(name, value) for (_, name, _), value in zip(new, values, strict=True)]
        before = [(centre, sense) for centre, _, sense in new]
        after = [
            (_at_work({**dict(centre), name: value + step}), sense)
            for (centre, name, sense), value, step in zip(new, values, steps, strict=True)
        ]
        lags = self._simulated([*before, *after])
        for key, step, *ends in zip(new, steps, lags, lags[len(new) :], strict=False):
            self.slopes[key] = Lags(*((b - a) / step for a, b in zip(*ends, strict=True)))


def _null(name: str) -> float:
    return float(effect_named(name).null) if is_effect(name) else 0.0


def _even(robot: _Columns) -> bool:
    """Tell whether a reversed motor gives the mirror image."""
    return all(effect_named(name).symmetry == "even" for name, _ in robot if is_effect(name))


def _at_work(robot: Mapping[str, float]) -> _Columns:
    """Sort the columns of a robot, without effects at their null."""
    return tuple(
        sorted((name, value) for name, value in robot.items() if not is_effect(name) or value != _null(name))
    )


def _change(robot: _Columns, other: _Columns) -> dict[str, float]:
    """Compute by how much the columns of another robot differ."""
    of, to = dict(robot), dict(other)
    changes = {name: to.get(name, _null(name)) - of.get(name, _null(name)) for name in sorted({*of, *to})}
    return {name: change for name, change in changes.items() if change}


def _size(name: str, value: float) -> float:
    """Return the size of a column: its value, or what is typical of an effect."""
    return abs(float(effect_named(name).typical - effect_named(name).null)) if is_effect(name) else value


def _step(name: str, value: float) -> float:
    """Choose a step for a slope, within the bounds of an effect."""
    step = _STEP * _size(name, value)
    return -step if is_effect(name) and value + step > effect_named(name).bounds[1] else step


def _distance(robot: _Columns, other: _Columns) -> float:
    """Compute how far two robots are apart, in sizes of their columns."""
    of = dict(robot)
    return max(
        (abs(by) / _size(name, of.get(name, 0.0)) for name, by in _change(robot, other).items()), default=0.0
    )


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
