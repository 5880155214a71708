"""A replayed (or measured) track against its plan: tracking error and an overlay.

The error is the distance of the tracked point from the declared path, weighted by time. The distance from the path
as given is computed, too. A track holds the head's centre and the heading. The tracked point follows from them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from planner.paths.distance import distance_to, two_sided
from planner.planning.picture import REPLAYED, draw_tracks
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.io.quantities import numbers_of
from sim.mechanics import planar

_LARGEST = 1e100  # of a number
_COLUMNS = ("time_bar", "x_over_l", "y_over_l", "heading_rad")


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
    stated: float  # error that the plan states
    track: Floats = field(repr=False)  # (S, 2) tracked point

    @property
    def line(self) -> str:
        verdict = "within" if self.largest <= self.stated else "ABOVE"
        return (
            f"tracking error {self.rms:.4f} l rms, {self.largest:.4f} l at most, {verdict} the stated error "
            f"{self.stated:.3f} l; from the raw path {self.raw_rms:.3f} l rms, {self.raw_largest:.3f} l at most, "
            f"every point of it within {self.missed:.3f} l"
        )


def tracking_error(plan: dict[str, Any], track: pd.DataFrame) -> TrackingError:
    """Compare a track with its plan.

    Args:
        plan: content of plan.json.
        track: time_bar, x_over_l, y_over_l, heading_rad of the head's centre.
    """
    for name in _COLUMNS:
        if name not in track:
            raise InputError(f"the track has no column {name!r}; it needs {', '.join(_COLUMNS)}")
    values = {name: numbers_of(track[name]).to_numpy() for name in _COLUMNS}
    pose = np.stack([values["x_over_l"], values["y_over_l"], values["heading_rad"]], 1)
    if not (np.abs([*pose.T, values["time_bar"]]) < _LARGEST).all():
        raise InputError("the track has a value that is not a finite number; correct the file")
    if len(pose) < 2 or not np.ptp(values["time_bar"]) > 0:
        raise InputError("the track has no two times; give a row for each time, in order")
    offset = np.array([plan.get("offset_over_l", 0.0), 0.0, 0.0])
    tracked = planar.compose(pose, offset)[:, :2]
    declared = distance_to(np.array(plan["reference"]), tracked)
    raw = distance_to(np.array(plan["raw_path"]), tracked)
    weight = np.gradient(values["time_bar"])
    weight = np.maximum(weight, 0) / max(float(np.maximum(weight, 0).sum()), 1e-300)
    return TrackingError(
        rms=float(np.sqrt((weight * declared**2).sum())),
        largest=float(declared.max()),
        raw_rms=float(np.sqrt((weight * raw**2).sum())),
        raw_largest=float(raw.max()),
        missed=float(two_sided(np.array(plan["raw_path"]), tracked)[0]),
        stated=float(plan["stated_error_over_l"]),
        track=tracked,
    )


def draw_overlay(axes: Axes, plan: dict[str, Any], error: TrackingError, title: str) -> None:
    """Draw the replayed track over the declared and the raw path."""
    draw_tracks(axes, np.array(plan["raw_path"]), np.array(plan["reference"]), error.stated)
    axes.plot(*error.track.T, color=REPLAYED, lw=0.8, label="replayed in the simulator")
    axes.set_title(f"{title}\n{error.rms:.3f} l rms, {error.largest:.3f} l at most", fontsize=10, parse_math=False)
