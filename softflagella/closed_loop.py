"""Close the loop with measured data: `softflagella.calibrate`, with the error on paths before and after."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import pandas as pd

from calibration.laws.laws import find_laws
from calibration.report.corrected_robot import check_given
from calibration.report.robot_verdict import RobotVerdict, read_runs
from calibration.swimmer.possible_runs import Owned, owned
from calibration.swimmer.swimmer import SwimmerModel
from calibration.verdict.calibrate import calibrate as find_what_is_missing
from common.errors import InputError
from common.keywords import checks_keywords
from common.units import LengthUnit
from sim.robot_rows import OneRobot, one_robot
from softflagella.path_error import path_errors, wanted_paths

MAX_SECONDS = 90.0  # of processor time for the search, without laws


@checks_keywords
def calibrate(
    table: str | Path | pd.DataFrame,
    robot: OneRobot,
    *,
    protocol: Literal["session", "paper"] = "session",
    seed: int = 0,
    own: Owned | Sequence[str] | None = None,
    laws: bool = True,
    paths: Sequence[str] = (),
    unit: LengthUnit | None = None,
    max_seconds: float | None = None,
    jobs: int | None = None,
    progress: bool = True,
    tell: Callable[[str], object] = lambda line: None,
) -> RobotVerdict:
    """Fit a table of measured runs, find what the model lacks, and correct the robot.

    Args:
        table: measured runs, one row for each run, or their file: `N`, `l_cm`, `omega_rpm` and two or more
            of `omega_h_rpm`, `omega_t_rpm`, `omega_yr_rad_s`, `R_yr_cm`, `theta_deg`, `v_cm_s`; repeats.
        robot: the robot as given, its robot.toml, or the name of a preset.
        protocol: what is fitted: all sessions but one ("session"), or N = 3 and 4 as in the paper ("paper").
        seed: of the bootstrap; the same seed gives the same result.
        own: what the lab can set in its next runs, `{"l_cm": (5, 7, 9)}` or `("l_cm=5,7,9",)`; for `N`, `l_cm`
            and `omega_rpm` (both directions). Default: the table's range.
        laws: look for laws where no effect explains the runs.
        paths: files or shapes, such as `("square:24cm",)`, on which the error with the robot as given and with the
            corrected one is stated; `verdict.paths` has it.
        unit: of lengths that are given without one; l for tail lengths. 24cm and 3l, columns x_cm and y_cm, and
            drawings with a size have their own.
        max_seconds: of processor time for the search (default 90, with laws 180). The verdict then is provisional,
            and says what was not tried.
        jobs: threads; default all processors.
        progress: show progress bars.
        tell: is told, before the fit, what was converted and what was excluded, a line at a time.

    Returns:
        The verdict, with `verdict` ("none", "number", "effect", "ambiguous", "partial", "unexplained"),
        `sentence`, `effects`, `nearest`, `moves`, fits with intervals, errors on the held-out runs, the
        `corrected` robot, and `save(folder)`.

    Raises:
        InputError: the table cannot be used; the message says why.

    Example:
        >>> import softflagella as sf
        >>> verdict = sf.calibrate("runs.csv", "robot.toml")  # doctest: +SKIP
        >>> print(verdict.sentence)  # doctest: +SKIP
        >>> result = sf.plan(sf.circle(2.0), verdict.corrected, knowledge=verdict.knowledge)  # doctest: +SKIP
    """
    robot = one_robot(robot)
    check_given(robot)
    limit = MAX_SECONDS * (1 + laws) if max_seconds is None else max_seconds
    if not limit > 0:
        raise InputError(f"max_seconds: {limit:g}; give a positive number of seconds")
    wanted = wanted_paths(paths, robot, unit)
    settings = own if isinstance(own, Mapping) else owned(own or ())
    data, held_out, name = read_runs(table, protocol, tell)
    model = SwimmerModel(robot, data, jobs, own=settings)
    verdict = find_what_is_missing(
        model,
        held_out=held_out,
        describe=find_laws if laws else None,
        seed=seed,
        max_seconds=limit,
        progress=progress,
    )
    result = RobotVerdict(**vars(verdict), robot=robot, table=name)
    return replace(result, paths=path_errors(wanted, robot, result.corrected, result.knowledge))
