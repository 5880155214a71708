"""Replayed and measured tracks against their plans: the tracking error and an overlay.

A track is a camera's table: time_s, x_cm, y_cm and heading_deg of the head's centre, or in other units, or the
columns of a replay. The error is the distance of the tracked point from the declared path, weighted by time; that
from the path as given is computed, too.
"""

from __future__ import annotations

import shlex
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import pandas as pd

from camera.gaps import seen_poses
from camera.pose_tracks import read_tracks
from common.arrays import Floats
from common.errors import InputError, InputWarning, naming
from common.keywords import checks_keywords
from common.quantities import convert_columns, numbers_of
from common.track_options import TrackOptions
from common.units import format_length, length_in_lab
from planner.files.saved_plan import load_plan
from planner.paths.distance import distance_to, farthest
from planner.paths.units import missed_words
from planner.planning.plan import Plan
from sim.mechanics import planar
from sim.model.presets import PRESETS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLUMNS = ("time_bar", "x_over_l", "y_over_l", "heading_rad")
_ALIKE = 1e-3  # of a place and of the tail length, largest difference of the same place in cm and in l
LAB = ("time_s", "x_cm", "y_cm", "heading_deg")  # or in other units
_NONE: Mapping[str, Any] = {}
_LARGEST = 1e6  # l, of a place; time units, of a time


class MissedPathError(InputError):
    """The track misses a part of the declared path."""

    status = 3


@dataclass(frozen=True)
class TrackingError:
    """Errors in tail lengths l, from the declared path; those called raw from the path as given.

    Example:
        >>> from softflagella import check, circle, plan, replay
        >>> result = plan(circle(1.2), "paper-control", objective="flips")
        >>> error = check(result, replay(result))
        >>> error.rms < error.largest < error.stated
        True
    """

    rms: float  # over time
    largest: float  # distance from the declared path
    raw_rms: float  # over time, from the path as given
    raw_largest: float  # distance from the path as given
    missed: float  # largest distance of a point of the path as given from the track
    declared_missed: float  # largest distance of a point of the declared path from the track
    stated: float  # error that the plan states
    gaps: tuple[str, ...]  # times without a new pose, in words
    track: Floats = field(repr=False)  # (S, 2) tracked point
    tail_length: float  # of the robot [m]

    @property
    def line(self) -> str:
        """The errors in one sentence, in units of length and in l; first, what of the path was not swum."""
        verdict = "within" if self.largest <= self.stated else "ABOVE"
        rms, largest, stated, raw_rms, raw_largest, missed = (
            length_in_lab(value, self.tail_length)
            for value in (self.rms, self.largest, self.stated, self.raw_rms, self.raw_largest, self.missed)
        )
        return missed_words(self.declared_missed, self.stated, self.tail_length) + (
            f"tracking error {rms} rms, {largest} at most, {verdict} the stated error {stated}; from the path as "
            f"drawn {raw_rms} rms, {raw_largest} at most, every point of it within {missed}"
            + "".join(f"; {line}" for line in self.gaps)
        )


@checks_keywords
def check(
    plan: Plan | Mapping[str, Any] | str | Path,
    track: pd.DataFrame | str | Path,
    **options: Unpack[TrackOptions],
) -> TrackingError:
    """Compare a replayed or measured track with its plan.

    Args:
        plan: plan.json. In Python also its content, or a plan.
        track: table with `time_s`, `x_cm`, `y_cm`, `heading_deg` of the head's centre, as a camera gives them, or
            with the columns that `replay` writes.
        options: of a file that another program has written, see `TrackOptions`.

    Returns:
        Distances of the tracked point from the declared path: `rms` and `largest`, with the `stated` error; from
        the path as drawn: `raw_rms` and `raw_largest`; of points of these paths from the track: `declared_missed`
        and `missed` [l]. `gaps` says for how long, beyond a dwell, there is no new pose, `line` all of it.

    Raises:
        InputError: the track has no such columns, or values that are not finite.

    Example:
        >>> import softflagella as sf
        >>> result = sf.plan(sf.circle(1.2), "paper-control", objective="flips")
        >>> error = sf.check(result, sf.replay(result))
        >>> error.rms < error.largest < error.stated
        True
    """
    content = load_plan(plan) if isinstance(plan, str | Path) else plan
    with naming(track):
        table = read_track(track, **options)
        return tracking_error(content.to_dict() if isinstance(content, Plan) else content, table)


