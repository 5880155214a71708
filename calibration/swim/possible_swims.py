"""Which swims are possible: the one that was made again, other paths of the robot, and other robots on a path.

Paths are closed ones as long as that of the swim, and twice as long. Another robot turns its motor more slowly,
has a tail more or less, or other tails; its path is the square, in its own tail lengths. All are planned with the
shipped look-up table. What cannot be planned is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from calibration.statistics.statistical_model import ForwardModel, Parameter, Parameters, Predict
from calibration.swim.measured_swim import MeasuredSwim
from calibration.table.runs import Runs
from common.arrays import Floats
from common.errors import InputError
from planner.jobs.plan import plan
from sim.model.groups import MOST_TAILS
from sim.model.robot import Robot
from surrogate.table_file import load

_NEXT = "next"  # name of a swim
_AGAIN = "as swum"
_SQUARE = "square:{:.2g}l", 1 / 4
_SHAPES = (("circle:{:.2g}l", 0.5 / math.pi), ("triangle:{:.2g}l", 1 / 3), _SQUARE, ("polygon:6:{:.2g}l", 1 / 6))
_LONGER = 2.0
_LENGTHS, _SLOWER = (0.7, 1.4), 0.7  # factors


class PossibleSwim(NamedTuple):
    """A swim that can be made next."""

    settings: dict[str, Any]  # column -> value
    robot: Robot  # as given
    swim: MeasuredSwim  # its flips and the times of its poses, which are not known: 0


def possible_swims(robot: Robot, swims: Sequence[MeasuredSwim]) -> Iterator[PossibleSwim]:
    """Plan swims of a robot and of others, the cheapest first, seen as often as the longest one that was made."""
    swum = max(swims, key=lambda swim: float(swim.dwells.sum()))
    yield _possible(robot, _AGAIN, replace(swum, name=_NEXT, poses=np.zeros_like(swum.poses)), "")
    size = _path_length(swum) / robot.tail_length
    tries = [(shape, size * factor, "", robot) for factor in (1.0, _LONGER) for shape in _SHAPES]
    tries += [(_SQUARE, size, change, other) for change, other in _others(robot)]
    for (words, share), length, change, other in tries:
        with suppress(InputError):
            path = words.format(length * share)
            planned = plan(path, other, lookup=load())
            flips = np.append(0.0, np.cumsum(planned.seconds))
            time = np.arange(0.0, flips[-1], float(np.median(np.diff(swum.time))))
            swim = replace(
                swum, name=_NEXT, time=time, poses=np.zeros((len(time), 3)), flips=flips,
                first_direction=planned.first_direction,
            )  # fmt: skip
            yield _possible(other, path, swim, change)


def _possible(robot: Robot, path: str, swim: MeasuredSwim, change: str) -> PossibleSwim:
    """Describe a swim by what a lab sets, and the command that plans it."""
    words = [
        "softflagella plan",
        path,
        "--robot robot.toml",
        *([f"--set {change}"] if change else []),
        "--out next",
    ]
    settings = {
        "path": path, "robot": change or "as given", "minutes": round(float(swim.dwells.sum()) / 60, 1),
        "plan": "the same plan again" if path == _AGAIN else " ".join(words),
    }  # fmt: skip
    return PossibleSwim(settings, robot, swim)


def _others(robot: Robot) -> Iterator[tuple[str, Robot]]:
    """List robots that differ in one number, and that number as in robot.toml."""
    rpm = float(f"{_SLOWER * robot.motor_speed * 30 / math.pi:.3g}")
    yield f"motor.speed_rpm={rpm:g}", replace(robot, motor_speed=rpm * math.pi / 30)
    for tails in (robot.tails - 1, robot.tails + 1):
        if 1 <= tails <= MOST_TAILS:
            yield f"tails.count={tails}", replace(robot, tails=tails)
    for factor in _LENGTHS:
        cm = float(f"{100 * factor * robot.tail_length:.3g}")
        yield f"tails.length_cm={cm:g}", replace(robot, tail_length=cm / 100)


def _path_length(swim: MeasuredSwim) -> float:
    """Measure a path [m] from every second flip to the next one, between which a robot goes straight on."""
    places = np.stack([np.interp(swim.flips[::2], swim.time, column) for column in swim.poses[:, :2].T], 1)
    return float(np.hypot(*np.diff(places, axis=0).T).sum())


class _Poses(Runs):
    """Poses that are not known yet."""

    @property
    def along(self) -> Floats:
        """Zero: a shift of all poses is that of the start."""
        return np.zeros(len(self))


@dataclass(frozen=True)
class PossibleSwims:
    """Predicts swims that can be made next, one after the other; each is a condition."""

    models: tuple[ForwardModel, ...]  # one of each swim, with the same parameters

    @property
    def coefficients(self) -> tuple[Parameter, ...]:
        return self.models[0].coefficients

    @property
    def nuisances(self) -> tuple[Parameter, ...]:
        return self.models[0].nuisances

    @property
    def effects(self) -> tuple[Parameter, ...]:
        return self.models[0].effects

    @cached_property
    def runs(self) -> Runs:
        """The poses of all swims."""
        swim = np.repeat(np.arange(len(self.models)), [len(model.runs) for model in self.models])
        first, count = self.models[0].runs, len(swim)
        return _Poses(
            outputs=first.outputs, y=np.zeros((count, len(first.outputs))), condition=swim,
            session=np.zeros(count, dtype=np.int64), session_names=(_NEXT,), inputs=np.empty((count, 0)),
            input_names=(), rows=np.arange(count), excluded=(), caveats=(),
        )  # fmt: skip

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Predict (P, n, 3), see `ForwardModel`."""
        return np.concatenate([model.predict(sets, title=title) for model in self.models], 1)

    def linearised(
        self, at: Parameters, along: Sequence[Parameter], *, title: str = "", quick: bool = False
    ) -> Predict:
        """Return the linear model, by differences; NaN of a swim that cannot be simulated."""
        models = [model.linearised(at, along, title=title, quick=True) for model in self.models]
        return lambda sets: np.concatenate([predict(sets) for predict in models], 1)
