"""Simulate a sweep, whatever describes it: the function behind `softflagella.sweep`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from common.errors import InputError
from common.keywords import checks_keywords
from dataset.build import build
from dataset.design import SWEEP_TOML, design_around, load_design
from sim.model.robot import Robot

_SCHEDULER = "DASK_SCHEDULER_ADDRESS"


@checks_keywords
def sweep(
    config: str | Path | Robot | None,
    out: str | Path,
    *,
    inputs: Mapping[str, tuple[float, float]] | None = None,
    rows: int | None = None,
    jobs: int | None = None,
    backend: str | None = None,
    scheduler: str | None = None,
    force: bool = False,
    resume: str = "run the same sweep again",
) -> dict[str, Any]:
    """Simulate a sweep into a folder of Parquet files. An interrupted sweep continues.

    Args:
        config: sweep.toml (default: the one that comes with the package). In Python None is that one, and a robot
            is swept around.
        out: folder, or a URL that fsspec knows (s3://…).
        inputs: around a robot, the lowest and highest value by name, in any unit; by default tail length, motor
            speed, N and the coefficients of drag.
        rows: number of robots (default: the configuration's, or 1,024); more than before adds rows.
        jobs: processes; default all processors.
        backend: where to run: local (processes here) or dask (default: local, or dask with a scheduler).
        scheduler: address of a dask scheduler (default: DASK_SCHEDULER_ADDRESS).
        force: take over a URL whose writer was killed.
        resume: what the last line of an interrupted sweep says is to be done.

    Returns:
        The manifest, with the configuration, the code and the counts of rows (all, converged, failed, touching).

    Raises:
        InputError: the configuration has no valid robots, the folder holds something else, or no such back end.

    Example:
        >>> import softflagella as sf
        >>> manifest = sf.sweep("sweep.toml", "data/sweep")  # doctest: +SKIP
        >>> robot, ranges = sf.load_robot("robot.toml"), {"tail_length_cm": (7, 13), "motor_speed_rpm": (30, 160)}
        ... # doctest: +SKIP
        >>> manifest = sf.sweep(robot, "data/around", inputs=ranges)  # doctest: +SKIP
    """
    if isinstance(config, Robot):
        design = design_around(config, inputs, rows or 1024)
    elif inputs is not None:
        raise InputError("inputs are for a sweep around a robot; a sweep.toml has its own: leave them out")
    else:
        design = load_design(config or SWEEP_TOML).with_rows(rows)
    where = backend or ("dask" if scheduler or os.environ.get(_SCHEDULER) else "local")
    local = where == "loky"  # its name of the last release
    return build(
        design, out, jobs=jobs, backend="local" if local else where, address=scheduler, force=force, resume=resume
    )
