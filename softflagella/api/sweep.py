"""Sweeps: the functions behind `softflagella.sweep` and `read_sweep`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from dataset.build.build import build
from dataset.rows.design import checked_design, load_design
from dataset.rows.robot_inputs import fields_of_robot
from dataset.storage.data_set import read
from sim.io.errors import InputError
from sim.model.robot import Robot
from softflagella.api.robots import one_robot


def sweep(
    config: str | Path | Robot,
    out: str | Path,
    *,
    inputs: Mapping[str, Sequence[float] | Mapping[str, Any]] | None = None,
    rows: int | None = None,
    jobs: int | None = None,
) -> dict[str, Any]:
    """Simulate a sweep into a folder of Parquet files. An interrupted sweep continues.

    Args:
        config: a sweep.toml. With `inputs`: the robot, its robot.toml, or the name of a preset, around which the
            sweep lies.
        out: the folder.
        inputs: what varies around the robot: name with unit, such as `tail_length_cm` or `motor_speed_rpm`; its
            least and largest value, or an entry as in sweep.toml. All else is the robot's.
        rows: number of robots; default the configuration's, or 1024.
        jobs: processes; default all processors.

    Returns:
        The manifest, with the configuration, the code and the counts of rows (all, converged, failed, touching).

    Raises:
        InputError: the configuration has no valid robots, or the folder holds something else.

    Example:
        >>> import softflagella as sf
        >>> manifest = sf.sweep("sweep.toml", "data/sweep")  # doctest: +SKIP
        >>> ranges = {"tail_length_cm": (6, 11), "motor_speed_rpm": (20, 60)}
        >>> manifest = sf.sweep("robot.toml", "data/around", inputs=ranges, rows=256)  # doctest: +SKIP
    """
    if inputs is None:
        if isinstance(config, Robot):
            raise InputError("a sweep around a robot needs inputs, such as {'tail_length_cm': (6, 11)}")
        design = load_design(config)
    else:
        entries = {name: dict(v) if isinstance(v, Mapping) else {"range": list(v)} for name, v in inputs.items()}
        content = {"robot": fields_of_robot(one_robot(config)), "inputs": entries}
        design = checked_design(content, "inputs")
    return build(design.with_rows(rows), out, jobs=jobs)


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
