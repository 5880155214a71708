"""Sweeps: the functions behind `softflagella.sweep` and `read_sweep`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from dataset.build.build import build
from dataset.rows.design import load_design
from dataset.storage.data_set import read


def sweep(
    config: str | Path, out: str | Path, *, rows: int | None = None, jobs: int | None = None
) -> dict[str, Any]:
    """Simulate a sweep into a folder of Parquet files. An interrupted sweep continues.

    Args:
        config: a sweep.toml.
        out: the folder.
        rows: number of robots; default the configuration's.
        jobs: processes; default all processors.

    Returns:
        The manifest, with the configuration, the code and the counts of rows (all, converged, failed, touching).

    Raises:
        InputError: the configuration has no valid robots, or the folder holds something else.

    Example:
        >>> import softflagella as sf
        >>> manifest = sf.sweep("sweep.toml", "data/sweep")  # doctest: +SKIP
    """
    return build(load_design(config).with_rows(rows), out, jobs=jobs)


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
