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
from calibration.swim.joint_model import joint_model
from calibration.swim.measured_swim import PlanSource, is_track, read_swims
from calibration.swim.swim_model import swim_model
from calibration.swimmer.measured_table import Measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.table.reader import open_table
from calibration.verdict.calibrate import calibrate
from camera.pose_tracks import read_tracks
from common.arrays import Flags
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
    beside: str | Path | pd.DataFrame | None,
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
        steady = None if beside is None else _runs_beside(beside, protocol, tell)
        swum, last = swim_model(robot, swims, jobs=jobs)
        if steady is None:
            result = calibrate(swum, held_out=last, **settings)
        else:
            with naming(beside):
                joint, rows = joint_model(swum, last, SwimmerModel(robot, steady[0], jobs), steady[1])
            result = calibrate(joint, held_out=rows, **settings)
    elif beside is not None:
        raise InputError(f"{name} is a table of runs; give the track of a swim, and --beside a table of runs")
    else:
        data, rows = read_runs(measured, protocol, tell, file=file)
        model = SwimmerModel(robot, data, jobs, own=own)
        result = calibrate(model, held_out=rows, describe=find_laws if laws else None, **settings)
    return replace(result, paths=path_errors(wanted, robot, result.corrected, result.knowledge))


def _runs_beside(
    table: str | Path | pd.DataFrame, protocol: Literal["session", "paper"], tell: Callable[[str], object]
) -> tuple[Measurements, Flags]:
    """Read the table of runs beside a swim, and the runs that are held out."""
    with naming(table):
        measured = open_table(table)
        if is_track(measured):
            raise InputError("--beside takes a table of steady runs, and this is a track; swims share one track")
    return read_runs(measured, protocol, tell, file=None if isinstance(table, pd.DataFrame) else table)


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