def tracking_error(plan: Mapping[str, Any], track: pd.DataFrame) -> TrackingError:
    """Compare a track with its plan.

    Args:
        plan: content of plan.json.
        track: time_s, x_cm, y_cm, heading_deg of the head's centre, or in other units; or the columns of a replay,
            time_bar, x_over_l, y_over_l, heading_rad.

    Raises:
        InputError: a column is missing, a value is no finite number, time goes back, or it is the track of
            another plan.
    """
    check_plan_id(plan, track)
    times, poses = poses_of(track, plan["robot"])
    if len(times) < 2 or not np.ptp(times) > 0:
        raise InputError("the track has no two times; give a row for each time, in order")
    offset = np.array([plan.get("offset_over_l", 0.0), 0.0, 0.0])
    tracked = planar.compose(poses, offset)[:, :2]
    declared = distance_to(np.array(plan["reference"]), tracked)
    raw = distance_to(np.array(plan["raw_path"]), tracked)
    seconds, longest = times * plan["robot"]["time_scale_s"], max(plan["dwell_s"])
    weight = np.gradient(times)
    weight = weight / weight.sum()
    return TrackingError(
        rms=float(np.sqrt((weight * declared**2).sum())),
        largest=float(declared.max()),
        raw_rms=float(np.sqrt((weight * raw**2).sum())),
        raw_largest=float(raw.max()),
        missed=farthest(np.array(plan["raw_path"]), tracked),
        declared_missed=farthest(np.array(plan["reference"]), tracked),
        stated=float(plan["stated_error_over_l"]),
        gaps=tuple(seen_poses(seconds, poses, longest)[1]),
        track=tracked,
        tail_length=float(plan["robot"]["tail_length_m"]),
    )


def check_plan_id(plan: Mapping[str, Any], track: pd.DataFrame) -> None:
    """Refuse the track of another plan."""
    others = set(track["plan_id"].dropna().astype(str)) - {plan["id"]} if "plan_id" in track else set()
    if others:
        raise InputError(
            f"the track is of plan {min(others)}, not of {plan['id']}; compare it with its own plan.json"
        )


def read_track(track: pd.DataFrame | str | Path, **options: Unpack[TrackOptions]) -> pd.DataFrame:
    """Read the table of a track from its file, see `camera.pose_tracks`, and warn of poses that are lost.

    Raises:
        InputError: the file cannot be read, or has the tracks of several robots.
    """
    table = read_tracks(track, **options)
    if options.get("written_by") and len(runs := table["run"].unique()) > 1:
        raise InputError(f"there are {len(runs)} tracks, of {runs[0]}, {runs[1]} …; give that of one robot")
    for line in table.attrs.get("lost", ()):
        warnings.warn(line, InputWarning, stacklevel=4)
    return table


def poses_of(track: pd.DataFrame, robot: Mapping[str, Any]) -> tuple[Floats, Floats]:
    """Return times (N,) and poses (N, 3) of a track, in time units, l and rad, of the rows that have a pose.

    Args:
        track: the table.
        robot: its `tail_length_m` and `time_scale_s`.

    Raises:
        InputError: a column is missing, a value is no finite number, or times go back.
    """
    table = track_in_tails(track, robot)
    rows = np.stack([numbers_of(table[name]).to_numpy() for name in _COLUMNS], 1)
    seen = ~np.isnan(rows[:, 1:]).all(1)
    fine = np.abs(rows) < _LARGEST
    bad = np.flatnonzero(~fine[:, 0] | (seen & ~fine.all(1)))
    if len(bad):
        raise InputError(
            f"row {bad[0] + 1} of the track has a value that is not a finite number; correct the file"
        )
    back = np.flatnonzero(np.diff(rows[:, 0]) < 0)
    if len(back):
        raise InputError(f"the track's time goes back at row {back[0] + 2}; give a row for each time, in order")
    return rows[seen, 0], rows[seen, 1:]


