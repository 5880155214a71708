"""Swims as they were measured: the poses that a camera saw, and when the motor was reversed.

A track has time_s, x_cm, y_cm and heading_deg, or these in other units, and `direction`, that of the motor: 1,
−1, or 0 where it rests. Without `direction`, a plan says when the motor flips (`calibration.swim.flips`). A row
without a pose still says how the motor turns.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from calibration.swim.flips import as_planned, motor_by_plan, motor_by_rows
from calibration.swim.seen import continuous, outliers, told
from camera.gaps import seen_poses
from camera.pose_tracks import run_names
from common.arrays import Floats
from common.errors import InputError, naming
from common.quantities import numbers_of
from common.tables import row_name
from common.units import split
from planner.files.saved_plan import load_plan
from planner.planning.plan import Plan
from tracking.tracks import LAB, check_plan_id, in_lab, require_lab

PlanSource = str | Path | Mapping[str, Any] | Plan  # plan.json, its content, or a plan

_FEWEST_DWELLS, _FEWEST_POSES = 12, 60
_LARGEST = 1e9  # of a value
_SIMULATED = {"dwell", "time_bar"}  # columns of a track of the simulator
_ANSWERED = "flip_at_s"  # a column of poses beside the answers of a tracker on a pipe


@dataclass(frozen=True)
class MeasuredSwim:
    """Poses of one swim, and when its motor was reversed. n poses, M dwells."""

    name: str  # of the run
    time: Floats  # (n,) [s], strictly increasing, of poses that a camera saw
    poses: Floats  # (n, 3): x, y [m], heading [rad] without jumps, of the tracked point
    first_direction: int  # of the motor, +1 or −1
    flips: Floats  # (M + 1,) [s]: start of the motor, M − 1 flips, end of the last dwell
    flip_error: float  # standard deviation of the time of a flip [s]; 0 where the simulator or a plan tells it
    clock_known: bool  # flips and poses are on one clock; False: the start of a plan was searched for in the track
    said: tuple[str, ...]  # what the user should know of the track, in lines

    @property
    def dwells(self) -> Floats:
        """Times between the flips (M,) [s]."""
        return np.diff(self.flips)


def read_swims(
    track: pd.DataFrame, plan: PlanSource | None = None, *, file: str | Path | None = None
) -> list[MeasuredSwim]:
    """Read the swims of a track, one for each `run`.

    Args:
        track: table of poses, see above.
        plan: that was carried out: plan.json, its content, or a plan. Needed where a track has no `direction`.
        file: from which the track was read, for messages and for the name of its swim.

    Raises:
        InputError: a column is missing, a value is no finite number, time goes back, the track is that of another
            plan, or has fewer than 12 dwells or 60 poses.
    """
    content = load_plan(plan) if isinstance(plan, str | Path) else plan
    content = content.to_dict() if isinstance(content, Plan) else content
    with naming(file):
        table, lost = in_lab(track), tuple(track.attrs.get("lost", ()))
        require_lab(table)
        if content is not None:
            check_plan_id(content, table)
        share = 0.0 if set(track) >= _SIMULATED else 1.0 if _ANSWERED in track else 0.5
        values = _values(table, [*LAB, *(name for name in ("direction",) if name in table)])
        name = "swim" if file is None else Path(file).stem
        runs = run_names(table["run"]) if "run" in table else pd.Series(name, table.index)
        swims: list[MeasuredSwim] = []
        for run in (names := runs.unique()):
            rows = np.flatnonzero(runs == run)
            for back in rows[1:][np.diff(values[rows, 0]) < 0]:
                at = row_name(table, int(back))
                raise InputError(f"the time of {run} goes back at {at}; give a row for each time, in order")
            with naming(run if len(names) > 1 else None):
                swims.append(_swim(run, values[rows], content, share, lost))
            lost = ()
    return swims


def is_track(table: pd.DataFrame) -> bool:
    """Tell whether a table has poses, and is none of runs of steady motion."""
    quantities = {split(str(name)).quantity.lower() for name in table}
    return {"x", "y", "heading"} <= quantities and "omega_rpm" not in table


def _values(table: pd.DataFrame, names: list[str]) -> Floats:
    """Return columns of a track as numbers (m, k); a pose may have gaps, NaN.

    Raises:
        InputError: a value is no number of a possible size.
    """
    columns = []
    for name in names:
        numbers, missing = numbers_of(table[name]).to_numpy(), table[name].isna().to_numpy()
        good = np.abs(numbers) < _LARGEST
        if name == "direction":
            good &= np.isin(numbers, (-1, 0, 1))
        bad = np.flatnonzero(~good & ~(missing & (name in LAB[1:])))
        if len(bad):
            wanted = "1, -1 or 0" if name == "direction" else "a finite number"
            raise InputError(f"{row_name(table, bad[0])}: {name} is {table[name].iloc[bad[0]]}; give {wanted}")
        columns.append(numbers)
    return np.stack(columns, 1)


def _swim(
    name: str, values: Floats, plan: Mapping[str, Any] | None, share: float, lost: tuple[str, ...]
) -> MeasuredSwim:
    """Make a swim of the rows of a run (m, 4 or 5), LAB and perhaps direction; for `share` see `motor_by_rows`."""
    seen = values[np.isfinite(values).all(1)]
    seen = seen[np.diff(seen[:, 0], prepend=-math.inf) > 0]
    time, poses = seen[:, 0], seen[:, 1:4] * [0.01, 0.01, math.pi / 180]
    missing = int(np.isnan(values).any(1).sum())
    said = [*lost, *([f"{missing} of {len(values)} rows have no pose"] if missing else [])]
    _refuse_few(len(time), _FEWEST_POSES, "poses")
    if values.shape[1] > len(LAB):
        motor, notes = motor_by_rows(values[:, 0], values[:, 4], share)
        said += notes
        _refuse_few(len(motor.flips) - 1, _FEWEST_DWELLS, "dwells between flips of the motor")
        motor, notes = as_planned(motor, plan) if plan is not None else (motor, [])
    elif plan is not None:
        motor, notes = motor_by_plan(plan, time, poses[:, 2])
    else:
        raise InputError("the track has no column 'direction' of the motor; give the plan that was carried out")
    said += notes
    turning = (time >= motor.flips[0]) & (time <= motor.flips[-1])
    time, poses = time[turning], poses[turning]
    _refuse_few(len(time), _FEWEST_POSES, "poses while the motor turns")
    if share:  # the simulator looks at a robot when it likes
        new, notes = seen_poses(time, poses, share=0.0)
        time, poses = time[new], poses[new]
        said += notes
    wrong = outliers(time, poses, motor)
    said += told(time, wrong, "jump away from the others")
    time, poses = time[~wrong], poses[~wrong]
    heading, used, notes = continuous(time, poses[:, 2], motor)
    time, poses = time[used], np.column_stack([poses[:, :2], heading])[used]
    first, flips, error, clock_known, _ = motor.within(time[0], time[-1])
    _refuse_few(len(time), _FEWEST_POSES, "usable poses")
    _refuse_few(len(flips) - 1, _FEWEST_DWELLS, "dwells in which it is seen")
    return MeasuredSwim(name, time, poses, first, flips, error, clock_known, (*said, *notes))


def _refuse_few(count: int, fewest: int, what: str) -> None:
    """Refuse a swim that is too short to tell anything."""
    if count < fewest:
        raise InputError(f"a swim needs {fewest} {what}; there are {count}")
