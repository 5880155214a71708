"""The part of `softflagella.calibrate` for a robot, which loads the simulator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import pandas as pd

from calibration.laws.laws import find_laws
from calibration.robot.corrected_robot import check_given
from calibration.robot.robot_verdict import RobotVerdict, read_runs
from calibration.statistics.budget import Work
from calibration.statistics.lab_settings import LabSettings
from calibration.swim.measured_swim import PlanSource, is_track, read_swims
from calibration.swim.swim_model import swim_model
from calibration.swimmer.swimmer import SwimmerModel
from calibration.verdict.calibrate import calibrate
from camera.pose_tracks import read_tracks
from common.errors import InputError, naming
from common.run_columns import convert_measured
from common.tables import read_table
from common.track_options import TrackOptions
from common.units import LengthUnit
from sim.robot_rows import OneRobot, one_robot
from softflagella.path_error import path_errors, wanted_paths


def calibrate_robot(
    table: str | Path | pd.DataFrame,
    robot: OneRobot,
    *,
    name: str,
    protocol: Literal["session", "paper"],
    seed: int,
    own: LabSettings,
    laws: bool,
    paths: Sequence[str],
    unit: LengthUnit | None,
    plan: PlanSource | None,
    limit: Work,
    jobs: int | None,
    progress: bool,
    tell: Callable[[str], object],
    options: TrackOptions,
) -> RobotVerdict:
    """Calibrate a robot with the table called `name`, see `softflagella.closed_loop.calibrate`."""
    robot = one_robot(robot)
    check_given(robot)
    wanted = wanted_paths(paths, robot, unit)
    settings: dict[str, Any] = {
        "limit": limit, "seed": seed, "progress": progress,
        "verdict": partial(RobotVerdict, robot=robot, table=name),
    }  # fmt: skip
    result: RobotVerdict
    file, measured = None if isinstance(table, pd.DataFrame) else table, _read(table, options)
    if plan is not None or is_track(measured):
        swims = read_swims(measured, plan, file=file)
        for line in (line for swim in swims for line in swim.said):
            tell(line)
        swum, last = swim_model(robot, swims, jobs=jobs)
        result = calibrate(swum, held_out=last, **settings)
    else:
        data, rows = read_runs(measured, protocol, tell, file=file)
        model = SwimmerModel(robot, data, jobs, own=own)
        result = calibrate(model, held_out=rows, describe=find_laws if laws else None, **settings)
    return replace(result, paths=path_errors(wanted, robot, result.corrected, result.knowledge))


def _read(table: str | Path | pd.DataFrame, options: TrackOptions) -> pd.DataFrame:
    """Read a table of runs, or of poses, once: it may be a pipe."""
    try:
        with naming(table):
            return read_tracks(table, **options)
    except InputError:
        if any(options.values()) and not isinstance(table, pd.DataFrame) and _has_runs(table):
            without = "a table of runs is read without --from and its options"
            raise InputError(f"{table} is no track of another program; {without}") from None
        raise


def _has_runs(file: str | Path) -> bool:
    """Tell whether a file is a table of runs."""
    try:
        convert_measured(read_table(file), str(file))
    except InputError:
        return False
    return True