def track_in_tails(track: pd.DataFrame, robot: Mapping[str, Any]) -> pd.DataFrame:
    """Return a track with the columns of a replay.

    Raises:
        InputError: a column is missing, or places in cm and in tail lengths differ: the track is of another robot.
    """
    replayed, lab = set(_COLUMNS) <= set(track), in_lab(track)
    cm = 100 * robot["tail_length_m"]
    if replayed:
        for over_l, in_cm in (("x_over_l", "x_cm"), ("y_over_l", "y_cm")):
            if in_cm not in lab:
                continue
            in_tails, given = numbers_of(track[over_l]) * cm, numbers_of(lab[in_cm])
            # Both columns are rounded, so places agree within a share of the tail length and of themselves.
            if not (np.abs(in_tails - given) <= _ALIKE * (cm + np.abs(given))).all():
                raise InputError(
                    f"{over_l} and {in_cm} of the track disagree with the plan's tail length, {cm:g} cm: it is "
                    "the track of another robot"
                )
        return track
    require_lab(lab)
    values = {name: numbers_of(lab[name]) for name in LAB}
    return pd.DataFrame(
        {
            "time_bar": values["time_s"] / robot["time_scale_s"],
            "x_over_l": values["x_cm"] / cm,
            "y_over_l": values["y_cm"] / cm,
            "heading_rad": np.radians(values["heading_deg"]),
        }
    )


def in_lab(track: pd.DataFrame) -> pd.DataFrame:
    """Return a track, also one of a replay, with those of the columns LAB that it has in any unit."""
    replayed = set(_COLUMNS) <= set(track)
    return convert_columns(track.drop(columns=[*_COLUMNS]) if replayed else track, LAB, "the track").table


def require_lab(track: pd.DataFrame) -> None:
    """Refuse a track that lacks one of the columns LAB."""
    for name in LAB:
        if name not in track:
            raise InputError(
                f"the track has no column {name!r}; it needs time_s, x_cm, y_cm and heading_deg, or in other units"
            )


def what_next(
    plan: Mapping[str, Any], track: str, plan_file: str | None = None, options: Mapping[str, Any] = _NONE
) -> str:
    """Write the command that finds in a track what the model lacks: one line.

    It is empty for a measured vehicle, which has no model.

    Args:
        plan: content of plan.json.
        track: file of the track.
        plan_file: file of the plan, where the track may need it; a tracker's track has flips of its own.
        options: see `TrackOptions`; those without a value are left out.
    """
    robot = plan["robot"]
    if "vehicle" in robot:
        return ""
    preset = PRESETS.get(robot["name"])
    own = preset is None or (preset.group_values(), preset.time_scale) != (robot["groups"], robot["time_scale_s"])
    words = [track, "--robot", "robot.toml" if own else robot["name"]]
    words += [] if plan_file is None else ["--plan", plan_file]
    for name in TrackOptions.__annotations__:
        if (value := options.get(name)) is not None:
            words.append("--from" if name == "written_by" else f"--{name}")
            words += [f"{number:g}" for number in value] if name == "origin" else [str(value)]
    return f"find out what the model lacks: softflagella calibrate {shlex.join([*words, '--out', 'calibrated'])}"


def draw_overlay(axes: Axes, plan: Mapping[str, Any], error: TrackingError, title: str) -> None:
    """Draw a track over the declared and the raw path, on axes in cm."""
    from planner.planning.picture import REPLAYED, draw_tracks

    length = error.tail_length
    draw_tracks(axes, np.array(plan["raw_path"]), np.array(plan["reference"]), error.stated, length)
    axes.plot(*(100 * length * error.track.T), color=REPLAYED, lw=0.8, label="track")
    rms, largest = format_length(error.rms * length), format_length(error.largest * length)
    axes.set_title(f"{title}\n{rms} rms, {largest} at most\nfrom the declared path", fontsize=10, parse_math=False)


def write_overlay(path: str | Path, plan: Mapping[str, Any], error: TrackingError) -> None:
    """Write a PNG of a track over its plan."""
    from matplotlib.figure import Figure

    from common.files import whole_file

    figure = Figure(figsize=(6, 6))
    axes = figure.add_subplot()
    draw_overlay(axes, plan, error, plan["robot"]["name"])
    axes.legend(fontsize=8, frameon=False)
    with whole_file(path) as part:
        figure.savefig(part, format="png", dpi=130, bbox_inches="tight")
