"""Pictures of a fleet: all tracks with marks of time, and the distances between bodies over time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from planner.jobs.separation import Scheduled
from planner.planning.picture import draw_regions, label_points
from sim.arrays import Floats

_COLOURS = ("#2a7fba", "#c8452f", "#3f8f4f", "#8a5ca8", "#b8860b", "#4d4d4d")
_MARKS = 6  # of time on all tracks, at most
_INTERVALS_MIN = (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600)


def draw_motions(axes: Axes, names: Sequence[str], scheduled: Sequence[Scheduled]) -> Axes:
    """Draw the tracks of the heads' centres on axes in cm: bodies at the start, dots at round times."""
    minutes = max(each.end for each in scheduled) / 60
    interval = next((each for each in _INTERVALS_MIN if minutes / each <= _MARKS), minutes / _MARKS)
    marks = np.asarray(np.arange(1, math.floor(minutes / interval) + 1) * interval, dtype=float)
    labels: list[tuple[Floats, str, str]] = []
    for k, each in enumerate(scheduled):
        colour, motion = _COLOURS[k % len(_COLOURS)], each.motion
        plan = motion.plan
        if plan.kept_clear is not None:
            draw_regions(axes, plan.kept_clear.free_space, plan.robot.tail_length)
        times = np.linspace(each.begin, each.end, 2000)
        poses = each.places(times).poses
        axes.plot(*(100 * poses[:, :2].T), color=colour, lw=1.0, label=names[k])
        ends = 100 * motion.body.ends(poses[0])
        axes.plot(*ends.T, color=colour, lw=4, alpha=0.35, solid_capstyle="round")
        shown = marks[(60 * marks > each.begin) & (60 * marks < each.end)]
        places = 100 * each.places(60 * shown).poses[:, :2]
        axes.plot(*places.T, "o", color=colour, ms=4)
        labels += [(place, f"{minute:g}", colour) for minute, place in zip(shown.tolist(), places, strict=True)]
    axes.set_aspect("equal")
    if labels:
        points, words, colours = zip(*labels, strict=True)
        label_points(axes, np.array(points), words, colours, 7)
    axes.set_xlabel("x [cm]")
    axes.set_ylabel("y [cm]")
    return axes


def draw_distances(
    axes: Axes, names: Sequence[str], times: Floats, table: Mapping[tuple[int, int], tuple[Floats, Floats]],
    apart: float,
) -> Axes:  # fmt: skip
    """Draw the distance of each pair over time, the errors in place of both as an area, and the one asked for."""
    for k, ((first, second), (predicted, sure)) in enumerate(table.items()):
        colour = _COLOURS[k % len(_COLOURS)]
        label = f"{names[first]}, {names[second]}" if len(table) > 1 else "between bodies"
        axes.plot(times / 60, 100 * predicted, color=colour, lw=1.0, label=label)
        axes.fill_between(times / 60, 100 * sure, 100 * predicted, color=colour, alpha=0.2, lw=0)
    axes.axhline(100 * apart, color="#1a1a1a", lw=1.0, ls="--", label="asked for")
    axes.set_ylim(bottom=0)
    axes.set_xlabel("time [min]")
    axes.set_ylabel("distance [cm]")
    return axes
