"""The error on a path, before and after a calibration: what the corrected robot does on two schedules.

`softflagella.path_error` computes it. Lengths are in metres, unless a name says l; l is the tail length of the
robot as given.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from common.arrays import Floats
from common.units import format_length
from sim.model.schedule import Schedule

Model = Literal["as_given", "corrected"]
WORDS: dict[Model, str] = {"as_given": "the robot as given", "corrected": "the corrected robot"}


@dataclass(frozen=True)
class CarriedOut:
    """A schedule on the corrected robot, and how far from the wanted path it leads [m]."""

    schedule: Schedule  # planned for the robot as given, or for the corrected one
    track: Floats = field(repr=False)  # (S, 2) of the head's centre
    rms: float  # distance from the path, root mean square over time
    largest: float  # distance from the path
    end: float  # from the end of the track to the end of the path
    end_interval: tuple[float, float]  # 95 %, of the end, over robots that the calibration allows
    within: float  # 95 % of the robots that the calibration allows stay this near to the path

    def record(self, tail_length: float) -> dict[str, Any]:
        """Return the content for verdict.json, in l and in cm."""
        lengths = {"rms": self.rms, "largest": self.largest, "end": self.end, "within": self.within}
        low, high = self.end_interval
        record: dict[str, Any] = {}
        for unit, size in (("over_l", tail_length), ("cm", 0.01)):
            record |= {f"{name}_{unit}": length / size for name, length in lengths.items()}
            record[f"end_interval_{unit}"] = [low / size, high / size]
        seconds = float(self.schedule.dwells.sum()) * self.schedule.time_scale
        return record | {"dwells": len(self.schedule.dwells), "duration_s": seconds}

    @property
    def line(self) -> str:
        """The errors in words."""
        low, high = map(format_length, self.end_interval)
        rms, end = format_length(self.rms), format_length(self.end)
        return f"{rms} rms from the path, {end} at the end (95 %: {low} to {high})"


@dataclass(frozen=True)
class PathError:
    """The error on one path with both plans; what could not be planned is among the refusals."""

    words: str  # a file or a shape, as the path was asked for
    polyline: Floats  # the wanted path (n, 2)
    tail_length: float  # of the robot as given
    carried_out: Mapping[Model, CarriedOut]  # the schedules that could be planned
    refusals: tuple[str, ...] = ()  # in words

    @property
    def sentence(self) -> str:
        """Both errors in a line."""
        parts = [f"planned with {WORDS[name]} {each.line}" for name, each in self.carried_out.items()]
        return f"on the path {self.words}: {'; '.join([*parts, *self.refusals])}"

    def record(self) -> dict[str, Any]:
        """Return the content for verdict.json."""
        record: dict[str, Any] = dict.fromkeys(WORDS)
        record |= {name: each.record(self.tail_length) for name, each in self.carried_out.items()}
        return record | {"refused": list(self.refusals), "tail_length_m": self.tail_length}
