"""Swims as they were measured: the poses that a camera saw, and when the motor was reversed.

A track has time_s, x_cm, y_cm and heading_deg, or these in other units, and `direction`, that of the motor: 1, −1,
or 0 where it rests. A flip lies between the last row of one direction and the first of the other; where the
simulator has written `dwell`, it is the last row of one. Without `direction`, a plan says when the motor flips.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Unpack

import numpy as np
import pandas as pd

from camera.pose_tracks import read_tracks
from camera.track_options import TrackOptions
from common.arrays import Floats
from common.errors import InputError, naming
from common.quantities import convert_columns, numbers_of
from planner.files.saved_plan import load_plan
from planner.planning.plan import Plan

_POSE = ("x_cm", "y_cm", "heading_deg")
_FEWEST_DWELLS, _FEWEST_POSES = 12, 60


@dataclass(frozen=True)
class MeasuredSwim:
    """Poses of one swim, and when its motor was reversed. n poses, M dwells."""

    name: str  # of the run
    time: Floats  # (n,) [s], strictly increasing, of poses that a camera saw
    poses: Floats  # (n, 3): x, y [m], heading [rad] without jumps, of the tracked point
    first_direction: int  # of the motor, +1 or −1
    flips: Floats  # (M + 1,) [s]: start of the motor, M − 1 flips, end of the last dwell
    flip_error: float  # standard deviation of the time of a flip [s]
    clock_known: bool  # flips and poses are on one clock; False: the flips are those of a plan
    said: tuple[str, ...]  # what the user should know of the track, in lines

    @property
    def dwells(self) -> Floats:
        """Times between the flips (M,) [s]."""
        return np.diff(self.flips)


class _Motor(NamedTuple):
    """When a motor was reversed."""

    first_direction: int
    flips: Floats  # (M + 1,) [s]
    error: float  # standard deviation of a flip [s]
    clock_known: bool


def read_swims(
    source: str | Path | pd.DataFrame,
    plan: str | Path | Mapping[str, Any] | Plan | None = None,
    **options: Unpack[TrackOptions],
) -> list[MeasuredSwim]:
    """Read the swims of a track, one for each `run`.

    Args:
        source: table of poses, see above, or what another program has written.
        plan: that was carried out: plan.json, its content, or a plan. Needed where a track has no `direction`.
        options: of a file that another program has written, see `TrackOptions`.

    Raises:
        InputError: a column is missing, a value is no finite number, time goes back, the track is that of another
            plan, or has fewer than 12 dwells or 60 poses.
    """
    content = load_plan(plan) if isinstance(plan, str | Path) else plan
    content = content.to_dict() if isinstance(content, Plan) else content
    with naming(source):
        table = source if isinstance(source, pd.DataFrame) else read_tracks(source, **options)
        lab = {"time_s", *_POSE} & set(table)
        table = table.drop(columns=["heading_rad"]) if "heading_deg" in lab and "heading_rad" in table else table
        table = convert_columns(table, ("time_s", *_POSE), "the track").table
        runs = table["run"].astype(str) if "run" in table else pd.Series("swim", table.index)
        return [_swim(str(name), rows, content) for name, rows in table.groupby(runs, sort=False)]


def _swim(name: str, rows: pd.DataFrame, plan: Mapping[str, Any] | None) -> MeasuredSwim:
    values = np.stack([numbers_of(rows[each]).to_numpy() for each in ("time_s", *_POSE)], 1)
    time, poses = values[:, 0], values[:, 1:] * [0.01, 0.01, math.pi / 180]
    poses[:, 2] = np.unwrap(poses[:, 2])
    if "direction" in rows:
        motor = _of_directions(time, numbers_of(rows["direction"]).to_numpy(), rows.get("dwell"))
    elif plan is not None:
        flips = time[0] + np.append(0.0, np.cumsum(plan["dwell_s"]))
        motor = _Motor(int(plan["first_direction"]), flips, 0.0, False)
    else:
        raise InputError("the track has no column 'direction' of the motor; give the plan that it followed")
    seen = (time >= motor.flips[0]) & (time <= motor.flips[-1])
    return MeasuredSwim(name, time[seen], poses[seen], *motor, said=())


def _of_directions(time: Floats, direction: Floats, dwell: pd.Series | None) -> _Motor:
    turning = np.flatnonzero(direction)
    first, last = turning[0], turning[-1]
    before = first + np.flatnonzero(np.diff(direction[first : last + 1]))
    ends = [time[max(first - 1, 0) : first + 1].mean(), time[last : last + 2].mean()]
    if dwell is not None:
        return _Motor(int(direction[first]), np.array([time[first], *time[before], time[last]]), 0.0, True)
    steps = time[before + 1] - time[before]
    flips = np.array([ends[0], *(time[before] + steps / 2), ends[1]])
    return _Motor(int(direction[first]), flips, float(np.median(steps)) / math.sqrt(12), True)


def is_track(source: str | Path | pd.DataFrame) -> bool:
    """Tell whether a table has poses, not runs of steady motion."""
    table = source if isinstance(source, pd.DataFrame) else read_tracks(source)
    return "omega_rpm" not in table and any(str(name).startswith("heading") for name in table)
