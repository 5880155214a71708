"""Sweeps: the functions behind `softflagella.sweep` and `read_sweep`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from dataset.build import build
from dataset.data_set import read
from dataset.design import design_around, load_design
from sim.io.errors import InputError
from sim.io.keywords import checks_keywords
from sim.model.robot import Robot


@checks_keywords()
def sweep(
    config: str | Path | Robot,
    out: str | Path,
    *,
    inputs: Mapping[str, tuple[float, float]] | None = None,
    rows: int | None = None,
    jobs: int | None = None,
) -> dict[str, Any]:
    """Simulate a sweep into a folder of Parquet files. An interrupted sweep continues.

    Args:
        config: a sweep.toml, or a robot to sweep around.
        out: the folder.
        inputs: around a robot, the lowest and highest value by name, in any unit; by default tail length, motor
            speed, N and the coefficients of drag.
        rows: number of robots; default the configuration's, or 1,024.
        jobs: processes; default all processors.

    Returns:
        The manifest, with the configuration, the code and the counts of rows (all, converged, failed, touching).

    Raises:
        InputError: the configuration has no valid robots, or the folder holds something else.

    Example:
        >>> import softflagella as sf
        >>> manifest = sf.sweep("sweep.toml", "data/sweep")  # doctest: +SKIP
        >>> robot, ranges = sf.load_robot("robot.toml"), {"tail_length_cm": (7, 13), "motor_speed_rpm": (30, 160)}
        ... # doctest: +SKIP
        >>> manifest = sf.sweep(robot, "data/around", inputs=ranges)  # doctest: +SKIP
    """
    if isinstance(config, Robot):
        return build(design_around(config, inputs, rows or 1024), out, jobs=jobs)
    if inputs is not None:
        raise InputError("inputs are for a sweep around a robot; a sweep.toml has its own: leave them out")
    return build(load_design(config).with_rows(rows), out, jobs=jobs)


@checks_keywords()
def read_sweep(folder: str | Path) -> pd.DataFrame:
    """Read all rows of a finished sweep, in the order of its design; units are in the Parquet schema.

    Args:
        folder: written by `sweep`.

    Raises:
        InputError: there is no finished sweep, or its files are damaged.

    Example:
        >>> import softflagella as sf
        >>> table = sf.read_sweep("data/sweep")  # doctest: +SKIP
    """
    return read(folder)
