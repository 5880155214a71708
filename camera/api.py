"""Measured runs from camera tracks: the public function of the camera."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Unpack

import pandas as pd

from camera.measured_runs import measure_tracks
from common.errors import InputWarning
from common.files import whole_file
from common.keywords import checks_keywords
from common.track_options import TrackOptions
from sim.robot_rows import OneRobot, one_robot, with_units


@checks_keywords
def tracks(
    tracks: str | Path | pd.DataFrame,
    runs: str | Path | pd.DataFrame,
    *,
    y_down: bool = False,
    robot: OneRobot | None = None,
    check: str | Path | None = None,
    **options: Unpack[TrackOptions],
) -> pd.DataFrame:
    """Turn camera tracks into a measured table: yaw rate, turn radius, slip angle and speed of each run.

    Args:
        tracks: one row for each sample: `run`, `time_s`, `x_cm`, `y_cm`, `heading_deg`, or these in other units.
        runs: one row for each run: `run`, `N`, `l_cm`, `omega_rpm` and other columns of a measured table.
        y_down: y and headings are those of a picture, whose y axis points down.
        robot: the robot as given, its robot.toml, or the name of a preset, with whose simulated motion the tracks
            are compared.
        check: PNG, draw the fitted circles over the tracks.
        options: of tracks that another program has written, see `TrackOptions`.

    Returns:
        The runs with `omega_yr_rad_s`, `R_yr_cm`, `theta_deg`, `v_cm_s` and their errors. What was left out is in
        `attrs["excluded"]`, and is warned of; what was converted is in `attrs["converted"]`.

    Raises:
        InputError: the tracks cannot be used; the message says why.

    Example:
        >>> import numpy as np, pandas as pd
        >>> import softflagella as sf
        >>> time = np.linspace(0, 120, 240)
        >>> circle = pd.DataFrame({"run": 1, "time_s": time, "x_cm": 9 * np.cos(0.05 * time),
        ...     "y_cm": 9 * np.sin(0.05 * time), "heading_deg": np.degrees(0.05 * time) + 20})
        >>> runs = pd.DataFrame({"run": [1], "N": [2], "l_cm": [11.0], "omega_rpm": [43.0]})
        >>> sf.tracks(circle, runs)[["omega_yr_rad_s", "R_yr_cm", "theta_deg"]].round(3).values.tolist()
        [[0.05, 9.0, 70.0]]
    """
    known = None if robot is None else one_robot(robot)
    measured = measure_tracks(tracks, runs, y_down=y_down, robot=known, **options)
    for line in measured.excluded:
        warnings.warn(f"excluded: {line}", InputWarning, stacklevel=3)
    table = with_units(measured.table)
    table.attrs |= {"excluded": list(measured.excluded), "converted": list(measured.converted)}
    if check is not None:
        from camera.pictures import draw_tracks

        with whole_file(check) as part:
            draw_tracks(measured.tracks).savefig(part, format="png", dpi=110)
    return table
