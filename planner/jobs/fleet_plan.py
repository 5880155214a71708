"""Plans of robots that keep apart in one tank: text, pictures, content of fleet.json.

Robots have different units, so that lengths are in metres and times in seconds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from planner.jobs.separation import Approach, Scheduled, approach, instants
from planner.planning.picture import draw_regions, label_points
from planner.planning.plan import Plan
from sim.arrays import Floats
from sim.io.notebook import Shown, given_axes
from sim.io.units import format_length, format_time
from sim.robot_rows import with_units

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

FORMAT = 1
CLOSE = 2.8  # l between bodies: nearer, flow may move a robot by more than 5 % (docs/results.md)
_COLOURS = ("#2a7fba", "#c8452f", "#3f8f4f", "#8a5ca8", "#b8860b", "#4d4d4d")
_MARKS = 6  # of time on all tracks, at most
_INTERVALS_MIN = (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600)


class Nearest(NamedTuple):
    """The least distance between two bodies."""

    distance_m: float
    time_s: float
    pair: tuple[int, int]  # indices of the robots


@dataclass(frozen=True, repr=False)
class FleetPlan(Shown):
    """Plans that keep apart. Lengths in m, times in s.

    Example:
        >>> import softflagella as sf
        >>> right = sf.plan([(0, 0), (4, 0)], "paper-control")
        >>> up = sf.plan([(1.5, -2.5), (1.5, 3)], "paper-control")
        >>> both = sf.fleet([right, up], apart="5cm")
        >>> both.begin_s[0], both.begin_s[1] > 60, both.sure_m >= 0.05
        (0.0, True, True)
    """

    names: tuple[str, ...]  # of the robots
    scheduled: tuple[Scheduled, ...]  # their motions in time
    order: tuple[int, ...]  # indices of the robots: each gives way only to some of those before it
    apart_m: float  # as asked for
    feedback: bool  # poses are measured for a tracker

    @property
    def plans(self) -> tuple[Plan, ...]:
        """A plan for each robot, with its waiting circles."""
        return tuple(each.motion.plan for each in self.scheduled)

    @property
    def begin_s(self) -> tuple[float, ...]:
        """When the motor of each robot starts."""
        return tuple(each.begin for each in self.scheduled)

    @property
    def circles(self) -> tuple[int, ...]:
        """How many waiting circles each robot makes."""
        return tuple(each.circles for each in self.scheduled)

    @property
    def duration_s(self) -> float:
        """When the last robot stops."""
        return max(each.end for each in self.scheduled)

    @cached_property
    def distances(self) -> tuple[Floats, dict[tuple[int, int], tuple[Floats, Floats]]]:
        """Instants (K,), and of each pair the predicted distances (K,) and those less both errors in place."""
        times = instants(self.scheduled)
        table = {}
        for pair, known in self._approaches.items():
            predicted, sure = (np.interp(times, known.times, column) for column in known[1:])
            table[pair] = predicted, sure
        return times, table

    @cached_property
    def _approaches(self) -> dict[tuple[int, int], Approach]:
        pairs = combinations(range(len(self.scheduled)), 2)
        return {(i, j): approach(self.scheduled[i], self.scheduled[j]) for i, j in pairs}

    @property
    def nearest(self) -> Nearest:
        """The least predicted distance between two bodies, when it is, and between which robots."""
        pair, known = min(self._approaches.items(), key=lambda item: float(item[1].predicted.min()))
        k = int(known.predicted.argmin())
        return Nearest(float(known.predicted[k]), float(known.times[k]), pair)

    @property
    def sure_m(self) -> float:
        """The least distance that is left when both robots are off by their errors in place."""
        return min(float(known.sure.min()) for known in self._approaches.values())

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know, in words."""
        words = [
            f"{name}: {warning}"
            for name, plan in zip(self.names, self.plans, strict=True)
            for warning in plan.warnings
        ]
        longest = max(plan.robot.length_scale for plan in self.plans)
        if self.nearest.distance_m < CLOSE * longest:
            words.append(
                f"robots come within {format_length(self.nearest.distance_m)} of each other: nearer than "
                f"{format_length(CLOSE * longest)} the flow of one, which is left out, may move the other by more "
                "than 5 % of its speed"
            )
        drifting = [
            name for name, plan in zip(self.names, self.plans, strict=True) if plan.tracked.vehicle.current.any()
        ]
        if drifting:
            words.append(
                f"{', '.join(drifting)}: in a current a robot drifts while it rests, and the plans hold it where "
                "it is; start it when its time has come"
            )
        return tuple(words)

    def lines(self) -> list[str]:
        """Say when each robot starts, how often it circles, and how near the robots come."""
        lines = []
        for k in range(len(self.names)):
            lines.append(f"{self.names[k]}: {self._timing(k)}")
        one, two = (self.names[k] for k in self.nearest.pair)
        lines.append(
            f"least distance {format_length(self.nearest.distance_m)}, between {one} and {two} after "
            f"{format_time(self.nearest.time_s)}; with the errors in place of both at least "
            f"{format_length(self.sure_m)}, asked for {format_length(self.apart_m)}"
        )
        return lines

    def _timing(self, k: int) -> str:
        """Say when a robot begins and ends."""
        begin, count = self.begin_s[k], self.circles[k]
        starts = "starts at once" if begin == 0 else f"starts after {format_time(begin)}"
        circles = "" if not count else f", makes {count} waiting circle{'' if count == 1 else 's'}"
        return f"{starts}{circles}, ends after {format_time(self.scheduled[k].end)}"

    def __repr__(self) -> str:
        title = f"Plans for {len(self.names)} robots that keep {format_length(self.apart_m)} apart"
        lines = [title, *(f"  {line}" for line in self.lines())]
        if self.warnings:
            lines.append(f"  {len(self.warnings)} warnings, the first: {self.warnings[0][:200]}")
        return "\n".join(lines)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the predicted tracks on axes in cm: bodies at the start, dots at round times.

        Args:
            ax: default: axes of a new figure.
        """
        axes = given_axes(ax)
        minutes = self.duration_s / 60
        interval = next((each for each in _INTERVALS_MIN if minutes / each <= _MARKS), minutes / _MARKS)
        marks = np.asarray(np.arange(1, math.floor(minutes / interval) + 1) * interval, dtype=float)
        labels: list[tuple[Floats, str, str]] = []
        for k, each in enumerate(self.scheduled):
            colour, plan = _COLOURS[k % len(_COLOURS)], each.motion.plan
            if plan.kept_clear is not None:
                draw_regions(axes, plan.kept_clear.free_space, plan.robot.length_scale)
            poses = each.places(np.linspace(each.begin, each.end, 2000)).poses
            axes.plot(*(100 * poses[:, :2].T), color=colour, lw=1.0, label=self.names[k])
            ends = 100 * each.motion.body.centres(poses[0])
            axes.plot(*ends.T, color=colour, lw=4, alpha=0.35, solid_capstyle="round")
            shown = marks[(60 * marks > each.begin) & (60 * marks < each.end)]
            places = 100 * each.places(60 * shown).poses[:, :2]
            axes.plot(*places.T, "o", color=colour, ms=4)
            labels += [(place, f"{minute:g}", colour) for minute, place in zip(shown, places, strict=True)]
        axes.set_aspect("equal")
        if labels:
            points, words, colours = zip(*labels, strict=True)
            label_points(axes, np.array(points), words, colours, 7)
        axes.set_xlabel("x [cm]")
        axes.set_ylabel("y [cm]")
        return axes

    def plot_distances(self, axes: Axes) -> None:
        """Draw the distance of each pair over time, the errors in place as an area, and the distance asked for."""
        times, table = self.distances
        for k, ((first, second), (predicted, sure)) in enumerate(table.items()):
            colour = _COLOURS[k % len(_COLOURS)]
            label = f"{self.names[first]}, {self.names[second]}" if len(table) > 1 else "between bodies"
            axes.plot(times / 60, 100 * predicted, color=colour, lw=1.0, label=label)
            axes.fill_between(times / 60, 100 * sure, 100 * predicted, color=colour, alpha=0.2, lw=0)
        axes.axhline(100 * self.apart_m, color="#1a1a1a", lw=1.0, ls="--", label="asked for")
        axes.set_ylim(bottom=0)
        axes.set_xlabel("time [min]")
        axes.set_ylabel("distance [cm]")

    def to_frame(self) -> pd.DataFrame:
        """Tabulate the predicted distance between bodies over time, a column for each pair."""
        import pandas as pd

        times, table = self.distances
        columns = {"time_s": times}
        for (first, second), (predicted, sure) in table.items():
            pair = f"{self.names[first]}_{self.names[second]}"
            columns |= {f"{pair}_cm": 100 * predicted, f"{pair}_sure_cm": 100 * sure}
        return with_units(pd.DataFrame(columns))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of fleet.json."""
        return {
            "format": FORMAT,
            "robots": [
                {
                    "name": name,
                    "plan_id": each.motion.plan.to_dict()["id"],
                    "begin_s": each.begin,
                    "end_s": each.end,
                    "waiting_circles": each.circles,
                    "error_in_place_m": float(each.motion.error(np.array([each.motion.duration]))[0]),
                }
                for name, each in zip(self.names, self.scheduled, strict=True)
            ],
            "order": list(self.order),
            "apart_m": self.apart_m,
            "feedback": self.feedback,
            "least_distance_m": self.nearest.distance_m,
            "least_distance_s": self.nearest.time_s,
            "least_distance_between": [self.names[k] for k in self.nearest.pair],
            "sure_distance_m": self.sure_m,
            "warnings": list(self.warnings),
        }
