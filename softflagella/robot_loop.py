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
    if plan is not None or is_track(table):
        swims = read_swims(table, plan)
        for line in (line for swim in swims for line in swim.said):
            tell(line)
        swum, last = swim_model(robot, swims, jobs=jobs)
        result = calibrate(swum, held_out=last, **settings)
    else:
        data, rows = read_runs(table, protocol, tell)
        model = SwimmerModel(robot, data, jobs, own=own)
        result = calibrate(model, held_out=rows, describe=find_laws if laws else None, **settings)
    return replace(result, paths=path_errors(wanted, robot, result.corrected, result.knowledge))
