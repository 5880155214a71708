"""Calibrate with measured data: the function behind `softflagella.calibrate`."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from calibration.report.corrected_robot import check_given
from calibration.swimmer.head_correction import learn_head_correction
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.possible_runs import Owned
from calibration.swimmer.swimmer import SwimmerModel
from calibration.verdict.calibrate import calibrate as close_loop
from calibration.verdict.verdict import Verdict
from sim.inputs import load_robot
from sim.model.robot import Robot


def calibrate(
    table: str | Path | pd.DataFrame,
    robot: Robot | str | Path,
    *,
    seed: int = 0,
    own: Owned | None = None,
    jobs: int | None = None,
    progress: bool = True,
) -> Verdict:
    """Fit a table of measured runs, find what the model lacks, and correct the robot.

    Args:
        table: measured runs, one row for each run, or their file: `N`, `l_cm`, `omega_rpm` and two or more
            of `omega_h_rpm`, `omega_t_rpm`, `omega_yr_rad_s`, `R_yr_cm`, `theta_deg`, `v_cm_s`; repeats.
        robot: the robot as given, or its robot.toml.
        seed: of the bootstrap; the same seed gives the same result.
        own: what the lab can set in its next runs, such as `{"l_cm": (5, 7, 9)}`; for `N`, `l_cm` and `omega_rpm`
            (both directions). Default: the table's range.
        jobs: threads; default all processors.
        progress: show progress bars.

    Returns:
        The verdict, with `verdict` ("none", "effect", "ambiguous", "unexplained"), `sentence`, `effects`, fits
        with intervals, and errors on the held-out runs.

    Raises:
        InputError: the table cannot be used; the message says why.

    Example:
        >>> import softflagella as sf
        >>> verdict = sf.calibrate("runs.csv", "robot.toml")  # doctest: +SKIP
        >>> print(verdict.sentence)  # doctest: +SKIP
    """
    given = robot if isinstance(robot, Robot) else load_robot(robot)
    check_given(given)
    model = SwimmerModel(given, read_measurements(table), jobs, own=own or {})
    return close_loop(model, correction=learn_head_correction, seed=seed, progress=progress)
